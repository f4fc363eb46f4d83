//! The data of a design report: the output of `--json` and the content of the page.
#![forbid(unsafe_code)]

pub mod comparison;
pub mod detection;
pub mod fallback;
pub mod family;
pub mod identity;
pub mod losses;
pub mod number;
pub mod reconfiguration;
pub mod robustness;
pub mod schedule;

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Serialize, Serializer};

use crate::detection::Detection;
use crate::fallback::FallbackReport;
use crate::family::FamilyReport;
use crate::losses::LossReport;
use crate::reconfiguration::ReconfigurationReport;
use crate::robustness::{Number, Robustness, Verdict};
use crate::schedule::ScheduleReport;

/// The data of a design report.
#[derive(Serialize, JsonSchema)]
pub struct Report {
    /// A description of the controller.
    pub description: String,
    /// Name of the plant file.
    pub plant_file: String,
    /// The plant.
    pub plant: Plant,
    /// The verdict on the design.
    pub verdict: Verdict,
    /// What is unusual in the plant file, each as `plant.toml:3:5: sentence`.
    pub warnings: Vec<String>,
    /// The conditions that were checked.
    pub checks: Vec<Check>,
    /// K_x, K_f, L_x, L_f and the other matrices of the controller.
    pub gains: Vec<Matrix>,
    /// PI, PID and other controllers of low order, in place of a state feedback; empty otherwise.
    pub pid: Vec<PidController>,
    /// The loop of the state feedback.
    pub feedback: Loop,
    /// The loop of the observer.
    pub observer: Loop,
    /// The law that estimates the faults.
    pub estimation: Estimation,
    /// The sampling of the controller; none in continuous time.
    pub sampling: Option<Sampled>,
    /// Margins, noise, tolerances; none if the loop is not stable.
    pub robustness: Option<Robustness>,
    /// The members of the family of plants; none if the plant file states none.
    pub family: Option<FamilyReport>,
    /// The schedule of the gains; none if the plant file states none.
    pub schedule: Option<ScheduleReport>,
    /// The detection of faults, if the plant file asks for it.
    pub detection: Option<Detection>,
    /// Theorem 1 and related certificates.
    pub certificate: Certificate,
    /// Bounds of the errors, one entry for each pair of a fault and an error.
    pub bounds: Vec<Bound>,
    /// Responses to a change of each fault: as a step, and as a ramp if the bound of its rate is
    /// stated; with several faults, also to steps of all of them together.
    pub steps: Vec<StepResponse>,
    /// Responses to a step of each reference; empty without references.
    pub references: Vec<ReferenceStep>,
    /// Singular values over frequency.
    pub frequency: Vec<Frequency>,
    /// Stability under loss of effectiveness, one entry per such fault.
    pub effectiveness: Vec<Effectiveness>,
    /// The proofs about losses of effectiveness up to stated fractions; none if `up_to` is not stated.
    pub losses: Option<LossReport>,
    /// The controllers without each actuator that may be gone; none if `reconfiguration` is not stated.
    pub reconfiguration: Option<ReconfigurationReport>,
    /// One feedback for every actuator that may fail, without knowing which; none if `fallback` is not
    /// stated.
    pub fallback: Option<FallbackReport>,
    /// The assumptions of the report, in sentences.
    pub assumptions: Vec<String>,
    /// The variables of the controller FMU; empty without `--fmu`.
    pub interface: Vec<Variable>,
}

/// The plant of the design.
#[derive(Serialize, JsonSchema)]
pub struct Plant {
    /// The source of the matrices, in a sentence.
    pub origin: String,
    /// The states.
    pub states: Vec<Signal>,
    /// The commands.
    pub actuators: Vec<Signal>,
    /// The measured outputs.
    pub measurements: Vec<Signal>,
    /// The faults.
    pub faults: Vec<Signal>,
    /// A, B, C, F_a of the plant, and the extended matrices if they differ.
    pub matrices: Vec<Matrix>,
    /// Eigenvalues of A.
    pub eigenvalues: Vec<[f64; 2]>,
    /// The sample time, s, if no continuous plant has the sampled matrices of the plant file: the matrices and their
    /// eigenvalues are those of the samples.
    pub sample_time: Option<f64>,
}

