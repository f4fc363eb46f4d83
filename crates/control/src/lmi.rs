//! Linear matrix inequalities: pole regions, gain bounds, and the synthesis of feedback and observer gains.
//!
//! * [`Problem`] and [`Affine`]: semidefinite programs.
//! * [`certify_region`]: proves that the eigenvalues of a matrix are in a [`Region`], with a
//!   certificate P.
//! * [`common_reachable_set`]: bounds of the states of a family of systems.
//! * [`certify_gain`]: bounds the H-infinity or the generalised H2 norm of a system, with a
//!   certificate P.
//! * [`observer_gain`], [`state_feedback`]: compute a gain that places the eigenvalues in a region
//!   and keeps or minimises such a bound.
//! * [`ChannelWeights::observer_gain`], [`ChannelWeights::state_feedback`]: the same with weights over frequency;
//!   [`weight_of_table`]: the weight whose magnitude is nearest to a table.
//! * [`observer_norm_lower_bound`], [`feedback_norm_lower_bound`]: lower bounds of the H-infinity norm that hold
//!   for every gain and for filters of any order.
//! * [`noiseless_norm_lower_bound`], [`disc_norm_lower_bound`]: the same for measurements without noise, and for
//!   gains whose eigenvalues are in a disc.
//! * [`certify_common`], [`common_feedback`]: prove that the eigenvalues of all members of a family are in a
//!   region, with one P, and compute one gain for all of them.
//! * [`certify_schedule`]: proves that a loop that depends on a scheduling variable is stable while
//!   this variable changes at a bounded rate; P depends on the variable, too.
//! * [`constant_gain`]: the static gain whose worst error over a family of systems is least.
//! * [`until`]: ends the searches of a thread early.
//!
//! Problems are solved by an interior point method (Clarabel) in coordinates in which the entries of
//! the data are about one. A certificate is returned only if the eigenvalues of its inequalities, in
//! the units of the data, are positive by more than the rounding errors.

mod affine;
mod constant_gain;
mod coordinates;
pub(crate) mod definite;
mod descent;
mod disc_bound;
mod gain;
mod limit;
mod lower_bound;
mod noiseless;
mod observer;
mod problem;
mod reachable;
mod region;
mod requirement;
mod schedule;
mod solver;
mod synthesis;
mod table_weight;
mod vertices;
mod weighted;

pub use affine::Affine;
pub use constant_gain::{ConstantGain, constant_gain};
pub use disc_bound::disc_norm_lower_bound;
pub use gain::{GainBound, Norm, certify_gain};
pub use limit::{Ending, ending, until};
pub use lower_bound::{feedback_norm_lower_bound, observer_norm_lower_bound};
pub use noiseless::noiseless_norm_lower_bound;
pub(crate) use observer::norm_below;
pub use problem::Problem;
pub use reachable::{ReachableSet, common_reachable_set};
pub use region::{Disc, Region, RegionCertificate, certify_region};
pub use requirement::{Performance, Synthesis};
pub use schedule::{Interval, ScheduleCertificate, bernstein, certify_schedule, largest_change};
pub use synthesis::{observer_gain, state_feedback};
pub use table_weight::{TableWeight, weight_of_table};
pub(crate) use vertices::find_common;
pub use vertices::{CommonFeedback, Vertex, certify_common, common_feedback, largest_scaling};
pub use weighted::ChannelWeights;

use nalgebra::{DMatrix, DVector};

/// The outcome of a problem with inequalities; `C` identifies a requirement.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome<T, C = &'static str> {
    /// A solution whose inequalities were verified by eigenvalues.
    Optimal(T),
    /// No solution exists. Either eigenvalues violate each requirement in `conflict`, or the solver has found that the
    /// requirements in `conflict` contradict each other and that each is necessary for the contradiction.
    Infeasible {
        /// Names of requirements, in the order in which they were stated; for a family of plants, indices of plants.
        conflict: Vec<C>,
    },
    /// Neither a solution nor a contradiction was found in double precision. Contains the reason.
    Inconclusive(&'static str),
}

impl<T, C> Outcome<T, C> {
    /// The solution, if one was found.
    pub fn optimal(self) -> Option<T> {
        match self {
            Self::Optimal(answer) => Some(answer),
            Self::Infeasible { .. } | Self::Inconclusive(_) => None,
        }
    }

    /// Applies a function to the solution; any other outcome is passed on.
    fn then<U, E>(
        self,
        next: impl FnOnce(T) -> Result<Outcome<U, C>, E>,
    ) -> Result<Outcome<U, C>, E> {
        match self {
            Self::Optimal(answer) => next(answer),
            Self::Infeasible { conflict } => Ok(Outcome::Infeasible { conflict }),
            Self::Inconclusive(why) => Ok(Outcome::Inconclusive(why)),
        }
    }
}

/// Values of the unknowns that meet the requirements of a [`Problem`].
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One number per unknown.
    unknowns: DVector<f64>,
    /// For each requirement the name given to [`Problem::require`], if any, and the smallest eigenvalue of its
    /// matrix, which is at least half of the required margin.
    pub margins: Vec<(Option<&'static str>, f64)>,
}

impl Solution {
    /// The value of an expression.
    #[must_use]
    pub fn value(&self, expression: &Affine) -> DMatrix<f64> {
        expression.evaluate(&self.unknowns)
    }
}
