//! The decay rate that a quadratic Lyapunov function proves.

use crate::lmi::{Outcome, Region, RegionCertificate, certify_region};
use crate::stability::instability;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// Fractions by which the decay rate is reduced, one after the other, until a certificate is found.
const CONCESSIONS: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5];

/// A decay rate and its proof.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DecayCertificate {
    /// Decay rate alpha in 1/s.
    pub alpha: f64,
    /// P and its margin: F' P + P F + 2 alpha P < 0.
    pub certificate: RegionCertificate,
}

/// The largest decay rate alpha of z' = F z that a quadratic Lyapunov function proves.
///
/// ```text
/// P > 0,  F' P + P F + 2 alpha P < 0
/// V = z' P z  =>  V(t) <= exp(-2 alpha t) V(0)
/// ```
///
/// `error_dynamics`: F, n x n, `A_0` - L `C_0` for the observer. The least upper bound of alpha is
/// minus the spectral abscissa of F; the strict inequality does not attain it. Method: this bound is reduced by 1e-6 of
/// itself, then by larger parts up to a half, until [`certify_region`] proves the rate; [`Outcome::Inconclusive`] if it
/// proves none.
///
/// A system that is not stable is [`Outcome::Infeasible`] with the conflict "stability".
///
/// Source: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear matrix inequalities in system and
/// control theory (1994), section 5.1.2.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix;
/// [`Error::NotConverged`].
pub fn largest_decay(error_dynamics: &DMatrix<f64>) -> Result<Outcome<DecayCertificate>, Error> {
    check::square("error dynamics", error_dynamics)?;
    let abscissa = instability(error_dynamics, Domain::Continuous)?;
    if abscissa >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    for concession in CONCESSIONS {
        let alpha = -abscissa * (1.0 - concession);
        let region = Region { decay: Some(alpha), ..Region::default() };
        let outcome = certify_region(error_dynamics, &region, Domain::Continuous)?;
        if let Outcome::Optimal(certificate) = outcome {
            return Ok(Outcome::Optimal(DecayCertificate { alpha, certificate }));
        }
    }
    Ok(Outcome::Inconclusive("no decay rate could be proven in double precision"))
}
