//! The structured singular value for independent complex changes in each channel.

use crate::Error;
use crate::check::as_number;
use nalgebra::{Complex, DMatrix, DVector, SymmetricEigen};

/// The width of the bracket of ln(mu) at which the search ends.
const WIDTH: f64 = 1e-5;
const STEPS_PER_DIMENSION: usize = 400;
const BALANCINGS: usize = 30;
const EIGEN_ITERATIONS: usize = 1000;
/// Half of the range of ln(d), about the balanced start, in which the best scaling is searched.
const RANGE: f64 = 12.0;
/// The balancing does not reduce effects on other channels below this fraction of the largest diagonal entry.
const NEGLIGIBLE: f64 = 1e-3;

/// The largest value over frequency of a structured singular value.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScaledPeak {
    /// The largest value over the evaluated frequencies.
    pub value: f64,
    /// The frequency of `value`, in rad per unit of time; infinite for the D of a continuous system.
    pub frequency: f64,
    /// An upper bound over all frequencies, up to rounding.
    pub certified: f64,
}

/// Minimises the largest singular value of D M D^-1 over the positive diagonal matrices D: an upper
/// bound of the structured singular value, equal to it up to three channels.
///
/// Returns the bound and the logarithms of D. ln(bound) is a convex function of ln D with the gradient |u|^2 - |v|^2
/// for the singular vectors u and v. Method: Osborne's balancing, then the ellipsoid method until lower and upper bound
/// differ by at most 1e-5, relative.
///
/// Source: J. C. Doyle, Analysis of feedback systems with structured uncertainties, IEE Proc. D 129
/// (1982).
pub(super) fn scaled_norm(m: &DMatrix<Complex<f64>>) -> Result<(f64, DVector<f64>), Error> {
    scaled_norm_above(m, 0.0)
}

/// Same as [`scaled_norm`], but the search ends as soon as the bound is at most `enough`.
pub(super) fn scaled_norm_above(
    m: &DMatrix<Complex<f64>>,
    enough: f64,
) -> Result<(f64, DVector<f64>), Error> {
    let k = m.nrows();
    let start = balancing_exponents(m);
    let first = Scaled::new(m, &start)?;
    if k == 1 || first.norm <= enough {
        return Ok((first.norm, start));
    }
    let free = k - 1;
    let mut center = DVector::zeros(free);
    let mut shape = DMatrix::from_diagonal_element(free, free, RANGE * RANGE);
    let mut best = (first.norm, start.clone());
    let mut lower = f64::NEG_INFINITY;
    let n = as_number(free);
    for _ in 0..STEPS_PER_DIMENSION * free {
        let exponents = &start + center.clone().resize_vertically(k, 0.0);
        let scaled = Scaled::new(m, &exponents)?;
        if scaled.norm < best.0 {
            best = (scaled.norm, exponents);
        }
        let gradient = scaled.gradient.rows(0, free).into_owned();
        let direction = &shape * &gradient;
        let reach = gradient.dot(&direction).max(0.0).sqrt();
        let level = scaled.norm.ln();
        lower = f64::max(lower, level - reach);
        if best.0 <= enough || best.0.ln() - lower <= WIDTH || reach <= 0.0 {
            break;
        }
        // A deep cut: the minimum is where the linear bound is below the best value.
        let depth = (level - best.0.ln()) / reach;
        if free == 1 {
            let half = 0.5 * (1.0 - depth) * reach / gradient[0].abs();
            center[0] -= gradient[0].signum() * (reach / gradient[0].abs() - half);
            shape[(0, 0)] = half * half;
            continue;
        }
        center -= &direction * ((1.0 + n * depth) / ((n + 1.0) * reach));
        let shrink = 2.0 * (1.0 + n * depth) / ((n + 1.0) * (1.0 + depth)) / (reach * reach);
        shape -= &direction * direction.transpose() * shrink;
        shape *= n * n * (1.0 - depth * depth) / (n * n - 1.0);
    }
    Ok(best)
}

/// An upper bound of [`scaled_norm`]: the largest singular value of the balanced matrix, without a search.
pub(super) fn balanced_norm(m: &DMatrix<Complex<f64>>) -> Result<f64, Error> {
    Ok(Scaled::new(m, &balancing_exponents(m))?.norm)
}

/// The diagonal of ln D, its last entry 0, for about equal norms of rows and columns of D M D^-1 (Osborne 1960).
fn balancing_exponents(m: &DMatrix<Complex<f64>>) -> DVector<f64> {
    let k = m.nrows();
    let mut exponents = DVector::<f64>::zeros(k);
    let largest = m.diagonal().iter().map(Complex::norm_sqr).fold(0.0, f64::max);
    // Without this least size, coupling in one direction only would not be scaled.
    let least = NEGLIGIBLE * NEGLIGIBLE * largest;
    for _ in 0..BALANCINGS {
        for at in 0..k {
            let size = |row: usize, column: usize| {
                m[(row, column)].norm_sqr() * (2.0 * (exponents[row] - exponents[column])).exp()
            };
            let others = || (0..k).filter(|other| *other != at);
            let row: f64 = others().map(|other| size(at, other)).sum();
            let column: f64 = others().map(|other| size(other, at)).sum();
            let change = 0.25 * (column.max(least) / row.max(least)).ln();
            if change.is_finite() {
                exponents[at] += change;
            }
        }
    }
    let last = exponents[k - 1];
    exponents.add_scalar(-last)
}

