//! Weights that are positive semidefinite up to rounding.

use crate::Error;
use crate::check::as_number;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Negative eigenvalues of a weight down to this part of its scale are rounding, per state.
const SEMIDEFINITE: f64 = 1e-13;

/// Checks that `m` is positive semidefinite up to rounding. `before` is the matrix from which it
/// was computed; its diagonal gives the size of the rounding errors.
pub(super) fn require_semidefinite(m: &DMatrix<f64>, before: &DMatrix<f64>) -> Result<(), Error> {
    let n = m.nrows();
    let refused = Error::NotPositiveSemidefinite { matrix: "Q - N R^-1 N'" };
    let scale = DVector::from_fn(n, |i, _| before[(i, i)].abs().sqrt());
    let largest = scale.amax();
    if largest == 0.0 {
        return if m.amax() > 0.0 { Err(refused) } else { Ok(()) };
    }
    let scale = scale.map(|entry| if entry > 0.0 { entry } else { f64::EPSILON * largest });
    let scaled = DMatrix::from_fn(n, n, |i, j| m[(i, j)] / scale[i] / scale[j]);
    if scaled.iter().any(|entry| !entry.is_finite()) {
        return Err(refused);
    }
    let iterations = 100 * n;
    let eigen = SymmetricEigen::try_new(scaled, f64::EPSILON, iterations);
    let what = "the eigenvalue iteration of a weight";
    let values = eigen.ok_or(Error::NotConverged { what, iterations })?.eigenvalues;
    if values.min() < -(SEMIDEFINITE * as_number(n)) { Err(refused) } else { Ok(()) }
}
