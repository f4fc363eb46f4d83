//! The part of a design report on the members of a family of plants.

use schemars::JsonSchema;
use serde::Serialize;

use crate::robustness::{LoopPoint, Number, ToleranceResult};
use crate::{OrReason, or_reason};

/// A family of plants with one controller.
#[derive(Serialize, JsonSchema)]
pub struct FamilyReport {
    /// The plant of the file, `nominal`, then the others.
    pub members: Vec<MemberReport>,
    /// One P for the state feedback loops `A_i + B_i K_x` of all members, with integral action `A_e,i + B_e,i
    /// [K_x, K_i]` with the integrals; none if the feedback was designed for the nominal plant.
    pub feedback: Option<CommonCertificate>,
    /// One P for the loops of all members with the whole controller, or the reason why there is none. P proves
    /// stability while the plant moves between the members arbitrarily fast, in a sampled design from one sample to the
    /// next. Without P, nothing is proven for such plants, and the verdict is not green; each constant member is judged
    /// by its eigenvalues.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<CommonCertificate>")]
    pub whole: Result<CommonCertificate, String>,
}

/// A Lyapunov matrix for several loops.
#[derive(Serialize, JsonSchema)]
pub struct CommonCertificate {
    /// The matrix P, row by row. For the whole loop in the order: states of the plant (ten for each
    /// delay), filtered measurements, estimates of the states, estimates of the faults, integrals of references.
    pub p: Vec<Vec<f64>>,
    /// Margin of the inequalities of all members, relative; larger than the rounding errors.
    pub margin: f64,
}

/// A plant with the controller.
#[derive(Serialize, JsonSchema)]
pub struct MemberReport {
    /// Its name.
    pub name: String,
    /// Largest real part of the eigenvalues of plant and controller together, 1/s, or largest modulus
    /// less 1; negative if stable.
    pub instability: f64,
    /// Margins, noise and tolerances; none if the loop is not stable.
    pub margins: Option<MemberMargins>,
}

/// Margins of a plant with the controller.
#[derive(Serialize, JsonSchema)]
pub struct MemberMargins {
    /// The loop opened at the commands and at the measurements.
    pub points: Vec<LoopPoint>,
    /// Largest delay, s, common to all commands.
    #[schemars(with = "Option<f64>")]
    pub delay_margin: f64,
    /// The longest time, s, over which the signals may be held, or longest sample time.
    #[schemars(with = "Option<f64>")]
    pub longest_hold: f64,
    /// Root-mean-square values of commands and estimated faults under the noise of all measurements.
    pub noise_together: Vec<Number>,
    /// Stability while the entries of this plant vary within the tolerances of the plant file; none
    /// if parameters of an FMU vary, which is tested for the nominal plant.
    pub tolerance: Option<ToleranceResult>,
}
