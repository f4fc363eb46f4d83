//! Mistakes in a plant file that no numerical method would name: names that the controller FMU
//! cannot have, limits that exclude the operating point, faults that no measurement can tell apart.

use files::PlaceError;
use fmu_description::{array_element, is_structured_name, misplaced_elements};
use nalgebra::{DMatrix, DVector};

use crate::estimation::Law;
use crate::linear_plant::LinearPlant;
use crate::plant_file::{FAULTS, Model, PlantFile};
use crate::signals::{EntryPoint, Fault, FaultDynamics, Signal};
use crate::variants::Variable;
use control::faults::ExtendedPlant;

/// A column counts as a combination of others if they leave less than this of its length; rows and
/// columns have length one.
const DEPENDENT: f64 = 1e-10;
/// Coefficients of a combination below this, relative to the largest, count as zero.
const NEGLIGIBLE: f64 = 1e-6;
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
    let own = OwnVariables::of(file);
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
        if own.include(name) {
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
        let mut own = Self {
            scalars: vec!["time", "compensate", "t_on", "monitor"],
            signals: vec![("x_hat", states), ("f_hat", q), ("x_hat_0", states), ("f_hat_0", q)],
            matrices: MATRICES.to_vec(),
        };
        if file.sampling.is_some() {
            own.scalars.extend(["T_s", "sample_clock"]);
        }
        if file.schedule.is_some() {
            own.scalars.push("schedule_at");
        }
        if ramps > 0 {
            own.matrices.push("A_f");
        }
        let fed = match &file.model {
            Model::Matrices { d, .. } => d.amax() > 0.0,
            Model::Fmu(_) => file.filter.is_some(),
        };
        if fed {
            own.matrices.push("D");
        }
        let t = file.references.as_ref().map(|references| references.signals.len());
        if file.references.is_some() {
            own.matrices.extend(["H", "K_i", "F_i", "L_w", "N_r"]);
        }
        if file.detection.is_some() {
            own.scalars.extend(DETECTION);
        }
        let operating = |signal: &Signal| signal.operating.is_some_and(|value| value != 0.0);
        let stated = states.is_none() || file.signals().any(operating);
        let mut add = |present: bool, signals: &[(&'static str, Option<usize>)]| {
            own.signals.extend_from_slice(if present { signals } else { &[] });
        };
        add(
            file.detection.is_some(),
            &[("residual", None), ("statistic", None), ("threshold", None)],
        );
        add(file.faults.iter().any(lossy), &[("E_hat", q)]);
        add(file.filter.is_some(), &[("y_f", p), ("filter", p)]);
        add(stated, &[("x_op", states), ("u_op", m), ("y_op", p)]);
        add(t.is_some(), &[("x_i", t), ("x_i_0", t), ("r_op", t)]);
        match &file.estimation.law {
            Law::Augmented => {}
            Law::ProportionalIntegral { .. } | Law::FastAdaptive { .. } => {
                add(true, &[("f_hat_i", q)]);
                own.matrices.push("P_f");
            }
            Law::SlidingMode { .. } => {
                add(true, &[("rho", q), ("delta", q)]);
                own.matrices.push("A_f");
            }
            Law::Learning { .. } => own.matrices.push("A_f"),
        }
        let limited = file.actuators.iter().any(|actuator| actuator.limits.is_some());
        add(limited, &[("u_min", m), ("u_max", m)]);
        let reconfigured = file.reconfiguration.is_some();
        add(reconfigured, &[("actuator_gone", m), ("u_stuck", m)]);
        let fallback = file.fallback.is_some();
        own.scalars.extend((reconfigured || fallback).then_some("reconfiguration"));
        own.scalars.extend(fallback.then_some("fall_back"));
        own
    }

    /// Whether `name` is one of these variables, their derivatives, or an element of their arrays.
    fn include(&self, name: &str) -> bool {
        let derivative = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')'));
        if let Some(state) = derivative {
            let states = ["x_hat", "f_hat", "f_hat_i", "y_f", "x_i"];
            let signals = self.signals.iter().filter(|(own, _)| states.contains(own));
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
        signals.any(|(own, count)| match array {
            None => name == *own && count.is_none_or(|count| count == 1),
            Some(array) => array == *own && count.is_none_or(|count| count > 1),
        })
    }
}

/// Checks that the limits of each actuator contain its operating point; returns the warnings.
pub(crate) fn check_limits(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
) -> Result<Vec<PlaceError>, PlaceError> {
    let mut warnings = Vec::new();
    for actuator in &linear.actuators {
        let (Some([low, high]), [_, Some(place)]) = (actuator.limits, &actuator.places) else {
            continue;
        };
        let value = actuator.operating.unwrap_or(0.0);
        let unit = actuator.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
        let about =
            format!("the operating point of the actuator `{}`, {value}{unit}", actuator.name);
        if value < low || value > high {
            let message = format!(
                "{about}, is outside of its limits {low} and {high}; expected limits around it, or \
                 another `operating` or `operating_point`"
            );
            return Err(file.error_at(place, message));
        }
        if value <= low || value >= high {
            let message = format!(
                "{about}, is at a limit, so that the controller acts in one direction only"
            );
            warnings.push(file.error_at(place, message));
        }
    }
    Ok(warnings)
}

