//! Names that the controller FMU cannot have.

use files::PlaceError;
use fmu_description::{array_element, is_structured_name, misplaced_elements};

use crate::estimation::Law;
use crate::faults::{EntryPoint, Fault, FaultDynamics};
use crate::signals::Signal;
use crate::variants::Variable;
use crate::{Model, PlantFile};

/// The parameters of the controller FMU that are matrices.
const MATRICES: [&str; 8] = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"];

/// The scalars that a detection adds to the controller FMU.
const DETECTION: [&str; 7] = [
    "detection_reset",
    "fault_detected",
    "fault_isolated",
    "t_detected",
    "t_onset",
    "detect_from",
    "detection_sample_time",
];

/// Checks the names of actuators and measurements, which are variables of the controller FMU, and
/// that no two faults have the same name.
pub(crate) fn check_names(file: &PlantFile<'_>) -> Result<(), PlaceError> {
    let variables = OwnVariables::of(file);
    let references = file.references.as_ref().map_or(&[][..], |references| &references.signals);
    for signal in file
        .actuators
        .iter()
        .chain(&file.measurements)
        .chain(references)
        .chain(schedule_input(file))
    {
        let name = &signal.name;
        if !is_structured_name(name) {
            let message = format!(
                "`{name}` cannot be the name of a variable of the controller FMU: expected letters A \
                 to Z, digits and `_`, not starting with a digit, or ASCII text in apostrophes; \
                 `description` may hold any text"
            );
            return Err(at_name(file, signal, message));
        }
        if variables.include(name) {
            let message = format!(
                "the controller FMU has a variable `{name}` of its own; expected another name"
            );
            return Err(at_name(file, signal, message));
        }
    }
    for signal in &file.measurements {
        if file.actuators.iter().any(|actuator| actuator.name == signal.name) {
            let message = format!(
                "the actuator and the measurement `{}` would be one variable of the controller FMU; \
                 expected different names",
                signal.name
            );
            return Err(at_name(file, signal, message));
        }
    }
    for signal in references {
        let mut others = file.actuators.iter().chain(&file.measurements);
        if others.any(|other| other.name == signal.name) {
            let message = format!(
                "the reference `{}` would have the name of an actuator or a measurement in the controller \
                 FMU; expected another `name`",
                signal.name
            );
            return Err(at_name(file, signal, message));
        }
    }
    if let Some(input) = schedule_input(file)
        && file.actuators.iter().any(|actuator| actuator.name == input.name)
    {
        let message = format!(
            "the scheduling variable `{}` is an actuator; expected a measurement, or another name",
            input.name
        );
        return Err(at_name(file, input, message));
    }
    check_arrays(file, references)?;
    check_fault_names(file)
}

/// The input of the controller FMU that selects its gains, if it is no measurement.
fn schedule_input<'a>(file: &'a PlantFile<'_>) -> Option<&'a Signal> {
    match &file.schedule.as_ref()?.variable {
        Variable::Input(signal) => Some(signal),
        Variable::Measurement(_) => None,
    }
}

/// Checks that the elements of each array are adjacent and in order. In the FMU, references,
/// `compensate` and the input of a schedule are between measurements and actuators.
fn check_arrays(file: &PlantFile<'_>, references: &[Signal]) -> Result<(), PlaceError> {
    let names = |signals: &'_ [Signal]| signals.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    let mut all = names(&file.measurements);
    all.extend(names(references));
    all.push("compensate".to_owned());
    let scheduled = schedule_input(file);
    all.extend(scheduled.map(|signal| signal.name.clone()));
    all.extend(names(&file.actuators));
    let Some((at, text)) = misplaced_elements(all.iter().map(String::as_str)).into_iter().next()
    else {
        return Ok(());
    };
    let inputs = file
        .measurements
        .iter()
        .chain(references)
        .map(Some)
        .chain([None])
        .chain(scheduled.map(Some));
    let mut signals = inputs.chain(file.actuators.iter().map(Some));
    let Some(signal) = signals.nth(at).flatten() else {
        return Err(file.error(&["actuators", "measurements"], text));
    };
    let message =
        format!("in the controller FMU the {text}; expected another order or other names");
    Err(at_name(file, signal, message))
}

fn check_fault_names(file: &PlantFile<'_>) -> Result<(), PlaceError> {
    for (at, fault) in file.faults.iter().enumerate() {
        let rate = |other: &Fault| {
            other.dynamics == FaultDynamics::Ramp && fault.name == format!("{}_rate", other.name)
        };
        let message = if file.faults[..at].iter().any(|other| other.name == fault.name) {
            format!("two faults have the name `{}`; expected different names", fault.name)
        } else if let Some(other) = file.faults.iter().find(|other| rate(other)) {
            format!(
                "fault `{}` has the name of the rate of the ramp `{}`; expected another name",
                fault.name, other.name
            )
        } else {
            continue;
        };
        return Err(file.error_at(&fault.place, message));
    }
    Ok(())
}

fn at_name(file: &PlantFile<'_>, signal: &Signal, message: String) -> PlaceError {
    match &signal.places[0] {
        Some(place) => file.error_at(place, message),
        None => file.error(&["actuators", "measurements", "reference"], message),
    }
}

