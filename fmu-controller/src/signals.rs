//! The signals of the controller: as the importer sees them, and as the equations take them.

use serde::{Deserialize, Serialize};

use crate::design::{Design, Signal};
use crate::mode::Mode;

/// The signals as the importer sees them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Values {
    /// z = [x_hat; f_hat; y_f].
    pub(crate) z: Vec<f64>,
    /// The measurements, and their derivatives with respect to time.
    pub(crate) y: Vec<f64>,
    pub(crate) y_slopes: Vec<f64>,
    /// The commands.
    pub(crate) u: Vec<f64>,
}

/// The signals of the equations: deviations from the operating point, or a direction in them.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Signals {
    /// z = [x_hat; f_hat; y_f].
    pub(crate) z: Vec<f64>,
    /// The measurements.
    pub(crate) y: Vec<f64>,
    /// The innovations.
    pub(crate) e: Vec<f64>,
    /// The commands.
    pub(crate) u: Vec<f64>,
    /// z'.
    pub(crate) z_slopes: Vec<f64>,
}

/// Adds the operating point, times `sign`, to the values of some signals.
#[inline]
fn add_operating(values: &mut [f64], signals: &[Signal], sign: f64) {
    for (value, signal) in values.iter_mut().zip(signals) {
        *value += sign * signal.operating.unwrap_or_default();
    }
}

/// Adds the operating point [x_op; 0; y_op], times `sign`, to z or to its first parts.
#[inline]
pub(crate) fn add_operating_point(design: &Design, z: &mut [f64], sign: f64) {
    let (x, rest) = z.split_at_mut(design.states.len());
    add_operating(x, &design.states, sign);
    add_operating(&mut rest[design.faults.len()..], &design.measurements, sign);
}

impl Signals {
    /// All signals of `design`, zero.
    pub(crate) fn zero(design: &Design) -> Self {
        let (p, m) = (design.measurements.len(), design.actuators.len());
        let [z, z_slopes] = [0.0; 2].map(|zero| vec![zero; design.order()]);
        Self { z, y: vec![0.0; p], e: vec![0.0; p], u: vec![0.0; m], z_slopes }
    }

    /// Sets z and y to the deviations of `values`, the measurements `offset` s after these were given.
    pub(crate) fn set(&mut self, design: &Design, values: &Values, offset: f64) {
        self.z.copy_from_slice(&values.z);
        add_operating_point(design, &mut self.z, -1.0);
        self.y.copy_from_slice(&values.y);
        add_operating(&mut self.y, &design.measurements, -1.0);
        for (y, slope) in self.y.iter_mut().zip(&values.y_slopes) {
            *y += slope * offset;
        }
    }
}

impl Values {
    /// All signals of `design`, zero.
    pub(crate) fn zero(design: &Design) -> Self {
        let Signals { z, y, u, .. } = Signals::zero(design);
        Self { z, y_slopes: y.clone(), y, u }
    }

    /// Sets z, or its first parts, to the operating point plus the deviations `z`.
    pub(crate) fn set_estimate(&mut self, design: &Design, z: &[f64]) {
        let values = &mut self.z[..z.len()];
        values.copy_from_slice(z);
        add_operating_point(design, values, 1.0);
    }

    /// Sets u to the operating point plus the deviations `u`, and the channels at a limit to it.
    pub(crate) fn set_commands(&mut self, design: &Design, mode: Mode, u: &[f64]) {
        for (j, (value, actuator)) in self.u.iter_mut().zip(&design.actuators).enumerate() {
            let free = u[j] + actuator.operating.unwrap_or_default();
            *value = mode.limit(actuator.limits, j).unwrap_or(free);
        }
    }
}
