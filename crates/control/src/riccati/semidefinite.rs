//! Weights that are positive semidefinite up to rounding.

use crate::Error;
use crate::check::as_number;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A negative eigenvalue of the scaled weight counts as rounding up to this size, times the number of states.
const SEMIDEFINITE: f64 = 1e-13;

/// Checks that `m`, Q - N R^-1 N', is positive semidefinite up to rounding; otherwise
/// [`Error::NotPositiveSemidefinite`], or [`Error::NotConverged`] when eigenvalues are not found. `q` is the weight Q,
/// whose diagonal gives the size of the rounding errors.
pub(super) fn require_semidefinite(m: &DMatrix<f64>, q: &DMatrix<f64>) -> Result<(), Error> {
    let n = m.nrows();
    let indefinite = Error::NotPositiveSemidefinite { matrix: "Q - N R^-1 N'" };
    let scale = DVector::from_fn(n, |i, _| q[(i, i)].abs().sqrt());
    let largest = scale.amax();
    if largest == 0.0 {
        return if m.amax() > 0.0 { Err(indefinite) } else { Ok(()) };
    }
    let scale = scale.map(|entry| if entry > 0.0 { entry } else { f64::EPSILON * largest });
    let scaled = DMatrix::from_fn(n, n, |i, j| m[(i, j)] / scale[i] / scale[j]);
    if scaled.iter().any(|entry| !entry.is_finite()) {
        return Err(indefinite);
    }
    let iterations = 100 * n;
    let eigen = SymmetricEigen::try_new(scaled, f64::EPSILON, iterations);
    let what = "the eigenvalue iteration of a weight";
    let values = eigen.ok_or(Error::NotConverged { what, iterations })?.eigenvalues;
    if values.min() < -(SEMIDEFINITE * as_number(n)) { Err(indefinite) } else { Ok(()) }
}
