//! The mean of residuals after a step of a fault.

use crate::blocks::stacked;
use crate::hold::zero_order_hold;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector};

/// The mean of each residual in the samples after a unit step of the input of `effect`: rows are
/// residuals, column k, from 0, is the k-th sample from the step on.
///
/// `effect`: n states, one input, p outputs. In sampled time the result is the step response, and `period` is only
/// checked. In continuous time the result is the average over each interval of `period` s, times the root of `period`:
/// the average of white noise of intensity 1 over an interval has the variance 1 / `period`, so that the result is in
/// standard deviations.
///
/// Method: one exponential for x and its integral (Van Loan 1978).
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for a period that is not above 0;
/// [`Error::Overflow`].
pub fn mean_after_step(
    effect: &StateSpace,
    period: f64,
    samples: usize,
) -> Result<DMatrix<f64>, Error> {
    effect.check()?;
    check::positive("the period", period)?;
    let steps = match effect.domain {
        Domain::Sampled { .. } => effect.clone(),
        Domain::Continuous => averaged(effect, period)?,
    };
    let mut x = DVector::zeros(steps.a.nrows());
    let mut means = DMatrix::zeros(steps.c.nrows(), samples);
    for k in 0..samples {
        means.set_column(k, &(&steps.c * &x + steps.d.column(0)));
        x = &steps.a * &x + steps.b.column(0);
    }
    Ok(means)
}

/// The limit of [`mean_after_step`] after many samples: the mean of the residuals under a constant input 1.
///
/// # Errors
///
/// Same as [`mean_after_step`]; [`Error::NotHurwitz`] or [`Error::NotSchur`] if there is no limit.
pub fn mean_of_constant(effect: &StateSpace, period: f64) -> Result<DVector<f64>, Error> {
    effect.stable_eigenvalues()?;
    check::positive("the period", period)?;
    let x = effect.dc_matrix().lu().solve(&effect.b).ok_or(Error::Overflow { what: "the mean" })?;
    let mean = &effect.c * x + &effect.d;
    let root = match effect.domain {
        Domain::Sampled { .. } => 1.0,
        Domain::Continuous => period.sqrt(),
    };
    Ok(mean.column(0) * root)
}

/// The sampled system from an input, constant over each interval, to the averages of the output over the
/// intervals, times the root of the period.
pub(crate) fn averaged(system: &StateSpace, period: f64) -> Result<StateSpace, Error> {
    let (n, p) = (system.a.nrows(), system.c.nrows());
    let a = stacked(&system.a, &system.c).resize_horizontally(n + p, 0.0);
    let (phi, gamma) = zero_order_hold(&a, &stacked(&system.b, &system.d), period)?;
    let root = 1.0 / period.sqrt();
    Ok(StateSpace {
        a: phi.view((0, 0), (n, n)).into_owned(),
        b: gamma.rows(0, n).into_owned(),
        c: phi.view((n, 0), (p, n)) * root,
        d: gamma.rows(n, p) * root,
        domain: Domain::Sampled { period },
    })
}
