//! The equilibrium of a loop in which actuators are gone.

use control::Error;
use control::rank::uncontrollable_modes;
use control::stability::is_clearly_stable;
use nalgebra::{DMatrix, DVector};

use crate::plant::fixed_mode::described_in;
use crate::plant::linear::LinearPlant;
use crate::report::robustness::Number;
use plant_file::signals::Signal;

/// The equilibrium of a loop in which actuators are gone.
pub(crate) struct Rest {
    /// Deviations of the commands from the operating point.
    pub(crate) u: DVector<f64>,
    /// Deviations of the measurements from the operating point.
    pub(crate) measurements: Vec<Number>,
    /// Whether the measurements that must be kept are at the operating point.
    pub(crate) is_held: bool,
}

impl Rest {
    /// Returns the equilibrium at deviations x and u from the operating point.
    pub(crate) fn of(
        linear: &LinearPlant,
        x: &DVector<f64>,
        u: DVector<f64>,
        is_held: bool,
    ) -> Self {
        let measured = &linear.c * x;
        let measurements = linear.measurements.iter().zip(measured.iter());
        Self {
            u,
            measurements: measurements.map(|(signal, value)| number(signal, *value)).collect(),
            is_held,
        }
    }
}

fn number(signal: &Signal, value: f64) -> Number {
    Number { name: signal.name.clone(), unit: signal.unit.clone(), value }
}

/// Returns the commands at rest: the operating point plus `deviations`; an actuator that is gone has the command at
/// which it is stuck.
pub(crate) fn commands(
    actuators: &[Signal],
    deviations: &DVector<f64>,
    stuck: &[(usize, f64)],
) -> Vec<Number> {
    let one = |(at, (signal, deviation)): (usize, (&Signal, &f64))| {
        let stuck = stuck.iter().find(|(gone, _)| *gone == at);
        let free = signal.operating.unwrap_or(0.0) + deviation;
        number(signal, stuck.map_or(free, |(_, command)| *command))
    };
    actuators.iter().zip(deviations.iter()).enumerate().map(one).collect()
}

/// Returns the actuators that are not `gone` and whose command at rest is beyond their limits.
pub(crate) fn beyond_limits(
    actuators: &[Signal],
    commands: &[Number],
    gone: &[usize],
) -> Vec<String> {
    let beyond = |(at, (signal, command)): (usize, (&Signal, &Number))| {
        let [low, high] = signal.limits.filter(|_| !gone.contains(&at))?;
        (command.value < low || command.value > high).then(|| signal.name.clone())
    };
    actuators.iter().zip(commands).enumerate().filter_map(beyond).collect()
}

/// Describes a mode of the plant that is not stable and that the columns of `b` do not reach; None if there is none.
pub(crate) fn unreachable_mode(
    linear: &LinearPlant,
    b: &DMatrix<f64>,
) -> Result<Option<String>, Error> {
    for mode in uncontrollable_modes(&linear.a, b)? {
        if !is_clearly_stable(mode.eigenvalue, &linear.a, linear.domain)? {
            let name = |at: usize| linear.states[at].name.clone();
            return Ok(Some(described_in(&mode, linear.domain, true, name)));
        }
    }
    Ok(None)
}
