//! Stability of a square matrix in continuous or sampled time.

use crate::eigen::eigenvalues;
use crate::{Domain, Error, check};
use nalgebra::{Complex, DMatrix};

/// The eigenvalues of a stable matrix; an unstable one is refused under the name given.
pub(crate) fn require(
    matrix: &'static str,
    a: &DMatrix<f64>,
    domain: Domain,
) -> Result<Vec<Complex<f64>>, Error> {
    if let Domain::Sampled { period } = domain {
        check::positive("period", period)?;
    }
    let values = eigenvalues(a)?;
    match domain {
        Domain::Continuous => {
            let abscissa = values.iter().fold(f64::NEG_INFINITY, |most, value| most.max(value.re));
            if abscissa >= 0.0 {
                return Err(Error::NotHurwitz { matrix, abscissa });
            }
        }
        Domain::Sampled { .. } => {
            let radius = values.iter().fold(0.0_f64, |most, value| most.max(value.norm()));
            if radius >= 1.0 {
                return Err(Error::NotSchur { matrix, radius });
            }
        }
    }
    Ok(values)
}
