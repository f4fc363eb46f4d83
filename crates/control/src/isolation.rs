//! Residual generators, decoupled from commands, disturbances and chosen faults, to detect and isolate faults.
//!
//! The plant is a [`DisturbedPlant`]. A residual has a pattern: one entry per fault, true if the residual responds to
//! the fault, false if the residual is decoupled from the fault. The patterns of several
//! residuals are the rows of the structure matrix, whose columns are the signatures of the faults.
//!
//! 1. [`achievable_patterns`] lists the patterns that a plant admits.
//! 2. [`residual_generator`] computes a generator of least order for one pattern.
//! 3. [`structure`] reads the pattern back from the response of the residual to the faults.
//!
//! # Method
//!
//! ```text
//! x' = A x + B_u u + B_d d + B_f f,   y = C x + D_u u + D_d d + D_f f      (1)
//! ```
//!
//! Disturbances and decoupled faults are unknown inputs e with the columns (E, `D_e`). The smallest
//! unobservability subspace that contains their effect is divided out by orthogonal
//! transformations: W is the smallest subspace with
//! `[A W, E] ker [C W, D_e]` in W; with V orthogonal to W there is a K with
//! V' [A W, E] = K [C W, `D_e`], and H is the orthogonal complement of [C W, `D_e`], so that
//!
//! ```text
//! v' = (V' A - K C) V v + (V' B_u - K D_u) u + K y,   H y = H C V v + H D_u u        (2)
//! ```
//!
//! (2) holds for v = V' x and all e. Its observable part has the states z and the matrices `A_o`,
//! `C_o`. A generator of order k with one residual is a function of z: states ζ = T z and the
//! residual r = c ζ + w (H y - H `D_u` u) with
//!
//! ```text
//! T A_o - F T = L C_o,   c T + w C_o = 0                                             (3)
//! ```
//!
//! where F, c are a chain of k lags with the prescribed poles. (3) is linear in (L, w); its solutions are the left null
//! space of one matrix, whose dimension follows from the observability indices of (2). k is the least order for which
//! all faults of the pattern have a gain; the solution is the one whose smallest gain is largest for a given effect of
//! measurement noise. The decoupling is verified on the given plant; if it fails because a coupling counted as zero,
//! the generator is computed again with a smaller tolerance.
//!
//! Sources: M.-A. Massoumnia, A geometric approach to the synthesis of failure detection filters,
//! IEEE Trans. Autom. Control 31 (1986), and, with G. C. Verghese and A. S. Willsky, Failure
//! detection and identification, 34 (1989), for unobservability subspaces; G. Basile and G. Marro,
//! Controlled and conditioned invariants in linear system theory (1992), for W; D. G. Luenberger, An
//! introduction to observers, IEEE Trans. Autom. Control 16 (1971), for (3); A. Varga, Solving fault
//! diagnosis problems (2017), sections 2.5 and 5.4, for the problem, the patterns and least orders.

mod decoupled;
mod direction;
mod family;
mod generator;
mod patterns;
mod plant;
mod verification;

pub use generator::{Requirements, Residual, residual_generator};
pub use patterns::{AchievablePattern, achievable_patterns, structure};
pub use plant::DisturbedPlant;
