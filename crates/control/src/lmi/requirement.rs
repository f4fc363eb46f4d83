//! A requirement on a gain, and a gain that is proven to meet it.

use super::gain::{GainBound, Norm};
use super::region::RegionCertificate;
use crate::{Error, check};
use nalgebra::DMatrix;

/// A requirement on the gain from a disturbance w to an output z.
#[derive(Debug, Clone, PartialEq)]
pub struct Performance {
    /// n x k: how w acts on the states.
    pub disturbance: DMatrix<f64>,
    /// r x n: the part of z that depends on the states.
    pub output: DMatrix<f64>,
    /// The effect of w on the measurement (p x k, for an observer), or of the command on z (r x m, for a state
    /// feedback).
    pub feedthrough: DMatrix<f64>,
    /// The norm to bound.
    pub norm: Norm,
    /// The bound to keep; None for nearly the smallest one possible.
    pub gamma: Option<f64>,
}

/// A gain and the certificates of its closed loop.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Synthesis {
    /// L of the observer, or K of the state feedback.
    pub gain: DMatrix<f64>,
    /// The proof that the eigenvalues are in the region.
    pub region: RegionCertificate,
    /// The bound of the norm, if a performance was required, not above the given bound. For weights with states it
    /// may be None, see [`super::ChannelWeights::observer_gain`].
    pub bound: Option<GainBound>,
}

impl Performance {
    /// Checks that the matrices fit n states and a feedthrough of the given shape, and that the bound is above zero.
    pub(super) fn check(&self, n: usize, feedthrough: (usize, usize)) -> Result<(), Error> {
        check::shape("disturbance", &self.disturbance, (n, self.disturbance.ncols()))?;
        check::shape("output", &self.output, (self.output.nrows(), n))?;
        check::shape("feedthrough", &self.feedthrough, feedthrough)?;
        check::positive("gamma", self.gamma.unwrap_or(1.0))
    }

    /// The requirement for the transposed system.
    #[must_use]
    pub fn transposed(&self) -> Self {
        Self {
            disturbance: self.output.transpose(),
            output: self.disturbance.transpose(),
            feedthrough: self.feedthrough.transpose(),
            norm: match self.norm {
                Norm::HInfinity => Norm::HInfinity,
                Norm::EnergyToPeak => Norm::ImpulseToEnergy,
                Norm::ImpulseToEnergy => Norm::EnergyToPeak,
            },
            gamma: self.gamma,
        }
    }
}
