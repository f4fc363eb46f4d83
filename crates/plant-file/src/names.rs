//! Checks the names in a plant file against the names in the controller FMU.

use crate::read::Result;
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

/// Checks the names of the variables of the controller FMU (actuators, measurements, references, the input of a
/// schedule), the order of elements of arrays among them, and that faults and rates of ramps have different names.
pub(crate) fn check_names(file: &PlantFile<'_>) -> Result<()> {
    let variables = ControllerVariables::of(file);
    let references = file.references.as_ref().map_or(&[][..], |references| &references.signals);
    let signals = file.actuators.iter().chain(&file.measurements).chain(references);
    for signal in signals.chain(schedule_input(file)) {
        let name = &signal.name;
        let message = if !is_structured_name(name) {
            format!(
                "`{name}` cannot be the name of a variable of the controller FMU: expected letters A \
                 to Z, digits and `_`, not starting with a digit, or ASCII text in apostrophes; \
                 `description` may hold any text"
            )
        } else if variables.include(name) {
            format!("the controller FMU has a variable `{name}` of its own; expected another name")
        } else {
            continue;
        };
        return Err(at_name(file, signal, message));
    }
    let is_among =
        |signals: &[Signal], signal: &Signal| signals.iter().any(|other| other.name == signal.name);
    let is_actuator = |signal: &&Signal| is_among(&file.actuators, signal);
    let is_either = |signal: &&Signal| is_actuator(signal) || is_among(&file.measurements, signal);
    if let Some(signal) = file.measurements.iter().find(is_actuator) {
        let message = format!(
            "the actuator and the measurement `{}` would be one variable of the controller FMU; \
             expected different names",
            signal.name
        );
        return Err(at_name(file, signal, message));
    }
    if let Some(signal) = references.iter().find(is_either) {
        let message = format!(
            "the reference `{}` would have the name of an actuator or a measurement in the controller \
             FMU; expected another `name`",
            signal.name
        );
        return Err(at_name(file, signal, message));
    }
    if let Some(input) = schedule_input(file)
        && (is_actuator(&input) || is_among(references, input))
    {
        let kind = if is_actuator(&input) { "an actuator" } else { "a reference" };
        let message = format!(
            "the scheduling variable `{}` is {kind}; expected a measurement, or another name",
            input.name
        );
        return Err(at_name(file, input, message));
    }
    check_arrays(file, references)?;
    check_fault_names(file)
}

/// The scheduling variable, if it is a separate input of the controller FMU.
fn schedule_input<'a>(file: &'a PlantFile<'_>) -> Option<&'a Signal> {
    match &file.schedule.as_ref()?.variable {
        Variable::Input(signal) => Some(signal),
        Variable::Measurement(_) => None,
    }
}

/// Checks that the elements of each array are adjacent and in order. In the FMU, references,
/// `compensate` and the input of a schedule are between measurements and actuators.
fn check_arrays<'a>(file: &'a PlantFile<'_>, references: &'a [Signal]) -> Result<()> {
    let signals = file.measurements.iter().chain(references).map(Some).chain([None]);
    let signals = signals.chain(schedule_input(file).map(Some));
    let signals: Vec<_> = signals.chain(file.actuators.iter().map(Some)).collect();
    let name = |signal: Option<&'a Signal>| signal.map_or("compensate", |signal| &signal.name);
    let Some((at, text)) = misplaced_elements(signals.iter().copied().map(name)).into_iter().next()
    else {
        return Ok(());
    };
    let Some(signal) = signals[at] else {
        return Err(file.error(&["actuators", "measurements"], text));
    };
    let message =
        format!("in the controller FMU the {text}; expected another order or other names");
    Err(at_name(file, signal, message))
}

