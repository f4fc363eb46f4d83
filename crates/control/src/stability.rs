//! Stability of a square matrix, in continuous or sampled time.

use crate::eigen::eigenvalues;
use crate::{Domain, Error};
use nalgebra::{Complex, DMatrix};

/// Relative rounding error of an eigenvalue near the stability limit.
const ROUNDING: f64 = 1e-12;

/// Distance of a matrix beyond the stability limit; negative when the matrix is stable.
///
/// ```text
/// max Re(lambda_i)       continuous: the spectral abscissa
/// max |lambda_i| - 1     sampled: the spectral radius less one
/// ```
///
/// `a`: n x n, with eigenvalues lambda; the result has the unit of A in continuous time, none in
/// sampled time. Method and precision: see [`eigenvalues`].
///
/// # Example
///
/// ```
/// use control::{Domain, stability::instability};
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, -3.0]);
/// assert!(instability(&a, Domain::Continuous)?.abs() < 1e-15);
/// assert!((instability(&a, Domain::Sampled { period: 0.1 })? - 2.0).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`eigenvalues`]; [`Error::OutOfRange`] for a bad period.
pub fn instability(a: &DMatrix<f64>, domain: Domain) -> Result<f64, Error> {
    domain.check()?;
    Ok(largest_excess(&eigenvalues(a)?, domain))
}

/// Whether an eigenvalue of A is stable by more than its rounding error, 1e-12 of the largest modulus.
///
/// `a`: n x n. For modes that no gain moves: a mode on the limit that is computed a little inside does not count as
/// stable.
///
/// # Errors
///
/// Same as [`eigenvalues`]; [`Error::OutOfRange`] for a bad period.
pub fn is_clearly_stable(
    eigenvalue: Complex<f64>,
    a: &DMatrix<f64>,
    domain: Domain,
) -> Result<bool, Error> {
    domain.check()?;
    let size = eigenvalues(a)?.iter().map(|value| value.norm()).fold(0.0, f64::max);
    Ok(domain.excess(eigenvalue) < -ROUNDING * size)
}

/// The largest [`Domain::excess`] of the eigenvalues.
pub(crate) fn largest_excess(eigenvalues: &[Complex<f64>], domain: Domain) -> f64 {
    eigenvalues.iter().map(|&value| domain.excess(value)).fold(f64::NEG_INFINITY, f64::max)
}

/// Returns the eigenvalues of a stable A; [`Error::NotHurwitz`] or [`Error::NotSchur`] with `name` if A is not stable.
pub(crate) fn require_stable(
    name: &'static str,
    a: &DMatrix<f64>,
    domain: Domain,
) -> Result<Vec<Complex<f64>>, Error> {
    domain.check()?;
    let values = eigenvalues(a)?;
    let excess = largest_excess(&values, domain);
    if excess < 0.0 {
        return Ok(values);
    }
    Err(match domain {
        Domain::Continuous => Error::NotHurwitz { matrix: name, abscissa: excess },
        Domain::Sampled { .. } => Error::NotSchur { matrix: name, radius: 1.0 + excess },
    })
}
