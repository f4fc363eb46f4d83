//! The filter whose error has an H-infinity norm below a bound.

use super::problem::balancing;
use super::{KalmanFilter, doubling, kalman};
use crate::balance::{divided, multiplied, similar};
use crate::blocks::symmetric_part;
use crate::{Domain, Error, check, stability};
use nalgebra::DMatrix;

/// Largest number of Riccati equations that are solved for one bound if doubling cannot be used.
const ITERATIONS: usize = 400;
/// Relative change at which the iteration has converged.
const CONVERGED: f64 = 1e-4;
/// The bound counts as too small when the norm of X exceeds that of the Kalman filter's covariance by this factor.
const GROWTH: f64 = 1e8;
/// Largest relative difference of the covariances of the Kalman filter by doubling and by [`kalman`] at which
/// doubling is trusted for bounds, too.
const SAME: f64 = 1e-6;

/// The error dynamics for [`NormFilter`]: x' = (A - L C) x + (B - L D) w, z = E x, in sampled time
/// `x[k+1] = (A - L C) x[k] + (B - L D) w[k]`.
#[derive(Debug, Clone, Copy)]
pub struct NormFilterProblem<'a> {
    /// A, n x n.
    pub a: &'a DMatrix<f64>,
    /// C, p x n.
    pub c: &'a DMatrix<f64>,
    /// B, n x k: how w acts on the states.
    pub disturbance: &'a DMatrix<f64>,
    /// D, p x k, of full row rank: every measurement has noise.
    pub feedthrough: &'a DMatrix<f64>,
    /// E, r x n: z = E x is the estimated signal.
    pub output: &'a DMatrix<f64>,
}

/// Filters whose H-infinity norm from the disturbance w to the error z is below a bound.
///
/// ```text
/// R = D D',  S = B D',  A_s = A - S R^-1 C,  Q = B B' - S R^-1 S',  G = C' R^-1 C - E' E / gamma^2
///
/// continuous:  A_s X + X A_s' - X G X + Q = 0
///              L = X C' R^-1 + S R^-1
/// sampled:     X = A_s X (I + G X)^-1 A_s' + Q,  gamma^2 I - E X E' > 0
///              Y = X + X E' (gamma^2 I - E X E')^-1 E X
///              L = A_s Y C' (R + C Y C')^-1 + S R^-1
/// ```
///
/// A filter of any order exists if and only if there is a solution X >= 0 that stabilises `A_s` - X G, in sampled
/// time `A_s` (I + X G)^-1; X >= 0 is equivalent to A - L C being stable.
///
/// Method: doubling in balanced coordinates, if it finds the covariance of the Kalman filter, which it may not for
/// unstable modes that no w moves. Otherwise X is the limit of a sequence of covariances of Kalman filters: the
/// previous X increases the process noise of each filter. The sequence starts at the covariance of the Kalman filter,
/// grows, and stays below the solution X if there is one, so that it converges if and only if gamma is above the least
/// norm. The number of steps grows without limit as gamma approaches this norm; 400 steps are enough from about 2 %
/// above it on.
///
/// Source: K. M. Nagpal, P. P. Khargonekar, Filtering and smoothing in an H-infinity setting, IEEE
/// Trans. Autom. Control 36 (1991), theorem 3.1; sampled: B. Hassibi, A. H. Sayed, T. Kailath, Linear
/// estimation in Krein spaces, part II, IEEE Trans. Autom. Control 41 (1996), theorem 4 (a priori filter).
#[derive(Debug, Clone)]
pub struct NormFilter {
    /// `A_s` = A - S R^-1 C, the dynamics after the noises are decorrelated.
    a: DMatrix<f64>,
    c: DMatrix<f64>,
    /// Q, the covariance of the disturbance that is not correlated with the measurement noise.
    process: DMatrix<f64>,
    /// R = D D', the covariance of the measurement noise.
    noise: DMatrix<f64>,
    /// E, the output matrix of the estimated signal.
    output: DMatrix<f64>,
    /// C' R^-1 C, the information of the measurements.
    measured: DMatrix<f64>,
    /// S R^-1, with S = B D' the correlation of disturbance and measurement noise.
    correlated: DMatrix<f64>,
    domain: Domain,
    /// The Kalman filter for `A_s`, C, Q and R.
    filter: KalmanFilter,
    /// Whether doubling finds the covariance of the Kalman filter; then doubling also solves the equation of each
    /// bound.
    by_doubling: bool,
}

