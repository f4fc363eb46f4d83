//! Numerics of the master, free of FMUs: solvers for coupled values, step control, location of
//! events, order of dependencies.
//!
//! A loop of connected values u is a fixed point, `u = G(u)`: G takes the inputs u, steps the slaves
//! or evaluates their outputs, and answers with what the connections then carry. A [`Solver`] is
//! told u and G(u) and says where to evaluate next; it never calls anything, so that whoever owns
//! the slaves stays in charge:
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
pub use graph::{Components, components};
pub use newton::Newton;
pub use quasi_newton::QuasiNewton;
pub use root::Bracket;

use serde::{Deserialize, Serialize};

/// A residual so many times the first one ends an iteration.
const GROWTH: f64 = 1e12;
/// A residual that is small beside a u that ran away is no solution: it must also be this part of
/// the first one.
const SMALLER: f64 = 0.1;

/// What a difference of values is measured by, component by component:
/// `w_i = absolute nominal_i + relative max(|a_i|, |b_i|)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    relative: f64,
    absolute: f64,
    nominals: Vec<f64>,
}

impl Scale {
    /// Tolerances, and the magnitude of each component.
    ///
    /// What is not a number above zero is taken as: tolerances the smallest that make sense (the
    /// rounding of a double), nominals 1.
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

    /// Number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nominals.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nominals.is_empty()
    }

    /// Magnitude of each component.
    #[must_use]
    pub fn nominals(&self) -> &[f64] {
        &self.nominals
    }

    /// The weight w of component `index` between the values `a` and `b`.
    #[must_use]
    pub fn weight(&self, index: usize, a: f64, b: f64) -> f64 {
        self.absolute * self.nominals[index] + self.relative * a.abs().max(b.abs())
    }

    /// `max_i |a_i - b_i| / w_i`: at most 1 where a and b agree within the tolerances; infinite
    /// where one of them is not finite.
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

/// What a [`Solver`] wants next, or how it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Evaluate G at `u_next`, then call `next` with both.
    Evaluate,
    /// Give the matrix `dG/du` at this u, column by column ([`Solver::set_column`]), then call `next`
    /// with the same u and G(u) again.
    Matrix,
    /// `|G(u) - u| <= w`: u and G(u) agree, `u_next` is not set.
    Converged {
        /// Evaluations of G.
        iterations: u32,
    },
    /// Not within the evaluations allowed.
    NotConverged {
        /// Evaluations of G.
        iterations: u32,
        /// `max_i |G_i(u) - u_i| / w_i`, to be 1.
        residual: f64,
    },
    /// A value is not finite, or the residual has become 1e12 times the first one.
    Diverged {
        /// Evaluations of G.
        iterations: u32,
    },
    /// `I - dG/du` is singular as far as one can tell: the loop has no solution or many.
    Singular {
        /// Its condition number, the unknowns measured by their nominals.
        condition: f64,
    },
}

/// An iteration for `u = G(u)`. Nothing here allocates but the constructors.
pub trait Solver: Send {
    /// Begins a new solution.
    fn begin(&mut self);

    /// Is told `g = G(u)`; where the answer is [`Progress::Evaluate`], `u_next` is where next.
    /// All three have the length of the [`Scale`].
    fn next(&mut self, u: &[f64], g: &[f64], u_next: &mut [f64]) -> Progress;

    /// Column `column` of `dG/du`: the change of G per change of that component of u.
    /// Asked for by [`Progress::Matrix`] alone.
    fn set_column(&mut self, column: usize, values: &[f64]) {
        let _ = (column, values);
    }

    /// By how much to change component `column` of `u` for a difference quotient in place of a
    /// derivative: far above what slaves that integrate with a tolerance of their own add by chance,
    /// as the iteration needs the matrix to a few digits only.
    fn perturbation(&self, column: usize, u: &[f64]) -> f64 {
        1e-4 * u[column].abs().max(self.scale().nominals()[column])
    }

    /// The scale that it was made with.
    fn scale(&self) -> &Scale;

    /// Drops what was learned in earlier solutions: G has changed, as after an event or with another
    /// step.
    fn forget(&mut self);
}

/// The residual of an iteration, and when to end it.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Watch {
    scale: Scale,
    limit: u32,
    iterations: u32,
    /// G(u) - u.
    residual: Vec<f64>,
    /// The weights of the first evaluation, which stay, so that residuals can be compared.
    weights: Vec<f64>,
    first: f64,
    /// `max_i |residual_i| / weights_i`.
    merit: f64,
}

impl Watch {
    fn new(scale: Scale, limit: u32) -> Self {
        let n = scale.len();
        let (residual, weights) = (vec![0.0; n], vec![1.0; n]);
        Self { scale, limit, iterations: 0, residual, weights, first: 0.0, merit: 0.0 }
    }

    fn begin(&mut self) {
        self.iterations = 0;
    }

    /// Takes in an evaluation; the answer is how the iteration ends, if it does.
    fn look(&mut self, u: &[f64], g: &[f64]) -> Option<Progress> {
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
        if distance <= 1.0 && self.merit <= f64::max(1.0, SMALLER * self.first) {
            return Some(Progress::Converged { iterations });
        }
        if !distance.is_finite() || self.merit > GROWTH * self.first {
            return Some(Progress::Diverged { iterations });
        }
        let ended = iterations >= self.limit;
        ended.then_some(Progress::NotConverged { iterations, residual: distance })
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
