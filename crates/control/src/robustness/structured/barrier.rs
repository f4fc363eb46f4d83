//! The analytic centre of the scales D and G that satisfy a bound.

use super::blocks::{Block, Direction, SparseEntry, directions};
use super::form::{form, form_size};
use super::hermitian::{factor, forward, times};
use crate::blocks::ComplexMatrix;
use nalgebra::{Cholesky, Complex, DMatrix, DVector};
use std::iter::successors;

/// The largest G, relative to D and M: a delta whose angle to the real axis is below 1 / `LARGEST_G` counts as real.
const LARGEST_G: f64 = 1e3;
const NEWTON_STEPS: usize = 40;
/// The Newton decrement below which a point is near enough to the centre.
const NEAR: f64 = 0.3;
const HALVINGS: usize = 20;
const RIDGE: f64 = 1e-13;

/// The barrier function of the scales of a matrix M; its variables are the coefficients of [`directions`].
pub(super) struct Barrier<'a> {
    m: &'a ComplexMatrix,
    directions: Vec<Direction>,
    /// The largest G, relative to D.
    largest_g: f64,
}

/// The scales D and G, and their coefficients of [`directions`].
#[derive(Clone)]
pub(super) struct Point {
    coefficients: DVector<f64>,
    pub(super) d: ComplexMatrix,
    pub(super) g: ComplexMatrix,
}

/// A linear matrix inequality F = N* W N > 0 at a point.
struct Inequality {
    /// K = N F^-1 N*, from which the derivatives of log det F follow.
    k: ComplexMatrix,
    /// Whether K has no entries between different blocks.
    diagonal: bool,
    /// The entries of W for each direction.
    weights: Vec<Vec<SparseEntry>>,
}

impl<'a> Barrier<'a> {
    /// `size`: an upper bound of the norm of M, which limits G.
    pub(super) fn new(m: &'a ComplexMatrix, blocks: &[Block], size: f64) -> Self {
        Self { m, directions: directions(blocks), largest_g: LARGEST_G * size }
    }

    /// The point D = I / 2, G = 0, from which Newton's method starts.
    pub(super) fn start(&self) -> Point {
        let half = |direction: &Direction| {
            let diagonal = direction.entries.iter().all(|(row, column, _)| row == column);
            if diagonal && !direction.of_g { 0.5 } else { 0.0 }
        };
        self.point(DVector::from_iterator(self.directions.len(), self.directions.iter().map(half)))
    }

    fn point(&self, coefficients: DVector<f64>) -> Point {
        let r = self.m.nrows();
        let mut point =
            Point { coefficients, d: ComplexMatrix::zeros(r, r), g: ComplexMatrix::zeros(r, r) };
        for (direction, value) in self.directions.iter().zip(point.coefficients.iter()) {
            let matrix = if direction.of_g { &mut point.g } else { &mut point.d };
            for (row, column, entry) in &direction.entries {
                matrix[(*row, *column)] += entry * *value;
            }
        }
        point
    }

    /// The Cholesky factors of [`form`], c D + G, c D - G and I - D, c the largest G; None unless all exist.
    fn factors(&self, at: &Point, bound: f64) -> Option<[ComplexMatrix; 4]> {
        let Point { d, g, .. } = at;
        if d.diagonal().iter().any(|x| x.re <= 0.0) {
            return None;
        }
        let size: Vec<f64> = d.diagonal().iter().map(|x| x.re * self.largest_g).collect();
        let sized = d.scale(self.largest_g);
        let rest = ComplexMatrix::identity(d.nrows(), d.nrows()) - d;
        Some([
            factor(&form(self.m, d, g, bound), &form_size(self.m, d, g, bound))?,
            factor(&(&sized + g), &size)?,
            factor(&(sized - g), &size)?,
            factor(&rest, &vec![1.0; d.nrows()])?,
        ])
    }

    /// The barrier: minus the sum of the logarithms of the determinants.
    fn value(factors: &[ComplexMatrix; 4]) -> f64 {
        let logarithm = |l: &ComplexMatrix| l.diagonal().iter().map(|x| x.re.ln()).sum::<f64>();
        -2.0 * factors.iter().map(logarithm).sum::<f64>()
    }

