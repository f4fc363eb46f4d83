//! The error of the Gauss method for a plant whose entries vary.

use crate::check::as_number;
use nalgebra::DMatrix;

const TERMS: usize = 300;
/// Relative size of a term at which the series ends.
const NEGLIGIBLE: f64 = 1e-16;
/// The relative increase of the bound that allows for rounding errors of the series.
const ROUNDING: f64 = 1e-6;

/// Bounds |E(Z + dZ) - E(Z)| for |dZ| <= Y, entry by entry, E(Z) = e^Z - (its Padé approximation [s/s], s = `stages`).
///
/// With E(x) = sum of `c_k` x^k, k from 2 s + 1 on, and X = |Z| the bound is the sum of |`c_k`| ((X + Y)^k - X^k). None
/// if the series does not converge: the poles of the approximations have moduli of 2, 3.46 and 4.64.
pub(super) fn remainder(x: &DMatrix<f64>, y: &DMatrix<f64>, stages: usize) -> Option<DMatrix<f64>> {
    let n = x.nrows();
    let both = x + y;
    let (mut power, mut difference) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
    let mut sum: DMatrix<f64> = DMatrix::zeros(n, n);
    for (k, coefficient) in coefficients(stages).into_iter().enumerate() {
        if k > 0 {
            difference = &difference * &both + &power * y;
            power = &power * x;
        }
        let term = &difference * coefficient.abs();
        let size = term.amax();
        sum += term;
        if !sum.amax().is_finite() {
            return None;
        }
        if k > 2 * stages + 2 && size <= NEGLIGIBLE * sum.amax() {
            return Some(sum * (1.0 + ROUNDING));
        }
    }
    None
}

/// The first [`TERMS`] coefficients of the power series of e^x - N(x) / N(-x), N(x) / N(-x) the Padé approximant.
fn coefficients(stages: usize) -> Vec<f64> {
    let numerator: &[f64] = match stages {
        1 => &[1.0, 0.5],
        2 => &[1.0, 0.5, 1.0 / 12.0],
        _ => &[1.0, 0.5, 0.1, 1.0 / 120.0],
    };
    let mut quotient: Vec<f64> = Vec::with_capacity(TERMS);
    let mut factorial = 1.0;
    let mut all = Vec::with_capacity(TERMS);
    for k in 0..TERMS {
        let mut next = numerator.get(k).copied().unwrap_or(0.0);
        for (j, value) in numerator.iter().enumerate().skip(1).take(k) {
            let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
            next -= sign * value * quotient[k - j];
        }
        quotient.push(next);
        if k > 0 {
            factorial *= as_number(k);
        }
        all.push(if k <= 2 * stages { 0.0 } else { 1.0 / factorial - next });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exponential::exponential;
    use crate::robustness::structured::gauss::Gauss;
    use nalgebra::DVector;

    /// The end of a step of the Gauss method is e^Z up to an error; the bound holds for the change of this error.
    #[test]
    fn the_error_of_a_changed_step_is_within_its_bound() {
        let z = DMatrix::from_row_slice(3, 3, &[0.0, 0.7, 0.1, -0.9, -0.3, 0.4, 0.0, 0.0, 0.0]);
        let (left, right) =
            (DVector::from_vec(vec![0.0, 0.3, 0.0]), DVector::from_vec(vec![1.0, -0.5, 0.2]));
        let change = &left * right.transpose();
        for stages in 1..=3 {
            let bound = remainder(&z.abs(), &change.abs(), stages).unwrap();
            let step = |z: &DMatrix<f64>| {
                let matrix = |v: &DVector<f64>| DMatrix::from_columns(std::slice::from_ref(v));
                let step =
                    Gauss::new(stages).step(z, [&matrix(&left), &matrix(&right)], 1.0).unwrap();
                (step.b, step.c, step.d)
            };
            let (b, c, d) = step(&z);
            for delta in [-1.0, -0.4, 0.3, 1.0] {
                let exact =
                    exponential(&(&z + &change * delta)).unwrap() - exponential(&z).unwrap();
                let loop_gain = DMatrix::identity(stages, stages) - &d * delta;
                let feedback = loop_gain.try_inverse().unwrap() * &c * delta;
                let error = (exact - &b * feedback).abs();
                let within = error.zip_map(&bound, |error, bound| error <= bound + 1e-15);
                assert!(within.iter().all(|within| *within), "{stages} {delta}: {error} {bound}");
                // The bound is not too large to be useful.
                assert!(bound.amax() < 1e3 * error.amax().max(1e-12) || delta.abs() < 1.0);
            }
        }
    }

    #[test]
    fn a_step_beyond_the_poles_has_no_bound() {
        let (x, y) = (DMatrix::from_element(1, 1, 5.0), DMatrix::from_element(1, 1, 0.1));
        assert!((1..=3).all(|stages| remainder(&x, &y, stages).is_none()));
        assert!(remainder(&(x * 0.75), &y, 3).is_some());
    }
}
