//! The tolerance of one integration step.

use crate::dynamics::State;
use crate::parameters::{Refusal, require};
use fmu::solver::Step;
use serde::{Deserialize, Serialize};

/// The fraction of the tolerance that the error of one step may reach.
///
/// The upright pendulum multiplies an early error by some 7e4 in 2 s.
const SAFETY: f64 = 0.1;

/// Bounds of the error of one integration step, per component of the state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Tolerance {
    relative: f64,
    absolute: f64,
}

impl Default for Tolerance {
    /// A relative tolerance of 1e-9, and an absolute one of 1e-12.
    fn default() -> Self {
        Self { relative: 1e-9, absolute: 1e-12 }
    }
}

impl Tolerance {
    /// The relative tolerance `relative`, and a thousandth of it as the absolute tolerance.
    ///
    /// A value outside of 1e-12 to 1e-3 is replaced by the nearest of these; an error for one that is not finite or not
    /// positive.
    pub(crate) fn new(relative: f64) -> Result<Self, Refusal> {
        require("tolerance", relative, relative > 0.0, "finite and > 0")?;
        let relative = relative.clamp(1e-12, 1e-3);
        Ok(Self { relative, absolute: relative / 1e3 })
    }

    /// Sum of the squares of the errors of a step, each relative to its bound.
    pub(super) fn squared_error(&self, step: &Step<State>) -> f64 {
        let mut sum = 0.0;
        for (i, (start, end)) in step.start().iter().zip(step.end()).enumerate() {
            let bound = self.absolute + self.relative * start.abs().max(end.abs());
            let scaled = step.error(i) / (SAFETY * bound);
            sum += scaled * scaled;
        }
        sum
    }
}
