//! Faults that the measurements cannot tell from a motion of the states.
//!
//! A fault f = `f_0` e^(s t) that follows its model, `A_f` `f_0` = s `f_0`, and a motion x = `x_0` e^(s t) of the plant
//! driven by f give no output when
//!
//! ```text
//! (A - s I) x_0 + F_a f_0 = 0,   C x_0 = 0
//! ```
//!
//! With N a basis of the eigenvectors of `A_f` for s and `f_0` = N v, [`x_0`; v] is in the null space of
//!
//! ```text
//! R(s) = [A - s I, F_a N; C, 0],   R(s) [x_0; v] = 0          (n + p) x (n + columns of N)
//! ```
//!
//! which is the Popov-Belevitch-Hautus test of (`A_0`, `C_0`) at the eigenvalues of `A_f`. A vector of
//! the null space with v = 0 is an unobservable mode of (A, C) and no hidden fault.
//!
//! Source: M. L. J. Hautus, Controllability and observability conditions of linear autonomous
//! systems, Indagationes Mathematicae 72 (1969).

use crate::Error;
use crate::blocks::{ComplexMatrix, beside, stacked, to_complex};
use crate::eigen::eigenvalues;
use crate::faulty_plant::FaultyPlant;
use crate::svd::ComplexSvd;
use nalgebra::{Complex, DMatrix, DVector};

/// Singular values below this fraction of the largest count as zero; for `A_f` - s I, below this fraction of |`A_f`| +
/// |s|.
const RANK_TOLERANCE: f64 = 1e-12;
/// Eigenvalues of the fault model closer than this, relative to the norm of the fault model, count as equal.
const CLUSTER_TOLERANCE: f64 = 1e-6;
/// Entries of a combination of faults below this fraction of its largest entry count as zero.
const ENTRY_TOLERANCE: f64 = 1e-6;

type ComplexVector = DVector<Complex<f64>>;

/// A combination of faults that the measurements cannot tell from a motion of the states.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct HiddenFault {
    /// The s of the fault and the motion, which develop as e^(s t) or in sampled time as s^k: an eigenvalue of `A_f`.
    pub at: Complex<f64>,
    /// Number of independent faults at s: columns of N, the eigenvectors of `A_f` for s.
    pub channels: usize,
    /// Rank of the matrix R(s) = [A - s I, `F_a` N; C, 0].
    pub rank: usize,
    /// Number of columns of R(s). The fault is hidden because `rank` is lower.
    pub expected: usize,
    /// The fault `f_0`, q entries. One entry is 1: the largest one, if no other fault is hidden at s.
    pub fault: DVector<Complex<f64>>,
    /// The motion `x_0` of the states that cancels the fault in the measurements, n entries.
    pub state: DVector<Complex<f64>>,
}

impl HiddenFault {
    /// Indices, from zero, of the faults with an entry in `fault` that is not negligible.
    #[must_use]
    pub fn faults(&self) -> Vec<usize> {
        support(&self.fault)
    }

    /// Indices, from zero, of the states with an entry in `state` that is not negligible.
    #[must_use]
    pub fn states(&self) -> Vec<usize> {
        support(&self.state)
    }
}

/// Indices of the entries above [`ENTRY_TOLERANCE`] times the largest.
fn support(v: &ComplexVector) -> Vec<usize> {
    let largest = v.iter().map(|entry| entry.norm()).fold(0.0, f64::max);
    (0..v.len()).filter(|&at| v[at].norm() > ENTRY_TOLERANCE * largest).collect()
}

/// All hidden faults of a plant: for each eigenvalue s of `A_f`, a basis of the null space of R(s).
///
/// The basis is reduced so that each of its vectors has a fault that the other vectors lack. R(s) has rows
/// and columns scaled to length one. Of two conjugate s only the one above the real axis is examined;
/// for a complex s at most one combination is returned.
pub(crate) fn hidden_faults(plant: &FaultyPlant) -> Result<Vec<HiddenFault>, Error> {
    let n = plant.a.nrows();
    let mut hidden = Vec::new();
    for s in distinct_eigenvalues(&plant.a_f)? {
        let eigenvectors = eigenvectors(&plant.a_f, s)?;
        let channels = eigenvectors.ncols();
        let (rank, null, lengths) = scaled_null_space(&rosenbrock_matrix(plant, s, &eigenvectors))?;
        let faults = &eigenvectors * null.rows(n, channels);
        let expected = n + channels;
        for (fault, vector) in reduced_basis(faults, null) {
            let state = without_rounding_errors(&vector, &lengths).rows(0, n).into_owned();
            hidden.push(HiddenFault { at: s, channels, rank, expected, fault, state });
        }
    }
    Ok(hidden)
}

/// The distinct eigenvalues of `A_f` on and above the real axis; a cluster counts as one eigenvalue, its mean.
fn distinct_eigenvalues(a_f: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    let radius = CLUSTER_TOLERANCE * a_f.norm();
    let mut clusters: Vec<(Complex<f64>, f64)> = Vec::new();
    for value in eigenvalues(a_f)? {
        match clusters.iter_mut().find(|(sum, count)| (*sum / *count - value).norm() <= radius) {
            Some((sum, count)) => (*sum, *count) = (*sum + value, *count + 1.0),
            None => clusters.push((value, 1.0)),
        }
    }
    let means = clusters.into_iter().map(|(sum, count)| sum / count);
    Ok(means.filter(|mean| mean.im >= 0.0).collect())
}