/// A signal.
#[derive(Serialize, JsonSchema)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Unit, if stated.
    pub unit: Option<String>,
    /// Description.
    pub description: String,
    /// Value at the operating point.
    pub operating: f64,
    /// Limits, bounds and entry point, in words.
    pub notes: String,
}

/// A matrix with names of its rows and columns.
#[derive(Serialize, JsonSchema)]
pub struct Matrix {
    /// Symbol, for example `K_x`.
    pub name: String,
    /// Description.
    pub meaning: String,
    /// Names of the rows.
    pub rows: Vec<String>,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The values, row by row.
    #[schemars(with = "Vec<Vec<Option<f64>>>")]
    pub values: Vec<Vec<f64>>,
}

/// A PI or PID controller from one measurement y, with its reference r, to one command.
///
/// ```text
/// u = N_r r - K y_f + K_i integral of (r - y) dt - K_d y_f' - K_2 y_f'' - ...
/// ```
///
/// in deviations from the operating point; `y_f`, `y_f`' are the filtered measurement and its rate. The filter is 1 /
/// (1 + s / w) in a PI controller, 1 / (1 + sqrt(2) s / w + s^2 / w^2) in a PID controller, and a Butterworth filter of
/// order n in a controller of order n.
#[derive(Clone, Serialize, JsonSchema)]
pub struct PidController {
    /// The name of the command.
    pub command: String,
    /// The name of the measurement.
    pub measurement: String,
    /// K.
    pub proportional: f64,
    /// `K_i`, 1/s times the unit of K.
    pub integral: f64,
    /// `K_d`, s times the unit of K; none of a PI controller.
    pub derivative: Option<f64>,
    /// `K_2`, `K_3`, ..., s^k times the unit of K; empty for PI and PID controllers.
    pub higher_derivatives: Vec<f64>,
    /// The entry of `N_r`; none without a feedforward.
    pub set_point: Option<f64>,
    /// w of the filter, rad/s.
    pub corner: f64,
}

/// A condition that was checked.
#[derive(Clone, Serialize, JsonSchema)]
pub struct Check {
    /// The condition, in a sentence.
    pub condition: String,
    /// Whether it holds.
    pub holds: bool,
    /// The number that the condition is about, such as a rank or a distance; none if there is no such number.
    pub value: Option<f64>,
    /// Explanation of the number.
    pub explanation: String,
}

/// Eigenvalues of a closed loop.
#[derive(Serialize, JsonSchema)]
pub struct Loop {
    /// The matrix, for example `A + B K_x`.
    pub matrix: String,
    /// The method that found the gain, in a sentence.
    pub method: String,
    /// Required eigenvalues [re, im]; empty if the requirement is of another kind.
    pub required: Vec<[f64; 2]>,
    /// The same as `required`, under its name up to version 0.1; the next version leaves it out.
    pub wanted: Vec<[f64; 2]>,
    /// Eigenvalues [re, im] of the closed loop.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Condition number of the eigenvectors in the units of the plant file, if they were chosen.
    pub condition: Option<f64>,
    /// Condition number of the eigenvectors in balanced coordinates.
    pub balanced_condition: Option<f64>,
    /// Largest distance of an eigenvalue from the required one, relative.
    pub pole_error: Option<f64>,
    /// The required region, if there is one.
    pub region: Option<Region>,
    /// The H-infinity norm, if the gain was designed by it.
    pub norm: Option<NormReport>,
}

/// The H-infinity norm of a gain that was designed by it.
#[derive(Clone, Serialize, JsonSchema)]
pub struct NormReport {
    /// Input and output of the norm, in words.
    pub channel: String,
    /// The norm, with weights and noise; at most 1e-4 of it above the true value.
    pub norm: f64,
    /// A bound of the norm that the bounded real lemma proves, verified by eigenvalues; none if that
    /// fails in double precision, or for more than 30 states.
    pub certified: Option<f64>,
    /// A proven lower bound of the norm, for the gains and filters of `lower_bound_for`. 0 if growing gains make the
    /// norm arbitrarily small; none if no bound is known.
    pub lower_bound: Option<f64>,
    /// For what the lower bound holds: for all gains, within a region or not, and filters of any order, or for the
    /// gains that place all eigenvalues in the disc of the region.
    pub lower_bound_for: Option<LowerBoundFor>,
    /// The relative distance of the norm from its lower bound; none if that is 0.
    pub gap: Option<f64>,
    /// The norm without weights and noise; none if there are neither.
    pub unweighted: Option<f64>,
    /// Frobenius norm of the gain.
    pub gain: f64,
    /// The weights over frequency.
    pub weights: Vec<NormWeight>,
}

