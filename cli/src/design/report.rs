//! The numbers of a design: what `--json` prints and what the page shows.

use nalgebra::{Complex, DMatrix};
use serde::{Serialize, Serializer};

/// Everything that is known of a design.
#[derive(Serialize)]
pub(crate) struct Report {
    pub(crate) description: String,
    /// Name of the plant file.
    pub(crate) plant_file: String,
    pub(crate) plant: Plant,
    pub(crate) checks: Vec<Check>,
    /// K_x, K_f, L_x, L_f and what else the controller runs with.
    pub(crate) gains: Vec<Matrix>,
    pub(crate) feedback: Loop,
    pub(crate) observer: Loop,
    pub(crate) sampling: Option<Sampled>,
    pub(crate) certificate: Certificate,
    /// How large each error can get, one entry for each pair of a fault and an error.
    pub(crate) bounds: Vec<Bound>,
    /// What a change of each fault does: all at once, and at the bound of its rate where one is stated.
    pub(crate) steps: Vec<StepResponse>,
    /// Singular values over the frequency.
    pub(crate) frequency: Vec<Frequency>,
    /// For which losses of effectiveness the loop is stable, one entry per such fault.
    pub(crate) effectiveness: Vec<Effectiveness>,
    /// What all this rests on, in sentences.
    pub(crate) assumptions: Vec<String>,
    /// The variables of the controller FMU; empty without `--fmu`.
    pub(crate) interface: Vec<Variable>,
}

/// The plant as designed for.
#[derive(Serialize)]
pub(crate) struct Plant {
    /// Where the matrices come from, in a sentence.
    pub(crate) origin: String,
    pub(crate) states: Vec<Signal>,
    pub(crate) actuators: Vec<Signal>,
    pub(crate) measurements: Vec<Signal>,
    pub(crate) faults: Vec<Signal>,
    /// A, B, C, F_a of the plant, and the extended ones where they differ.
    pub(crate) matrices: Vec<Matrix>,
    /// Eigenvalues of A.
    pub(crate) eigenvalues: Vec<[f64; 2]>,
}

/// A signal.
#[derive(Serialize)]
pub(crate) struct Signal {
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
    pub(crate) description: String,
    /// Value at the operating point.
    pub(crate) operating: f64,
    /// Limits, bounds, the way it enters and the like, in words.
    pub(crate) notes: String,
}

/// A matrix with names of its rows and columns.
#[derive(Serialize)]
pub(crate) struct Matrix {
    pub(crate) name: String,
    pub(crate) meaning: String,
    pub(crate) rows: Vec<String>,
    pub(crate) columns: Vec<String>,
    /// Row by row.
    pub(crate) values: Vec<Vec<f64>>,
}

/// A condition that was checked.
#[derive(Serialize)]
pub(crate) struct Check {
    /// What must hold, in a sentence.
    pub(crate) condition: String,
    pub(crate) holds: bool,
    /// The number behind it: a rank, a distance.
    pub(crate) value: Option<f64>,
    pub(crate) explanation: String,
}

/// Eigenvalues of a closed loop.
#[derive(Serialize)]
pub(crate) struct Loop {
    /// Which matrix, `A + B K_x` for one.
    pub(crate) matrix: String,
    /// How the gain was found, in a sentence.
    pub(crate) method: String,
    /// Eigenvalues [re, im] that were asked for; empty where none were.
    pub(crate) wanted: Vec<[f64; 2]>,
    /// Eigenvalues [re, im] as reached.
    pub(crate) eigenvalues: Vec<[f64; 2]>,
    /// Condition number of the eigenvectors in the units of the plant file, where they were chosen.
    pub(crate) condition: Option<f64>,
    /// The same in balanced coordinates.
    pub(crate) balanced_condition: Option<f64>,
    /// Largest distance of an eigenvalue from the wanted one, relative.
    pub(crate) pole_error: Option<f64>,
    /// Boundary of the wanted region, where one was wanted.
    pub(crate) region: Option<Region>,
}

/// The region wanted, in 1/s and degrees.
#[derive(Serialize)]
pub(crate) struct Region {
    pub(crate) decay: Option<f64>,
    pub(crate) disc_center: Option<f64>,
    pub(crate) disc_radius: Option<f64>,
    pub(crate) sector: Option<f64>,
}

/// The sampled design.
#[derive(Serialize)]
pub(crate) struct Sampled {
    /// Sample time, s.
    pub(crate) sample_time: f64,
    /// `current` or `prediction`.
    pub(crate) estimator: String,
}

