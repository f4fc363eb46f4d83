#![doc = include_str!("../README.md")]
//!
//! # Modules
//!
//! | task | module |
//! |---|---|
//! | assign the poles of a state feedback or an observer | [`placement`] |
//! | linear-quadratic regulator, Kalman filter | [`riccati`] |
//! | augmented state observer (ASO): estimate and compensate faults | [`aso`], [`faults`], [`sampled`] |
//! | other laws that estimate faults: proportional-integral, fast adaptive, sliding mode, learning | [`estimation`] |
//! | commands without an actuator: control allocation, equilibrium | [`allocation`] |
//! | test which faults can be estimated | [`detectability`] |
//! | controllability, observability, distance from losing them, zeros | [`rank`], [`distance`], [`zeros`] |
//! | residual generators | [`residual`] |
//! | residuals that isolate faults: decoupled from commands, disturbances, other faults | [`isolation`] |
//! | white residuals, tests with a stated rate of false alarms, predicted delays | [`detection`] |
//! | norms, step and frequency responses, the effect of faults | [`response`] |
//! | margins of a loop: sensitivity, disk, gain, phase, delay, hold time, parameter tolerances | [`robustness`] |
//! | references: feedforward, integral action, anti-windup | [`tracking`] |
//! | bound of the estimation error with a proof | [`theorem1`] |
//! | weights over frequency | [`weight`] |
//! | linear matrix inequalities (feature `lmi`) | `lmi` |
//! | the controller as one system, the closed loop, its stability | [`controller`], [`stability`] |
//! | discretisation, matrix exponential | [`hold`], [`exponential`] |
//! | eigenvalues, Lyapunov equations, reproducible products | [`eigen`], [`lyapunov`], [`product`] |
//!
//! # Conventions
//!
//! Feedback is u = K x, so that the closed loop is A + B K; an observer has the error dynamics A - L C.
//! ' is the transpose in formulas, [A, B; C, D] a matrix of blocks, eps the machine epsilon. Systems are
//! [`StateSpace`]; [`Domain`] distinguishes continuous and sampled time. Matrices may have any size. Bad
//! arguments and unsolvable problems are an [`Error`], never a panic.
#![forbid(unsafe_code)]

pub mod allocation;
pub mod aso;
mod balance;
mod blocks;
mod check;
pub mod controller;
pub mod detectability;
pub mod detection;
pub mod distance;
mod domain;
pub mod eigen;
mod error;
pub mod estimation;
pub mod exponential;
pub mod faults;
pub mod hold;
pub mod isolation;
#[cfg(feature = "lmi")]
pub mod lmi;
pub mod lyapunov;
pub mod placement;
mod product;
pub mod rank;
mod reflections;
pub mod residual;
pub mod response;
pub mod riccati;
pub mod robustness;
pub mod sampled;
pub mod stability;
mod state_space;
mod svd;
pub mod theorem1;
pub mod tracking;
pub mod weight;
pub mod zeros;

pub use domain::Domain;
pub use error::Error;
pub use product::product;
pub use state_space::StateSpace;
