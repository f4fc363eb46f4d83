//! Numerics of a co-simulation master, independent of FMUs: solvers for algebraic loops, step size
//! control, location of events, topological order of dependencies.
//!
//! The connected values u of a loop are a fixed point, `u = G(u)`: G sets the inputs u, steps the
//! slaves or evaluates their outputs, and returns the resulting values of the connections. A
//! [`Solver`] receives u and G(u) and returns the next u to evaluate. It never calls G, unlike solvers of
//! other libraries, so that the caller keeps control of the slaves. The solvers allocate nothing while
//! they iterate and can be serialised into a checkpoint:
//!
//! ```
//! use solve::{Anderson, Progress, Scale, Solver};
//!
//! let scale = Scale::new(1e-9, 1e-12, vec![1.0]);
//! let mut solver = Anderson::new(scale, 20, 5);
//! let (mut u, mut next) = ([0.0], [0.0]);
//! solver.begin();
//! let outcome = loop {
//!     let g = [1.0 - 3.0 * u[0]]; // plain iteration would diverge
//!     match solver.next(&u, &g, &mut next) {
//!         Progress::Evaluate => u = next,
//!         end => break end,
//!     }
//! };
//! assert!(matches!(outcome, Progress::Converged { .. }));
//! assert!((u[0] - 0.25).abs() < 1e-9);
//! ```

#![forbid(unsafe_code)]

mod anderson;
mod control;
mod dense;
mod graph;
mod newton;
mod quasi_newton;
mod root;
mod secants;
#[cfg(test)]
mod tests;

pub use anderson::Anderson;
pub use control::{Bond, EnergyControl, ErrorControl, ForwardControl, SizeBounds, Verdict};
pub use dense::Factors;
pub use graph::{Components, components};
pub use newton::Newton;
pub use quasi_newton::QuasiNewton;
pub use root::Bracket;

use serde::{Deserialize, Serialize};

/// Ratio of a residual to the first one above which the iteration counts as diverged.
const DIVERGENCE: f64 = 1e12;
/// Ratio of the last residual to the first one required for convergence, unless the residual is within
/// the tolerances at the first u. A residual that is only small relative to a growing u is no solution.
const REDUCTION: f64 = 0.1;

/// The weights of a difference of values, component by component:
/// `w_i = absolute nominal_i + relative max(|a_i|, |b_i|)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    relative: f64,
    absolute: f64,
    nominals: Vec<f64>,
}

impl Scale {
    /// Creates a scale from a relative and an absolute tolerance and the nominal value of each component.
    ///
    /// A tolerance that is NaN or not above zero is replaced by the machine epsilon. Nominals count by their
    /// absolute value; zero, NaN and infinity are replaced by 1.
    #[must_use]
    pub fn new(relative: f64, absolute: f64, nominals: Vec<f64>) -> Self {
        let positive = |value: f64, other: f64| if value > 0.0 { value } else { other };
        let nominals = nominals
            .into_iter()
            .map(|nominal| if nominal.is_finite() { positive(nominal.abs(), 1.0) } else { 1.0 })
            .collect();
        let relative = positive(relative, f64::EPSILON);
        Self { relative, absolute: positive(absolute, f64::EPSILON), nominals }
    }

    /// Returns the number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nominals.len()
    }

    /// Whether there are no components.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nominals.is_empty()
    }

    /// Returns the nominal value of each component.
    #[must_use]
    pub fn nominals(&self) -> &[f64] {
        &self.nominals
    }

    /// Replaces the nominal value of each component by one that [`Scale::nominals`] has returned.
    pub fn set_nominals(&mut self, nominals: &[f64]) {
        self.nominals.clear();
        self.nominals.extend_from_slice(nominals);
    }

    /// Returns the weight `w_i` of component `index`, from 0, for the values `a` and `b`.
    #[must_use]
    pub fn weight(&self, index: usize, a: f64, b: f64) -> f64 {
        self.absolute * self.nominals[index] + self.relative * a.abs().max(b.abs())
    }

    /// Returns `max_i |a_i - b_i| / w_i`: at most 1 if a and b agree within the tolerances; infinite if
    /// a value or the difference of two is not finite, 0 without components.
    #[must_use]
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut largest = 0.0_f64;
        for (index, (a, b)) in a.iter().zip(b).enumerate() {
            let part = (a - b).abs() / self.weight(index, *a, *b);
            if !part.is_finite() {
                return f64::INFINITY;
            }
            largest = largest.max(part);
        }
        largest
    }
}

