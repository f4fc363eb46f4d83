//! The matrices of the report, with the names of their rows and columns.

use control::Domain;
use nalgebra::DMatrix;

use crate::plant::linear::LinearPlant;
use crate::report::Matrix;
use crate::solve::names::fault_names;
use crate::solve::solution::Solution;
use plant_file::signals::Signal;

/// Returns the gains of a design.
pub(crate) fn gains(designed: &Solution) -> Vec<Matrix> {
    Names::of(designed).gains(designed)
}

/// Names of the rows and columns of the matrices.
pub(crate) struct Names {
    states: Vec<String>,
    extended: Vec<String>,
    actuators: Vec<String>,
    measurements: Vec<String>,
    faults: Vec<String>,
    references: Vec<String>,
}

impl Names {
    pub(crate) fn of(designed: &Solution) -> Self {
        let Solution { linear, tracking, .. } = designed;
        let tracking = tracking.as_ref();
        let (states, measurements) = (names(&linear.states), names(&linear.measurements));
        let mut extended = states.clone();
        if designed.filter.is_some() {
            extended.extend(measurements.iter().map(|name| format!("filtered {name}")));
        }
        Self {
            actuators: names(&linear.actuators),
            faults: fault_names(linear, &designed.extended),
            references: tracking.map_or(Vec::new(), |tracking| names(&tracking.signals)),
            states,
            extended,
            measurements,
        }
    }

    /// Returns A, B, C, F_a of the plant, and D with direct feedthrough; the model in the observer if this model
    /// differs, and A_f if not 0.
    pub(crate) fn plant_matrices(&self, designed: &Solution) -> Vec<Matrix> {
        let Self { states, extended, actuators, measurements, faults, .. } = self;
        let linear = &designed.linear;
        let f_a = designed.extended.plant.f_a.rows(0, states.len()).into_owned();
        let mut matrices = vec![
            matrix("A", "states", &linear.a, states, states),
            matrix("B", "commands", &linear.b, states, actuators),
            matrix("C", "measurements", &linear.c, measurements, states),
            matrix("F_a", "faults", &f_a, states, faults),
        ];
        if linear.has_feedthrough() {
            let meaning = "commands in the measurements";
            matrices.insert(3, matrix("D", meaning, &linear.d, measurements, actuators));
        }
        let extended_plant = &designed.plant;
        if extended_plant.a != linear.a {
            let kind = match designed.domain {
                Domain::Continuous => "extended",
                Domain::Sampled { .. } => "sampled",
            };
            for (name, values, rows, columns) in [
                ("A_e", &extended_plant.a, extended, extended),
                ("B_e", &extended_plant.b, extended, actuators),
                ("C_e", &extended_plant.c, measurements, extended),
                ("F_e", &extended_plant.f_a, extended, faults),
            ] {
                matrices.push(matrix(name, &format!("{kind} plant"), values, rows, columns));
            }
        }
        if extended_plant.a_f.amax() > 0.0 {
            matrices.push(matrix("A_f", "fault model", &extended_plant.a_f, faults, faults));
        }
        matrices
    }

    pub(crate) fn gains(&self, designed: &Solution) -> Vec<Matrix> {
        let gains = &designed.gains;
        let Self { extended, actuators, measurements, faults, references, .. } = self;
        let mut all = vec![
            matrix("K_x", "state feedback", &gains.k_x, actuators, extended),
            matrix("K_f", "fault compensation", &gains.k_f, actuators, faults),
            matrix("L_x", "correction of the states", &gains.l_x, extended, measurements),
            matrix("L_f", "correction of the faults", &gains.l_f, faults, measurements),
        ];
        if let Some(p_f) = &gains.p_f {
            all.push(matrix("P_f", "direct term of the faults", p_f, faults, measurements));
        }
        if let Some(injection) = &designed.law.injection {
            let meaning = "argument of the sliding-mode injection; L_f is its linearisation";
            all.push(matrix("F", meaning, &injection.f, faults, measurements));
        }
        if let Some(filter) = &designed.filter {
            let diagonal = DMatrix::from_diagonal(&filter.clone().into());
            all.push(matrix("W", "measurement filter", &diagonal, measurements, measurements));
        }
        let Some(tracking) = &designed.tracking else { return all };
        let h = matrix("H", "outputs of the references", &tracking.h, references, measurements);
        all.push(h);
        if let Some(integral) = &gains.integral {
            let k_i = &integral.gain;
            all.push(matrix("K_i", "integral action", k_i, actuators, references));
        }
        if let Some(l_w) = tracking.windup() {
            all.push(matrix("L_w", "back-calculation", l_w, references, actuators));
        }
        if let Some(n_r) = tracking.feedforward() {
            all.push(matrix("N_r", "feedforward", n_r, actuators, references));
        }
        all
    }
}

pub(crate) fn names(signals: &[Signal]) -> Vec<String> {
    signals.iter().map(|signal| signal.name.clone()).collect()
}

/// Names the rows and columns of four matrices shaped as A, B, C and D of the plant without its delays; the last matrix
/// is left out if D is 0.
pub(crate) fn of_plant(
    linear: &LinearPlant,
    meaning: &str,
    [a, b, c, d]: &[DMatrix<f64>; 4],
) -> Vec<Matrix> {
    let states = &names(linear.plant_states());
    let (actuators, measurements) = (&names(&linear.actuators), &names(&linear.measurements));
    let mut all = vec![
        matrix("A", meaning, a, states, states),
        matrix("B", meaning, b, states, actuators),
        matrix("C", meaning, c, measurements, states),
    ];
    if linear.undelayed.d.amax() > 0.0 {
        all.push(matrix("D", meaning, d, measurements, actuators));
    }
    all
}

pub(crate) fn matrix(
    name: &str,
    meaning: &str,
    values: &DMatrix<f64>,
    rows: &[String],
    columns: &[String],
) -> Matrix {
    Matrix {
        name: name.to_owned(),
        meaning: meaning.to_owned(),
        rows: rows.to_vec(),
        columns: columns.to_vec(),
        values: crate::matrix::rows(values),
    }
}
