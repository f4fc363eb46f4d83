//! The choice of feedback and observer together, among the placements that were found for each.

use control::aso::{FaultyPlant, Gains};
use control::robustness::{Loop, least_sensitive};
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

use super::gains::GainResult;
use super::linear_plant::LinearPlant;
use super::tracking::DesignLoop;

/// The plant of a pair of gains.
pub(crate) struct PairProblem<'a> {
    pub(crate) linear: &'a LinearPlant,
    /// The model in the observer.
    pub(crate) plant: &'a FaultyPlant,
    pub(crate) filter: Option<&'a [f64]>,
    pub(crate) domain: Domain,
}

impl PairProblem<'_> {
    /// Returns feedback and observer whose loop has the lowest peaks of S, see [`least_sensitive`].
    ///
    /// `gains`: those of the controller, from the gains of feedback and observer. A measurement filter
    /// belongs to the plant, except with integral action.
    pub(crate) fn chosen(
        &self,
        (feedback, observer): (GainResult, GainResult),
        gains: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains,
    ) -> Result<(GainResult, GainResult), Error> {
        let (feedbacks, observers) = (feedback.with_others(), observer.with_others());
        let count = observers.len();
        let pairs =
            feedbacks.iter().flat_map(|own| observers.iter().map(move |other| (own, other)));
        let own = |(feedback, observer): (&GainResult, &GainResult)| {
            self.closed(&gains(&feedback.gain, &observer.gain))
        };
        let best = match feedbacks.len() * count {
            1 => 0,
            _ => least_sensitive(&pairs.map(own).collect::<Result<Vec<_>, _>>()?),
        };
        Ok((feedbacks[best / count].clone(), observers[best % count].clone()))
    }

    fn closed(&self, gains: &Gains) -> Result<Loop, Error> {
        let Self { linear, plant, filter, domain } = *self;
        let DesignLoop { plant, controller } =
            DesignLoop::of((linear, plant), gains, filter, domain)?;
        let FaultyPlant { a, b, c, .. } = plant;
        let d = DMatrix::zeros(c.nrows(), b.ncols());
        Loop::new(StateSpace { a, b, c, d, domain }, controller)
    }
}
