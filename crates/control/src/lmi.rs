//! Linear matrix inequalities: pole regions, bounds of gains, and gains that keep them.
//!
//! * [`Problem`] and [`Affine`]: any problem with semidefinite requirements.
//! * [`certify_region`]: eigenvalues in a [`Region`] of the complex plane, with its certificate P.
//! * [`certify_gain`]: a bound of the H-infinity or the generalised H2 norm, with its certificate.
//! * [`observer_gain`], [`state_feedback`]: a gain that puts the eigenvalues into a region and keeps
//!   or minimises such a bound.
//!
//! Problems are solved by an interior point method (Clarabel) in coordinates that suit the data, and
//! nothing that it says is trusted: a certificate counts only if the eigenvalues of its inequality
//! are positive in the data as given, by more than the rounding errors.

mod affine;
mod coordinates;
pub(crate) mod definite;
mod gain;
mod observer;
mod problem;
mod region;
mod solver;
mod synthesis;

pub use affine::Affine;
pub use gain::{GainBound, Norm, certify_gain};
pub use problem::Problem;
pub use region::{Disc, Region, RegionCertificate, certify_region};
pub use synthesis::{Performance, Synthesis, observer_gain, state_feedback};

use nalgebra::{DMatrix, DVector};

/// How a problem with inequalities ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome<T> {
    /// An answer whose inequalities were checked by eigenvalues.
    Optimal(T),
    /// By the numbers of the solver no answer exists: these requirements contradict each other, and
    /// without any one of them the others do not.
    Infeasible {
        /// Their names, in the order in which they were stated.
        conflict: Vec<&'static str>,
    },
    /// Neither an answer nor a contradiction was found in double precision; says why.
    Inconclusive(&'static str),
}

impl<T> Outcome<T> {
    /// The answer if there is one.
    pub fn optimal(self) -> Option<T> {
        match self {
            Self::Optimal(answer) => Some(answer),
            Self::Infeasible { .. } | Self::Inconclusive(_) => None,
        }
    }

    /// The outcome with a function of the answer, which may end otherwise.
    fn then<U, E>(self, next: impl FnOnce(T) -> Result<Outcome<U>, E>) -> Result<Outcome<U>, E> {
        match self {
            Self::Optimal(answer) => next(answer),
            Self::Infeasible { conflict } => Ok(Outcome::Infeasible { conflict }),
            Self::Inconclusive(why) => Ok(Outcome::Inconclusive(why)),
        }
    }
}

/// Unknowns that keep the requirements of a [`Problem`].
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// One number per unknown.
    unknowns: DVector<f64>,
    /// Smallest eigenvalue of each requirement with its name, if it has one, as stated in
    /// [`Problem::require`]; at least half of the margin that was wanted.
    pub margins: Vec<(Option<&'static str>, f64)>,
}

impl Solution {
    /// The value of an expression.
    #[must_use]
    pub fn value(&self, expression: &Affine) -> DMatrix<f64> {
        expression.evaluate(&self.unknowns)
    }
}
