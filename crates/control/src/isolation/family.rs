//! The linear family of all generators of one order with one residual.

use super::decoupled::DecoupledPart;
use crate::blocks::{ComplexMatrix, stacked, to_complex};
use crate::svd::Svd;
use crate::{Domain, Error};
use nalgebra::{Complex, DMatrix};

/// Number of frequencies at which the effect of noise is averaged; in continuous time they span [`NOISE_DECADES`].
const NOISE_POINTS: u32 = 40;
const NOISE_DECADES: f64 = 4.0;

/// A basis of all solutions of (3) of [`crate::isolation`] for given poles `p_1`, ..., `p_k`.
///
/// The states are a chain of lags `zeta_i'` = `p_i` `zeta_i` + `g_i` `zeta_(i-1)` + `L_i` (H y - `D_u` u) +
/// ..., so that row by row
///
/// ```text
/// t_i (A - p_i I) = g_i t_(i-1) + L_i C,   t_k + w C = 0
/// ```
///
/// Row r of each matrix belongs to member r of the basis.
pub(super) struct Family {
    /// `t_1`, ..., `t_k`, the weights of the plant's states; each with one row of n entries per member.
    pub(super) t: Vec<DMatrix<f64>>,
    /// `L_1`, ..., `L_k`, the gains from the outputs; each with one row of q entries per member.
    pub(super) l: Vec<DMatrix<f64>>,
    /// The direct gain w, one row of q entries per member.
    pub(super) w: DMatrix<f64>,
    pub(super) poles: Vec<f64>,
    pub(super) domain: Domain,
    /// Relative error of the members: rounding times the largest condition of a null space.
    pub(super) accuracy: f64,
}

impl Family {
    /// The family of order k = `poles.len()`, by one orthogonal null space for each lag and one for w.
    ///
    /// [A - p I; C] has full column rank, as (A, C) is observable, and the rank of the last matrix is
    /// the number of states that y, ..., y^(k) determine; no rank is decided here.
    pub(super) fn new(part: &DecoupledPart, poles: &[f64], domain: Domain) -> Result<Self, Error> {
        let (n, q, k) = (part.a.nrows(), part.c.nrows(), poles.len());
        let mut family = Self {
            t: Vec::new(),
            l: Vec::new(),
            w: DMatrix::zeros(0, q),
            poles: poles.to_vec(),
            domain,
            accuracy: f64::EPSILON,
        };
        let mut last = DMatrix::zeros(0, n);
        for &pole in poles {
            let gain = unit_gain(pole, domain);
            let shifted = &part.a - DMatrix::identity(n, n) * pole;
            let equations = stacked(&stacked(&shifted, &(&part.c * -gain)), &(last * -gain));
            let null = family.left_null_space(&equations, n)?;
            family.combine(&null.columns(n + q, null.ncols() - n - q).into_owned());
            last = null.columns(0, n).into_owned();
            family.t.push(last.clone());
            family.l.push(null.columns(n, q) * gain);
        }
        let rank = part.blocks.iter().take(k + 1).sum();
        let null = family.left_null_space(&stacked(&last, &part.c), rank)?;
        family.combine(&null.columns(0, last.nrows()).into_owned());
        family.w = null.columns(last.nrows(), q).into_owned();
        Ok(family)
    }

    /// Orthonormal rows v with v M = 0 for a matrix M of known rank.
    fn left_null_space(&mut self, m: &DMatrix<f64>, rank: usize) -> Result<DMatrix<f64>, Error> {
        let svd = Svd::new(&m.transpose())?;
        if rank > 0 {
            let condition = svd.values[0] / svd.values[rank - 1];
            self.accuracy = self.accuracy.max(f64::EPSILON * condition);
        }
        Ok(svd.right.columns(rank, m.nrows() - rank).transpose())
    }

    /// Replaces the t and L of the members by their linear combinations with the rows of `factors` as weights.
    fn combine(&mut self, factors: &DMatrix<f64>) {
        for m in self.t.iter_mut().chain(&mut self.l) {
            *m = factors * &*m;
        }
    }

    /// The combination of the members with the given factors, as a family of one.
    pub(super) fn member(mut self, factors: &DMatrix<f64>) -> Self {
        self.combine(factors);
        self.w = factors * self.w;
        self
    }

    /// The frequency response of the residuals to the faults, with a row for each member.
    pub(super) fn fault_gains(&self, part: &DecoupledPart, frequency: f64) -> ComplexMatrix {
        let input = |at: usize| &self.l[at] * &part.d_f - &self.t[at] * &part.b_f;
        self.response(frequency, input, &(&self.w * &part.d_f))
    }

    /// For each fault, an upper bound of its gains: the sum of the norms of the terms, which may cancel in a gain.
    pub(super) fn fault_scale(&self, part: &DecoupledPart, frequency: f64) -> Vec<f64> {
        let s = self.domain.point(frequency);
        let size = |fault: usize| {
            let (b, d) = (part.b_f.column(fault).norm(), part.d_f.column(fault).norm());
            let lags = self.poles.iter().zip(self.t.iter().zip(&self.l));
            let through =
                lags.map(|(&pole, (t, l))| (t.norm() * b + l.norm() * d) / (s - pole).norm());
            through.sum::<f64>() + self.w.norm() * d
        };
        (0..part.b_f.ncols()).map(size).collect()
    }

    /// W: the residual of the combination v has the variance v W v' per frequency for noise of the intensity
    /// `noise[i]`^2.
    ///
    /// The mean over 40 frequencies: in continuous time over four decades up to ten times `fastest`, the
    /// rate of the fastest pole; in sampled time evenly from 0 to pi / period.
    pub(super) fn noise(&self, part: &DecoupledPart, noise: &[f64], fastest: f64) -> DMatrix<f64> {
        let sizes = DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(noise));
        let (h, k) = (&part.h * &sizes, &part.k * &sizes);
        let mut sum = DMatrix::zeros(self.w.nrows(), self.w.nrows());
        for point in 0..NOISE_POINTS {
            let fraction = f64::from(point) / f64::from(NOISE_POINTS - 1);
            let frequency = match self.domain {
                Domain::Continuous => {
                    10.0 * fastest * 10.0_f64.powf(NOISE_DECADES * (fraction - 1.0))
                }
                Domain::Sampled { period } => std::f64::consts::PI / period * fraction,
            };
            let input = |at: usize| &self.l[at] * &h + &self.t[at] * &k;
            let x = self.response(frequency, input, &(&self.w * &h));
            sum += (&x * x.adjoint()).map(|entry| entry.re) / f64::from(NOISE_POINTS);
        }
        sum
    }

    /// The response through the chain of lags: `input(i)` drives lag i, from 0, and `direct` the residual.
    fn response(
        &self,
        frequency: f64,
        input: impl Fn(usize) -> DMatrix<f64>,
        direct: &DMatrix<f64>,
    ) -> ComplexMatrix {
        let s = self.domain.point(frequency);
        let mut sum = to_complex(direct);
        let mut through = Complex::new(1.0, 0.0);
        for (at, &pole) in self.poles.iter().enumerate().rev() {
            sum += to_complex(&input(at)) * (through / (s - pole));
            through *= unit_gain(pole, self.domain) / (s - pole);
        }
        sum
    }
}

/// The gain of a lag with the pole p whose static gain is one: -p, or 1 - p in sampled time.
pub(super) fn unit_gain(pole: f64, domain: Domain) -> f64 {
    domain.constant() - pole
}
