//! Mathematics of linear control on matrices: no input or output, no FMI.
//!
//! * [`eigen`]: eigenvalues. [`exponential`]: e^A. [`lyapunov`]: A' P + P A = -Q and
//!   A' P A - P = -Q. [`riccati`]: linear-quadratic regulators and Kalman filters.
//! * [`hold`]: the exact discretisation of x' = A x + B w with w constant or linear over a step.
//! * [`rank`]: controllability and observability; [`distance`]: how far they are from being lost;
//!   [`zeros`]: invariant zeros.
//! * [`response`]: gains, norms, step and frequency responses, and what a fault does to the loop.
//! * [`placement`]: state feedback with wanted eigenvalues.
//! * [`aso`]: the augmented state observer that estimates and compensates actuator faults, and
//!   [`theorem1`]: the bound that belongs to it.
//! * [`faults`]: fault models beyond the constant fault; [`detectability`]: which faults can be seen.
//! * [`sampled`]: the controller designed for its sample time; [`controller`]: its equations.
//! * [`product`]: products of matrices for exported models.
//! * `lmi`, behind the feature of that name: linear matrix inequalities by Clarabel, for pole
//!   regions, H-infinity and generalised H2 bounds, and theorem 1 with free P.
//!
//! Matrices have any size; bad arguments and singular problems are an [`Error`], never a panic.
//! Feedback gains and Lyapunov solutions are put back into their equations before they are
//! returned. ' is the transpose in formulas.
#![forbid(unsafe_code)]

pub mod aso;
mod balance;
mod blocks;
mod check;
pub mod controller;
pub mod detectability;
pub mod distance;
mod domain;
pub mod eigen;
mod error;
pub mod exponential;
pub mod faults;
pub mod hold;
#[cfg(feature = "lmi")]
pub mod lmi;
pub mod lyapunov;
pub mod placement;
mod product;
pub mod rank;
pub mod response;
pub mod riccati;
pub mod sampled;
pub mod stability;
mod state_space;
mod svd;
pub mod theorem1;
pub mod zeros;

pub use domain::Domain;
pub use error::Error;
pub use product::product;
pub use state_space::StateSpace;
