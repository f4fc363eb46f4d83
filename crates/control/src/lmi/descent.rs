//! Local descent of the H-infinity norm over the entries of a gain.

use super::limit;
use super::region::Region;
use crate::blocks::to_complex;
use crate::eigen::eigenvalues;
use crate::response::h_infinity;
use crate::{Domain, StateSpace};
use nalgebra::{DMatrix, DVector};

const ITERATIONS: usize = 80;
/// The descent ends when the norm decreases by less than `PROGRESS` in this number of iterations.
const PATIENCE: usize = 8;
const PROGRESS: f64 = 2e-3;
const SEARCHES: usize = 25;
/// First step, relative to the gain.
const FIRST: f64 = 0.1;
/// Required decrease and curvature of a step (weak Wolfe conditions).
const DECREASE: f64 = 1e-4;
const CURVATURE: f64 = 0.5;
/// Relative distance between the computed lower and upper bound of a norm.
const WIDTH: f64 = 1e-5;

/// The error dynamics A - [L; 0] C, B - [L; 0] D, E with a gain on the first states.
pub(super) struct GainNorm<'a> {
    pub(super) a: &'a DMatrix<f64>,
    pub(super) b: &'a DMatrix<f64>,
    pub(super) c: &'a DMatrix<f64>,
    pub(super) d: &'a DMatrix<f64>,
    pub(super) e: &'a DMatrix<f64>,
    pub(super) region: &'a Region,
    pub(super) domain: Domain,
}

impl GainNorm<'_> {
    /// The norm and its derivative with respect to L, n x p; None if the eigenvalues of the first n states
    /// leave the region, the loop is not stable, or the norm cannot be computed.
    ///
    /// ```text
    /// dnorm / dL = -Re(conj(h) g'),  h the first rows of R* E' u,  g = (C R B + D) v,  R = (lambda I - A)^-1,
    /// A and B of the closed loop, lambda at the frequency of the maximum, u and v the singular vectors there
    /// ```
    pub(super) fn value(&self, gain: &DMatrix<f64>) -> Option<(f64, DMatrix<f64>)> {
        let (n, order) = (gain.nrows(), self.a.nrows());
        let wide = gain.clone().resize_vertically(order, 0.0);
        let (a, b) = (self.a - &wide * self.c, self.b - &wide * self.d);
        let system = StateSpace::strictly_proper(a, b, self.e.clone(), self.domain);
        let first = system.a.view((0, 0), (n, n)).into_owned();
        if !self.region.violated(&eigenvalues(&first).ok()?, self.domain).is_empty() {
            return None;
        }
        let norm = h_infinity(&system, WIDTH).ok()?;
        let point = self.domain.point(norm.frequency);
        let shifted = DMatrix::identity(order, order) * point - to_complex(&system.a);
        let states = shifted.clone().lu().solve(&to_complex(&system.b))?;
        let transfer = to_complex(self.e) * &states;
        let svd = transfer.svd(true, true);
        let (u, v) = (svd.u?.column(0).into_owned(), svd.v_t?.row(0).adjoint());
        let measured = (to_complex(self.c) * states + to_complex(self.d)) * v;
        // u' E R = (R' E' u)'
        let reached = shifted.adjoint().lu().solve(&(to_complex(self.e).transpose() * u))?;
        let derivative =
            DMatrix::from_fn(n, gain.ncols(), |i, j| -(reached[i].conj() * measured[j]).re);
        Some((norm.upper, derivative))
    }

    /// Lowers the norm from a gain that is stable and in the region. Ends early with the best gain so far when
    /// [`limit::ending`] is true. Returns `start` if its norm cannot be computed.
    ///
    /// Method: BFGS with a line search for the weak Wolfe conditions. It converges in practice also for functions that
    /// are not smooth at their minimum: A. S. Lewis and M. L. Overton, Nonsmooth optimization via quasi-Newton methods,
    /// Math. Program. 141 (2013). The entries are scaled by the norms of the rows and columns of `start`.
    pub(super) fn descend(&self, start: &DMatrix<f64>) -> DMatrix<f64> {
        let (rows, cols) = start.shape();
        let size = start.norm().max(f64::MIN_POSITIVE);
        let part = |norm: f64| (norm / size).max(1e-3);
        let scale = DMatrix::from_fn(rows, cols, |i, j| {
            size * part(start.row(i).norm()) * part(start.column(j).norm())
        });
        let evaluate = |x: &DVector<f64>| {
            let gain = DMatrix::from_column_slice(rows, cols, x.as_slice()).component_mul(&scale);
            let (value, derivative) = self.value(&gain)?;
            let scaled = derivative.component_mul(&scale);
            Some((value, DVector::from_column_slice(scaled.as_slice())))
        };
        let mut x = DVector::from_column_slice(start.component_div(&scale).as_slice());
        let Some((mut value, mut slope)) = evaluate(&x) else { return start.clone() };
        let first = |slope: &DVector<f64>, x: &DVector<f64>| {
            FIRST * x.norm() / slope.norm().max(f64::MIN_POSITIVE)
        };
        let identity = DMatrix::<f64>::identity(x.len(), x.len());
        let mut inverse = &identity * first(&slope, &x);
        let mut fresh = true;
        let mut history = vec![value];
        for _ in 0..ITERATIONS {
            let direction = -(&inverse * &slope);
            let rate = slope.dot(&direction);
            let (mut low, mut high, mut step) = (0.0, f64::INFINITY, 1.0);
            let mut accepted = None;
            for _ in 0..SEARCHES {
                if limit::is_over() {
                    break;
                }
                let next = &x + &direction * step;
                match evaluate(&next) {
                    Some((other, gradient)) if other <= value + DECREASE * step * rate => {
                        let flat = gradient.dot(&direction) >= CURVATURE * rate;
                        accepted = Some((next, other, gradient));
                        if flat {
                            break;
                        }
                        low = step;
                    }
                    _ => high = step,
                }
                step = if high.is_finite() { 0.5 * (low + high) } else { 2.0 * step };
            }
            let Some((next, other, gradient)) = accepted else {
                if fresh || limit::is_over() {
                    break;
                }
                (inverse, fresh) = (&identity * first(&slope, &x), true);
                continue;
            };
            let (step, change) = (&next - &x, &gradient - &slope);
            let product = step.dot(&change);
            (x, value, slope, fresh) = (next, other, gradient, false);
            if product > 0.0 {
                let left = &identity - &step * change.transpose() / product;
                inverse = &left * inverse * left.transpose() + &step * step.transpose() / product;
            }
            history.push(value);
            let before = history.len().checked_sub(PATIENCE + 1).map(|at| history[at]);
            if before.is_some_and(|before| value > before * (1.0 - PROGRESS)) {
                break;
            }
        }
        DMatrix::from_column_slice(rows, cols, x.as_slice()).component_mul(&scale)
    }
}