/// Checks that each fault acts on the plant in a direction of its own and that there are as many
/// independent measurements as faults.
///
/// Both follow from the condition for an observer, rank [A - s I, F; C, 0] = n + q at s = 0, which
/// needs rank F = q and rank C >= q.
pub(crate) fn check_faults(
    file: &PlantFile<'_>,
    linear: &LinearPlant,
    extended: &ExtendedPlant,
) -> Result<(), PlaceError> {
    let estimates: Vec<_> = extended.channels.iter().map(|channel| channel.estimate).collect();
    let effects = extended.plant.f_a.select_columns(&estimates);
    let faults = &linear.faults;
    if let Some(Dependence { column, of }) = dependences(&effects).into_iter().next() {
        let name = &faults[column].name;
        let others: Vec<_> = of.iter().map(|&at| format!("`{}`", faults[at].name)).collect();
        let message = match others.as_slice() {
            [] => format!("fault `{name}` has no effect on the plant: its column of F_a is zero"),
            [other] => format!(
                "the faults {other} and `{name}` act on the plant in the same direction (their \
                 columns of F_a are parallel), so that no measurement tells one from the other; \
                 expected one fault in place of both"
            ),
            others => format!(
                "fault `{name}` acts on the plant as a combination of {} does (their columns of F_a \
                 are linearly dependent), so that no measurement tells them apart; expected fewer \
                 faults",
                others.join(", ")
            ),
        };
        return Err(file.error_at(&faults[column].place, message));
    }
    let dependent = match &extended.filter {
        // The filter makes the measurements independent.
        Some(_) => Vec::new(),
        None => dependences(&linear.c.transpose()),
    };
    let independent = linear.measurements.len() - dependent.len();
    if faults.len() <= independent {
        return Ok(());
    }
    let names =
        |all: Vec<&String>| all.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ");
    let kind = if dependent.is_empty() { "" } else { "independent " };
    let message = format!(
        "{} faults ({}) cannot be estimated from {independent} {kind}measurement{} ({}): expected at \
         least as many independent measurements as faults",
        faults.len(),
        names(faults.iter().map(|fault| &fault.name).collect()),
        if independent == 1 { "" } else { "s" },
        names(linear.measurements.iter().map(|signal| &signal.name).collect()),
    );
    let place = faults.get(independent).map(|fault| &fault.place);
    Err(place.map_or_else(|| file.error(&FAULTS, &message), |at| file.error_at(at, &message)))
}

/// A column that is a combination of earlier ones.
#[derive(Debug, PartialEq)]
struct Dependence {
    column: usize,
    /// The earlier columns with a coefficient that is not negligible; none for a zero column.
    of: Vec<usize>,
}

/// Returns all columns of M that are combinations of earlier ones.
///
/// Method: rows, then columns are scaled to length one; Gram-Schmidt, each column twice.
fn dependences(m: &DMatrix<f64>) -> Vec<Dependence> {
    let unit = |length: f64| if length > 0.0 { length } else { 1.0 };
    let mut scaled = m.clone();
    scaled.row_iter_mut().for_each(|mut row| row /= unit(row.amax()));
    scaled.column_iter_mut().for_each(|mut column| column /= unit(column.norm()));
    let (mut found, mut kept) = (Vec::new(), Vec::new());
    // Columns of the orthonormal basis, and of R with M = Q R.
    let (mut basis, mut r) = (Vec::<DVector<f64>>::new(), Vec::<DVector<f64>>::new());
    for column in 0..m.ncols() {
        let mut rest: DVector<f64> = scaled.column(column).into();
        let mut parts = DVector::zeros(basis.len() + 1);
        for _ in 0..2 {
            for (at, direction) in basis.iter().enumerate() {
                let part = direction.dot(&rest);
                parts[at] += part;
                rest.axpy(-part, direction, 1.0);
            }
        }
        let length = rest.norm();
        if length > DEPENDENT {
            let last = basis.len();
            parts[last] = length;
            basis.push(rest / length);
            r.push(parts);
            kept.push(column);
            continue;
        }
        let order = basis.len();
        let upper = DMatrix::from_fn(order, order, |i, j| if i <= j { r[j][i] } else { 0.0 });
        let parts = parts.rows(0, order).into_owned();
        let coefficients = upper.solve_upper_triangular(&parts).unwrap_or(parts);
        let least = NEGLIGIBLE * coefficients.amax();
        let taking_part = (0..order).filter(|&at| coefficients[at].abs() > least);
        found.push(Dependence { column, of: taking_part.map(|at| kept[at]).collect() });
    }
    found
}

/// Returns `plant.toml:3:5: message` for a warning.
pub(crate) fn line(file: &PlantFile<'_>, warning: &PlaceError) -> String {
    format!("{}:{}:{}: {}", file.name(), warning.line(), warning.column(), warning.message())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(rows: usize, values: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(rows, values.len() / rows, values)
    }

    #[test]
    fn a_dependent_column_is_returned_with_the_columns_that_it_depends_on() {
        let none: [Dependence; 0] = [];
        assert_eq!(dependences(&columns(2, &[1.0, 0.0, 1e-12, 1.0])), none);
        // The units of the rows do not matter.
        assert_eq!(dependences(&columns(2, &[1e9, 2e9, 1e-9, -2e-9])), none);
        let parallel = columns(3, &[0.0, 0.0, 3.0, -9.0, 0.1, -0.3]);
        assert_eq!(dependences(&parallel), [Dependence { column: 1, of: vec![0] }]);
        let sum = columns(3, &[1.0, 0.0, 0.5, 2.0, 0.0, 1.0, 0.5, -3.0, 1.0, 1.0, 0.0, -1.0]);
        assert_eq!(dependences(&sum), [Dependence { column: 3, of: vec![0, 1] }]);
        let zero = columns(2, &[0.0, 1.0, 0.0, 0.0]);
        assert_eq!(dependences(&zero), [Dependence { column: 0, of: Vec::new() }]);
    }
}
