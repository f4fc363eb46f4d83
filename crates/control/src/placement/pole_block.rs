//! Requested eigenvalues, grouped into real ones and conjugate pairs.

use crate::Error;
use nalgebra::{Complex, DMatrix};

/// A real eigenvalue, or a pair of conjugate eigenvalues p and conj p that is assigned together.
///
/// The eigenvectors [v, conj v] of a pair are represented by the real matrix V = sqrt 2 [Re v, Im
/// v], from which they differ by a unitary factor. Condition numbers and angles are therefore the
/// same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoleBlock {
    /// The eigenvalue p of the block, with an imaginary part of at least zero.
    pub(crate) pole: Complex<f64>,
}

impl PoleBlock {
    /// Number of eigenvalues: 1 or 2.
    pub(crate) fn count(self) -> usize {
        if self.pole.im > 0.0 { 2 } else { 1 }
    }

    /// The real matrix M of order `count` with (A + B K) V = V M.
    pub(crate) fn block(self) -> DMatrix<f64> {
        let Complex { re, im } = self.pole;
        DMatrix::from_fn(self.count(), self.count(), |i, j| match (i, j) {
            (0, 1) => im,
            (1, 0) => -im,
            _ => re,
        })
    }
}

/// Groups eigenvalues; returns one entry per real eigenvalue and per pair, sorted by descending
/// real part, so that the order of the argument does not influence which of several local optima is
/// found.
///
/// An eigenvalue without its conjugate, or more often than `inputs`, is an error. Both are decided
/// by exact equality.
pub(crate) fn pole_blocks(poles: &[Complex<f64>], inputs: usize) -> Result<Vec<PoleBlock>, Error> {
    let occurrences = |pole| poles.iter().filter(|&&other| distance(other, pole) <= 0.0).count();
    for &pole in poles {
        let times = occurrences(pole);
        if times > occurrences(pole.conj()) {
            return Err(Error::UnpairedPole { pole });
        }
        if times > inputs {
            return Err(Error::RepeatedPole { pole, times, inputs });
        }
    }
    let upper = poles.iter().filter(|pole| pole.im >= 0.0);
    let mut all: Vec<_> = upper.map(|&pole| PoleBlock { pole }).collect();
    let order =
        |x: &Complex<f64>, y: &Complex<f64>| y.re.total_cmp(&x.re).then(x.im.total_cmp(&y.im));
    all.sort_by(|x, y| order(&x.pole, &y.pole));
    Ok(all)
}

/// |x - y|, without overflow of the squares.
pub(super) fn distance(x: Complex<f64>, y: Complex<f64>) -> f64 {
    (x.re - y.re).hypot(x.im - y.im)
}
