//! The sliding-mode observer of a sampled controller.

use super::{DirectForm, OwnModel, eigenvalue, require_constant_faults, require_current};
use crate::faulty_plant::FaultyPlant;
use crate::gains::Gains;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// The fraction of a constant fault, small compared with rho, that is missing in the estimate because of the boundary
/// layer.
const SHORTFALL: f64 = 0.01;

/// The parameters of [`sliding_mode`], one number for each fault, in the unit of the fault.
#[derive(Debug, Clone, PartialEq)]
pub struct SlidingMode {
    /// rho: for each fault a bound that the fault does not reach.
    pub rho: Vec<f64>,
    /// delta, the half-width of the boundary layer; None for the width at which small errors decay with the
    /// argument `rate` of [`sliding_mode`].
    pub delta: Option<Vec<f64>>,
}

/// Designs a sliding-mode observer with a boundary layer; returns its linearisation and delta.
///
/// ```text
/// f_hat[k] = nu[k],  nu_i = rho_i s_i / (|s_i| + delta_i),  s = F e[k],  e[k] = y[k] - C x_hat[k|k-1]
/// x_hat[k+1|k] = A x_hat[k|k-1] + B u[k] + F_a nu[k] + L e[k]
/// s[k+1] = lambda s[k] + f[k] - nu[k] + * w
/// ```
///
/// F = `M_1` of [`DirectForm`], F C `F_a` = I, and L gives each s the eigenvalue lambda; * w is the effect of the error
/// of the other states. In the boundary layer (small s) nu is about (rho / delta) s, and s decays with lambda - rho /
/// delta. The default of delta makes this e^(-rate T). With lambda = 1 - 0.01 (1 - e^(-rate T)), the estimate of a
/// small constant fault is 1 % too small; the relative error of a larger fault is rho / (rho - |f|) times as large. In
/// the linearisation, the gain of the correction of `x_hat` is M with A M = L, and `L_f` is (rho / delta) F; the
/// observer itself uses F and the nonlinear nu.
///
/// Each estimate stays between -rho and rho. The error stays bounded if every |`f_i`| is below `rho_i`.
///
/// Source: C. Edwards, S. K. Spurgeon and R. J. Patton, Sliding mode observers for fault detection and isolation,
/// Automatica 36 (2000): injection rho P e / (|P e| + delta) and reconstruction by its equivalent value. There the
/// injection is a unit vector in continuous time; here it acts element by element, so that faults may have different
/// units, and in sampled time.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`DirectForm::observer_gain`]; [`Error::OutOfRange`] for a parameter or a `rate`
/// that is not above zero, faults that are not modelled as constant, a continuous plant or a prediction estimator;
/// [`Error::NotSchur`] for a delta so small that the samples oscillate about s = 0; [`Error::Overflow`] if A is
/// singular.
pub fn sliding_mode(
    plant: &FaultyPlant,
    form: &DirectForm,
    gains: &Gains,
    law: &SlidingMode,
    rate: f64,
) -> Result<(OwnModel, Vec<f64>), Error> {
    let domain = form.domain;
    require_constant_faults(plant, domain)?;
    require_current(domain, gains.estimator)?;
    gains.check(plant)?;
    let q = plant.f_a.ncols();
    for list in [Some(&law.rho), law.delta.as_ref()].into_iter().flatten() {
        let name = "rho, or delta,";
        check::column(name, list, q)?;
        list.iter().try_for_each(|&value| check::positive(name, value))?;
    }
    check::positive("rate", rate)?;
    let fast = eigenvalue(rate, domain);
    let pole = domain.constant() - SHORTFALL * (domain.constant() - fast);
    let slope = pole - fast;
    let delta = law.delta.clone();
    let delta = delta.unwrap_or_else(|| law.rho.iter().map(|rho| rho / slope).collect());
    let slopes = law.rho.iter().zip(&delta).map(|(rho, delta)| rho / delta);
    let slopes = DVector::from_iterator(q, slopes);
    if let Some(slope) = slopes.iter().find(|slope| (pole - **slope).abs() >= 1.0) {
        let radius = (pole - slope).abs();
        return Err(Error::NotSchur { matrix: "lambda - rho / delta", radius });
    }
    let l_x = form.observer_gain(pole, rate)?;
    let l_x = plant.a.clone().lu().solve(&l_x).ok_or(Error::Overflow { what: "A^-1 L_x" })?;
    let l_f = DMatrix::from_diagonal(&slopes) * &form.m_1;
    let gains = Gains { l_x, l_f, p_f: None, ..gains.clone() };
    Ok((OwnModel { gains, a_f: DMatrix::zeros(q, q) }, delta))
}