/// The variables that the controller FMU has besides actuators and measurements.
struct OwnVariables {
    scalars: Vec<&'static str>,
    /// Signals with the number of their channels, if it is known before linearisation: with one
    /// channel a scalar, otherwise an array.
    signals: Vec<(&'static str, Option<usize>)>,
    matrices: Vec<&'static str>,
}

impl OwnVariables {
    fn of(file: &PlantFile<'_>) -> Self {
        let states = match &file.model {
            Model::Matrices { a, .. } => Some(a.nrows()),
            Model::Fmu(_) => None,
        };
        let (m, p) = (Some(file.actuators.len()), Some(file.measurements.len()));
        let ramps =
            file.faults.iter().filter(|fault| fault.dynamics == FaultDynamics::Ramp).count();
        let q = Some(file.faults.len() + ramps);
        let lossy = |fault: &Fault| matches!(fault.entry_point, EntryPoint::Loss { .. });
        let mut variables = Self {
            scalars: vec!["time", "compensate", "t_on", "monitor"],
            signals: vec![("x_hat", states), ("f_hat", q), ("x_hat_0", states), ("f_hat_0", q)],
            matrices: MATRICES.to_vec(),
        };
        if file.sampling.is_some() {
            variables.scalars.extend(["T_s", "sample_clock"]);
        }
        if file.schedule.is_some() {
            variables.scalars.push("schedule_at");
        }
        if ramps > 0 {
            variables.matrices.push("A_f");
        }
        let fed = match &file.model {
            Model::Matrices { d, .. } => d.amax() > 0.0,
            Model::Fmu(_) => file.filter.is_some(),
        };
        if fed {
            variables.matrices.push("D");
        }
        let t = file.references.as_ref().map(|references| references.signals.len());
        if file.references.is_some() {
            variables.matrices.extend(["H", "K_i", "F_i", "L_w", "N_r"]);
        }
        if file.detection.is_some() {
            variables.scalars.extend(DETECTION);
        }
        let operating = |signal: &Signal| signal.operating.is_some_and(|value| value != 0.0);
        let stated = states.is_none() || file.signals().any(operating);
        let mut add = |present: bool, signals: &[(&'static str, Option<usize>)]| {
            variables.signals.extend_from_slice(if present { signals } else { &[] });
        };
        add(
            file.detection.is_some(),
            &[("residual", None), ("statistic", None), ("threshold", None)],
        );
        add(file.faults.iter().any(lossy), &[("E_hat", q)]);
        add(file.transfer_time.is_some(), &[("u_t", m)]);
        add(file.filter.is_some(), &[("y_f", p), ("filter", p)]);
        add(stated, &[("x_op", states), ("u_op", m), ("y_op", p)]);
        add(t.is_some(), &[("x_i", t), ("x_i_0", t), ("r_op", t)]);
        match &file.estimation.law {
            Law::Augmented => {}
            Law::ProportionalIntegral { .. } | Law::FastAdaptive { .. } => {
                add(true, &[("f_hat_i", q)]);
                variables.matrices.push("P_f");
            }
            Law::SlidingMode { .. } => {
                add(true, &[("rho", q), ("delta", q)]);
                variables.matrices.push("A_f");
            }
            Law::Learning { .. } => variables.matrices.push("A_f"),
        }
        let limited = file.actuators.iter().any(|actuator| actuator.limits.is_some());
        add(limited, &[("u_min", m), ("u_max", m)]);
        let reconfigured = file.reconfiguration.is_some();
        add(reconfigured, &[("actuator_gone", m), ("u_stuck", m)]);
        let fallback = file.fallback.is_some();
        if file.checks_measurements() {
            variables.scalars.extend(["measurement_held", "measurement_lost"]);
        }
        variables.scalars.extend((reconfigured || fallback).then_some("reconfiguration"));
        variables.scalars.extend(fallback.then_some("fall_back"));
        variables
    }

    /// Whether `name` is one of these variables, their derivatives, or an element of their arrays.
    fn include(&self, name: &str) -> bool {
        let derivative = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
        if let Some(state) = derivative {
            let states = ["x_hat", "f_hat", "f_hat_i", "y_f", "x_i"];
            let signals = self.signals.iter().filter(|(signal, _)| states.contains(signal));
            return !self.scalars.contains(&"T_s") && Self::is_among(state, signals);
        }
        let indexed = array_element(name).map(|(array, _)| array);
        self.scalars.contains(&name)
            || indexed.is_some_and(|array| self.matrices.contains(&array))
            || Self::is_among(name, self.signals.iter())
    }

    fn is_among<'a>(
        name: &str,
        mut signals: impl Iterator<Item = &'a (&'static str, Option<usize>)>,
    ) -> bool {
        let array = array_element(name).map(|(array, _)| array);
        signals.any(|(signal, count)| match array {
            None => name == *signal && count.is_none_or(|count| count == 1),
            Some(array) => array == *signal && count.is_none_or(|count| count > 1),
        })
    }
}
