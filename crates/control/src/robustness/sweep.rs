//! Frequencies at which margins are searched.

use super::crossing::{Evaluation, narrow};
use crate::Error;
use crate::response::KnownResponse;
use nalgebra::{Complex, DMatrix};

/// A frequency response on a grid that includes the resonances of the system.
pub(super) struct Sweep<'a> {
    pub(super) response: &'a KnownResponse,
    /// Ascending, in rad per unit of time.
    pub(super) frequencies: Vec<f64>,
    /// G at each of them.
    pub(super) values: Vec<DMatrix<Complex<f64>>>,
}

impl<'a> Sweep<'a> {
    /// At [`KnownResponse::frequencies`].
    pub(super) fn new(response: &'a KnownResponse) -> Result<Self, Error> {
        let frequencies = response.frequencies();
        let values = frequencies.iter().map(|w| response.gain(*w)).collect::<Result<_, _>>()?;
        Ok(Self { response, frequencies, values })
    }

    /// The frequencies at which a real function of G changes its sign.
    pub(super) fn crossings(
        &self,
        function: impl Fn(&DMatrix<Complex<f64>>) -> f64,
    ) -> Result<Vec<f64>, Error> {
        let values: Vec<f64> = self.values.iter().map(&function).collect();
        self.crossings_of(&values, |response| Ok(function(response)))
    }

    /// Same as [`Self::crossings`], for a function whose `values` on the grid are known, and whose evaluation may
    /// fail. An interval with NaN at one end has no crossing.
    pub(super) fn crossings_of(
        &self,
        values: &[f64],
        function: impl Fn(&DMatrix<Complex<f64>>) -> Result<f64, Error>,
    ) -> Result<Vec<f64>, Error> {
        let mut crossings = Vec::new();
        for at in 1..values.len() {
            let (before, after) = (values[at - 1], values[at]);
            if before.is_nan() || after.is_nan() || (before > 0.0) == (after > 0.0) {
                continue;
            }
            let low = Evaluation { at: self.frequencies[at - 1], value: before };
            let high = Evaluation { at: self.frequencies[at], value: after };
            let (low, high) =
                narrow(low, high, |frequency| function(&self.response.gain(frequency)?))?;
            crossings.push(0.5 * (low + high));
        }
        Ok(crossings)
    }
}
