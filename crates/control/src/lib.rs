#![doc = include_str!("../README.md")]
//!
//! # Modules
//!
//! | task | module |
//! |---|---|
//! | assign the poles of a state feedback or an observer | [`placement`] |
//! | linear-quadratic regulator, Kalman filter | [`riccati`]; designed for a bandwidth: [`bandwidth`] |
//! | augmented state observer (ASO): estimate and compensate faults | [`aso`], [`faults`], [`sampled`] |
//! | extended and unscented Kalman filters for nonlinear plants | [`nonlinear_filter`] |
//! | other laws that estimate faults: proportional-integral, fast adaptive, sliding mode, learning | [`estimation`] |
//! | commands after the failure of an actuator: control allocation, equilibrium | [`allocation`] |
//! | test which faults can be estimated | [`detectability`] |
//! | a plant from samples of its inputs and outputs: subspace identification | [`identification`] |
//! | controllability, observability, the distance from their loss, zeros | [`rank`], [`distance`], [`zeros`] |
//! | residual generators | [`residual`] |
//! | residuals that isolate faults: decoupled from commands, disturbances, other faults | [`isolation`] |
//! | white residuals, tests with a stated rate of false alarms, predicted delays | [`detection`] |
//! | norms, step and frequency responses, the effect of faults | [`response`] |
//! | margins of a loop: sensitivity, disk, gain, phase, delay, hold time, parameter tolerances | [`robustness`] |
//! | delays of commands and measurements: approximated, and exact | [`delay`] |
//! | references: feedforward, integral action, anti-windup | [`tracking`] |
//! | bound of the estimation error with a proof | [`theorem1`] |
//! | loop shaping: mixed sensitivity for gains of a given structure | [`tuning`] |
//! | weights over frequency | [`weight`] |
//! | loss of effectiveness: its estimate, the losses for which the loop is stable | [`losses`] |
//! | linear matrix inequalities (feature `lmi`) | `lmi` |
//! | the controller as one system, the closed loop, its stability | [`controller`], [`stability`] |
//! | discretisation and back, matrix exponential and logarithm | [`hold`], [`exponential`], [`logarithm`] |
//! | block matrices | [`blocks`] |
//! | eigenvalues, Lyapunov equations, reproducible products | [`eigen`], [`lyapunov`], [`product`] |
//!
//! # Conventions
//!
//! Feedback is u = K x, so that the closed loop is A + B K; an observer has the error dynamics A - L C. ' is the
//! transpose in formulas, [A, B; C, D] a matrix of blocks, eps the machine epsilon. Systems are [`StateSpace`];
//! [`Domain`] distinguishes continuous and sampled time. Matrices may have any size. Functions return an [`Error`]
//! for bad arguments and unsolvable problems; those without a `Result`, such as [`blocks`], panic for bad shapes.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(feature = "design"),
    allow(dead_code, reason = "balancing and checks that design needs")
)]

#[cfg(feature = "design")]
pub mod allocation;
#[cfg(feature = "design")]
pub mod aso;
mod balance;
#[cfg(feature = "design")]
pub mod bandwidth;
pub mod blocks;
mod check;
#[cfg(feature = "design")]
pub mod controller;
#[cfg(feature = "design")]
pub mod delay;
#[cfg(feature = "design")]
pub mod detectability;
#[cfg(feature = "design")]
pub mod detection;
#[cfg(feature = "design")]
pub mod distance;
#[cfg(feature = "design")]
mod domain;
#[cfg(feature = "design")]
pub mod eigen;
mod error;
#[cfg(feature = "design")]
pub mod estimation;
pub mod exponential;
#[cfg(feature = "design")]
pub mod faults;
#[cfg(feature = "design")]
mod faulty_plant;
#[cfg(feature = "design")]
mod gains;
pub mod hold;
#[cfg(feature = "design")]
pub mod identification;
#[cfg(feature = "design")]
pub mod isolation;
#[cfg(feature = "lmi")]
pub mod lmi;
pub mod logarithm;
#[cfg(feature = "design")]
pub mod losses;
#[cfg(feature = "design")]
pub mod lyapunov;
pub mod nonlinear_filter;
#[cfg(feature = "design")]
pub mod placement;
mod product;
#[cfg(feature = "design")]
pub mod rank;
#[cfg(feature = "design")]
mod reflections;
#[cfg(feature = "design")]
pub mod residual;
#[cfg(feature = "design")]
pub mod response;
#[cfg(feature = "design")]
pub mod riccati;
#[cfg(feature = "design")]
pub mod robustness;
#[cfg(feature = "design")]
pub mod sampled;
#[cfg(feature = "design")]
pub mod stability;
#[cfg(feature = "design")]
mod state_space;
#[cfg(feature = "design")]
mod svd;
#[cfg(feature = "design")]
pub mod theorem1;
#[cfg(feature = "design")]
pub mod tracking;
#[cfg(feature = "design")]
pub mod tuning;
#[cfg(feature = "design")]
pub mod weight;
#[cfg(feature = "design")]
pub mod zeros;

#[cfg(feature = "design")]
pub use domain::Domain;
pub use error::Error;
pub use product::product;
#[cfg(feature = "design")]
pub use state_space::StateSpace;