/// For what a lower bound of the norm holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LowerBoundFor {
    /// Every gain, and every filter of any order.
    Filters,
    /// Every gain with all eigenvalues in the disc of the required region.
    Disc,
}

/// A weight over frequency.
#[derive(Clone, Serialize, JsonSchema)]
pub struct NormWeight {
    /// The signal.
    pub signal: String,
    /// Numerator in s, of a sampled design in z, the highest power first.
    pub numerator: Vec<f64>,
    /// Denominator, likewise.
    pub denominator: Vec<f64>,
    /// The largest factor by which the weight deviates from its table; none without a table.
    pub table_deviation: Option<f64>,
}

/// A required region of eigenvalues, in 1/s and degrees.
#[derive(Serialize, JsonSchema)]
pub struct Region {
    /// Minimum decay rate in 1/s.
    pub decay: Option<f64>,
    /// Centre of the disc on the real axis, in 1/s.
    pub disc_center: Option<f64>,
    /// Radius of the disc, in 1/s.
    pub disc_radius: Option<f64>,
    /// Half angle of the sector about the negative real axis, in degrees.
    pub sector: Option<f64>,
}

/// The law that estimates the faults. The numbers of a sliding-mode law are those of its linearisation
/// within the boundary layer.
#[derive(Default, Serialize, JsonSchema)]
pub struct Estimation {
    /// Its name in the plant file.
    pub law: String,
    /// Its authors.
    pub sources: String,
    /// Its equations.
    pub equations: Vec<String>,
    /// Its parameters.
    pub parameters: Vec<Number>,
    /// The conditions for its existence.
    pub conditions: Vec<Check>,
    /// The errors of the estimates, one entry for each fault.
    pub errors: Vec<EstimationErrors>,
}

/// The error f_hat - f of the estimate of a fault, relative to the fault, and its noise.
#[derive(Serialize, JsonSchema)]
pub struct EstimationErrors {
    /// The fault.
    pub fault: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Lasting error of a constant fault of 1.
    pub constant: f64,
    /// Time in s after a sudden fault of 1 from which the distance of the error from its lasting value is at most 2 %
    /// of the largest such distance; null if it never is.
    #[schemars(with = "Option<f64>")]
    pub step_settling: f64,
    /// Largest error after a sudden fault of 1.
    pub step_peak: f64,
    /// Lasting error of a fault that grows by 1 per s, in s; none if it grows without end.
    pub ramp: Option<f64>,
    /// Amplitude of the error for a sinusoidal fault of amplitude 1 and the frequency `sine_frequency`.
    pub sine: f64,
    /// The frequency, rad/s: a tenth of the mean rate of the augmented observer.
    pub sine_frequency: f64,
    /// Largest error for any fault of at most 1 (peak-to-peak gain); in a sampled design at the samples.
    pub peak_gain: f64,
    /// Root-mean-square value of the estimate under the measurement noise, in the unit of the fault;
    /// without limit if a direct term passes white noise. None if the loop is not stable.
    pub noise: Option<f64>,
    /// Largest amplitude of the estimate for sinusoidal errors of the measurements whose norm is that of
    /// the noise. None if the loop is not stable.
    pub noise_peak: Option<f64>,
}

/// The sampling of a design.
#[derive(Serialize, JsonSchema)]
pub struct Sampled {
    /// Sample time, s.
    pub sample_time: f64,
    /// `current` or `prediction`.
    pub estimator: String,
}

