//! Bumpless transfer: the commands do not jump when their law changes.

use crate::equations::Equations;
use crate::mode::Mode;
use crate::signals::{OperatingPoint, Signals, Values};
use aso_controller::Design;
use aso_controller::design::Actuator;

/// A continuous command that is at a limit when its law changes starts beyond the limit, by this fraction of its range.
/// So the command stays at the limit, and no event indicator changes its sign at the event: FMPy's Euler method would
/// miss the change back in the next step.
const BEYOND_LIMIT: f64 = 2e-9;

impl Values {
    /// If `mode` has another law than the last commands, u_t becomes the difference of the last commands and the
    /// commands of the new law at z, y and r of `signals`, so that the commands do not jump,
    ///
    /// ```text
    /// u_t = u before - (K_x x_hat + K_f f_hat + K_i x_i + N_r r + K_s u_stuck)
    /// ```
    ///
    /// and 0 for an actuator that is gone. Returns whether u_t was set. Without a transfer, nothing is done; for the
    /// first commands after a start or a rest, only the law is recorded.
    pub(crate) fn transfer(
        &mut self,
        design: &Design,
        mode: Mode,
        point: &OperatingPoint,
        signals: &mut Signals,
    ) -> bool {
        if design.transfer.is_none() {
            return false;
        }
        let law = mode.law(design);
        if self.law.replace(law).is_none_or(|before| before == law) {
            return false;
        }
        let equations = Equations::<f64>::new(design, mode);
        let margin = if design.sample_time.is_some() { 0.0 } else { BEYOND_LIMIT };
        for (j, actuator) in design.actuators.iter().enumerate() {
            let at = design.transfer_at(j);
            signals.z[at] = 0.0;
            if !mode.is_gone(j) {
                let Signals { z, y, r, .. } = &*signals;
                let stuck = mode.stuck_part(design, j);
                let command = equations.free_command(j, equations.estimate(z), [y, r], stuck);
                signals.z[at] = start(self.u[j], actuator, margin) - (command + point.u[j]);
            }
            self.z[at] = signals.z[at];
        }
        true
    }
}

/// The command from which the transfer starts; at a limit, `margin` of the range beyond it.
fn start(command: f64, actuator: &Actuator, margin: f64) -> f64 {
    match actuator.limits {
        Some([low, high]) if command <= low => low - margin * (high - low),
        Some([low, high]) if command >= high => high + margin * (high - low),
        _ => command,
    }
}
