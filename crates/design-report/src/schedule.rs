//! The part of a design report on a scheduled controller.

use schemars::JsonSchema;
use serde::Serialize;

use crate::family::{CommonCertificate, MemberReport};
use crate::{Matrix, OrReason, or_reason};

/// A controller whose gains depend on a scheduling variable.
#[derive(Serialize, JsonSchema)]
pub struct ScheduleReport {
    /// The scheduling variable.
    pub variable: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Whether it is a measurement; otherwise it is an input of its own.
    pub measured: bool,
    /// Its largest rate, per s, as stated in the plant file.
    pub rate_bound: Option<f64>,
    /// The points of the grid.
    pub points: Vec<SchedulePointReport>,
    /// One P, or the reason why there is none. P proves stability, with plant and controller interpolated linearly,
    /// while the variable changes arbitrarily fast between the first and the last point.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<CommonCertificate>")]
    pub any_rate: Result<CommonCertificate, String>,
    /// A proof as `any_rate`, with P a function of the variable, for a bounded rate; tried only if no common P was
    /// found.
    #[serde(serialize_with = "or_reason")]
    #[schemars(with = "OrReason<RateCertificate>")]
    pub bounded_rate: Result<RateCertificate, String>,
    /// Number of values between the first and the last point at which the eigenvalues of the
    /// interpolated loop were computed, for constant values of the variable.
    pub checked: usize,
    /// The worst instability at these values: largest modulus less 1; of a continuous controller the largest real part,
    /// 1/s.
    pub worst_instability: f64,
    /// The value of the variable at which `worst_instability` occurs.
    pub worst_at: f64,
}

/// A proof with P(variable) piecewise linear over the grid.
#[derive(Serialize, JsonSchema)]
pub struct RateCertificate {
    /// The largest rate of the variable, per s, that is proven.
    pub rate: f64,
    /// P at each point of the grid, row by row.
    pub p: Vec<Vec<Vec<f64>>>,
    /// Margin of the inequalities, relative; larger than the rounding errors.
    pub margin: f64,
}

/// A point of the grid.
#[derive(Serialize, JsonSchema)]
pub struct SchedulePointReport {
    /// The value of the scheduling variable.
    pub at: f64,
    /// Values of states, commands and measurements at its operating point.
    pub operating: [Vec<f64>; 3],
    /// The gains.
    pub gains: Vec<Matrix>,
    /// The loop of the plant and the controller of this point.
    pub closed: MemberReport,
    /// If the variable is a measurement: the instability of the loop with the feedback through the interpolated
    /// operating points, which the design at the point neglects.
    pub coupled_instability: Option<f64>,
}