fn check_fault_names(file: &PlantFile<'_>) -> Result<()> {
    for (at, fault) in file.faults.iter().enumerate() {
        let is_rate_of = |other: &Fault| {
            other.dynamics == FaultDynamics::Ramp && fault.name == format!("{}_rate", other.name)
        };
        let message = if file.faults[..at].iter().any(|other| other.name == fault.name) {
            format!("two faults have the name `{}`; expected different names", fault.name)
        } else if let Some(other) = file.faults.iter().find(|other| is_rate_of(other)) {
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

/// An error at the name of `signal`, or at the lists of signals if the name has no place of its own.
fn at_name(file: &PlantFile<'_>, signal: &Signal, message: String) -> PlaceError {
    match &signal.places[0] {
        Some(place) => file.error_at(place, message),
        None => file.error(&["actuators", "measurements", "reference"], message),
    }
}

const SCALAR: Option<usize> = Some(1);
/// The number of elements of a matrix, represented by 2: any number above 1 makes it an array.
const MATRIX: Option<usize> = Some(2);

/// The variables that the controller FMU has besides the signals of the plant file, each with the number of its
/// elements: with one element a scalar, otherwise an array. `None` if the number is known only after linearisation.
struct ControllerVariables(Vec<(&'static str, Option<usize>)>);

impl ControllerVariables {
    fn of(file: &PlantFile<'_>) -> Self {
        let (states, has_feedthrough) = match &file.model {
            Model::Matrices { a, d, .. } => (Some(a.nrows()), d.amax() > 0.0),
            Model::Fmu(_) => (None, file.filter.is_some()),
        };
        let (m, p) = (Some(file.actuators.len()), Some(file.measurements.len()));
        let t = file.references.as_ref().map(|references| references.signals.len());
        let ramps =
            file.faults.iter().filter(|fault| fault.dynamics == FaultDynamics::Ramp).count();
        let q = Some(file.faults.len() + ramps);
        let is_loss = |fault: &Fault| matches!(fault.entry_point, EntryPoint::Loss { .. });
        let is_shifted = |signal: &Signal| signal.operating.is_some_and(|value| value != 0.0);
        let has_point = states.is_none() || file.signals().any(is_shifted);
        let is_limited = file.actuators.iter().any(|actuator| actuator.limits.is_some());
        let has_cases = file.reconfiguration.is_some();
        let has_fallback = file.fallback.is_some();
        let has_detection = file.detection.is_some();
        let law = &file.estimation.law;
        let is_direct = matches!(law, Law::ProportionalIntegral { .. } | Law::FastAdaptive { .. });
        let is_sliding = matches!(law, Law::SlidingMode { .. });
        let has_model = ramps > 0 || is_sliding || matches!(law, Law::Learning { .. });
        let mut all = Vec::new();
        let mut add = |is_present: bool, names: &[&'static str], count: Option<usize>| {
            all.extend(names.iter().filter(|_| is_present).map(|name| (*name, count)));
        };
        add(true, &["time", "compensate", "t_on", "monitor"], SCALAR);
        add(true, &["x_hat", "x_hat_0"], states);
        add(true, &["f_hat", "f_hat_0"], q);
        add(true, &MATRICES, MATRIX);
        add(file.sampling.is_some(), &["T_s", "sample_clock"], SCALAR);
        add(file.schedule.is_some(), &["schedule_at"], SCALAR);
        add(has_model, &["A_f"], MATRIX);
        add(has_feedthrough, &["D"], MATRIX);
        add(t.is_some(), &["H", "K_i", "F_i", "L_w", "N_r"], MATRIX);
        add(t.is_some(), &["x_i", "x_i_0", "r_op"], t);
        add(has_detection, &DETECTION, SCALAR);
        add(has_detection, &["residual", "statistic", "threshold"], None);
        add(file.faults.iter().any(is_loss), &["E_hat"], q);
        add(file.transfer_time.is_some(), &["u_t"], m);
        add(file.filter.is_some(), &["y_f", "filter"], p);
        add(has_point, &["x_op"], states);
        add(has_point, &["u_op"], m);
        add(has_point, &["y_op"], p);
        add(is_direct, &["f_hat_i"], q);
        add(is_direct, &["P_f"], MATRIX);
        add(is_sliding, &["rho", "delta"], q);
        add(is_limited, &["u_min", "u_max"], m);
        add(has_cases, &["actuator_gone", "u_stuck"], m);
        add(file.checks_measurements(), &["measurement_held", "measurement_lost"], SCALAR);
        add(has_cases || has_fallback, &["reconfiguration"], SCALAR);
        add(has_fallback, &["fall_back"], SCALAR);
        Self(all)
    }

    /// Whether `name` is one of the scalars, an element of one of the arrays, or, in continuous time, a derivative.
    fn include(&self, name: &str) -> bool {
        let derivative = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
        if let Some(state) = derivative {
            let states = ["x_hat", "f_hat", "f_hat_i", "y_f", "x_i", "u_t"];
            let is_sampled = self.0.iter().any(|(variable, _)| *variable == "T_s");
            return !is_sampled && self.has(state, |variable| states.contains(&variable));
        }
        self.has(name, |_| true)
    }

    /// Whether `name` is one of the variables for which `examined` is true, or an element of such a variable.
    fn has(&self, name: &str, examined: impl Fn(&str) -> bool) -> bool {
        let array = array_element(name).map(|(array, _)| array);
        self.0.iter().filter(|(variable, _)| examined(variable)).any(
            |(variable, count)| match array {
                None => name == *variable && count.is_none_or(|count| count == 1),
                Some(array) => array == *variable && count.is_none_or(|count| count > 1),
            },
        )
    }
}