/// Theorem 1 and related certificates.
#[derive(Serialize, JsonSchema)]
pub struct Certificate {
    /// Theorem 1 as printed by Patton and Klinkhieo (2009), or the reason why it does not hold.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<Theorem1>")]
    pub printed: Result<Theorem1, String>,
    /// Theorem 1 with P from linear matrix inequalities, or the reason why there is none.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<FreeP>")]
    pub free: Result<FreeP, String>,
    /// The ultimate bound of the error for bounded rates of the faults, or the reason why there is
    /// none.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<Ultimate>")]
    pub ultimate: Result<Ultimate, String>,
    /// Norms from the rates of the faults to the estimation errors.
    pub norms: Vec<Norm>,
}

/// The quantities of Theorem 1 (Patton and Klinkhieo 2009, (12), (16)).
#[derive(Serialize, JsonSchema)]
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

/// The certificate with P from linear matrix inequalities.
#[derive(Serialize, JsonSchema)]
pub struct FreeP {
    /// Largest certified decay rate, 1/s.
    pub decay: f64,
    /// Margin of the inequality of the decay rate, relative.
    pub decay_margin: f64,
    /// Smallest certified delta.
    pub delta: f64,
    /// The matrix P, row by row.
    pub p: Vec<Vec<f64>>,
    /// Margin of the inequalities of delta, relative.
    pub margin: f64,
}

/// The ball to which the errors [e; eps] converge, e = x - x_hat, eps = f_hat - f.
#[derive(Serialize, JsonSchema)]
pub struct Ultimate {
    /// Bound of the norm of the faults' rates, per s.
    pub rate: f64,
    /// Radius of the ball.
    pub radius: f64,
    /// Largest value of each component in the invariant set.
    pub peaks: Vec<f64>,
    /// Margin of the inequalities, relative.
    pub margin: f64,
}

/// A norm of the error dynamics.
#[derive(Serialize, JsonSchema)]
pub struct Norm {
    /// Name of the norm.
    pub name: String,
    /// The input.
    pub from: String,
    /// The output.
    pub to: String,
    /// Its value.
    pub value: f64,
    /// How the value was computed and verified.
    pub method: String,
}

/// The bound of an error for a bounded fault.
#[derive(Serialize, JsonSchema)]
pub struct Bound {
    /// The fault.
    pub fault: String,
    /// The error.
    pub error: String,
    /// Unit of the error.
    pub unit: Option<String>,
    /// Peak-to-peak (L1) gain from the fault.
    pub gain_of_fault: f64,
    /// Peak-to-peak (L1) gain from the rate of the fault, without what the commands leave of the fault itself; without
    /// limit if a constant fault leaves a lasting error of its estimate.
    #[schemars(with = "Option<f64>")]
    pub gain_of_rate: f64,
    /// The bound of the error by the bound of the fault or, if it is smaller, by that of its rate; none if the file
    /// states neither, or `rate_bound` alone and the commands leave a part of the fault. That of the rate does not hold
    /// for a sudden change of the fault.
    pub largest: Option<f64>,
}

/// The response of the compensated loop to a change of a fault, or of all faults together.
#[derive(Serialize, JsonSchema)]
pub struct StepResponse {
    /// The fault; several names with `and` between them if they change together.
    pub fault: String,
    /// Its unit; none for several faults.
    pub unit: Option<String>,
    /// Size of the change, in the unit of the fault; 1 for several faults.
    pub size: f64,
    /// Each fault that changes, with the size of its change.
    pub parts: Vec<Number>,
    /// Rate of the change, per s; none for a step.
    pub rate: Option<f64>,
    /// The responding signals: states, errors of estimates, commands.
    pub curves: Vec<Curve>,
}

