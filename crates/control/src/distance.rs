//! The distance of a pair (A, B) or (A, C) from the nearest uncontrollable or unobservable pair.
//!
//! The rank only decides whether a pair is controllable; the distance is the size of the smallest
//! change of the matrices that destroys controllability.

mod reduced;

use crate::balance::{Balance, divide_rows, unit_columns};
use crate::blocks::to_complex;
use crate::eigen::eigenvalues;
use crate::svd::{ComplexSvd, norm_2};
use crate::{Error, check};
use nalgebra::{Complex, DMatrix};
use reduced::ReducedPencil;
use std::cmp::Ordering;

/// Largest number of evaluations of the smallest singular value in the search of the complex plane.
const EVALUATIONS: usize = 1000;
/// A distance of the scaled pair below this is a rounding error, so that no lower bound is searched.
const ROUNDING: f64 = 1e-14;
/// The search ends when the lower bound reaches this fraction of the upper bound.
const CLOSE: f64 = 0.9;
/// Largest number of steps of a descent.
const DESCENT_STEPS: usize = 30;
/// Number of states up to which the complex plane is searched for a lower bound.
const LARGEST_SEARCH: usize = 24;
/// The descent ends when a step lowers the value by less than this fraction.
const WORTHWHILE: f64 = 1e-3;

/// Bounds of the distance of a scaled pair from the nearest uncontrollable or unobservable one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Distance {
    /// Lower bound, proven up to rounding by a search of the whole complex plane. Zero if the
    /// search ended at its limit of evaluations before a larger bound was proven, if the upper bound
    /// is within rounding, and with more than 24 states, for which the plane is not searched.
    pub lower: f64,
    /// Upper bound of the distance, attained at `at`.
    pub upper: f64,
    /// The point of the complex plane, in the unit of A and not below the real axis: the eigenvalue
    /// that becomes uncontrollable or unobservable first.
    pub at: Complex<f64>,
}

