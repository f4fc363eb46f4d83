//! Frequencies at which margins are searched.

use super::crossing::{Evaluation, narrow};
use crate::eigen::{complex_eigenvalues, eigenvalues};
use crate::response::{KnownResponse, resonances};
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};

/// A sweep ends when the eigenvalues of T have moduli below this; below 1/2 the eigenvalues of L have moduli below 1.
const SMALL: f64 = 0.25;
/// Ratio of successive frequencies above the grid, about 60 for each decade.
const STEP: f64 = 1.04;

/// A frequency response on a grid that includes the resonances of the system.
pub(super) struct Sweep<'a> {
    pub(super) response: &'a KnownResponse,
    /// The frequencies of the grid, ascending, in rad per unit of time.
    pub(super) frequencies: Vec<f64>,
    /// The response at each of `frequencies`.
    pub(super) values: Vec<DMatrix<Complex<f64>>>,
}

impl<'a> Sweep<'a> {
    /// The sweep at [`KnownResponse::frequencies`].
    pub(super) fn new(response: &'a KnownResponse) -> Result<Self, Error> {
        Self::at(response, response.frequencies())
    }

    /// The sweep of T = `complementary` for L = T (I - T)^-1. It includes the frequencies of the poles of L, the
    /// eigenvalues of A + B C, where L may have narrow peaks. In continuous time it ends where the eigenvalues of L
    /// have moduli below 1.
    pub(super) fn of_loop(complementary: &'a KnownResponse) -> Result<Self, Error> {
        let StateSpace { a, b, c, domain, .. } = &complementary.system;
        let mut frequencies = complementary.frequencies();
        frequencies.extend(resonances(&eigenvalues(&(a + b * c))?, *domain));
        frequencies.sort_by(f64::total_cmp);
        frequencies.dedup();
        let mut sweep = Self::at(complementary, frequencies)?;
        loop {
            let last = sweep.frequencies.len() - 1;
            let moduli = complex_eigenvalues(&sweep.values[last])?.into_iter().map(Complex::norm);
            if *domain != Domain::Continuous || moduli.fold(0.0, f64::max) < SMALL {
                return Ok(sweep);
            }
            let frequency = STEP * sweep.frequencies[last];
            sweep.values.push(complementary.gain(frequency)?);
            sweep.frequencies.push(frequency);
        }
    }

    fn at(response: &'a KnownResponse, frequencies: Vec<f64>) -> Result<Self, Error> {
        let values = frequencies.iter().map(|w| response.gain(*w)).collect::<Result<_, _>>()?;
        Ok(Self { response, frequencies, values })
    }

    /// The frequencies at which a real function of the response changes its sign.
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