#[cfg(test)]
mod tests {
    use super::super::lower_bound::tests::row;
    use super::*;

    #[test]
    fn the_derivative_is_that_of_a_difference_quotient() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, -1.0, -0.3, 1.0, 0.5, 0.0, -0.2]);
        let b = DMatrix::from_row_slice(3, 2, &[0.0, 0.1, 1.0, 0.0, 0.0, 0.3]);
        let (c, d) = (row(&[1.0, 0.0, 0.2]), row(&[0.0, 0.1]));
        let e = DMatrix::from_row_slice(2, 3, &[0.0, 1.0, 0.3, 0.1, 0.0, 1.0]);
        let region = Region::default();
        let domain = Domain::Continuous;
        let (region, [a, b, c, d, e]) = (&region, [&a, &b, &c, &d, &e]);
        let loops = GainNorm { a, b, c, d, e, region, domain };
        let gain = DMatrix::from_row_slice(2, 1, &[2.0, 1.5]);
        let (value, derivative) = loops.value(&gain).unwrap();
        for at in 0..2 {
            let moved = |by: f64| {
                let mut moved = gain.clone();
                moved[at] += by;
                loops.value(&moved).unwrap().0
            };
            let expected = (moved(1e-3) - moved(-1e-3)) / 2e-3;
            assert!((derivative[at] - expected).abs() < 0.02 * derivative.norm(), "{at}");
        }
        assert!(loops.value(&loops.descend(&gain)).unwrap().0 < value);
    }
}
