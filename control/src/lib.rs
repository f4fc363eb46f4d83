//! Mathematics of linear control on matrices: no input or output, no FMI.
//!
//! * [`eigen`]: eigenvalues. [`exponential`]: e^A. [`lyapunov`]: A' P + P A = -Q.
//! * [`hold`]: the exact discretisation of x' = A x + B w with w constant or linear over a step.
//! * [`rank`]: controllability and observability.
//! * [`placement`]: state feedback with wanted eigenvalues.
//! * [`aso`]: the augmented state observer that estimates and compensates actuator faults, and
//!   [`theorem1`]: the bound that belongs to it.
//! * `lmi`, behind the feature of that name: linear matrix inequalities by Clarabel, for pole
//!   regions, H-infinity and generalised H2 bounds, and theorem 1 with free P.
//!
//! Matrices have any size; bad arguments and singular problems are an [`Error`], never a panic.
//! Feedback gains and Lyapunov solutions are put back into their equations before they are
//! returned. ' is the transpose in formulas.
#![forbid(unsafe_code)]

pub mod aso;
mod balance;
mod check;
mod domain;
pub mod eigen;
mod error;
pub mod exponential;
pub mod hold;
#[cfg(feature = "lmi")]
pub mod lmi;
pub mod lyapunov;
pub mod placement;
pub mod rank;
mod singular;
pub mod theorem1;

pub use domain::Domain;
pub use error::Error;
