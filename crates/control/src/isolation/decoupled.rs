//! The part of a plant that unknown inputs do not reach and that the measurements show.

use super::DisturbedPlant;
use crate::Error;
use crate::balance::{multiply_columns, multiply_rows, unit_columns};
use crate::blocks::{beside, stacked};
use crate::svd::Svd;
use nalgebra::{DMatrix, DVector};

/// The observable part of (2) of [`crate::isolation`], which holds for all unknown inputs: z' = A z + `B_u` u + K y +
/// `B_f` f, `y_h` = H y - `D_u` u = C z + `D_f` f.
pub(super) struct DecoupledPart {
    pub(super) a: DMatrix<f64>,
    pub(super) b_u: DMatrix<f64>,
    pub(super) b_f: DMatrix<f64>,
    pub(super) k: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
    pub(super) d_u: DMatrix<f64>,
    pub(super) d_f: DMatrix<f64>,
    pub(super) h: DMatrix<f64>,
    /// For each fault, the length of its column of [`B_f`; `D_f`] relative to the length of its column of the plant.
    pub(super) effects: Vec<f64>,
    /// The relative singular values closest to the tolerance.
    pub(super) gap: Gap,
    /// The number of states that y determines, the number of further states that y' determines, and so on: the
    /// conjugate partition of the observability indices.
    pub(super) blocks: Vec<usize>,
}

/// The relative singular values closest to the tolerance on both sides, over all rank decisions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// The smallest relative singular value that counted as nonzero.
    pub(super) above: f64,
    /// The largest relative singular value that counted as zero.
    pub(super) below: f64,
}

impl Gap {
    /// The gap before the first rank decision.
    pub(super) fn none() -> Self {
        Self { above: f64::INFINITY, below: 0.0 }
    }

    /// The number of singular values above `tolerance`; narrows the gap.
    fn rank(&mut self, svd: &Svd, tolerance: f64) -> usize {
        let rank = svd.rank_above(tolerance);
        if rank > 0 {
            self.above = self.above.min(svd.values[rank - 1]);
        }
        if rank < svd.values.len() {
            self.below = self.below.max(svd.values[rank]);
        }
        rank
    }
}

impl DecoupledPart {
    /// Decouples the disturbances and the faults with `decoupled[fault]`; None if no measurements are left.
    ///
    /// `plant`: in balanced coordinates. Rows of C and columns of unknown inputs are scaled to length one, A is divided
    /// by its norm; a singular value below `tolerance` counts as zero.
    pub(super) fn new(
        plant: &DisturbedPlant,
        decoupled: &[bool],
        tolerance: f64,
    ) -> Result<Option<Self>, Error> {
        let ([a, e, c, d], outputs, size) = scaled(plant, decoupled);
        let mut gap = Gap::none();
        let w = conditioned_invariant([&a, &e, &c, &d], tolerance, &mut gap)?;
        let v = complement(&w, tolerance, &mut gap)?;
        let image = beside(&(&c * &w), &d);
        let h = complement(&image, tolerance, &mut gap)?.transpose();
        if h.nrows() == 0 {
            return Ok(None);
        }
        let k = injection(&image, &v.tr_mul(&beside(&(&a * &w), &e)), tolerance)?;
        let dynamics = (v.tr_mul(&a) - &k * &c) * &v;
        let (basis, blocks) = observable_states(&dynamics, &(&h * &c * &v), tolerance, &mut gap)?;
        let (z, k) = (basis.tr_mul(&v.transpose()), basis.tr_mul(&k));
        let (dynamics, output) = (basis.tr_mul(&dynamics) * &basis, &h * &c * &v * &basis);
        // Converts K and H to the units of the plant.
        let k = multiply_columns(&(k * size), &outputs);
        let h = multiply_columns(&h, &outputs);
        let b_f = &z * &plant.b_f - &k * &plant.d_f;
        let d_f = &h * &plant.d_f;
        let original = stacked(&(&plant.b_f / size), &multiply_rows(&plant.d_f, &outputs));
        let effects = relative_lengths(&stacked(&(&b_f / size), &d_f), &original);
        Ok(Some(Self {
            a: dynamics * size,
            b_u: &z * &plant.b_u - &k * &plant.d_u,
            c: output,
            d_u: &h * &plant.d_u,
            k,
            h,
            b_f,
            d_f,
            effects,
            gap,
            blocks,
        }))
    }
}

