//! Names of states and faults, in the order of the gains.

use control::faults::ExtendedPlant;
use plant_file::PlantFile;

use crate::plant::linear::LinearPlant;

/// Returns the names of the faults, then of the rates of ramps.
pub(crate) fn fault_names(linear: &LinearPlant, extended: &ExtendedPlant) -> Vec<String> {
    let mut all: Vec<_> = linear.faults.iter().map(|fault| fault.name.clone()).collect();
    all.resize(extended.plant.f_a.ncols(), String::new());
    for (fault, channel) in linear.faults.iter().zip(&extended.channels) {
        if let Some(rate) = channel.rate {
            all[rate] = format!("{}_rate", fault.name);
        }
    }
    all
}

/// Returns the name of a state, or of the measurement that a filter state belongs to; empty for positions beyond.
pub(crate) fn state_name(linear: &LinearPlant, state: usize) -> &str {
    let n = linear.states.len();
    let signal = linear.states.get(state).or_else(|| linear.measurements.get(state - n));
    signal.map_or("", |signal| signal.name.as_str())
}

/// Returns the names of the states of the feedback: the states of the plant, then, with integral action, the integrals.
pub(crate) fn feedback_states(file: &PlantFile<'_>, linear: &LinearPlant) -> Vec<String> {
    let integrals = file.references.iter().filter(|references| references.integral);
    let integrals = integrals.flat_map(|references| &references.signals);
    let integrals = integrals.map(|signal| format!("integral of {}", signal.name));
    linear.states.iter().map(|signal| signal.name.clone()).chain(integrals).collect()
}

/// Returns the names of the states of the observer: states, filters, faults, and rates of ramps.
pub(crate) fn observer_states(linear: &LinearPlant, extended: &ExtendedPlant) -> Vec<String> {
    let plain = (0..extended.plant.a.nrows()).map(|at| state_name(linear, at).to_owned());
    plain.chain(fault_names(linear, extended)).collect()
}
