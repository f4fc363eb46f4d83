//! The numbers of a design: what `--json` prints and what the page shows.

use nalgebra::{Complex, DMatrix};
use serde::{Serialize, Serializer};

/// Everything that is known of a design.
#[derive(Serialize)]
pub struct Report {
    /// What the controller does, in a sentence.
    pub description: String,
    /// Name of the plant file.
    pub plant_file: String,
    /// The plant.
    pub plant: Plant,
    /// The conditions that were checked.
    pub checks: Vec<Check>,
    /// K_x, K_f, L_x, L_f and what else the controller runs with.
    pub gains: Vec<Matrix>,
    /// The loop of the state feedback.
    pub feedback: Loop,
    /// The loop of the observer.
    pub observer: Loop,
    /// How the controller samples; none in continuous time.
    pub sampling: Option<Sampled>,
    /// Theorem 1 and what is known beside it.
    pub certificate: Certificate,
    /// How large each error can get, one entry for each pair of a fault and an error.
    pub bounds: Vec<Bound>,
    /// What a change of each fault does: all at once, and at the bound of its rate where one is stated.
    pub steps: Vec<StepResponse>,
    /// Singular values over the frequency.
    pub frequency: Vec<Frequency>,
    /// For which losses of effectiveness the loop is stable, one entry per such fault.
    pub effectiveness: Vec<Effectiveness>,
    /// What all this rests on, in sentences.
    pub assumptions: Vec<String>,
    /// The variables of the controller FMU; empty without `--fmu`.
    pub interface: Vec<Variable>,
}

/// The plant as designed for.
#[derive(Serialize)]
pub struct Plant {
    /// Where the matrices come from, in a sentence.
    pub origin: String,
    /// The states.
    pub states: Vec<Signal>,
    /// The commands.
    pub actuators: Vec<Signal>,
    /// The measured outputs.
    pub measurements: Vec<Signal>,
    /// The faults.
    pub faults: Vec<Signal>,
    /// A, B, C, F_a of the plant, and the extended ones where they differ.
    pub matrices: Vec<Matrix>,
    /// Eigenvalues of A.
    pub eigenvalues: Vec<[f64; 2]>,
}

/// A signal.
#[derive(Serialize)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Its unit, where one is stated.
    pub unit: Option<String>,
    /// What it is.
    pub description: String,
    /// Value at the operating point.
    pub operating: f64,
    /// Limits, bounds, the way it enters and the like, in words.
    pub notes: String,
}

/// A matrix with names of its rows and columns.
#[derive(Serialize)]
pub struct Matrix {
    /// Its letter, `K_x` for one.
    pub name: String,
    /// What it is.
    pub meaning: String,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Row by row.
    pub values: Vec<Vec<f64>>,
}

/// A condition that was checked.
#[derive(Serialize)]
pub struct Check {
    /// What must hold, in a sentence.
    pub condition: String,
    /// Whether it holds.
    pub holds: bool,
    /// The number behind it: a rank, a distance.
    pub value: Option<f64>,
    /// What the number means.
    pub explanation: String,
}

/// Eigenvalues of a closed loop.
#[derive(Serialize)]
pub struct Loop {
    /// Which matrix, `A + B K_x` for one.
    pub matrix: String,
    /// How the gain was found, in a sentence.
    pub method: String,
    /// Eigenvalues [re, im] that were asked for; empty where none were.
    pub wanted: Vec<[f64; 2]>,
    /// Eigenvalues [re, im] as reached.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Condition number of the eigenvectors in the units of the plant file, where they were chosen.
    pub condition: Option<f64>,
    /// The same in balanced coordinates.
    pub balanced_condition: Option<f64>,
    /// Largest distance of an eigenvalue from the wanted one, relative.
    pub pole_error: Option<f64>,
    /// Boundary of the wanted region, where one was wanted.
    pub region: Option<Region>,
}

/// The region wanted, in 1/s and degrees.
#[derive(Serialize)]
pub struct Region {
    /// Decay rate in 1/s, at least.
    pub decay: Option<f64>,
    /// Centre of the disc on the real axis, in 1/s.
    pub disc_center: Option<f64>,
    /// Radius of the disc, in 1/s.
    pub disc_radius: Option<f64>,
    /// Half angle of the sector about the negative real axis, in degrees.
    pub sector: Option<f64>,
}

/// The sampled design.
#[derive(Serialize)]
pub struct Sampled {
    /// Sample time, s.
    pub sample_time: f64,
    /// `current` or `prediction`.
    pub estimator: String,
}

/// Theorem 1 and what is known beside it.
#[derive(Serialize)]
pub struct Certificate {
    /// Theorem 1 as printed, or why it does not hold.
    #[serde(serialize_with = "or_reason")]
    pub printed: Result<Theorem1, String>,
    /// The same with P chosen by linear matrix inequalities, or why there is none.
    #[serde(serialize_with = "or_reason")]
    pub free: Result<FreeP, String>,
    /// Where the error ends for bounded rates of the faults, or why nothing is said.
    #[serde(serialize_with = "or_reason")]
    pub ultimate: Result<Ultimate, String>,
    /// Norms from the faults' rates to the errors: name, value and how it was verified.
    pub norms: Vec<Norm>,
}