/// Bounds the distance of (A, B) from the nearest uncontrollable pair.
///
/// ```text
/// min over all complex s of the smallest singular value of [A / r - s I, B],   r = norm of A
/// ```
///
/// `a`: n x n; `b`: n x m. First the states are balanced, A divided by its norm (2-norm; by one
/// when A is zero) and the columns of B scaled to length one, so that the units of states, inputs
/// and time do not matter. The distance is the 2-norm of the smallest complex change of the scaled
/// [A, B] that makes the pair uncontrollable: 1 is large, 1e-12 is within rounding.
///
/// The upper bound is the smallest value found by descents s := u* A u, u the left singular vector. A descent starts at
/// each eigenvalue of A on or above the real axis, and at each better point of the search for the lower bound. This
/// search is a branch and bound: the singular value changes by at most the change of s, so that in a square it is at
/// least its value at the centre minus half the diagonal; for |s| > 1 + upper it is larger than `upper`. The square
/// with the lowest bound is divided until the bounds agree to 10 %, with at most 1000 evaluations of about 100 (n + m)
/// n^2 multiplications each, besides those of the descents. For a small distance the lower bound may remain far below
/// the upper bound; below 1e-14 it is zero.
///
/// With more than 24 states the lower bound is zero, and inverse iteration computes the singular values of the descents
/// in coordinates in which [B, A] is zero below its diagonal, with about 8 (m + 4) n^2 multiplications each.
///
/// Source: R. Eising, Between controllable and uncontrollable, Systems and Control Letters 4
/// (1984); the lower bound follows from Weyl's inequality for singular values.
///
/// # Example
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
/// let distance = control::distance::from_uncontrollable(&a, &b)?;
/// // [A, B] at s = 0 has the rows (0, 1, 0) and (0, 0, 1), which are orthonormal.
/// assert!(distance.lower > 0.5 && distance.upper <= 1.0);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix;
/// [`Error::NotConverged`] when an inner iteration does not end.
pub fn from_uncontrollable(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Distance, Error> {
    check::with_inputs(a, b)?;
    Pencil::new(a, b)?.search()
}

/// Bounds the distance of (A, C) from the nearest unobservable pair.
///
/// `a`: n x n; `c`: p x n. Equals the distance of (A', C') from uncontrollability, see [`from_uncontrollable`].
///
/// # Errors
///
/// Same as [`from_uncontrollable`].
pub fn from_unobservable(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Distance, Error> {
    check::with_outputs(a, c)?;
    Pencil::new(&a.transpose(), &c.transpose())?.search()
}

/// A pair (A, B), scaled for the search.
struct Pencil {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    /// The norm by which A was divided.
    unit: f64,
    /// The pair in coordinates for fast evaluations; None up to 24 states.
    reduced: Option<ReducedPencil>,
}

impl Pencil {
    fn new(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Self, Error> {
        let Balance { matrix, scale } = Balance::new(a);
        let size = norm_2(&matrix)?;
        let unit = if size.is_normal() { size } else { 1.0 };
        let (a, b) = (matrix / unit, unit_columns(&divide_rows(b, &scale)));
        let reduced = (a.nrows() > LARGEST_SEARCH).then(|| ReducedPencil::new(&a, &b));
        Ok(Self { a, b, unit, reduced })
    }

    /// Smallest singular value of [A - s I, B], and u* A u with its left singular vector u.
    fn at(&self, s: Complex<f64>) -> Result<(f64, Complex<f64>), Error> {
        if let Some(reduced) = &self.reduced {
            return Ok(reduced.at(s));
        }
        let n = self.a.nrows();
        let adjoint = DMatrix::from_fn(n + self.b.ncols(), n, |i, j| {
            let entry = if i < n { self.a[(j, i)] } else { self.b[(j, i - n)] };
            let shift = if i == j { s.conj() } else { Complex::new(0.0, 0.0) };
            Complex::new(entry, 0.0) - shift
        });
        let (value, u) = ComplexSvd::new(&adjoint)?.nth_smallest(0);
        let image = to_complex(&self.a) * &u;
        Ok((value, u.dotc(&image)))
    }

    /// Descends from s to a local minimum: for a fixed u the smallest value is at s = u* A u.
    fn descend(&self, s: Complex<f64>) -> Result<Minimum, Error> {
        let mut best = Minimum { value: f64::INFINITY, s };
        let mut s = s;
        for _ in 0..DESCENT_STEPS {
            let (value, next) = self.at(s)?;
            if value >= (1.0 - WORTHWHILE) * best.value {
                break;
            }
            best = Minimum { value, s };
            s = next;
        }
        Ok(best)
    }

    /// Bounds the minimum over all s, see [`from_uncontrollable`].
    fn search(&self) -> Result<Distance, Error> {
        let mut best = Minimum { value: f64::INFINITY, s: Complex::new(0.0, 0.0) };
        for start in eigenvalues(&self.a)?.into_iter().filter(|start| start.im >= 0.0) {
            let minimum = self.descend(start)?;
            if minimum.value < best.value {
                best = minimum;
            }
        }
        let half = 0.5 * (1.0 + best.value);
        let centres = [Complex::new(-half, half), Complex::new(half, half)];
        let mut squares = centres.map(|centre| Square { bound: 0.0, centre, half }).to_vec();
        let mut lower = 0.0;
        let searched = self.reduced.is_none();
        for _ in 0..if searched { EVALUATIONS / 4 } else { 0 } {
            let first = (0..squares.len()).min_by(|&i, &j| squares[i].order(&squares[j]));
            let Some(first) = first else { break };
            let square = squares.swap_remove(first);
            lower = square.bound;
            if lower >= CLOSE * best.value || best.value <= ROUNDING {
                break;
            }
            for centre in square.quarters() {
                let half = 0.5 * square.half;
                let (value, _) = self.at(centre)?;
                if value < best.value {
                    best = self.descend(centre)?;
                }
                let bound = (value - half * std::f64::consts::SQRT_2).max(square.bound);
                squares.push(Square { bound, centre, half });
            }
        }
        let at = Complex::new(best.s.re, best.s.im.abs()) * self.unit;
        Ok(Distance { lower: lower.min(best.value), upper: best.value, at })
    }
}

/// A local minimum over s of the smallest singular value of [A - s I, B].
struct Minimum {
    value: f64,
    s: Complex<f64>,
}

/// A square of the complex plane in which no singular value is below `bound`.
#[derive(Clone)]
struct Square {
    bound: f64,
    centre: Complex<f64>,
    /// Half of the side length of the square.
    half: f64,
}

impl Square {
    fn quarters(&self) -> [Complex<f64>; 4] {
        let h = 0.5 * self.half;
        [(-h, -h), (-h, h), (h, -h), (h, h)].map(|(x, y)| self.centre + Complex::new(x, y))
    }

    /// Orders squares by their bound, the lowest first, then by their centre, from right to left and from the top down.
    fn order(&self, other: &Self) -> Ordering {
        let (here, there) = (self.centre, other.centre);
        let by_centre = there.re.total_cmp(&here.re).then(there.im.total_cmp(&here.im));
        self.bound.total_cmp(&other.bound).then(by_centre)
    }
}
