//! The part of the report on actuators that are gone.

use schemars::JsonSchema;
use serde::Serialize;

use crate::robustness::Number;
use crate::{OrReason, or_reason};

/// The controllers for actuators that are gone.
#[derive(Serialize, JsonSchema)]
pub struct ReconfigurationReport {
    /// Loss, and time in s: an actuator counts as gone after its estimated loss of effectiveness has been above this
    /// loss for this time; none if only inputs of the FMU report it.
    pub by_estimate: Option<[f64; 2]>,
    /// One entry for each actuator that may be gone.
    pub without: Vec<WithoutActuator>,
    /// One entry for each set of several actuators that may be gone together; empty unless the plant file
    /// states `together`.
    pub several: Vec<WithoutSeveral>,
    /// The actuators, alone and in pairs, without gains of their own: the fall-back is in force while they are gone.
    /// Empty without a fall-back.
    pub by_fallback: Vec<ServedByFallback>,
}

/// The controller without several actuators.
#[derive(Serialize, JsonSchema)]
pub struct WithoutSeveral {
    /// The actuators.
    pub actuators: Vec<String>,
    /// The controller, or the reason why there is none.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<Reconfigured>")]
    pub outcome: Result<Reconfigured, String>,
}

/// The fall-back while actuators are known to be gone.
#[derive(Serialize, JsonSchema)]
pub struct ServedByFallback {
    /// The actuators.
    pub actuators: Vec<String>,
    /// Decay rate of the slowest eigenvalue of plant and controller together, 1/s; 0 or negative if it is not
    /// stable.
    pub decay: f64,
    /// Whether the loop is stable.
    pub stable: bool,
}

/// The controller without one actuator.
#[derive(Serialize, JsonSchema)]
pub struct WithoutActuator {
    /// The actuator.
    pub actuator: String,
    /// Its unit.
    pub unit: Option<String>,
    /// The command at which it is stuck.
    pub stuck_at: f64,
    /// The controller, or the reason why there is none.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<Reconfigured>")]
    pub outcome: Result<Reconfigured, String>,
}

/// A controller for actuators that are gone: u = K_x x_hat + K_f f_hat + K_s (stuck command - operating point).
#[derive(Serialize, JsonSchema)]
pub struct Reconfigured {
    /// How the feedback was found, in a sentence.
    pub method: String,
    /// The part of the effect of all actuators that the remaining ones cannot produce, relative.
    pub residual: f64,
    /// Eigenvalues [re, im] of A + B K_x.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Frobenius norm of K_x.
    pub gain_norm: f64,
    /// Frobenius norm of K_x with all actuators.
    pub intact_gain_norm: f64,
    /// K_x, row by row.
    pub k_x: Vec<Vec<f64>>,
    /// K_f, row by row.
    pub k_f: Vec<Vec<f64>>,
    /// K_s, row by row; a column for each actuator that is gone.
    pub k_s: Vec<Vec<f64>>,
    /// The commands of the equilibrium.
    pub commands: Vec<Number>,
    /// The actuators whose command of the equilibrium is beyond their limits.
    pub beyond_limits: Vec<String>,
    /// The deviations of the measurements from the operating point in the equilibrium.
    pub measurements: Vec<Number>,
    /// Whether the measurements that must be kept are at the operating point.
    pub kept: bool,
}
