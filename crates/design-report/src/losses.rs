//! The part of the report on losses of effectiveness up to stated fractions.

use schemars::JsonSchema;
use serde::Serialize;

use crate::number::rounded;
use crate::robustness::Number;
use crate::{OrReason, or_reason};

/// The proofs about losses of effectiveness up to the fractions that the plant file states.
#[derive(Serialize, JsonSchema)]
pub struct LossReport {
    /// The stated fraction `up_to` of each actuator that may lose effectiveness.
    pub stated: Vec<Number>,
    /// Each loop that the controller can close.
    pub loops: Vec<LossLoop>,
}

/// A loop under losses of effectiveness.
#[derive(Serialize, JsonSchema)]
pub struct LossLoop {
    /// `compensation on` or `compensation off`.
    pub name: String,
    /// What the controller does in this loop, in a sentence.
    pub meaning: String,
    /// Constant losses: the limits of all actuators together, in proportion to the stated fractions; with
    /// several actuators, also of each one alone.
    pub constant: Vec<ConstantLoss>,
    /// The proof for the stated losses, or the reason why there is none.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<LossProof>")]
    pub proof: Result<LossProof, String>,
    /// The largest proven losses, for the same sets of actuators as in `constant`; empty if the search was left out.
    pub certified: Vec<CertifiedLoss>,
}

/// How large constant losses may become.
#[derive(Serialize, JsonSchema)]
pub struct ConstantLoss {
    /// The losses beyond which the loop is unstable; if `stable`, the largest losses that were tested.
    pub losses: Vec<Number>,
    /// Whether the loop is stable for all losses that were tested.
    pub stable: bool,
    /// The ratio of `losses` to the stated losses.
    pub factor: f64,
}

/// The largest losses that a proof was found for.
#[derive(Serialize, JsonSchema)]
pub struct CertifiedLoss {
    /// The losses, which may vary with time between 0 and these values.
    pub losses: Vec<Number>,
    /// The ratio of `losses` to the stated losses.
    pub factor: f64,
}

/// The proof that a loop is stable for all losses up to the stated ones, constant or varying.
#[derive(Serialize, JsonSchema)]
pub struct LossProof {
    /// Smallest eigenvalue of the inequalities, scaled to a diagonal of about one.
    pub margin: f64,
    /// The common Lyapunov matrix P of [x; z], row by row; z are the states of the controller.
    pub p: Vec<Vec<f64>>,
    /// The decay rate that is proven for all these losses, 1/s; none if it was left out or not found. Like `peaks`, it
    /// is computed only with the compensation on.
    pub decay: Option<f64>,
    /// Bounds of the states for all these losses.
    pub peaks: Vec<LossPeak>,
}

/// The bound of a state under a disturbance, for all losses up to the stated ones.
#[derive(Serialize, JsonSchema)]
pub struct LossPeak {
    /// The cause of the deviation: the name of a fault, or of an actuator, which loses a part of its command at the
    /// operating point.
    pub disturbance: String,
    /// The largest absolute value of the disturbance.
    pub size: f64,
    /// The state.
    pub state: String,
    /// Unit of the state.
    pub unit: Option<String>,
    /// The bound of its deviation from the operating point, from rest.
    pub largest: f64,
}

/// Losses in words: `u1 0.4, u2 0.3`.
#[must_use]
pub fn described(losses: &[Number]) -> String {
    let one = |loss: &Number| format!("{} {}", loss.name, rounded(loss.value));
    losses.iter().map(one).collect::<Vec<_>>().join(", ")
}
