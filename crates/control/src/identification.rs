//! Identification of a linear system from samples of its inputs and outputs.
//!
//! ```text
//! x[k+1] = A x[k] + B u[k] + K e[k] + b,    y[k] = C x[k] + D u[k] + e[k] + d
//! ```
//!
//! is the innovation form: e is white, K the gain of the Kalman predictor. The method is predictor-based subspace
//! identification; it needs no iteration, estimates K too, and holds for unstable plants and in closed loop:
//!
//! 1. A long autoregressive model predicts `y[k]` from s earlier samples `z = [u; y]`, and `u[k]` if there is D: least
//!    squares.
//! 2. Its coefficients are the Markov parameters C (A - K C)^i `[B - K D, K]`. Their block Toeplitz matrix times the s
//!    earlier samples is the extended observability matrix times `x[k]`, if (A - K C)^s is negligible.
//! 3. The singular value decomposition of this product gives `x[k]` = T z, the states ordered by their singular values.
//! 4. Least squares of `y[k]` on `x[k]`, `u[k]` gives C, D, d and `e[k]`; of `x[k+1]` on `x[k]`, `u[k]`, `e[k]` A, B,
//!    K, b.
//!
//! The samples enter only by one triangular factor of constant size, [`Windows`]. Factors of parts of a record, and of
//! several records, can be [joined](Windows::joined).
//!
//! Source: A. Chiuso, The role of vector autoregressive modeling in predictor-based subspace identification, Automatica
//! 43 (2007); M. Verhaegen and V. Verdult, Filtering and System Identification, Cambridge (2007), chapter 9; P. Van
//! Overschee and B. De Moor, Subspace Identification for Linear Systems, Kluwer (1996).

mod coordinates;
mod model;
mod subspace;
mod tolerance;
mod windows;

pub use coordinates::MeasuredStates;
pub use model::IdentifiedModel;
pub use subspace::Subspace;
pub use tolerance::{ResponseUnits, equivalent_tolerance};
pub use windows::{Record, Windows};
