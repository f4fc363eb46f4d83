//! Signals, matrices and numbers of samples, which the parts of a controller share.

use aso_controller::clock::clock_rounding;
use aso_controller::design::{Actuator, Fault, Measurement};
use nalgebra::DMatrix;

use crate::Error;

/// A state, an actuator, a measurement, a reference or a fault, for comments of the code.
pub(super) struct Signal {
    pub(super) name: String,
    pub(super) unit: Option<String>,
    pub(super) description: String,
    /// The value at the operating point.
    pub(super) operating: f64,
    /// The limits of an actuator, the range of a measurement.
    pub(super) limits: Option<[f64; 2]>,
}

impl Signal {
    pub(super) fn new(
        name: String,
        unit: Option<String>,
        description: String,
        operating: f64,
    ) -> Self {
        Self { name, unit, description, operating, limits: None }
    }
}

impl From<aso_controller::design::Signal> for Signal {
    fn from(signal: aso_controller::design::Signal) -> Self {
        let aso_controller::design::Signal { name, unit, description, operating } = signal;
        Self::new(name, unit, description, operating.unwrap_or_default())
    }
}

impl From<Measurement> for Signal {
    fn from(measurement: Measurement) -> Self {
        let Measurement { name, unit, description, operating, range, longest_hold: _ } =
            measurement;
        let operating = operating.unwrap_or_default();
        Self { limits: range, ..Self::new(name, unit, description, operating) }
    }
}

impl From<Actuator> for Signal {
    fn from(actuator: Actuator) -> Self {
        let Actuator { name, unit, description, operating, limits } = actuator;
        Self { limits, ..Self::new(name, unit, description, operating.unwrap_or_default()) }
    }
}

impl From<Fault> for Signal {
    fn from(fault: Fault) -> Self {
        Self::new(fault.name, fault.unit, fault.description, 0.0)
    }
}

/// A matrix of the design file for linear algebra.
pub(super) fn dense(matrix: &aso_controller::Matrix) -> DMatrix<f64> {
    DMatrix::from_row_slice(matrix.rows, matrix.columns, &matrix.values)
}

/// The number of the first sample at or after the time `start` in s, with the tolerance of the FMU; sample 0 is at time
/// 0. An error, which calls the time `name`, if the number needs more than 32 bits.
pub(super) fn first_at(name: &str, start: f64, period: f64) -> Result<u32, Error> {
    let is_reached = |sample: f64| {
        let time = sample * period;
        time >= start - clock_rounding(time)
    };
    let mut sample = ((start / period).floor() - 2.0).max(0.0);
    while !is_reached(sample) && sample <= f64::from(u32::MAX) {
        sample += 1.0;
    }
    if sample > f64::from(u32::MAX) {
        return Err(Error(format!(
            "{name} = {start} s is more than 2^32 samples of {period} s after the start; a counter of the code has 32 \
             bits"
        )));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number")]
    Ok(sample as u32)
}

#[cfg(test)]
mod tests {
    use super::first_at;

    #[test]
    fn the_first_compensated_sample_is_the_first_one_at_t_on() {
        for (t_on, period, expected) in [
            (0.0, 0.1, 0),
            (-3.0, 0.1, 0),
            (0.3, 0.1, 3), // 3 * 0.1 is above 0.3, 0.3 / 0.1 below 3
            (0.31, 0.1, 4),
            (5.0, 1e-3, 5000),
            (0.7, 0.1, 7),
        ] {
            assert_eq!(first_at("t_on", t_on, period).unwrap(), expected, "{t_on} {period}");
        }
        assert!(first_at("t_on", 1e9, 1e-3).is_err());
    }
}
