//! Loss of effectiveness: the part of a command that its actuator does not carry out.
//!
//! An actuator that carries out (1 - E) u of its command u acts like an actuator with the additive
//! fault f = -E u. The estimate of that fault gives
//!
//! ```text
//! E_hat = -u f_hat / (u^2 + u_e^2)
//! ```
//!
//! which is near -f_hat / u for commands well above u_e, `least_command`, and near 0 for commands well
//! below it, where the loss cannot be observed.

use serde::{Deserialize, Serialize};

use crate::number::Number;
use aso_controller::design::{self, Design};

/// One fault that is a loss of effectiveness.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Loss {
    /// Position of the fault.
    pub(crate) fault: usize,
    /// Position of the actuator.
    pub(crate) actuator: usize,
    /// u_e, the command at which the estimate is half of the loss.
    least_command: f64,
    /// The estimated loss E_hat.
    pub(crate) estimate: f64,
    /// The derivative of E_hat with respect to time.
    pub(crate) slope: f64,
}

impl Loss {
    /// The losses of `design`, in the order of its faults.
    pub(crate) fn all(design: &Design) -> Vec<Self> {
        let loss = |design::Loss { fault, actuator, least_command }| Self {
            fault,
            actuator,
            least_command,
            estimate: 0.0,
            slope: 0.0,
        };
        design.losses().into_iter().map(loss).collect()
    }

    /// The estimate of the fault of this loss: an element of `f_hat`, or, if `f_hat` is empty (no direct term), the
    /// element of `z` after `n` states.
    pub(crate) fn fault_of(&self, f_hat: &[f64], z: &[f64], n: usize) -> f64 {
        *f_hat.get(self.fault).unwrap_or(&z[n + self.fault])
    }

    /// Computes `E_hat = -u f_hat / (u^2 + u_e^2)` from a command and an estimated fault.
    pub(crate) fn effectiveness_lost<D: Number>(&self, u: D, f_hat: D) -> D {
        let scale = (u * u + self.least_command * self.least_command).recip();
        -(u * scale) * f_hat
    }
}