/// The response of the loop to a step of a reference, from rest, without faults and limits.
#[derive(Default, Serialize, JsonSchema)]
pub struct ReferenceStep {
    /// The reference.
    pub reference: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Size of the step, in this unit; 1 if the plant file states none.
    pub size: f64,
    /// Whether the plant file states the size.
    pub stated: bool,
    /// Time from 10 % to 90 % of the step, in s; none if 90 % are never reached.
    pub rise_time: Option<f64>,
    /// Largest value beyond the reference, as a part of the step; 0 if there is none.
    pub overshoot: f64,
    /// Settling time in s: from then on the output that follows differs from the reference by at most 2 % of the step;
    /// null if it never settles.
    #[schemars(with = "Option<f64>")]
    pub settling_time: f64,
    /// The difference of the reference from the output after a long time, as a part of the step.
    pub steady_state_error: f64,
    /// The commands, as deviations from the operating point.
    pub commands: Vec<CommandPeak>,
    /// The largest movement of the other outputs that follow references, as deviations.
    pub others: Vec<Number>,
    /// The largest negative and the largest positive step whose commands stay within the limits; null if no limit
    /// restricts it.
    #[schemars(with = "[Option<f64>; 2]")]
    pub largest_step: [f64; 2],
    /// The output that follows, the measurements and the commands over time.
    pub curves: Vec<Curve>,
}

/// The extremes of a command after a step of a reference.
#[derive(Default, Serialize, JsonSchema)]
pub struct CommandPeak {
    /// The actuator.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Smallest and largest command as deviations from the operating point.
    pub range: [f64; 2],
    /// The limits as deviations from the operating point; none if it has none.
    pub limits: Option<[f64; 2]>,
    /// The command after a long time.
    pub final_value: f64,
}

/// The response of a signal.
#[derive(Serialize, JsonSchema)]
pub struct Curve {
    /// The signal.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// The value farthest from 0, with its sign.
    pub peak: f64,
    /// Time of `peak`, in s.
    pub peak_time: f64,
    /// Settling time in s: from then on the distance of the signal from its final value is at most 2 % of the largest
    /// such distance; null if it never is, as in a signal that only rounding moves.
    #[schemars(with = "Option<f64>")]
    pub settling_time: f64,
    /// Times in s.
    pub times: Vec<f64>,
    /// Values at those times.
    pub values: Vec<f64>,
}

/// Singular values over frequency.
#[derive(Serialize, JsonSchema)]
pub struct Frequency {
    /// Input and output of the transfer function.
    pub name: String,
    /// Frequencies in rad/s.
    pub frequencies: Vec<f64>,
    /// Singular values: one list per order, the largest first.
    pub singular_values: Vec<Vec<f64>>,
}

/// Stability under loss of effectiveness.
#[derive(Serialize, JsonSchema)]
pub struct Effectiveness {
    /// The actuator.
    pub actuator: String,
    /// The largest loss between 0 and 1 below which every loss leaves the loop stable.
    pub largest_stable_loss: f64,
}

/// A variable of the controller FMU.
#[derive(Serialize, JsonSchema)]
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
    /// Description.
    pub description: String,
}

/// The serialized form of a result, for the schema.
#[derive(JsonSchema)]
#[schemars(untagged)]
#[expect(dead_code, reason = "describes the form only")]
enum OrReason<T> {
    /// The value.
    Found(T),
    /// Why there is none.
    Missing {
        /// The reason, in a sentence.
        reason: String,
    },
}

/// Returns the JSON schema (draft 2020-12) of the serialized report.
///
/// All properties are required, and there are no others. A number that has no limit is `null`.
#[must_use]
pub fn schema() -> serde_json::Value {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let mut schema = settings.into_generator().into_root_schema_for::<Report>().to_value();
    close(&mut schema);
    schema
}

/// Requires all properties of each object and allows no others.
fn close(schema: &mut serde_json::Value) {
    if let Some(object) = schema.as_object_mut() {
        if let Some(properties) = object.get("properties").and_then(|value| value.as_object()) {
            let all: Vec<_> = properties.keys().cloned().collect();
            object.insert("required".to_owned(), all.into());
            object.insert("additionalProperties".to_owned(), false.into());
        }
        object.values_mut().for_each(close);
    } else if let Some(list) = schema.as_array_mut() {
        list.iter_mut().for_each(close);
    }
}

/// Serializes the value, or `{ "reason": ... }` for an error.
fn or_reason<T: Serialize, S: Serializer>(
    outcome: &Result<T, String>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match outcome {
        Ok(result) => result.serialize(serializer),
        Err(reason) => serializer.collect_map([("reason", reason)]),
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