impl NormFilter {
    /// Prepares filters for a problem.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for B, D or E; [`Error::NotPositiveDefinite`] if a
    /// measurement has no noise; otherwise same as [`kalman`].
    pub fn new(problem: &NormFilterProblem<'_>, domain: Domain) -> Result<Self, Error> {
        let NormFilterProblem { a, c, disturbance: b, feedthrough: d, output } = *problem;
        let (n, p, k) = (check::with_outputs(a, c)?, c.nrows(), b.ncols());
        check::shape("B", b, (n, k))?;
        check::shape("D", d, (p, k))?;
        check::shape("E", output, (output.nrows(), n))?;
        let noise = symmetric_part(&(d * d.transpose()));
        let indefinite = Error::NotPositiveDefinite { matrix: "D D'" };
        let factor = noise.clone().cholesky().ok_or(indefinite)?;
        let correlated = factor.solve(&(d * b.transpose())).transpose();
        // B - S R^-1 D is free of D: its square is Q without a difference of large numbers.
        let free = b - &correlated * d;
        let process = symmetric_part(&(&free * free.transpose()));
        let a = a - &correlated * c;
        let filter = kalman(&a, c, &process, &noise, domain)?;
        let measured = symmetric_part(&c.tr_mul(&factor.solve(c)));
        let mut filters = Self {
            a,
            c: c.clone(),
            process,
            noise,
            output: output.clone(),
            measured,
            correlated,
            domain,
            filter,
            by_doubling: false,
        };
        let covariance = &filters.filter.covariance;
        filters.by_doubling = filters
            .solve_by_doubling(f64::INFINITY)
            .is_some_and(|x| (x - covariance).norm() <= SAME * covariance.norm());
        Ok(filters)
    }

    /// Returns the gain of the Kalman filter, the limit for large bounds.
    #[must_use]
    pub fn kalman_gain(&self) -> DMatrix<f64> {
        &self.filter.gain + &self.correlated
    }

    /// Computes the gain of a filter whose norm is below `gamma`; None if no such filter was found.
    ///
    /// The bound holds up to rounding errors, and without doubling up to 1e-4 of X: evaluate the norm of the result.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for `gamma`.
    pub fn gain(&self, gamma: f64) -> Result<Option<DMatrix<f64>>, Error> {
        check::positive("gamma", gamma)?;
        if self.by_doubling {
            let gain = |x| self.stabilising_gain(&x, gamma);
            return Ok(self.solve_by_doubling(gamma).and_then(gain));
        }
        Ok(self.iterate(gamma))
    }

    /// The matrix G, the information of the measurements less the information of the bound.
    fn information(&self, gamma: f64) -> DMatrix<f64> {
        let output = &self.output / gamma;
        symmetric_part(&(&self.measured - output.tr_mul(&output)))
    }

    /// Computes X by doubling; None if it does not converge.
    fn solve_by_doubling(&self, gamma: f64) -> Option<DMatrix<f64>> {
        let (a, g) = (self.a.transpose(), self.information(gamma));
        let scale = balancing(&a, &g, &self.process);
        let q = multiplied(&self.process, &scale);
        let (a, g) = (similar(&a, &scale), divided(&g, &scale));
        let x = match self.domain {
            Domain::Continuous => doubling::continuous(&a, &g, &q),
            Domain::Sampled { .. } => doubling::sampled(&a, &g, &q),
        };
        Some(divided(&x.ok()?, &scale))
    }

    /// Returns the gain of X; None if X is not the stabilising and positive semidefinite solution.
    fn stabilising_gain(&self, x: &DMatrix<f64>, gamma: f64) -> Option<DMatrix<f64>> {
        let g = self.information(gamma);
        let game = match self.domain {
            Domain::Continuous => &self.a - x * g,
            Domain::Sampled { .. } => {
                let identity = DMatrix::identity(x.nrows(), x.nrows());
                &self.a * (identity + x * g).try_inverse()?
            }
        };
        let gain = self.gain_of(&(x + self.increment(x, gamma)?))?;
        let stable = |matrix| stability::require_stable("", matrix, self.domain).is_ok();
        let error = &self.a - &gain * &self.c;
        (stable(&game) && stable(&error)).then(|| gain + &self.correlated)
    }

    /// Y - X in sampled time, X E' (`gamma^2` I - E X E')^-1 E X; zero in continuous time. None if `gamma^2` I - E X E'
    /// is not positive definite.
    fn increment(&self, x: &DMatrix<f64>, gamma: f64) -> Option<DMatrix<f64>> {
        if self.domain == Domain::Continuous {
            return Some(DMatrix::zeros(x.nrows(), x.ncols()));
        }
        let output = &self.output * x / gamma;
        let rest = DMatrix::identity(output.nrows(), output.nrows())
            - &output * self.output.transpose() / gamma;
        Some(symmetric_part(&output.tr_mul(&symmetric_part(&rest).cholesky()?.solve(&output))))
    }

    /// The part L - S R^-1 of the gain; `covariance`: X, in sampled time Y; None if it cannot be computed.
    fn gain_of(&self, covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let crossed = &self.c * covariance;
        Some(match self.domain {
            Domain::Continuous => self.noise.clone().cholesky()?.solve(&crossed).transpose(),
            Domain::Sampled { .. } => {
                let innovation = &self.noise + &crossed * self.c.transpose();
                let factor = symmetric_part(&innovation).cholesky()?;
                &self.a * factor.solve(&crossed).transpose()
            }
        })
    }