/// N: the null space of `A_f` - s I, q x (number of eigenvectors).
fn eigenvectors(a_f: &DMatrix<f64>, s: Complex<f64>) -> Result<ComplexMatrix, Error> {
    let q = a_f.nrows();
    let size = a_f.norm() + s.norm();
    if size <= 0.0 {
        return Ok(ComplexMatrix::identity(q, q));
    }
    let svd = ComplexSvd::new(&(to_complex(a_f) - ComplexMatrix::identity(q, q) * s))?;
    let pairs = (0..q).map(|index| svd.nth_smallest(index));
    let null: Vec<_> = pairs.take_while(|(value, _)| *value <= RANK_TOLERANCE * size).collect();
    Ok(ComplexMatrix::from_fn(q, null.len(), |i, j| null[j].1[i]))
}

/// Builds the Rosenbrock matrix R(s) = [A - s I, `F_a` N; C, 0].
fn rosenbrock_matrix(
    plant: &FaultyPlant,
    s: Complex<f64>,
    eigenvectors: &ComplexMatrix,
) -> ComplexMatrix {
    let (n, p) = (plant.a.nrows(), plant.c.nrows());
    let shifted = to_complex(&plant.a) - ComplexMatrix::identity(n, n) * s;
    let of_faults = to_complex(&plant.f_a) * eigenvectors;
    let of_states = stacked(&shifted, &to_complex(&plant.c));
    beside(&of_states, &of_faults.resize_vertically(n + p, Complex::ZERO))
}

/// Returns the rank of M, a basis of its null space and the diagonal of D. The rank does not depend on units: it is the
/// rank of M with rows, then columns, scaled to length one.
///
/// D has the lengths of the columns: D^-1 z is in the null space of M for z in the null space of the scaled matrix.
fn scaled_null_space(m: &ComplexMatrix) -> Result<(usize, ComplexMatrix, Vec<f64>), Error> {
    let length = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
    let mut scaled = m.clone();
    for mut row in scaled.row_iter_mut() {
        let norm = length(row.norm());
        row.unscale_mut(norm);
    }
    let lengths: Vec<f64> = scaled.column_iter().map(|column| length(column.norm())).collect();
    for (mut column, length) in scaled.column_iter_mut().zip(&lengths) {
        column.unscale_mut(*length);
    }
    let (rank, null) = null_space(&scaled)?;
    let (rows, cols) = null.shape();
    Ok((rank, ComplexMatrix::from_fn(rows, cols, |i, j| null[(i, j)] / lengths[i]), lengths))
}

/// Sets to zero the entries of `vector`, D^-1 z, that are negligible in z; `lengths`: the diagonal of D.
fn without_rounding_errors(vector: &ComplexVector, lengths: &[f64]) -> ComplexVector {
    let size = |at: usize| vector[at].norm() * lengths[at];
    let zero = ENTRY_TOLERANCE * (0..vector.len()).map(size).fold(0.0, f64::max);
    let entry = |at: usize, _: usize| if size(at) > zero { vector[at] } else { Complex::ZERO };
    ComplexVector::from_fn(vector.len(), entry)
}

/// The rank of M and a basis of the null space of M; for a complex M only one vector of the null space.
fn null_space(m: &ComplexMatrix) -> Result<(usize, ComplexMatrix), Error> {
    let svd = ComplexSvd::new(m)?;
    let (cols, rank) = (m.ncols(), svd.rank(RANK_TOLERANCE));
    if let Some(null) = svd.real_right(rank) {
        return Ok((rank, to_complex(&null)));
    }
    let count = (cols - rank).min(1);
    let (_, vector) = svd.nth_smallest(0);
    Ok((rank, ComplexMatrix::from_fn(cols, count, |i, _| vector[i])))
}

/// Pairs of fault and vector that span the same space as the columns of `faults` and `vectors`, each
/// fault with a row in which the other faults are zero (Gauss-Jordan elimination with pivots in `faults`).
///
/// Columns without a fault, which are unobservable modes of (A, C), are left out.
fn reduced_basis(
    mut faults: ComplexMatrix,
    mut vectors: ComplexMatrix,
) -> Vec<(ComplexVector, ComplexVector)> {
    let zero = ENTRY_TOLERANCE * faults.norm();
    let mut basis: Vec<usize> = Vec::new();
    for column in 0..faults.ncols() {
        let row = faults.column(column).icamax();
        let pivot = faults[(row, column)];
        if pivot.norm() <= zero {
            continue;
        }
        for m in [&mut faults, &mut vectors] {
            m.column_mut(column).apply(|entry| *entry /= pivot);
        }
        for other in (0..faults.ncols()).filter(|&other| other != column) {
            let factor = faults[(row, other)];
            for m in [&mut faults, &mut vectors] {
                let multiple = m.column(column) * factor;
                m.column_mut(other).zip_apply(&multiple, |entry, part| *entry -= part);
            }
        }
        basis.push(column);
    }
    let pair = |&at: &usize| (faults.column(at).into_owned(), vectors.column(at).into_owned());
    basis.iter().map(pair).collect()
}
