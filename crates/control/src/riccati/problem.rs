//! A Riccati equation in balanced coordinates, with R = I.

use super::Weights;
use super::doubling;
use super::equation::RiccatiEquation;
use super::semidefinite::require_semidefinite;
use crate::balance::{
    Balance, divide_columns, divide_rows, divided, multiplied, multiply_rows, power_of_two, similar,
};
use crate::blocks::{block_2x2, symmetric_part};
use crate::lyapunov;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

const NEWTON_STEPS: usize = 60;

/// The problem in balanced coordinates `x_s`, with inputs `u_s` for which R = I.
///
/// x = S `x_s` with a positive diagonal S, u = L^-T `u_s` with R = L L'.
pub(super) struct ScaledProblem {
    pub(super) equation: RiccatiEquation,
    /// A - B N', the dynamics after the substitution of u that removes the product of x and u from
    /// the cost.
    pub(super) decoupled_a: DMatrix<f64>,
    /// Q - N N', the weight of the states after this substitution.
    pub(super) decoupled_q: DMatrix<f64>,
    /// The scales of the states: the diagonal of S, powers of two.
    scale: DVector<f64>,
    /// L, the Cholesky factor of the weight R.
    factor: DMatrix<f64>,
}

impl ScaledProblem {
    /// Checks the matrices and scales the problem, with the errors of [`super::lqr`] for bad matrices and weights,
    /// [`Error::Overflow`] and [`Error::NotConverged`].
    pub(super) fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        weights: &Weights,
        domain: Domain,
    ) -> Result<Self, Error> {
        let (order, inputs) = (check::with_inputs(a, b)?, b.ncols());
        check::shape("Q", &weights.q, (order, order))?;
        check::shape("R", &weights.r, (inputs, inputs))?;
        lyapunov::symmetric("Q", &weights.q)?;
        lyapunov::symmetric("R", &weights.r)?;
        let n = weights.n.clone().unwrap_or_else(|| DMatrix::zeros(order, inputs));
        check::shape("N", &n, (order, inputs))?;
        let indefinite = Error::NotPositiveDefinite { matrix: "R" };
        let factor = weights.r.clone().cholesky().ok_or(indefinite)?.l();
        let b = check::in_range("B R^-1 B'", per_unit(b, &factor))?;
        let n = check::in_range("N R^-1 N'", per_unit(&n, &factor))?;
        let decoupled_a = check::in_range("A - B R^-1 N'", a - &b * n.transpose())?;
        let decoupled_q =
            check::in_range("Q - N R^-1 N'", &weights.q - symmetric_part(&(&n * n.transpose())))?;
        require_semidefinite(&decoupled_q, &weights.q)?;
        let effect = check::in_range("B R^-1 B'", &b * b.transpose())?;
        let scale = balancing(&decoupled_a, &effect, &decoupled_q);
        let (a, q) = (similar(a, &scale), multiplied(&weights.q, &scale));
        let (b, n) = (divide_rows(&b, &scale), multiply_rows(&n, &scale));
        Ok(Self {
            decoupled_a: similar(&decoupled_a, &scale),
            decoupled_q: multiplied(&decoupled_q, &scale),
            equation: RiccatiEquation { a, b, q, n, domain },
            scale,
            factor,
        })
    }

    /// Computes a P from which Newton's method converges to the stabilising solution.
    ///
    /// Doubling computes the least semidefinite solution, which does not stabilise an unstable mode
    /// that does not appear in Q. With Q + d I every mode appears, and Newton's method converges
    /// from there to the stabilising solution. The errors are the errors of doubling for Q + d I.
    pub(super) fn start(&self) -> Result<DMatrix<f64>, Error> {
        let effect = symmetric_part(&(&self.equation.b * self.equation.b.transpose()));
        let solve = |q: &DMatrix<f64>| match self.equation.domain {
            Domain::Continuous => doubling::continuous(&self.decoupled_a, &effect, q),
            Domain::Sampled { .. } => doubling::sampled(&self.decoupled_a, &effect, q),
        };
        if let Ok(p) = solve(&self.decoupled_q)
            && self.equation.newton(&p).is_some()
        {
            return Ok(p);
        }
        let order = self.decoupled_a.nrows();
        let size = self.decoupled_q.amax().max(self.decoupled_a.amax());
        solve(&(&self.decoupled_q + DMatrix::from_diagonal_element(order, order, size)))
    }

    /// Applies Newton's method until its step or the residual is within rounding errors; returns the P of the
    /// smallest residual. [`Error::NotConverged`] if the method ends before that, after 60 steps or because a step
    /// cannot be computed, and the residual is not allowed either.
    pub(super) fn refine(&self, start: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        let (mut best, mut residual) = (start.clone(), self.equation.entrywise_residual(start));
        let mut p = start.clone();
        for _ in 0..NEWTON_STEPS {
            let Some(next) = self.equation.newton(&p) else { break };
            let step = (&next - &p).amax();
            let next_residual = self.equation.entrywise_residual(&next);
            if next_residual < residual {
                (best, residual) = (next.clone(), next_residual);
            }
            if step <= 10.0 * f64::EPSILON * next.amax() || residual <= f64::EPSILON {
                return Ok(best);
            }
            p = next;
        }
        if self.equation.residual(&best) <= super::ALLOWED_RESIDUAL {
            return Ok(best);
        }
        let what = "Newton's method for the Riccati equation";
        Err(Error::NotConverged { what, iterations: NEWTON_STEPS })
    }

    /// Converts P to the problem without scales; [`Error::Overflow`] if P exceeds the range of double precision.
    pub(super) fn restore(&self, p: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        check::in_range("P", divided(p, &self.scale))
    }

    /// The residual of a P of the problem without scales.
    pub(super) fn residual(&self, p: &DMatrix<f64>) -> f64 {
        self.equation.residual(&multiplied(p, &self.scale))
    }

    /// Returns the gain of a scaled P for the problem without scales, L^-T K S^-1; [`Error::Overflow`] if it cannot be
    /// computed or leaves the range.
    pub(super) fn restore_gain(&self, p: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
        let gain =
            self.equation.gain(p).and_then(|gain| self.factor.tr_solve_lower_triangular(&gain));
        let gain = gain.ok_or(Error::Overflow { what: "K" })?;
        check::in_range("K", divide_columns(&gain, &self.scale))
    }
}

/// M L^-T with L = `factor`; NaN if L is singular.
fn per_unit(m: &DMatrix<f64>, factor: &DMatrix<f64>) -> DMatrix<f64> {
    let solved = factor.solve_lower_triangular(&m.transpose());
    solved.map_or_else(|| DMatrix::from_element(m.nrows(), m.ncols(), f64::NAN), |x| x.transpose())
}

/// Diagonal S that balances the Hamiltonian matrix [A, -G; -Q, -A'] by diag(S, S^-1).
pub(super) fn balancing(a: &DMatrix<f64>, g: &DMatrix<f64>, q: &DMatrix<f64>) -> DVector<f64> {
    let (order, dynamics) = (a.nrows(), a.abs());
    let hamiltonian = block_2x2([&dynamics, &g.abs()], [&q.abs(), &dynamics.transpose()]);
    let scale = Balance::new(&hamiltonian).scale;
    DVector::from_fn(order, |i, _| power_of_two((scale[i] / scale[order + i]).sqrt()))
}
