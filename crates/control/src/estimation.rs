//! Laws that estimate faults: alternatives to the augmented state observer of [`crate::aso`].
//!
//! e is the innovation y - C `x_hat`. Every law can be written as [`crate::aso::Gains`], so that the controller and all
//! analyses of this crate apply. For constant faults, without the feedback:
//!
//! | law | estimate of the fault | exists if |
//! |---|---|---|
//! | augmented, [`crate::aso`] | `f_hat`' = `L_f` e | (`A_0`, `C_0`) is detectable |
//! | [`proportional_integral`] | `f_hat` = `f_hat_i` + `P_f` e, `f_hat_i`' = `L_f` e | the same |
//! | [`fast_adaptive`] | `f_hat` = Gamma F (e + sigma integral of e) | rank C `F_a` = q, zeros of (A, `F_a`, C) stable |
//! | [`sliding_mode`] | `f_hat` = rho F e / (\|F e\| + delta) | the same, rho above the fault |
//! | [`learning`] | `f_hat` = `K_1` (`f_hat` a sample before) + `K_2` e | the same |
//!
//! and `x_hat`' = A `x_hat` + B u + `F_a` `f_hat` + `L_x` e. Fast adaptive, sliding-mode and learning laws are designed
//! in the coordinates of [`DirectForm`]; sliding mode and learning are for sampled controllers.

mod direct_form;
mod fast_adaptive;
mod learning;
mod proportional_integral;
mod sliding_mode;

pub use direct_form::DirectForm;
pub use fast_adaptive::{FastAdaptive, fast_adaptive};
pub use learning::{Learning, learning};
pub use proportional_integral::proportional_integral;
pub use sliding_mode::{SlidingMode, sliding_mode};

use crate::eigen::eigenvalues;
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// The largest decay of an error in one sample that [`mean_rate`] counts: by the factor e^-4, 1.8 %.
const FASTEST: f64 = 4.0;

/// A law whose observer has another `A_f` than the fault model.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct OwnModel {
    /// The gains; for a nonlinear law, the gains of its linearisation about a zero estimate.
    pub gains: Gains,
    /// `A_f` of the observer, q x q.
    pub a_f: DMatrix<f64>,
}

/// The rate in 1/s at which the errors of an observer decay: the geometric mean of |lambda| over the
/// eigenvalues, in sampled time of |ln lambda| / T, at most 4 / T each.
///
/// `dynamics`: the matrix of the estimation error, stable.
///
/// # Errors
///
/// Same as [`eigenvalues`].
pub fn mean_rate(dynamics: &DMatrix<f64>, domain: Domain) -> Result<f64, Error> {
    let all = eigenvalues(dynamics)?;
    let rate = |value: &nalgebra::Complex<f64>| match domain {
        Domain::Continuous => value.norm(),
        Domain::Sampled { period } => (value.norm().ln().max(-FASTEST) / period)
            .hypot(value.arg() / period)
            .min(FASTEST / period),
    };
    let sum: f64 = all.iter().map(|value| rate(value).ln()).sum();
    Ok((sum / check::as_number(all.len())).exp())
}

/// The eigenvalue of an error that decays with `rate`: -rate, in sampled time e^(-rate T).
pub(crate) fn eigenvalue(rate: f64, domain: Domain) -> f64 {
    match domain {
        Domain::Continuous => -rate,
        Domain::Sampled { period } => (-rate * period).exp(),
    }
}

/// The matrix from e after the correction to e before the correction: (I - C `L_x`)^-1 of a current estimator, I of a
/// prediction estimator.
fn before_correction(plant: &FaultyPlant, gains: &Gains) -> Result<DMatrix<f64>, Error> {
    let p = plant.c.nrows();
    let identity = DMatrix::identity(p, p);
    if gains.estimator == Estimator::Prediction {
        return Ok(identity);
    }
    let inverse = (identity - &plant.c * &gains.l_x).try_inverse();
    check::in_range("(I - C L_x)^-1", inverse.unwrap_or(DMatrix::from_element(1, 1, f64::NAN)))
}

/// Checks that the faults of `plant` are modelled as constant.
fn require_constant_faults(plant: &FaultyPlant, domain: Domain) -> Result<(), Error> {
    plant.check()?;
    let q = plant.a_f.nrows();
    let difference = (&plant.a_f - DMatrix::identity(q, q) * domain.constant()).amax();
    let rule = "zero: the law is about faults that are modelled as constant";
    check::that(difference <= 0.0, "A_f of f' = A_f f", difference, rule)
}

/// Checks that the controller is sampled and has a current estimator.
fn require_current(domain: Domain, estimator: Estimator) -> Result<(), Error> {
    let holds = domain != Domain::Continuous && estimator == Estimator::Current;
    check::that(holds, "the domain", f64::NAN, "a sampled controller with a current estimator")
}
