//! The structure of a perturbation, and the matrices that commute with it.

use crate::blocks::ComplexMatrix;
use nalgebra::{Complex, DMatrix};

/// A block of the diagonal of a structured perturbation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Block {
    /// delta I with one real number delta, on this many channels.
    Real(usize),
    /// A full complex matrix on this many channels; its size is the 2-norm.
    Full(usize),
}

impl Block {
    pub(super) fn size(self) -> usize {
        match self {
            Self::Real(size) | Self::Full(size) => size,
        }
    }
}

/// The first channel of each block, and the block.
pub(super) fn places(blocks: &[Block]) -> impl Iterator<Item = (usize, Block)> + '_ {
    let mut first = 0;
    blocks.iter().map(move |block| {
        let place = (first, *block);
        first += block.size();
        place
    })
}

/// An entry of a sparse matrix: row, column, value.
pub(super) type SparseEntry = (usize, usize, Complex<f64>);

/// A direction in which the scales D and G change.
pub(super) struct Direction {
    pub(super) block: usize,
    /// Whether the direction changes G instead of D.
    pub(super) of_g: bool,
    /// The entries of a Hermitian matrix.
    pub(super) entries: Vec<SparseEntry>,
}

/// A basis of the Hermitian matrices D and G that commute with every perturbation of the structure.
pub(super) fn directions(blocks: &[Block]) -> Vec<Direction> {
    let mut all = Vec::new();
    for (block, (first, kind)) in places(blocks).enumerate() {
        let one = Complex::new(1.0, 0.0);
        let diagonal = |at: usize| (first + at, first + at, one);
        let size = match kind {
            Block::Full(size) => {
                let entries = (0..size).map(diagonal).collect();
                all.push(Direction { block, of_g: false, entries });
                continue;
            }
            Block::Real(size) => size,
        };
        for of_g in [false, true] {
            for row in 0..size {
                all.push(Direction { block, of_g, entries: vec![diagonal(row)] });
                for column in 0..row {
                    for value in [one, Complex::new(0.0, 1.0)] {
                        let (row, column) = (first + row, first + column);
                        let entries = vec![(row, column, value), (column, row, value.conj())];
                        all.push(Direction { block, of_g, entries });
                    }
                }
            }
        }
    }
    all
}

/// The logarithms of a diagonal scaling D that commutes with the structure and for which rows and columns of D M D^-1
/// have about equal norms (Osborne 1960).
pub(super) fn balancing_exponents(m: &ComplexMatrix, blocks: &[Block]) -> Vec<f64> {
    const ROUNDS: usize = 20;
    // Without a limit, the scaling of a coupling in one direction only would grow in each round.
    const MOST_SCALED: f64 = 100.0;
    let mut exponents = vec![0.0; m.nrows()];
    let groups: Vec<(usize, usize)> = places(blocks)
        .flat_map(|(first, block)| match block {
            Block::Full(size) => vec![(first, size)],
            Block::Real(size) => (first..first + size).map(|at| (at, 1)).collect(),
        })
        .collect();
    for _ in 0..ROUNDS {
        for &(first, size) in &groups {
            let places = first..first + size;
            let (mut row, mut column) = (0.0, 0.0);
            for at in places.clone() {
                for other in (0..m.nrows()).filter(|other| !places.contains(other)) {
                    let factor = f64::exp(2.0 * (exponents[at] - exponents[other]));
                    row += m[(at, other)].norm_sqr() * factor;
                    column += m[(other, at)].norm_sqr() / factor;
                }
            }
            let change = 0.25 * (column / row).ln();
            if change.is_finite() {
                let exponent = (exponents[first] + change).clamp(-MOST_SCALED, MOST_SCALED);
                places.for_each(|at| exponents[at] = exponent);
            }
        }
    }
    exponents
}

/// D M D^-1 for the logarithms of a diagonal D.
pub(super) fn scaled(m: &ComplexMatrix, exponents: &[f64]) -> ComplexMatrix {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * (exponents[i] - exponents[j]).exp())
}
