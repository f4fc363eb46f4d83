//! The mean of residuals that errors of the model cause without a fault.

use crate::blocks::{beside, stacked};
use crate::eigen::eigenvalues;
use crate::hold::zero_order_hold;
use crate::residual::ResidualGenerator;
use crate::response::peak_gain;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix, DVector};

/// Relative width of the bracket of a peak gain.
const WIDTH: f64 = 1e-2;

/// A stable plant, in continuous time or in the samples of the filter, whose entries are not known exactly.
///
/// ```text
/// x' = (A + dA) x + (B + dB) u,  y = (C + dC) x + D u,   |dA| <= sizes[0], |dB| <= sizes[1], |dC| <= sizes[2]
/// ```
///
/// entry by entry. The errors dA, dB, dC may vary with time.
#[derive(Debug, Clone, PartialEq)]
pub struct UncertainPlant {
    /// A, B, C, D. A constant deviation from the operating point is a column of B and D with an input bounded by 1.
    pub nominal: StateSpace,
    /// The largest errors of the entries of A, B and C, not below 0.
    pub sizes: [DMatrix<f64>; 3],
}

impl UncertainPlant {
    /// Bounds the moduli of the means of `rows` r with the residuals r of `filter`, in sampled time at the samples.
    /// None if no bound exists.
    ///
    /// `rows`: one row for each result, one column for each residual of `filter`; `bounds`: `u_max`, the
    /// largest modulus of each entry of u. The plant starts at rest.
    ///
    /// ```text
    /// |x| <= x_max = G_u u_max + G_w w_max,  w_max = |dA| x_max + |dB| u_max      (w = dA x + dB u)
    /// |r| <= R_u u_max + R_w w_max + R_z |dC| x_max                               (z = dC x)
    /// ```
    ///
    /// with the peak gains G of the plant from u and w to x, and R of plant and filter together to r. This small-gain
    /// bound exists if the spectral radius of `G_w |dA|` is below 1. A constant command attains the bound if the
    /// impulse response of the plant has no sign changes and the errors add up; for a lightly damped plant, the bound
    /// may be several times too large.
    ///
    /// In sampled time u is constant over a sample, and the effect of w over a sample, the integral of `e^(A s) w`, is
    /// bounded by the integral of `e^(M s) w_max`, M = A with absolute values off the diagonal.
    ///
    /// Source: M. A. Dahleh and M. H. Khammash, Automatica 29 (1993), for peak bounds under structured
    /// errors; the comparison with M: T. Wazewski (1950).
    ///
    /// # Errors
    ///
    /// [`Error::Shape`] for matrices or bounds that do not fit; [`Error::Empty`] without `rows`; the errors of
    /// [`peak_gain`], among them [`Error::NotHurwitz`] and [`Error::NotSchur`] for an unstable plant or filter.
    pub fn largest_mean(
        &self,
        filter: &ResidualGenerator,
        rows: &DMatrix<f64>,
        bounds: &DVector<f64>,
    ) -> Result<Option<DVector<f64>>, Error> {
        let StateSpace { a, b, c, d, .. } = &self.nominal;
        self.nominal.check()?;
        filter.check()?;
        let shapes = [("dA", a.shape()), ("dB", b.shape()), ("dC", c.shape())];
        for (size, (name, shape)) in self.sizes.iter().zip(shapes) {
            check::shape(name, size, shape)?;
        }
        check::shape("the filter's D_y", &filter.d_y, (filter.d_y.nrows(), c.nrows()))?;
        check::shape("the filter's D_u", &filter.d_u, (filter.d_u.nrows(), b.ncols()))?;
        check::shape("rows", rows, (rows.nrows(), filter.d_y.nrows()))?;
        check::column("the bounds of u", bounds.as_slice(), b.ncols())?;
        let Some([w, z]) = self.errors(bounds)? else { return Ok(None) };
        let n = a.nrows();
        let unit = DMatrix::identity(n, n);
        let (phi, gamma, w) = match (filter.domain, self.nominal.domain) {
            (Domain::Continuous, _) | (_, Domain::Sampled { .. }) => (a.clone(), b.clone(), w),
            (Domain::Sampled { period }, Domain::Continuous) => {
                let (phi, gamma) = zero_order_hold(a, b, period)?;
                let (_, integral) = zero_order_hold(&comparison(a), &unit, period)?;
                (phi, gamma, integral * w)
            }
        };
        // Plant and filter in series: rows of A and B for the states of the filter, of C and D for the residuals.
        let rows_of = |[dynamics, from_u, from_y]: [&DMatrix<f64>; 3]| {
            let from_inputs = (from_u + from_y * d).resize_horizontally(b.ncols() + n, 0.0);
            (beside(&(from_y * c), dynamics), beside(&from_inputs, from_y))
        };
        let (filter_a, filter_b) = rows_of([&filter.a, &filter.b_u, &filter.b_y]);
        let (output, direct) =
            rows_of([&(rows * &filter.c), &(rows * &filter.d_u), &(rows * &filter.d_y)]);
        let (order, width) = (n + filter.a.nrows(), direct.ncols());
        let whole = StateSpace {
            a: stacked(&phi.resize_horizontally(order, 0.0), &filter_a),
            b: stacked(&beside(&gamma, &unit).resize_horizontally(width, 0.0), &filter_b),
            c: output,
            d: direct,
            domain: filter.domain,
        };
        let inputs = DVector::from_iterator(width, bounds.iter().chain(&w).chain(&z).copied());
        Ok(Some(peak_gain(&whole, WIDTH)?.upper * inputs))
    }

