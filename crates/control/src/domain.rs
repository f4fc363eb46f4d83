//! The time domain of a system.

use crate::{Error, check};
use nalgebra::Complex;

/// Continuous or sampled time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Domain {
    /// x' = A x + B u: stable when every eigenvalue of A has a negative real part.
    Continuous,
    /// `x[k+1] = A x[k] + B u[k]`: stable when every eigenvalue of A has a modulus below one.
    Sampled {
        /// Time from one sample to the next, in s, above zero.
        period: f64,
    },
}

impl Domain {
    /// Distance of an eigenvalue beyond the stability limit: Re s in continuous time, |z| - 1 in
    /// sampled time. A mode with a negative excess is stable.
    #[must_use]
    pub fn excess(self, eigenvalue: Complex<f64>) -> f64 {
        match self {
            Self::Continuous => eigenvalue.re,
            Self::Sampled { .. } => eigenvalue.norm() - 1.0,
        }
    }

    /// The decay rate in 1/s of a mode with this [`Domain::excess`]: -Re s, or -ln |z| / period.
    #[must_use]
    pub fn decay_rate(self, excess: f64) -> f64 {
        match self {
            Self::Continuous => -excess,
            Self::Sampled { period } => -excess.ln_1p() / period,
        }
    }

    /// The time of one step: the sample time in s; 1 in continuous time, where rates are per second.
    #[must_use]
    pub fn step(self) -> f64 {
        match self {
            Self::Continuous => 1.0,
            Self::Sampled { period } => period,
        }
    }

    /// The point s = j w, or z = e^(j w T), at the frequency w in rad per unit of time.
    pub(crate) fn point(self, frequency: f64) -> Complex<f64> {
        match self {
            Self::Continuous => Complex::new(0.0, frequency),
            Self::Sampled { period } => Complex::from_polar(1.0, frequency * period),
        }
    }

    /// The eigenvalue of a constant signal: 0 in continuous, 1 in sampled time.
    #[must_use]
    pub fn constant(self) -> f64 {
        match self {
            Self::Continuous => 0.0,
            Self::Sampled { .. } => 1.0,
        }
    }

    /// Checks that the period of sampled time is a finite number above zero.
    pub(crate) fn check(self) -> Result<(), Error> {
        match self {
            Self::Continuous => Ok(()),
            Self::Sampled { period } => check::positive("period", period),
        }
    }
}