    /// Computes the gain by a sequence of Kalman filters; None if it does not converge.
    fn iterate(&self, gamma: f64) -> Option<DMatrix<f64>> {
        let first = self.filter.covariance.norm();
        let mut x = self.filter.covariance.clone();
        for _ in 0..ITERATIONS {
            let noise = match self.domain {
                Domain::Continuous => {
                    let output = &self.output * &x / gamma;
                    symmetric_part(&output.tr_mul(&output))
                }
                Domain::Sampled { .. } => self.increment(&x, gamma)?,
            };
            let process = &self.process + &noise;
            let next = kalman(&self.a, &self.c, &process, &self.noise, self.domain).ok()?;
            let update = match self.domain {
                Domain::Continuous => next.covariance,
                Domain::Sampled { .. } => next.covariance - noise,
            };
            let size = update.norm();
            if (&update - x).norm() <= CONVERGED * size {
                return Some(next.gain + &self.correlated);
            }
            if size > GROWTH * first {
                return None;
            }
            x = update;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StateSpace;
    use crate::response::h_infinity;

    const SAMPLED: Domain = Domain::Sampled { period: 1.0 };

    fn row(entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(1, entries.len(), entries)
    }

    /// x' = a x + w, y = x + v, z = x.
    fn scalar(a: f64, domain: Domain) -> NormFilter {
        NormFilter::new(
            &NormFilterProblem {
                a: &row(&[a]),
                c: &row(&[1.0]),
                disturbance: &row(&[1.0, 0.0]),
                feedthrough: &row(&[0.0, 1.0]),
                output: &row(&[1.0]),
            },
            domain,
        )
        .unwrap()
    }

    /// 0 = -(1 - `1/gamma^2`) X^2 + 1: a filter exists for gamma above 1, and L = 1 / sqrt(1 - `1/gamma^2`).
    #[test]
    fn the_filter_of_an_integrator_has_the_gain_of_the_scalar_equation() {
        let filter = scalar(0.0, Domain::Continuous);
        assert!(filter.by_doubling);
        let by_doubling = filter.gain(1.25).unwrap().unwrap();
        assert!((by_doubling[(0, 0)] - 1.0 / 0.6).abs() < 1e-12);
        assert!((filter.iterate(1.25).unwrap()[(0, 0)] - 1.0 / 0.6).abs() < 1e-3);
        assert_eq!(filter.gain(0.9).unwrap(), None);
        assert_eq!(filter.iterate(0.9), None);
        assert!(filter.gain(0.0).is_err());
    }

    /// X = a^2 / (1 / X + 1 - `1/gamma^2`) + 1 with X below `gamma^2`: at the limit X = `gamma^2` = a^2 + 1.
    #[test]
    fn a_sampled_filter_exists_above_the_limit_of_the_scalar_equation() {
        for a in [0.0, 0.5, -1.0, 1.0, 2.0_f64] {
            let (filter, least) = (scalar(a, SAMPLED), (1.0 + a * a).sqrt());
            for gain in [filter.gain(1.001 * least).unwrap(), filter.iterate(1.05 * least)] {
                let gain = gain.unwrap()[0];
                let error = StateSpace {
                    a: row(&[a - gain]),
                    b: row(&[1.0, -gain]),
                    c: row(&[1.0]),
                    d: row(&[0.0, 0.0]),
                    domain: SAMPLED,
                };
                let norm = h_infinity(&error, 1e-6).unwrap().upper;
                assert!(norm > 0.999 * least && norm < 1.05 * least, "{a}: {norm}, {least}");
            }
            assert_eq!(filter.gain(0.999 * least).unwrap(), None, "{a}");
            assert_eq!(filter.iterate(0.99 * least), None, "{a}");
        }
    }

    /// y[k] = x[k] + w[k] shares w with x[k+1] = x[k] + w[k]: L = 1 leaves no error.
    #[test]
    fn noise_that_is_the_disturbance_leaves_no_error() {
        let one = row(&[1.0]);
        let both = row(&[1.0, 1e-3]);
        let problem = NormFilterProblem {
            a: &one,
            c: &one,
            disturbance: &row(&[1.0, 0.0]),
            feedthrough: &both,
            output: &one,
        };
        let gain = NormFilter::new(&problem, SAMPLED).unwrap().gain(0.01).unwrap().unwrap();
        assert!((gain[(0, 0)] - 1.0).abs() < 1e-3);
    }

    #[test]
    fn an_unstable_mode_that_no_disturbance_moves_is_stabilised() {
        let a = DMatrix::from_row_slice(2, 2, &[0.5, 0.0, 0.0, -1.0]);
        let problem = NormFilterProblem {
            a: &a,
            c: &row(&[1.0, 1.0]),
            disturbance: &DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 1.0, 0.0]),
            feedthrough: &row(&[0.0, 1.0]),
            output: &row(&[1.0, 0.0]),
        };
        let filter = NormFilter::new(&problem, Domain::Continuous).unwrap();
        for gain in [filter.gain(10.0).unwrap(), filter.iterate(10.0)] {
            let error = &a - gain.unwrap() * problem.c;
            assert!(stability::require_stable("", &error, Domain::Continuous).is_ok());
        }
    }
}
