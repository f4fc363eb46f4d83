//! Whether feedback and observer exist.

use control::detectability::Detectability;
use control::distance::{Distance, from_uncontrollable};
use control::faults::ExtendedPlant;
use control::rank::{Mode, Rank, controllability, uncontrollable_modes};
use control::stability::is_clearly_stable;
use control::{Domain, Error};
use files::PlaceError;
use nalgebra::Complex;
use plant_file::{FAULTS, PlantFile};

use crate::plant::fixed_mode::described_in;
use crate::plant::linear::LinearPlant;
use crate::solve::names::{fault_names, state_name};
use plant_file::signals::signal_names;

/// Checks that the commands reach every mode that is not stable; the error names the mode, and stable modes out of
/// reach are warnings. Returns the rank of the controllability matrix, and the distance from the nearest pair that is
/// not controllable.
pub(crate) fn check_controllable(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    warnings: &mut Vec<PlaceError>,
) -> Result<(Rank, Distance), crate::Error> {
    let refuse = |error: Error| file.error(&["B", "actuators"], error.to_string());
    let rank = controllability(&linear.a, &linear.b).map_err(refuse)?;
    let state = |at: usize| linear.states[at].name.clone();
    let modes = uncontrollable_modes(&linear.a, &linear.b).map_err(refuse)?;
    for mode in modes.into_iter().filter(above_or_on_the_real_axis) {
        let stable = is_clearly_stable(mode.eigenvalue, &linear.a, linear.domain);
        let stable = stable.map_err(refuse)? && rank.rank > 0;
        if linear.is_of_delays(&mode) {
            continue;
        }
        let message = format!(
            "the commands {} reach {} of {} states only: no feedback moves {}{}",
            signal_names(&linear.actuators),
            rank.rank,
            rank.n,
            described_in(&mode, linear.domain, true, state),
            consequence(stable, &mode, linear.domain),
        );
        let error = file.error(&["B", "actuators"], message);
        if !stable {
            return Err(error.into());
        }
        warnings.push(error);
    }
    Ok((rank, from_uncontrollable(&linear.a, &linear.b).map_err(refuse)?))
}

/// Checks that the augmented observer exists; the error names the faults and the measurements, and stable modes that
/// the measurements do not show are warnings.
pub(crate) fn check_detectable(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
    detectability: &Detectability,
    warnings: &mut Vec<PlaceError>,
) -> Result<(), crate::Error> {
    let measurements = signal_names(&linear.measurements);
    let modes = detectability.unobservable.iter();
    let shown =
        |(mode, _): &&(Mode, bool)| above_or_on_the_real_axis(mode) && !linear.is_of_delays(mode);
    for (mode, stable) in modes.filter(shown) {
        let message = format!(
            "the measurements {measurements} show {} of {} states only: no observer moves {}{}",
            detectability.observability.rank,
            detectability.observability.n,
            described_in(mode, linear.domain, true, |at| state_name(linear, at).to_owned()),
            consequence(*stable, mode, linear.domain),
        );
        let error = file.error(&["C", "measurements"], message);
        if !stable {
            return Err(error.into());
        }
        warnings.push(error);
    }
    let fault_names = fault_names(linear, extended);
    if let Some(&invisible) = detectability.invisible_faults().first() {
        let name = &fault_names[invisible];
        let message = format!("fault `{name}` cannot be seen from the measurements {measurements}");
        return Err(at_fault(file, linear, invisible, message).into());
    }
    if let Some(hidden) = detectability.hidden.first() {
        let faults = hidden.faults();
        let states: Vec<_> = hidden.states().iter().map(|&at| state_name(linear, at)).collect();
        let mut hiding = faults.iter().map(|&fault| fault_names[fault].as_str());
        // If no state is involved, the fault is hidden by the other faults.
        let (distinguished, from): (Vec<_>, String) = match states.as_slice() {
            [] => (hiding.by_ref().take(1).collect(), hiding.collect::<Vec<_>>().join(", ")),
            states => (hiding.collect(), format!("a movement of {}", states.join(", "))),
        };
        let message = format!(
            "{} of {} independent courses of faults and states are seen: the measurements \
             {measurements} cannot tell a {} of {} from {}",
            hidden.rank,
            hidden.expected,
            if hidden.at == Complex::from(linear.domain.constant()) {
                "constant value"
            } else {
                "change"
            },
            distinguished.join(", "),
            from,
        );
        return Err(at_fault(file, linear, faults[0], message).into());
    }
    let outcome = extended.plant.check_detectable(linear.domain);
    outcome.map_err(|error| file.error(&FAULTS, error.to_string()))?;
    Ok(())
}

/// Whether the eigenvalue has no negative imaginary part: selects one mode of each complex pair.
pub(crate) fn above_or_on_the_real_axis(mode: &Mode) -> bool {
    mode.eigenvalue.im >= 0.0
}

/// Returns what follows from a mode that no gain moves, as the end of a sentence; empty for a mode that is stable, but
/// hardly.
pub(crate) fn consequence(stable: bool, mode: &Mode, domain: Domain) -> &'static str {
    match stable {
        true => "; it is stable and keeps its eigenvalue",
        false if domain.excess(mode.eigenvalue) < 0.0 => "",
        false => "; expected that only stable modes are out of reach",
    }
}

/// Returns an error at the entry of the fault in column `column` of F_a; for the rate of a ramp at the entry of all
/// faults.
pub(crate) fn at_fault(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    column: usize,
    message: String,
) -> PlaceError {
    match linear.faults.get(column) {
        Some(fault) => file.error_at(&fault.place, message),
        None => file.error(&FAULTS, message),
    }
}