/// Theorem 1 and what is known beside it.
#[derive(Serialize)]
pub(crate) struct Certificate {
    /// Theorem 1 as printed, or why it does not hold.
    #[serde(serialize_with = "or_reason")]
    pub(crate) printed: Result<Theorem1, String>,
    /// The same with P chosen by linear matrix inequalities, or why there is none.
    #[serde(serialize_with = "or_reason")]
    pub(crate) free: Result<FreeP, String>,
    /// Where the error ends for bounded rates of the faults, or why nothing is said.
    #[serde(serialize_with = "or_reason")]
    pub(crate) ultimate: Result<Ultimate, String>,
    /// Norms from the faults' rates to the errors: name, value and how it was verified.
    pub(crate) norms: Vec<Norm>,
}

/// The quantities of Theorem 1 (Patton and Klinkhieo 2009, (12), (16)).
#[derive(Serialize)]
pub(crate) struct Theorem1 {
    pub(crate) alpha: f64,
    pub(crate) beta: f64,
    pub(crate) p: Vec<Vec<f64>>,
    pub(crate) smallest_eigenvalue: f64,
    pub(crate) largest_eigenvalue: f64,
    /// Relative residual of the Lyapunov equation.
    pub(crate) residual: f64,
    pub(crate) delta: f64,
}

/// P by linear matrix inequalities.
#[derive(Serialize)]
pub(crate) struct FreeP {
    /// Largest certified decay rate, 1/s, and the margin of its inequality.
    pub(crate) decay: f64,
    pub(crate) decay_margin: f64,
    /// Smallest certified delta.
    pub(crate) delta: f64,
    pub(crate) p: Vec<Vec<f64>>,
    /// Smallest eigenvalue by which the inequalities hold, relative.
    pub(crate) margin: f64,
}

/// The ball in which [e; eps] ends, eps = f_hat - f.
#[derive(Serialize)]
pub(crate) struct Ultimate {
    /// Bound of the norm of the faults' rates, per s.
    pub(crate) rate: f64,
    pub(crate) radius: f64,
    /// Largest value of each component.
    pub(crate) peaks: Vec<f64>,
    /// Smallest eigenvalue by which the inequalities hold, relative.
    pub(crate) margin: f64,
}

/// A norm of the error's dynamics.
#[derive(Serialize)]
pub(crate) struct Norm {
    pub(crate) name: String,
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) value: f64,
    pub(crate) method: String,
}

/// How large an error gets for a bounded fault.
#[derive(Serialize)]
pub(crate) struct Bound {
    pub(crate) fault: String,
    pub(crate) error: String,
    pub(crate) unit: Option<String>,
    /// Peak-to-peak (L1) gain from the fault, and from its rate.
    pub(crate) gain_of_fault: f64,
    pub(crate) gain_of_rate: f64,
    /// The smaller of gain times bound, where the file states bounds.
    pub(crate) largest: Option<f64>,
}

/// What a change of a fault does to the compensated loop.
#[derive(Serialize)]
pub(crate) struct StepResponse {
    pub(crate) fault: String,
    pub(crate) unit: Option<String>,
    /// Size of the change, in the unit of the fault.
    pub(crate) size: f64,
    /// How fast it changes, per s; all at once where nothing is stated.
    pub(crate) rate: Option<f64>,
    pub(crate) curves: Vec<Curve>,
}

/// A signal over time after the change.
#[derive(Serialize)]
pub(crate) struct Curve {
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
    /// Largest absolute value, and when.
    pub(crate) peak: f64,
    pub(crate) peak_time: f64,
    /// When it stays within 2 % of its peak; of an estimate: of its final value, s.
    pub(crate) settling_time: f64,
    /// Times in s and values.
    pub(crate) times: Vec<f64>,
    pub(crate) values: Vec<f64>,
}

/// Singular values over the frequency.
#[derive(Serialize)]
pub(crate) struct Frequency {
    /// From what to what, in words.
    pub(crate) name: String,
    /// rad/s.
    pub(crate) frequencies: Vec<f64>,
    /// One list per singular value, the largest first.
    pub(crate) singular_values: Vec<Vec<f64>>,
}

/// Stability under loss of effectiveness.
#[derive(Serialize)]
pub(crate) struct Effectiveness {
    pub(crate) actuator: String,
    /// Largest loss, between 0 and 1, up to which every smaller one leaves the loop stable.
    pub(crate) largest_stable_loss: f64,
}

/// A variable of the controller FMU.
#[derive(Serialize)]
pub(crate) struct Variable {
    pub(crate) name: String,
    pub(crate) causality: String,
    pub(crate) variability: String,
    pub(crate) unit: Option<String>,
    pub(crate) start: Option<String>,
    pub(crate) description: String,
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
pub(crate) fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().map(|entry| entry + 0.0).collect()).collect()
}

/// Real and imaginary parts.
pub(crate) fn pairs(numbers: &[Complex<f64>]) -> Vec<[f64; 2]> {
    numbers.iter().map(|number| [number.re, number.im]).collect()
}
