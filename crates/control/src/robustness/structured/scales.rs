//! Scales D and G that bound the structured singular value of one complex matrix.

use super::barrier::{Barrier, Point};
use super::blocks::{Block, balancing_exponents, scaled};
use super::form::{form, form_size};
use super::hermitian::{factor, forward, largest_eigenvalue, times};
use crate::Error;
use crate::blocks::ComplexMatrix;

/// Fraction of the distance from the least bound of the current scales that a step leaves, so that the scales stay
/// inside.
const DISTANCE: f64 = 0.1;
const STEPS: usize = 60;
/// The search ends after a step that reduces the bound by less than this fraction.
const STALLED: f64 = 5e-4;

/// Hermitian matrices D > 0 and G that commute with the structure.
#[derive(Debug, Clone)]
pub(super) struct Scales {
    pub(super) d: ComplexMatrix,
    pub(super) g: ComplexMatrix,
    /// The bound that D and G prove.
    pub(super) bound: f64,
}

impl Scales {
    /// The scales of `m` for the bound `goal`, near their analytic centre; if there are none, those for the least
    /// bound that the method of centres reaches.
    ///
    /// Each step lowers the bound to slightly above the least bound of the current scales, then moves the scales to
    /// the centre for the new bound. Source: S. Boyd and L. El Ghaoui, Method of centers for minimizing
    /// generalized eigenvalues, Linear Algebra and its Applications 188 (1993).
    pub(super) fn search(m: &ComplexMatrix, blocks: &[Block], goal: f64) -> Result<Self, Error> {
        let exponents = balancing_exponents(m, blocks);
        let m = scaled(m, &exponents);
        let first = largest_eigenvalue(&times(&m.adjoint(), &m))?.max(0.0).sqrt();
        let barrier = Barrier::new(&m, blocks, goal.max(first));
        let mut point = barrier.start();
        let mut bound = goal.max(1.01 * first);
        for _ in 0..STEPS {
            let Some(centre) = barrier.centre(point.clone(), bound) else { break };
            point = centre;
            if bound <= goal {
                break;
            }
            let least = least_bound(&m, &point)?;
            let next = if least < goal * (1.0 - 1e-9) {
                goal
            } else {
                (least + DISTANCE * (bound - least)).max(goal)
            };
            if next > goal && bound - next < STALLED * bound {
                break;
            }
            bound = next;
        }
        let back = |matrix: &ComplexMatrix| {
            ComplexMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
                matrix[(i, j)] * (exponents[i] + exponents[j]).exp()
            })
        };
        Ok(Self { d: back(&point.d), g: back(&point.g), bound })
    }

    /// Whether [`form`] is positive definite at M, by more than rounding errors.
    pub(super) fn hold(&self, m: &ComplexMatrix, bound: f64) -> bool {
        let size = form_size(m, &self.d, &self.g, bound);
        factor(&form(m, &self.d, &self.g, bound), &size).is_some()
    }
}

/// The least bound that the scales of a point prove.
fn least_bound(m: &ComplexMatrix, at: &Point) -> Result<f64, Error> {
    let Point { d, g, .. } = at;
    let size: Vec<f64> = d.diagonal().iter().map(|x| x.re).collect();
    let Some(lower) = factor(d, &size) else { return Ok(f64::INFINITY) };
    let inner = -form(m, d, g, 0.0);
    let half = forward(&lower, &inner);
    let whole = forward(&lower, &half.adjoint());
    Ok(largest_eigenvalue(&whole)?.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::check::as_number;

    /// A complex matrix l r' of rank one.
    fn of_rank_one(count: usize, seed: f64) -> ComplexMatrix {
        let entry = |at: usize, turn: f64| {
            let x = as_number(at) + seed;
            Complex::from_polar(10.0_f64.powf((3.1 * x).sin()), turn * x * x)
        };
        ComplexMatrix::from_fn(count, count, |i, j| entry(i, 1.7) * entry(j, 2.9))
    }

    /// The structured singular value of a matrix of rank one with the diagonal c is the sum of |c| for complex numbers.
    /// For real ones it is, by the duality of linear programs, the least sum of |Re c + g Im c| over g, at a kink.
    /// Both are equal to their bounds: P. M. Young, The rank one mixed mu problem and "Kharitonov-type" analysis,
    /// Automatica 30 (1994).
    #[test]
    fn the_bounds_of_a_matrix_of_rank_one_are_its_closed_forms() {
        for (count, seed) in [(1, 0.2), (2, 0.7), (3, 1.1), (5, 2.3), (9, 0.4), (16, 3.3)] {
            let m = of_rank_one(count, seed);
            let c = m.diagonal();
            let complex: f64 = c.iter().map(|x| x.norm()).sum();
            let sum = |g: f64| c.iter().map(|x| (x.re + g * x.im).abs()).sum::<f64>();
            let real = c.iter().map(|x| sum(-x.re / x.im)).fold(f64::INFINITY, f64::min);
            let bound = |block: Block| {
                let blocks = vec![block; count];
                let mut goal = 1e-3 * complex;
                loop {
                    let scales = Scales::search(&m, &blocks, goal).unwrap();
                    if scales.bound <= goal {
                        assert!(scales.hold(&m, goal));
                        break goal;
                    }
                    goal = scales.bound * 1.001;
                }
            };
            let (actual, both) = (bound(Block::Full(1)), [count, 1]);
            assert!((1.0..1.01).contains(&(actual / complex)), "{both:?} {actual} {complex}");
            let actual = bound(Block::Real(1));
            assert!(actual >= real.max(1e-3 * complex) * 0.999_999, "{both:?} {actual} {real}");
            assert!(
                actual <= real.max(1e-3 * complex) * 1.02,
                "{both:?} {actual} {real} {complex}"
            );
        }
    }

    /// For one real number delta on all channels the structured singular value is the largest real eigenvalue of M; no
    /// diagonal scaling proves this bound.
    #[test]
    fn a_repeated_real_number_is_bounded_by_the_real_eigenvalues() {
        let t = ComplexMatrix::from_fn(3, 3, |i, j| {
            Complex::from_polar(1.0, as_number(3 * i + 2 * j * j) + f64::from(u8::from(i == j)))
        });
        let eigenvalues = [Complex::new(0.8, 0.0), Complex::new(0.0, 2.0), Complex::new(1.0, -3.0)];
        let diagonal = ComplexMatrix::from_diagonal(&eigenvalues.to_vec().into());
        let m = &t * diagonal * t.clone().try_inverse().unwrap();
        let mut goal = 0.01;
        while let Ok(scales) = Scales::search(&m, &[Block::Real(3)], goal) {
            if scales.bound <= goal {
                break;
            }
            goal = scales.bound * 1.001;
        }
        assert!((1.0..1.02).contains(&(goal / 0.8)), "{goal}");
    }
}
