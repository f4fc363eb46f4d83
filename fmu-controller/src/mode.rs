//! Which of the linear systems is in force.

use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::equations::Equations;

/// The switches of the equations: while the mode stays, all equations are linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Mode {
    /// K_f f_hat is part of the command.
    pub(crate) compensating: bool,
    /// f_hat follows the observer.
    pub(crate) estimating: bool,
    /// Bit j: channel j is at its lower limit.
    lower: u64,
    /// Bit j: channel j is at its upper limit.
    upper: u64,
}

impl Mode {
    /// The mode with no channel at a limit.
    pub(crate) fn free(compensating: bool, estimating: bool) -> Self {
        Self { compensating, estimating, lower: 0, upper: 0 }
    }

    /// The same mode, with the channels at a limit whose free command at `z` and the inputs y and r
    /// (deviations) is beyond that limit.
    pub(crate) fn limited(self, design: &Design, z: &[f64], inputs: [&[f64]; 2]) -> Self {
        let mut mode = Self::free(self.compensating, self.estimating);
        let equations = Equations::<f64>::new(design, mode);
        for (j, actuator) in design.actuators.iter().enumerate() {
            if let Some([low, high]) = actuator.range() {
                let command = equations.free_command(j, equations.estimate(z), inputs);
                mode.lower |= u64::from(command < low) << j;
                mode.upper |= u64::from(command > high) << j;
            }
        }
        mode
    }

    /// Whether channel `j` is at its lower (0) or upper (1) limit.
    pub(crate) fn is_at(self, side: usize, j: usize) -> bool {
        [self.lower, self.upper][side] & (1 << j) != 0
    }

    /// Whether channel `j` is at a limit.
    pub(crate) fn is_limited(self, j: usize) -> bool {
        self.is_at(0, j) || self.is_at(1, j)
    }

    /// Whether the equations of both modes have the same matrices.
    pub(crate) fn has_the_matrices_of(self, other: Self) -> bool {
        (self.compensating, self.estimating, self.lower | self.upper)
            == (other.compensating, other.estimating, other.lower | other.upper)
    }

    /// The element of `limits` that channel `j` is at; `None` for a free channel.
    pub(crate) fn limit(self, limits: Option<[f64; 2]>, j: usize) -> Option<f64> {
        let [low, high] = limits.filter(|_| self.is_limited(j))?;
        Some(if self.is_at(0, j) { low } else { high })
    }

    /// Sets the deviations `u` of the channels at a limit to that limit.
    pub(crate) fn set_limited(self, design: &Design, u: &mut [f64]) {
        for (j, (u, actuator)) in u.iter_mut().zip(&design.actuators).enumerate() {
            if self.is_limited(j) {
                *u = self.limit(actuator.range(), j).unwrap_or(*u);
            }
        }
    }
}