/// A, E, C, D for the outputs R y and time in units of 1 / |A|; the diagonal of R; |A|, the norm.
fn scaled(plant: &DisturbedPlant, decoupled: &[bool]) -> ([DMatrix<f64>; 4], DVector<f64>, f64) {
    let (e, d) = plant.unknown_inputs(decoupled);
    let (n, size) = (plant.a.nrows(), size_or_one(&plant.a));
    let outputs = plant.c.row_iter().zip(d.row_iter()).map(|(state, direct)| {
        let length = if state.norm() > 0.0 { state.norm() } else { direct.norm() };
        if length > 0.0 { 1.0 / length } else { 1.0 }
    });
    let outputs = DVector::from_iterator(plant.c.nrows(), outputs);
    let inputs = unit_columns(&stacked(&(e / size), &multiply_rows(&d, &outputs)));
    let (e, d) = (inputs.rows(0, n).into_owned(), inputs.rows(n, d.nrows()).into_owned());
    ([&plant.a / size, e, multiply_rows(&plant.c, &outputs), d], outputs, size)
}

/// The norm of A or C as a divisor; 1 if the matrix has no entries or is zero, like A of integrators.
pub(super) fn size_or_one(m: &DMatrix<f64>) -> f64 {
    let norm = m.norm();
    if norm > 0.0 { norm } else { 1.0 }
}

/// An orthonormal basis W of the smallest subspace that contains [A W, E] ker [C W, D].
fn conditioned_invariant(
    [a, e, c, d]: [&DMatrix<f64>; 4],
    tolerance: f64,
    gap: &mut Gap,
) -> Result<DMatrix<f64>, Error> {
    let mut w = DMatrix::zeros(a.nrows(), 0);
    if e.ncols() == 0 {
        return Ok(w);
    }
    loop {
        let svd = Svd::new(&beside(&(c * &w), d))?;
        let rank = gap.rank(&svd, tolerance);
        let kernel = svd.right.columns(rank, svd.right.ncols() - rank).into_owned();
        let image = beside(&(a * &w), e) * kernel;
        let sum = Svd::new(&beside(&w, &image).transpose())?;
        let dimension = gap.rank(&sum, tolerance);
        if dimension <= w.ncols() {
            return Ok(w);
        }
        w = sum.right.columns(0, dimension).into_owned();
    }
}

/// An orthonormal basis of the vectors that are orthogonal to the columns of M; narrows `gap`.
pub(super) fn complement(
    m: &DMatrix<f64>,
    tolerance: f64,
    gap: &mut Gap,
) -> Result<DMatrix<f64>, Error> {
    if m.ncols() == 0 {
        return Ok(DMatrix::identity(m.nrows(), m.nrows()));
    }
    let svd = Svd::new(&m.transpose())?;
    let rank = gap.rank(&svd, tolerance);
    Ok(svd.right.columns(rank, m.nrows() - rank).into_owned())
}

/// An orthonormal basis of the observable states of (A, C), and the numbers of states that y, y', ... each add.
///
/// Method: the staircase algorithm; further scaling would enlarge rounding errors. Narrows `gap`.
pub(super) fn observable_states(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    tolerance: f64,
    gap: &mut Gap,
) -> Result<(DMatrix<f64>, Vec<usize>), Error> {
    let n = a.nrows();
    let (mut observable, mut rest) = (DMatrix::zeros(n, 0), DMatrix::identity(n, n));
    let (mut link, mut blocks) = (c.clone(), Vec::new());
    while rest.ncols() > 0 {
        let svd = Svd::new(&link)?;
        let rank = gap.rank(&svd, tolerance);
        if rank == 0 {
            break;
        }
        blocks.push(rank);
        let rotated: DMatrix<f64> = rest * svd.right;
        let new = rotated.columns(0, rank).into_owned();
        rest = rotated.columns(rank, rotated.ncols() - rank).into_owned();
        link = new.tr_mul(a) * &rest;
        observable = beside(&observable, &new);
    }
    Ok((observable, blocks))
}

/// The K of least norm with K `image` = `target`; singular values below `tolerance` count as zero.
fn injection(
    image: &DMatrix<f64>,
    target: &DMatrix<f64>,
    tolerance: f64,
) -> Result<DMatrix<f64>, Error> {
    if image.ncols() == 0 {
        return Ok(DMatrix::zeros(target.nrows(), image.nrows()));
    }
    let svd = Svd::new(&image.transpose())?;
    let rank = svd.rank_above(tolerance);
    Ok(svd.least_squares(&target.transpose(), rank).transpose())
}

/// For each column, its length in `part` divided by its length in `whole`; 0 if both are zero.
fn relative_lengths(part: &DMatrix<f64>, whole: &DMatrix<f64>) -> Vec<f64> {
    let columns = part.column_iter().zip(whole.column_iter());
    columns.map(|(part, whole)| part.norm() / whole.norm().max(f64::MIN_POSITIVE)).collect()
}
