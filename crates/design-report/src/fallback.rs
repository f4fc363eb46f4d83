//! The part of the report on the fall-back.

use schemars::JsonSchema;
use serde::Serialize;

use crate::family::CommonCertificate;
use crate::robustness::{LoopPoint, Number};
use crate::{OrReason, or_reason};

/// One feedback for the intact plant and for each actuator that may fail, without knowing which.
#[derive(Serialize, JsonSchema)]
pub struct FallbackReport {
    /// The largest fraction of its effect that an actuator may lose; 1 if it may be gone.
    pub loss: f64,
    /// How the feedback was found, in a sentence.
    pub method: String,
    /// Decay rate, 1/s, that the loop of plant and controller has in all cases.
    pub decay: f64,
    /// Whether the estimated faults are compensated in the fall-back.
    pub compensates: bool,
    /// K_x, row by row.
    pub k_x: Vec<Vec<f64>>,
    /// Frobenius norm of K_x.
    pub gain_norm: f64,
    /// Frobenius norm of K_x of the intact controller.
    pub intact_gain_norm: f64,
    /// Decay rate, 1/s, of the loop of the intact plant and the intact controller.
    pub intact_decay: f64,
    /// One P for the state feedback loops of all cases, in the required region.
    pub feedback: CommonCertificate,
    /// One P for the loops of all cases with the observer, or the reason why there is none. P proves stability while
    /// the losses change arbitrarily fast (in a sampled design from one sample to the next), if the losses, as
    /// fractions of `loss`, add up to at most 1. Constant losses are judged by eigenvalues.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<CommonCertificate>")]
    pub whole: Result<CommonCertificate, String>,
    /// Whether the search for the P of `whole` was left out, or ended, for lack of time.
    pub whole_left_out: bool,
    /// The intact plant, then each actuator that has failed.
    pub cases: Vec<FallbackCase>,
}

/// The loop of the fall-back in one case.
#[derive(Serialize, JsonSchema)]
pub struct FallbackCase {
    /// `all actuators`, `without T1`, or `T1 with a loss of 0.6`.
    pub name: String,
    /// Decay rate of the slowest eigenvalue of plant and controller together, 1/s.
    pub decay: f64,
    /// Decay rate of the slowest eigenvalue of A + B K_x with the actuators of this case, 1/s.
    pub feedback_decay: f64,
    /// The loop opened at the commands and at the measurements.
    pub points: Vec<LoopPoint>,
    /// Largest delay, s, common to all commands.
    #[schemars(with = "Option<f64>")]
    pub delay_margin: f64,
    /// H2 norm from white noise to each measurement, relative to that of the intact plant with the intact controller.
    /// The noise acts as on the commands of the intact plant in all cases: a failure does not lessen it.
    pub price: Vec<Number>,
    /// The commands at rest.
    pub commands: Vec<Number>,
    /// The actuators whose command at rest is beyond their limits.
    pub beyond_limits: Vec<String>,
    /// The deviations of the measurements from the operating point at rest.
    pub measurements: Vec<Number>,
}

impl FallbackCase {
    /// The measurement with the largest price.
    #[must_use]
    pub fn worst_price(&self) -> Option<&Number> {
        self.price.iter().max_by(|x, y| x.value.total_cmp(&y.value))
    }
}
