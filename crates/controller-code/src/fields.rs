//! The identifiers of the signals in the code.

use super::controller::Controller;
use super::names::fields;
use super::parts::Signal;
use super::symbols::Matrix;

/// The identifiers, by kind of signal.
pub(super) struct Fields {
    pub(super) states: Vec<String>,
    pub(super) faults: Vec<String>,
    pub(super) actuators: Vec<String>,
    pub(super) measurements: Vec<String>,
    pub(super) references: Vec<String>,
    /// The scheduling variable, if it is a separate input.
    pub(super) schedule: Vec<String>,
    /// The integrals; each has the name of its reference.
    pub(super) integrals: Vec<String>,
}

impl Fields {
    pub(super) fn of(controller: &Controller) -> Self {
        let names = |signals: &[Signal]| fields(signals.iter().map(|signal| signal.name.as_str()));
        Self {
            states: names(&controller.states),
            faults: names(&controller.faults),
            actuators: names(&controller.actuators),
            measurements: names(&controller.measurements),
            integrals: if controller.has(Matrix::H) {
                names(&controller.references)
            } else {
                Vec::new()
            },
            references: names(&controller.references),
            schedule: names(controller.schedule_inputs()),
        }
    }

    /// The fields of the inputs about actuators: `gone_` and the actuator for each that may be gone, then `fall_back`
    /// if there is a fall-back.
    pub(super) fn switches(&self, controller: &Controller) -> Vec<String> {
        let Some(reconfiguration) = &controller.reconfiguration else { return Vec::new() };
        let gone = reconfiguration
            .cases
            .iter()
            .map(|case| format!("gone_{}", self.actuators[case.actuator]));
        gone.chain(reconfiguration.fallback.map(|_| "fall_back".to_owned())).collect()
    }

    /// The fields of the estimates, in order: states, faults, losses, integrals.
    pub(super) fn estimates(&self, controller: &Controller) -> Vec<String> {
        let states = self.states.iter().map(|field| format!("x_hat_{field}"));
        let faults = self.faults.iter().map(|field| format!("f_hat_{field}"));
        let losses = controller.losses.iter();
        let losses = losses.map(|loss| format!("E_hat_{}", self.faults[loss.fault]));
        let integrals = self.integrals.iter().map(|field| format!("x_i_{field}"));
        states.chain(faults).chain(losses).chain(integrals).collect()
    }
}