    fn inequalities(&self, factors: &[ComplexMatrix; 4], bound: f64) -> [Inequality; 4] {
        let r = self.m.nrows();
        let identity = ComplexMatrix::identity(r, r);
        let mut both = self.m.adjoint().resize_horizontally(2 * r, Complex::new(0.0, 0.0));
        both.columns_mut(r, r).copy_from(&identity);
        let inverse = |lower: &ComplexMatrix, by: &ComplexMatrix| {
            let half = forward(lower, by);
            times(&half.adjoint(), &half)
        };
        let weights = |of_d: f64, of_g: f64| {
            let one = |direction: &Direction| {
                let factor = if direction.of_g { of_g } else { of_d };
                let scaled = |(row, column, entry): &SparseEntry| (*row, *column, entry * factor);
                let entries = direction.entries.iter().filter(|_| factor != 0.0);
                entries.map(scaled).collect()
            };
            self.directions.iter().map(one).collect::<Vec<Vec<_>>>()
        };
        let large = self.largest_g;
        let simple = |lower: &ComplexMatrix, weights| Inequality {
            k: inverse(lower, &identity),
            diagonal: true,
            weights,
        };
        let of_bound =
            self.directions.iter().map(|direction| weight(direction, r, bound)).collect();
        let [form, above, below, rest] = factors;
        [
            Inequality { k: inverse(form, &both), diagonal: false, weights: of_bound },
            simple(above, weights(large, 1.0)),
            simple(below, weights(large, -1.0)),
            simple(rest, weights(-1.0, 0.0)),
        ]
    }

    /// Newton's method from a point inside to near the analytic centre for `bound`; None if the point is not inside.
    pub(super) fn centre(&self, start: Point, bound: f64) -> Option<Point> {
        let mut point = start;
        let mut factors = self.factors(&point, bound)?;
        for _ in 0..NEWTON_STEPS {
            let (gradient, hessian) = self.derivatives(&self.inequalities(&factors, bound));
            let Some(cholesky) = Cholesky::new(hessian) else { break };
            let step = cholesky.solve(&gradient);
            let decrement = step.dot(&gradient).max(0.0).sqrt();
            if decrement.is_nan() {
                break;
            }
            let mut length = if decrement < 0.25 { 1.0 } else { 1.0 / (1.0 + decrement) };
            // Twice the safe step of a self-concordant function is often better.
            if decrement > 1.0 {
                length *= 2.0;
            }
            let before = Self::value(&factors);
            let moved_by = |length: f64| {
                let next = self.point(&point.coefficients - &step * length);
                let inside = self.factors(&next, bound)?;
                (Self::value(&inside) < before).then_some((next, inside))
            };
            let mut lengths = successors(Some(length), |length| Some(0.5 * length)).take(HALVINGS);
            let Some(moved) = lengths.find_map(moved_by) else { break };
            (point, factors) = moved;
            if decrement < NEAR {
                break;
            }
        }
        Some(point)
    }

    /// Gradient and Hessian of the barrier, -`tr(W_a K)` and `tr(W_a K W_b K)`, added over the inequalities.
    fn derivatives(&self, inequalities: &[Inequality; 4]) -> (DVector<f64>, DMatrix<f64>) {
        let count = self.directions.len();
        let mut gradient = DVector::zeros(count);
        let mut hessian = DMatrix::zeros(count, count);
        for Inequality { k, diagonal, weights } in inequalities {
            for a in 0..count {
                let slope: Complex<f64> =
                    weights[a].iter().map(|(row, column, w)| w * k[(*column, *row)]).sum();
                gradient[a] -= slope.re;
                for b in 0..=a {
                    if *diagonal && self.directions[a].block != self.directions[b].block {
                        continue;
                    }
                    let mut sum = 0.0;
                    for &(p, q, w) in &weights[a] {
                        for &(s, t, v) in &weights[b] {
                            sum += (w * k[(q, s)] * v * k[(t, p)]).re;
                        }
                    }
                    hessian[(a, b)] += sum;
                }
            }
        }
        for a in 0..count {
            for b in 0..a {
                hessian[(b, a)] = hessian[(a, b)];
            }
            hessian[(a, a)] *= 1.0 + RIDGE;
        }
        (gradient, hessian)
    }
}

/// W with [M; I]* W [M; I] = the part of [`form`] that a direction of D or G adds.
fn weight(direction: &Direction, r: usize, bound: f64) -> Vec<SparseEntry> {
    let turn = Complex::i();
    let of = |(row, column, entry): &SparseEntry| {
        let (row, column) = (*row, *column);
        if direction.of_g {
            [(row, r + column, entry * turn), (r + row, column, -entry * turn)]
        } else {
            [(row, column, -*entry), (r + row, r + column, entry * (bound * bound))]
        }
    };
    direction.entries.iter().flat_map(of).collect()
}
