//! The signals of the controller, and their deviations from the operating point.

use serde::{Deserialize, Serialize};

use crate::design::Design;
use crate::equations::Mode;

/// What the equations connect: values, deviations, or a direction in them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Signals {
    /// z = [x_hat; f_hat; y_f].
    pub(crate) z: Vec<f64>,
    /// The measurements.
    pub(crate) y: Vec<f64>,
    /// The commands.
    pub(crate) u: Vec<f64>,
}

/// [x_op; 0; y_op], the operating point of z.
fn operating_point(design: &Design) -> impl Iterator<Item = f64> + '_ {
    let states = design.states.iter().map(|state| state.operating);
    let faults = design.faults.iter().map(|_| None);
    let filtered = design.measurements.iter().map(|measurement| measurement.operating);
    states.chain(faults).chain(filtered).map(Option::unwrap_or_default)
}

impl Signals {
    /// All signals of `design`, zero.
    pub(crate) fn zero(design: &Design) -> Self {
        Self {
            z: vec![0.0; design.order()],
            y: vec![0.0; design.measurements.len()],
            u: vec![0.0; design.actuators.len()],
        }
    }

    /// Becomes the deviations of `values`, but for those of the commands.
    pub(crate) fn deviate(&mut self, design: &Design, values: &Self) {
        for ((own, value), point) in self.z.iter_mut().zip(&values.z).zip(operating_point(design)) {
            *own = value - point;
        }
        for ((own, value), signal) in self.y.iter_mut().zip(&values.y).zip(&design.measurements) {
            *own = value - signal.operating.unwrap_or_default();
        }
    }

    /// The values of z that these deviations are those of.
    pub(crate) fn state_into(&self, design: &Design, z: &mut [f64]) {
        for ((value, own), point) in z.iter_mut().zip(&self.z).zip(operating_point(design)) {
            *value = own + point;
        }
    }

    /// The commands that these deviations are those of: at a limit the limit itself.
    pub(crate) fn command_into(&self, design: &Design, mode: Mode, u: &mut [f64]) {
        for (j, (value, actuator)) in u.iter_mut().zip(&design.actuators).enumerate() {
            *value = match actuator.limits {
                Some(limits) if mode.is_limited(j) => mode.side(limits, j),
                _ => self.u[j] + actuator.operating.unwrap_or_default(),
            };
        }
    }
}
