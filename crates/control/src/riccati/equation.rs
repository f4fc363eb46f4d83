//! The two Riccati equations with R = I: gain, left side, residual, and a step of Newton's method.

use crate::Domain;
use crate::blocks::symmetric_part;
use crate::lyapunov::{self, relative, sizes};
use nalgebra::DMatrix;

/// A sum of terms counts as at least this fraction of the largest sum, so that rounding errors of small sums do not
/// count.
const FLOOR: f64 = 1e-6;

/// A Riccati equation of continuous or sampled time, with the weights Q, N and R = I.
pub(super) struct RiccatiEquation {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
    pub(super) q: DMatrix<f64>,
    pub(super) n: DMatrix<f64>,
    pub(super) domain: Domain,
}

impl RiccatiEquation {
    /// K = -(B' P + N'), sampled -(I + B' P B)^-1 (B' P A + N'); None if I + B' P B is not positive
    /// definite.
    pub(super) fn gain(&self, p: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let effect = self.b.tr_mul(p);
        match self.domain {
            Domain::Continuous => Some(-(effect + self.n.transpose())),
            Domain::Sampled { .. } => {
                let size = symmetric_part(&(&effect * &self.b)) + identity(self.b.ncols());
                size.cholesky().map(|size| -size.solve(&(effect * &self.a + self.n.transpose())))
            }
        }
    }

    /// The left side of the equation, written as the Lyapunov equation for A + B K, in which an error
    /// of K has an effect of second order only.
    ///
    /// ```text
    /// (A + B K)' P (A + B K) - P + Q + N K + K' N' + K' K   in sampled time
    /// (A + B K)' P + P (A + B K) + Q + N K + K' N' + K' K   in continuous time
    /// ```
    pub(super) fn left_side(&self, p: &DMatrix<f64>, gain: &DMatrix<f64>) -> DMatrix<f64> {
        let cross = &self.n * gain;
        let cost = &self.q + &cross + cross.transpose() + gain.tr_mul(gain);
        let closed = &self.a + &self.b * gain;
        symmetric_part(&match self.domain {
            Domain::Continuous => closed.tr_mul(p) + p * closed + cost,
            Domain::Sampled { .. } => closed.tr_mul(p) * closed - p + cost,
        })
    }

    /// The largest entry of the left side of the equation relative to the sum of the moduli of its terms, to compare
    /// iterates; infinite if P has no gain, or the left side or a term is not finite.
    pub(super) fn entrywise_residual(&self, p: &DMatrix<f64>) -> f64 {
        self.relative_residual(p, &p.abs(), 0.0)
    }

    /// [`Self::entrywise_residual`], but with [`sizes`] for |P| and each sum at least [`FLOOR`] times the largest one:
    /// rounding errors of entries that are zero in theory do not count.
    pub(super) fn residual(&self, p: &DMatrix<f64>) -> f64 {
        self.relative_residual(p, &sizes(p), FLOOR)
    }

    /// The residual with `size` in place of |P|, where a sum counts as at least `floor` times the largest sum.
    fn relative_residual(&self, p: &DMatrix<f64>, size: &DMatrix<f64>, floor: f64) -> f64 {
        let Some(gain) = self.gain(p) else { return f64::INFINITY };
        let left = self.left_side(p, &gain);
        let (a, b, n) = (self.a.abs(), self.b.abs(), self.n.abs());
        let effect = b.tr_mul(size);
        let terms = match self.domain {
            Domain::Continuous => {
                let feedback = effect + n.transpose();
                a.tr_mul(size) + size * &a + feedback.tr_mul(&feedback)
            }
            Domain::Sampled { .. } => {
                let closed = a + b * gain.abs();
                let cross = n * gain.abs();
                closed.tr_mul(size) * &closed
                    + size
                    + &cross
                    + cross.transpose()
                    + gain.abs().tr_mul(&gain.abs())
            }
        };
        let terms = terms + self.q.abs();
        let least = floor * terms.amax();
        // A term that is NaN stays NaN.
        relative(&left, &terms.map(|term| if term < least { least } else { term }))
    }

    /// One step of Newton's method; None when A + B K is not stable or the step cannot be computed.
    pub(super) fn newton(&self, p: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let gain = self.gain(p)?;
        let closed = &self.a + &self.b * &gain;
        crate::stability::require_stable("A + B K", &closed, self.domain).ok()?;
        let equation = match self.domain {
            Domain::Continuous => lyapunov::CONTINUOUS,
            Domain::Sampled { .. } => lyapunov::DISCRETE,
        };
        let step = equation.solve(&closed, &self.left_side(p, &gain)).ok()?;
        Some(symmetric_part(&(p + step)))
    }
}

pub(super) fn identity(order: usize) -> DMatrix<f64> {
    DMatrix::identity(order, order)
}
