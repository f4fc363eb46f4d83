//! Families of plants within tolerances, and their loops with a controller.

use super::crossing::stability_limit;
use super::{Loop, held_plant};
use crate::stability::instability;
use crate::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

/// The worst direction is followed up to this multiple of the tolerances.
const REACH: f64 = 16.0;
const FACTOR: f64 = 1.1;
const FIRST: f64 = 1e-6;
/// Successive tested multiples differ by a factor of 2 below this multiple, and by [`FACTOR`] above.
const SMALL: f64 = 0.05;

/// The plants that a controller may control: each parameter deviates by -1 to 1 of its tolerance.
pub trait PlantFamily {
    /// The reason why a plant cannot be computed.
    type Error: From<Error>;

    /// The number of parameters.
    fn count(&self) -> usize;

    /// The plant whose parameters deviate by the fractions `deviations` of their tolerances, in continuous time or
    /// sampled at the sample time of the controller.
    ///
    /// # Errors
    ///
    /// The plant cannot be computed.
    fn plant(&self, deviations: &[f64]) -> Result<StateSpace, Self::Error>;

    /// The derivatives of a quantity with respect to each deviation, from `entries`, its derivatives with respect to
    /// the entries of A, B, C and D. They only guide the search.
    fn slopes(&self, entries: &[DMatrix<f64>; 4]) -> Vec<f64>;

    /// The ascending multiples of the tolerances for tests of the worst direction; by default from 1e-6 to at most 16.
    fn multiples(&self) -> Vec<f64> {
        let factor = |multiple: f64| if multiple < SMALL { 2.0 } else { FACTOR };
        let next =
            |multiple: &f64| Some(multiple * factor(*multiple)).filter(|next| *next <= REACH);
        std::iter::successors(Some(FIRST), next).collect()
    }
}

/// A plant of a family in the loop with a controller.
#[derive(Debug, Clone, PartialEq)]
pub struct ToleranceCase {
    /// [`crate::stability::instability`] of the loop.
    pub instability: f64,
    /// The deviations of the parameters, as parts of their tolerances.
    pub deviations: Vec<f64>,
}

/// The steps of [`super::tolerance_test`], with its errors, for a caller that runs cases and climbs in parallel.
pub struct ToleranceSearch<'a, F> {
    /// The plants that may be in the loop.
    pub family: &'a F,
    /// The controller, which does not vary.
    pub controller: &'a StateSpace,
}

impl<F: PlantFamily> ToleranceSearch<'_, F> {
    /// The dynamics of the loop with a plant, which is discretised for a sampled controller.
    pub(super) fn dynamics(&self, mut plant: StateSpace) -> Result<DMatrix<f64>, Error> {
        if let Domain::Sampled { period } = self.controller.domain {
            plant = held_plant(&plant, period)?;
        }
        Ok(Loop::new(plant, self.controller.clone())?.dynamics())
    }

    /// [`instability`] of the loop with the plant of `deviations`; infinite if the samples of the plant overflow.
    pub(super) fn instability(&self, deviations: &[f64]) -> Result<f64, F::Error> {
        let plant = self.family.plant(deviations)?;
        match self.dynamics(plant) {
            // The states of the plant leave the range of double precision within a sample.
            Err(Error::Overflow { .. }) if self.controller.domain != Domain::Continuous => {
                Ok(f64::INFINITY)
            }
            dynamics => Ok(instability(&dynamics?, self.controller.domain)?),
        }
    }

    /// The multiple of the deviations below which the loop is stable; None if the loop is stable at all
    /// [`PlantFamily::multiples`].
    pub(super) fn first_unstable(&self, deviations: &[f64]) -> Result<Option<f64>, F::Error> {
        stability_limit(0.0, self.family.multiples(), |multiple| {
            let scaled: Vec<f64> = deviations.iter().map(|part| multiple * part).collect();
            self.instability(&scaled)
        })
    }
}
