//! The proportional-integral observer.

use super::before_correction;
use crate::faulty_plant::FaultyPlant;
use crate::gains::Gains;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// Adds a direct term to an augmented state observer: the proportional-integral observer with the same error dynamics.
///
/// ```text
/// f_hat = f_hat_i + P_f (y - C x_hat),  f_hat_i' = A_f f_hat_i + L_f (y - C x_hat),  P_f = part T L_f
/// ```
///
/// T is the matrix of the lag: if the rate of a fault is constant (for a ramp model: its second derivative), `f_hat_i`
/// lags behind by T times this rate. For constant faults `L_f` (y - C `x_hat`) = `f_hat_i`', so that `f_hat` =
/// `f_hat_i` + part T `f_hat_i`'. `part` = 1 removes the lag: for constant fault models a ramp leaves no lasting error.
/// `part` = 0 gives the augmented observer. `gains`: the gains of an augmented observer with stable error dynamics. In
/// sampled time with a current estimator, `x_hat` in the first equation is the corrected estimate. The law exists
/// whenever the augmented observer does.
///
/// In continuous time `P_f` passes measurement noise of any frequency to `f_hat`.
///
/// Source: proportional and integral correction of B. Wojciechowski, Analysis and synthesis of
/// proportional-integral observers for single-input-single-output time-invariant continuous systems,
/// dissertation, Gliwice (1978); D. Soeffker, T.-J. Yu and P. C. Mueller, State estimation of dynamical systems with
/// nonlinearities by using proportional-integral observer, Int. J. Systems Science 26 (1995); K. Busawon and
/// P. Kabore, Disturbance attenuation using proportional integral observers, Int. J. Control 74 (2001). The choice of
/// `P_f` is our own: the steady state of the error equations of [`crate::response::fault_rate_system`].
///
/// # Errors
///
/// Same as [`Gains::check`]; [`Error::OutOfRange`] for a `part` that is not a finite number of at least zero;
/// [`Error::Overflow`] if the error dynamics have an eigenvalue 0 (1 in sampled time), or I - C `L_x` of a current
/// estimator is singular.
pub fn proportional_integral(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
    part: f64,
) -> Result<Gains, Error> {
    gains.check(plant)?;
    let holds = part.is_finite() && part >= 0.0;
    check::that(holds, "proportional", part, "a finite number of at least 0")?;
    let (n, q) = plant.f_a.shape();
    // The states of the fault models that are constant: the last one of each model.
    let change = &plant.a_f - DMatrix::identity(q, q) * domain.constant();
    let constant: Vec<usize> = (0..q).filter(|&j| change.row(j).amax() <= 0.0).collect();
    let mut rates = DMatrix::zeros(n + q, constant.len());
    for (column, &row) in constant.iter().enumerate() {
        rates[(n + row, column)] = 1.0;
    }
    let dynamics = gains.error_dynamics(plant);
    let change = dynamics - DMatrix::identity(n + q, n + q) * domain.constant();
    let steady = change.lu().solve(&rates).ok_or(Error::Overflow { what: "the lag of f_hat" })?;
    let lag = -steady.rows(n, q);
    let p_f = lag * gains.l_f.select_rows(&constant) * before_correction(plant, gains)? * part;
    Ok(Gains { p_f: Some(check::in_range("P_f", p_f)?), ..gains.clone() })
}
