//! Signals that are held, for plants of many states.

use crate::balance::Balance;
use crate::hold;
use crate::{Error, check};
use nalgebra::DMatrix;

/// From this order on, the effect of a held input is computed by [`mean`].
const LARGE: usize = 48;
/// Degree of the Taylor polynomial of [`mean`], exact to rounding up to a norm of `REACH`.
const DEGREE: u32 = 14;
const REACH: f64 = 0.5;

/// J(h), the mean of e^(A s) over s from 0 to h; `a`: A and its balance.
///
/// J(h) = (e^(A h) - I) (A h)^-1, also for a singular A: e^(A h) = I + h A J and the response to a held
/// input is h J B. Method: the Taylor polynomial of a part of h, then doublings
///
/// ```text
/// J(2 h) = J(h) (I + e^(A h)) / 2
/// ```
///
/// With I + (h / 2) A J in place of the second factor, rounding errors of a fast mode would grow with h.
///
/// Cost: 15 + 2 s products, s = log2(norm of A h) + 1, by nalgebra's fast kernels. Their last bits depend
/// on the processor; the bits of [`hold::zero_order_hold`] are the same everywhere.
pub(super) fn mean(a: &Balance, h: f64) -> Result<DMatrix<f64>, Error> {
    let (n, norm) = (a.matrix.nrows(), a.matrix.norm());
    let mut doublings = 0;
    let mut part = h;
    while part * norm > REACH {
        part *= 0.5;
        doublings += 1;
    }
    let scaled = &a.matrix * part;
    let identity = DMatrix::identity(n, n);
    let mut mean = identity.clone();
    // 1 + x / 2 (1 + x / 3 (1 + ...)).
    for k in (2..=DEGREE + 1).rev() {
        mean = &identity + &scaled * mean / f64::from(k);
    }
    let mut exponential = &identity + &scaled * &mean;
    for _ in 0..doublings {
        mean = (&mean + &mean * &exponential) * 0.5;
        exponential = &exponential * &exponential;
    }
    check::in_range("e^(A h)", a.restore(&mean))
}

/// Same as [`hold::zero_order_hold`], computed by [`mean`] from 48 states on.
pub(super) fn hold_inputs(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    h: f64,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let n = a.nrows();
    if n < LARGE {
        return hold::zero_order_hold(a, b, h);
    }
    check::positive("h", h)?;
    let mean = mean(&Balance::new(a), h)? * h;
    Ok((DMatrix::identity(n, n) + a * &mean, mean * b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fast and a slow mode in coordinates that mix them: each mode has the mean (e^(r h) - 1) / (r h).
    #[test]
    fn a_hold_of_many_time_constants_of_a_fast_mode_has_its_closed_form() {
        let t = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.5, 2.0]);
        let inverse = t.clone().try_inverse().unwrap();
        let of = |function: &dyn Fn(f64) -> f64| {
            let modes = DMatrix::from_diagonal(&[-500.0, -0.1].map(function).to_vec().into());
            &t * modes * &inverse
        };
        let balance = Balance::new(&of(&|rate| rate));
        for h in [1e-3, 0.3, 5.0, 40.0] {
            let exact = of(&|rate| (rate * h).exp_m1() / (rate * h));
            let error = (mean(&balance, h).unwrap() - &exact).norm() / exact.norm();
            assert!(error < 1e-10, "{h}: {error}");
        }
    }

    /// A chain of lightly damped masses and an unstable dense matrix, compared with the Padé approximant.
    #[test]
    fn large_matrices_have_the_exponential_of_the_pade_approximant() {
        let n = 50;
        let chain = DMatrix::from_fn(n, n, |i, j| match (i < n / 2, j < n / 2) {
            (true, _) => f64::from(u8::from(j == i + n / 2)),
            (false, true) if i == j + n / 2 => -2.0e3,
            (false, true) if i.abs_diff(j + n / 2) == 1 => 1.0e3,
            (false, false) if i == j => -0.3,
            _ => 0.0,
        });
        let dense = DMatrix::from_fn(n, n, |i, j| {
            f64::from(u32::try_from((7 * i + 11 * j * j) % 13).unwrap()) - 6.0
        });
        let b = DMatrix::from_fn(n, 2, |i, j| f64::from(u8::from(i % 7 == j)));
        for a in [chain, dense * 0.02] {
            for h in [1e-6, 0.03, 3.0] {
                let (phi, gamma) = hold_inputs(&a, &b, h).unwrap();
                let (exact, held) = hold::zero_order_hold(&a, &b, h).unwrap();
                let error =
                    ((phi - &exact).norm() / exact.norm(), (gamma - &held).norm() / held.norm());
                assert!(error.0 < 1e-10 && error.1 < 1e-10, "{h}: {error:?}");
            }
        }
    }
}
