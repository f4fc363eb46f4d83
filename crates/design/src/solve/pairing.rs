//! The choice of feedback and observer together, among the placements that were found for each.

use control::Error;
use control::aso::{Gains, pairs};
use control::robustness::{Loop, least_sensitive};
use nalgebra::DMatrix;

use crate::solve::gain::GainResult;
use crate::solve::tracking::{DesignLoop, LoopModel};

impl LoopModel<'_> {
    /// Returns feedback and observer whose loop has the lowest peaks of S, see [`least_sensitive`]; a single pair is
    /// returned without an examination.
    ///
    /// `gains` computes the gains of the controller from the gains of feedback and observer. A measurement filter is
    /// part of the plant, or, with integral action, of the controller.
    pub(crate) fn chosen(
        self,
        feedback: GainResult,
        observer: GainResult,
        gains: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> Gains,
    ) -> Result<(GainResult, GainResult), Error> {
        let (feedback, observer) = (feedback.into_choice(), observer.into_choice());
        let [first, second] = pairs(&feedback.candidates(), &observer.candidates());
        let chosen =
            |(feedback, observer): (&GainResult, &GainResult)| (feedback.clone(), observer.clone());
        if let ([only], []) = (first.as_slice(), second.as_slice()) {
            return Ok(chosen(*only));
        }
        let closed = |(feedback, observer): &(&GainResult, &GainResult)| {
            self.closed(&gains(&feedback.gain, &observer.gain))
        };
        let loops = |pairs: &[_]| pairs.iter().map(closed).collect::<Result<Vec<_>, Error>>();
        let standard = feedback.standard.iter().zip(&observer.standard);
        let standard = standard.filter_map(|(gain, other)| gain.as_ref().zip(other.as_ref()));
        let references = standard.map(|(gain, other)| self.closed(&gains(gain, other)));
        let references = references.collect::<Result<Vec<_>, Error>>()?;
        let best = least_sensitive([&loops(&first)?, &loops(&second)?], &references);
        Ok(chosen(*first.iter().chain(&second).nth(best).unwrap_or(&first[0])))
    }

    fn closed(self, gains: &Gains) -> Result<Loop, Error> {
        let DesignLoop { plant, controller } = self.design_loop(gains)?;
        Loop::new(plant.commanded(self.domain), controller)
    }
}