/// The quantities of Theorem 1 (Patton and Klinkhieo 2009, (12), (16)).
#[derive(Serialize)]
pub struct Theorem1 {
    /// alpha of (12).
    pub alpha: f64,
    /// beta of (16).
    pub beta: f64,
    /// The matrix P, row by row.
    pub p: Vec<Vec<f64>>,
    /// Smallest eigenvalue of P.
    pub smallest_eigenvalue: f64,
    /// Largest eigenvalue of P.
    pub largest_eigenvalue: f64,
    /// Relative residual of the Lyapunov equation.
    pub residual: f64,
    /// Bound of the error per bound of the rate, delta of (16).
    pub delta: f64,
}

/// P by linear matrix inequalities.
#[derive(Serialize)]
pub struct FreeP {
    /// Largest certified decay rate, 1/s.
    pub decay: f64,
    /// Margin of its inequality, relative.
    pub decay_margin: f64,
    /// Smallest certified delta.
    pub delta: f64,
    /// The matrix P, row by row.
    pub p: Vec<Vec<f64>>,
    /// Smallest eigenvalue by which the inequalities hold, relative.
    pub margin: f64,
}

/// The ball in which [e; eps] ends, eps = f_hat - f.
#[derive(Serialize)]
pub struct Ultimate {
    /// Bound of the norm of the faults' rates, per s.
    pub rate: f64,
    /// Radius of the ball.
    pub radius: f64,
    /// Largest value of each component.
    pub peaks: Vec<f64>,
    /// Smallest eigenvalue by which the inequalities hold, relative.
    pub margin: f64,
}

/// A norm of the error's dynamics.
#[derive(Serialize)]
pub struct Norm {
    /// Which norm.
    pub name: String,
    /// The input.
    pub from: String,
    /// The output.
    pub to: String,
    /// Its value.
    pub value: f64,
    /// How it was found and verified.
    pub method: String,
}

/// How large an error gets for a bounded fault.
#[derive(Serialize)]
pub struct Bound {
    /// The fault.
    pub fault: String,
    /// The error.
    pub error: String,
    /// Unit of the error.
    pub unit: Option<String>,
    /// Peak-to-peak (L1) gain from the fault, and from its rate.
    pub gain_of_fault: f64,
    /// Peak-to-peak (L1) gain from its rate.
    pub gain_of_rate: f64,
    /// The smaller of gain times bound, where the file states bounds.
    pub largest: Option<f64>,
}

/// What a change of a fault does to the compensated loop.
#[derive(Serialize)]
pub struct StepResponse {
    /// The fault.
    pub fault: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Size of the change, in the unit of the fault.
    pub size: f64,
    /// How fast it changes, per s; all at once where nothing is stated.
    pub rate: Option<f64>,
    /// The signals that follow.
    pub curves: Vec<Curve>,
}

/// A signal over time after the change.
#[derive(Serialize)]
pub struct Curve {
    /// The signal.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Largest absolute value, and when.
    pub peak: f64,
    /// When it has that value, in s.
    pub peak_time: f64,
    /// When it stays within 2 % of its peak; of an estimate: of its final value, s.
    pub settling_time: f64,
    /// Times in s and values.
    pub times: Vec<f64>,
    /// Values at those times.
    pub values: Vec<f64>,
}

/// Singular values over the frequency.
#[derive(Serialize)]
pub struct Frequency {
    /// From what to what, in words.
    pub name: String,
    /// rad/s.
    pub frequencies: Vec<f64>,
    /// One list per singular value, the largest first.
    pub singular_values: Vec<Vec<f64>>,
}

/// Stability under loss of effectiveness.
#[derive(Serialize)]
pub struct Effectiveness {
    /// The actuator.
    pub actuator: String,
    /// Largest loss, between 0 and 1, up to which every smaller one leaves the loop stable.
    pub largest_stable_loss: f64,
}

/// A variable of the controller FMU.
#[derive(Serialize)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its causality.
    pub causality: String,
    /// Its variability.
    pub variability: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Its start value.
    pub start: Option<String>,
    /// What it is.
    pub description: String,
}

/// What is known as it is, and `{ "reason": ... }` in the place of what is not.
fn or_reason<T: Serialize, S: Serializer>(
    found: &Result<T, String>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match found {
        Ok(found) => found.serialize(serializer),
        Err(reason) => serializer.collect_map([("reason", reason)]),
    }
}

/// Row by row, a negative zero as zero.
#[must_use]
pub fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().map(|entry| entry + 0.0).collect()).collect()
}

/// Real and imaginary parts.
#[must_use]
pub fn pairs(numbers: &[Complex<f64>]) -> Vec<[f64; 2]> {
    numbers.iter().map(|number| [number.re, number.im]).collect()
}
