//! Frequencies at which margins are searched.

use super::crossing::narrowed;
use crate::response::{Transfer, grid};
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::PI;

const PER_DECADE: u32 = 60;

/// A frequency response on a grid that has the resonances of the system.
pub(super) struct Sweep<'a> {
    transfer: Transfer<'a>,
    /// Ascending, in rad per unit of time.
    pub(super) frequencies: Vec<f64>,
    /// G at each of them.
    pub(super) values: Vec<DMatrix<Complex<f64>>>,
}

impl<'a> Sweep<'a> {
    /// From frequency zero to ten times the fastest eigenvalue or to the Nyquist frequency.
    pub(super) fn new(system: &'a StateSpace) -> Result<Self, Error> {
        let modes = system.stable_eigenvalues()?;
        let mut frequencies = grid(system, &modes, PER_DECADE);
        frequencies.push(0.0);
        let modes = modes.iter().filter(|mode| mode.im >= 0.0);
        frequencies.extend(modes.flat_map(|mode| match system.domain {
            Domain::Continuous => [mode.im.abs(), mode.norm()],
            Domain::Sampled { period } => {
                let frequency = mode.arg().abs() / period;
                [frequency, frequency]
            }
        }));
        if let Domain::Sampled { period } = system.domain {
            frequencies.retain(|frequency| *frequency <= PI / period);
        }
        frequencies.sort_by(f64::total_cmp);
        frequencies.dedup();
        let transfer = Transfer::new(system);
        let values = frequencies.iter().map(|w| transfer.gain(*w)).collect::<Result<_, _>>()?;
        Ok(Self { transfer, frequencies, values })
    }

    /// G at a frequency.
    pub(super) fn at(&self, frequency: f64) -> Result<DMatrix<Complex<f64>>, Error> {
        self.transfer.gain(frequency)
    }

    /// The frequencies at which the real function `of` of G changes its sign.
    pub(super) fn crossings(
        &self,
        of: impl Fn(&DMatrix<Complex<f64>>) -> f64,
    ) -> Result<Vec<f64>, Error> {
        let values: Vec<f64> = self.values.iter().map(&of).collect();
        let mut found = Vec::new();
        for at in 1..values.len() {
            let (before, after) = (values[at - 1], values[at]);
            if before.is_nan() || after.is_nan() || (before > 0.0) == (after > 0.0) {
                continue;
            }
            let ends = ((self.frequencies[at - 1], before), (self.frequencies[at], after));
            let value = |frequency| Ok::<_, Error>(of(&self.at(frequency)?));
            let (low, high) = narrowed(ends.0, ends.1, value)?;
            found.push(0.5 * (low + high));
        }
        Ok(found)
    }
}