/// The largest singular value of D M D^-1 and the gradient of its logarithm.
struct Scaled {
    norm: f64,
    gradient: DVector<f64>,
}

impl Scaled {
    fn new(m: &DMatrix<Complex<f64>>, exponents: &DVector<f64>) -> Result<Self, Error> {
        let k = m.nrows();
        let factor = |row: usize, column: usize| (exponents[row] - exponents[column]).exp();
        let scaled = DMatrix::from_fn(k, k, |i, j| m[(i, j)] * factor(i, j));
        let (norm, right) = largest_singular(&scaled)?;
        let left = &scaled * &right;
        let gradient = DVector::from_fn(k, |i, _| {
            if norm > 0.0 { left[i].norm_sqr() / (norm * norm) - right[i].norm_sqr() } else { 0.0 }
        });
        Ok(Self { norm, gradient })
    }
}

/// The largest singular value of M and its right singular vector, from the eigenvalues of M* M: precise
/// for the largest one, and much faster than a singular value decomposition.
fn largest_singular(m: &DMatrix<Complex<f64>>) -> Result<(f64, DVector<Complex<f64>>), Error> {
    let unit = m.iter().map(|entry| entry.re.abs().max(entry.im.abs())).fold(0.0, f64::max);
    if unit <= 0.0 {
        return Ok((0.0, DVector::zeros(m.ncols())));
    }
    let one = m.unscale(unit);
    let eigen = SymmetricEigen::try_new(one.adjoint() * &one, f64::EPSILON, EIGEN_ITERATIONS);
    let what = "the largest singular value";
    let eigen = eigen.ok_or(Error::NotConverged { what, iterations: EIGEN_ITERATIONS })?;
    let at = eigen.eigenvalues.imax();
    let right = eigen.eigenvectors.column(at).into_owned();
    Ok((unit * (&one * &right).norm(), right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up to three channels the bound is the structured singular value; for a matrix a b' of rank one
    /// this is the sum of all |`a_i` `b_i`|.
    #[test]
    fn a_matrix_of_rank_one_has_the_sum_of_the_moduli_of_its_diagonal() {
        let (a, b) = ([1.0, 200.0, 0.03], [5.0, -0.002, 7.0]);
        for k in 1..=3 {
            let m = DMatrix::from_fn(k, k, |i, j| {
                Complex::from_polar(a[i], 0.3) * Complex::from_polar(b[j], 1.1)
            });
            let exact: f64 = (0..k).map(|i: usize| f64::abs(a[i] * b[i])).sum();
            let (bound, _) = scaled_norm(&m).unwrap();
            assert!((bound / exact - 1.0).abs() < 2e-5, "{k}: {bound} {exact}");
            assert!(balanced_norm(&m).unwrap() >= bound * (1.0 - 1e-12));
        }
    }

    #[test]
    fn a_search_that_may_end_early_ends_between_the_least_bound_and_the_value_that_is_enough() {
        let m = DMatrix::from_fn(6, 6, |i, j| {
            let at = f64::from(u32::try_from(7 * i + 3 * j * j).unwrap());
            Complex::from_polar(1.0 + at.sin().abs(), at)
        });
        let (least, _) = scaled_norm(&m).unwrap();
        for enough in [1.0001 * least, 1.05 * least] {
            let (bound, scaling) = scaled_norm_above(&m, enough).unwrap();
            assert!(bound <= enough && bound >= least * (1.0 - 2e-5), "{bound} {least}");
            assert!((Scaled::new(&m, &scaling).unwrap().norm - bound).abs() < 1e-12 * bound);
        }
        assert!((scaled_norm_above(&m, 0.9 * least).unwrap().0 / least - 1.0).abs() < 2e-5);
    }

    /// The structured singular value of a triangular matrix is its largest diagonal entry. The best D is
    /// infinite; within the range of the search the bound comes close.
    #[test]
    fn coupling_in_one_direction_does_not_count() {
        let m = DMatrix::from_row_slice(2, 2, &[2.0, 100.0, 0.0, 1.0]).map(Complex::from);
        let (bound, _) = scaled_norm(&m).unwrap();
        assert!((bound - 2.0).abs() < 1e-2, "{bound}");
    }

    /// As one position in m that moves a pressure in Pa, which moves a force in mN.
    #[test]
    fn coupling_in_one_direction_does_not_count_in_any_units() {
        for unit in [1e6, 1e9, 1e12] {
            let entries = [2.0, unit, unit * unit, 0.0, 1.0, unit, 0.0, 0.0, 0.5];
            let m = DMatrix::from_row_slice(3, 3, &entries).map(Complex::from);
            for one_way in [m.transpose(), m] {
                let (bound, _) = scaled_norm(&one_way).unwrap();
                assert!((bound - 2.0).abs() < 1e-4, "{unit}: {bound}");
            }
        }
    }
}