    /// Bounds of w = dA x + dB u and of z = dC x; None if no bound exists.
    fn errors(&self, bounds: &DVector<f64>) -> Result<Option<[DVector<f64>; 2]>, Error> {
        let StateSpace { a, b, domain, .. } = &self.nominal;
        let [size_a, size_b, size_c] = &self.sizes;
        let (n, m) = b.shape();
        let unit = DMatrix::identity(n, n);
        let states = StateSpace::strictly_proper(a.clone(), beside(b, &unit), unit, *domain);
        let gains = peak_gain(&states, WIDTH)?.upper;
        let (from_u, from_w) = (gains.columns(0, m), gains.columns(m, n));
        let feedback = from_w * size_a;
        let radius = eigenvalues(&feedback)?.into_iter().map(Complex::norm).fold(0.0, f64::max);
        if radius >= 1.0 {
            return Ok(None);
        }
        let direct = size_b * bounds;
        let open = from_u * bounds + from_w * &direct;
        let largest = (DMatrix::identity(n, n) - feedback).lu().solve(&open);
        Ok(largest.map(|x| [size_a * &x + direct, size_c * x]))
    }
}

/// A with the absolute values of the entries off the diagonal: |e^(A s)| <= e^(M s) for s >= 0.
fn comparison(a: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |row, column| {
        let entry = a[(row, column)];
        if row == column { entry } else { entry.abs() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(value: f64) -> DMatrix<f64> {
        DMatrix::from_element(1, 1, value)
    }

    /// x' = -x + u with an observer of gain 1 as the filter: r = y - `x_hat`.
    fn filter() -> ResidualGenerator {
        ResidualGenerator {
            a: scalar(-2.0),
            b_u: scalar(1.0),
            b_y: scalar(1.0),
            c: scalar(-1.0),
            d_u: scalar(0.0),
            d_y: scalar(1.0),
            domain: Domain::Continuous,
        }
    }

    fn plant(sizes: [f64; 3]) -> UncertainPlant {
        let [a, b, c, d] = [-1.0, 1.0, 1.0, 0.0].map(scalar);
        let nominal = StateSpace { a, b, c, d, domain: Domain::Continuous };
        UncertainPlant { nominal, sizes: sizes.map(scalar) }
    }

    fn bound(sizes: [f64; 3]) -> Option<f64> {
        let inputs = DVector::from_element(1, 3.0);
        let bounds = plant(sizes).largest_mean(&filter(), &scalar(1.0), &inputs);
        bounds.unwrap().map(|bound| bound[0])
    }

    /// e' = -2 e + w, |w| <= 0.1 x + 0.2 u, x <= (1 + 0.2) u / (1 - 0.1).
    #[test]
    fn a_plant_of_first_order_reaches_the_bound() {
        let largest = 3.0 * 1.2 / 0.9;
        let expected = 0.5 * (0.1 * largest + 0.2 * 3.0);
        let bound = bound([0.1, 0.2, 0.0]).unwrap();
        assert!(bound >= expected && bound < 1.03 * expected, "{bound} {expected}");
    }

    #[test]
    fn bounds_of_another_number_of_inputs_are_refused() {
        let plant = plant([1.0; 3]);
        let bounds = plant.largest_mean(&filter(), &scalar(1.0), &DVector::zeros(2));
        assert!(matches!(bounds, Err(Error::Shape { .. })), "{bounds:?}");
        let rows = plant.largest_mean(&filter(), &DMatrix::zeros(1, 2), &DVector::zeros(1));
        assert!(matches!(rows, Err(Error::Shape { .. })), "{rows:?}");
    }

    #[test]
    fn without_errors_nothing_is_left_and_with_too_large_ones_there_is_no_bound() {
        assert!(bound([0.0, 0.0, 0.0]).unwrap() < 1e-9);
        assert!(bound([1.0, 0.0, 0.0]).is_none());
    }
}