/// The next request of a [`Solver`], or the end of its iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Evaluate G at `u_next`, then call `next` with `u_next` and the value of G.
    Evaluate,
    /// Set the matrix `dG/du` at this u ([`Solver::set_column`]), then call `next` again with the same u and G(u).
    Matrix,
    /// The iteration has converged, `|G_i(u) - u_i| <= w_i`. `u_next` is not set.
    Converged {
        /// Number of evaluations of G.
        iterations: u32,
    },
    /// The iteration has not converged within the allowed number of evaluations.
    NotConverged {
        /// Number of evaluations of G.
        iterations: u32,
        /// The residual `max_i |G_i(u) - u_i| / w_i`, required to be at most 1.
        residual: f64,
    },
    /// A value of u or G(u) or the next step is not finite, or the residual exceeds 1e12 times the first one.
    Diverged {
        /// Number of evaluations of G.
        iterations: u32,
    },
    /// `I - dG/du` is numerically singular: the loop has no solution or no unique one.
    Singular {
        /// Bound `(1 + |M|) |M^-1|` of the condition number of `M = I - dG/du` in the 1-norm, with the unknowns
        /// divided by their nominals; infinite if M has no inverse or is not finite.
        condition: f64,
    },
}

/// An iterative solver of `u = G(u)`. Only the constructors allocate memory.
pub trait Solver: Send {
    /// Starts a new solution.
    fn begin(&mut self);

    /// Takes `g = G(u)` and computes the next u. Stores it in `u_next` if the result is [`Progress::Evaluate`];
    /// otherwise `u_next` has no defined value. All three slices have the length of the [`Scale`].
    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress;

    /// Sets column `column` of `dG/du`, the derivative of G with respect to component `column` of u. Call it only after
    /// [`Progress::Matrix`]; a solver that never requests the matrix ignores it.
    fn set_column(&mut self, column: usize, values: &[f64]) {
        let _ = (column, values);
    }

    /// Returns the perturbation of component `column` of `u` for a difference quotient of G.
    ///
    /// It is large beside the integration errors of slaves, as the iteration needs few digits of the matrix.
    fn perturbation(&self, column: usize, u: &[f64]) -> f64 {
        1e-4 * u[column].abs().max(self.scale().nominals()[column])
    }

    /// Returns the scale of the unknowns.
    fn scale(&self) -> &Scale;

    /// Drops information from earlier solutions, because G has changed: after an event, for another step size.
    fn forget(&mut self);
}

/// The residual and the termination test of an iteration.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Convergence {
    scale: Scale,
    /// The largest number of evaluations of G.
    limit: u32,
    /// The evaluations of G in this solution.
    iterations: u32,
    /// The residual G(u) - u.
    residual: Vec<f64>,
    /// The weights of the first evaluation, kept so that residuals of one solution are comparable.
    weights: Vec<f64>,
    /// The merit of the first evaluation.
    first: f64,
    /// The size of the residual, `max_i |residual_i| / weights_i`.
    merit: f64,
}

impl Convergence {
    fn new(scale: Scale, limit: u32) -> Self {
        let n = scale.len();
        let (residual, weights) = (vec![0.0; n], vec![1.0; n]);
        Self { scale, limit, iterations: 0, residual, weights, first: 0.0, merit: 0.0 }
    }

    fn begin(&mut self) {
        self.iterations = 0;
    }

    /// Computes the residual of an evaluation; returns `Some` if the iteration ends.
    fn check(&mut self, u: &[f64], g: &[f64]) -> Option<Progress> {
        let first = self.iterations == 0;
        self.iterations += 1;
        let iterations = self.iterations;
        let distance = self.scale.distance(u, g);
        for i in 0..self.residual.len() {
            self.residual[i] = g[i] - u[i];
            if first {
                self.weights[i] = self.scale.weight(i, u[i], g[i]);
            }
        }
        let parts = self.residual.iter().zip(&self.weights);
        self.merit = parts.fold(0.0, |most, (part, weight)| most.max(part.abs() / weight));
        if first {
            self.first = self.merit;
        }
        if distance <= 1.0 && self.merit <= f64::max(1.0, REDUCTION * self.first) {
            return Some(Progress::Converged { iterations });
        }
        if !distance.is_finite() || self.merit > DIVERGENCE * self.first {
            return Some(Progress::Diverged { iterations });
        }
        let ended = iterations >= self.limit;
        ended.then_some(Progress::NotConverged { iterations, residual: distance })
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
