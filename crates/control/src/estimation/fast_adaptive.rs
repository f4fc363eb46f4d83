//! Fast adaptive fault estimation.

use super::{DirectForm, before_correction, eigenvalue, require_constant_faults};
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

/// The parameters of [`fast_adaptive`].
#[derive(Debug, Clone, PartialEq)]
pub struct FastAdaptive {
    /// The design parameter sigma in 1/s.
    pub sigma: f64,
    /// The diagonal of Gamma in 1/s: for each fault, the rate at which the estimate follows the fault.
    pub gamma: Vec<f64>,
}

/// Designs fast adaptive fault estimation.
///
/// ```text
/// x_hat' = A x_hat + B u + F_a f_hat + L_x e,   e = y - C x_hat
/// f_hat' = Gamma F (e' + sigma e),  realised as  f_hat = f_hat_i + Gamma F e,  f_hat_i' = sigma Gamma F e
/// ```
///
/// F = `M_1` of [`DirectForm`], F C `F_a` = I. In the coordinates of [`DirectForm`] A - `L_x` C = [-sigma I, J; 0, ..].
/// The error eps = `f_hat` - f then obeys eps' = -Gamma eps + Gamma J w - f': each estimate is the fault after a
/// first-order lag of rate gamma. The only disturbance is w, the error in the coordinates that no fault enters; no
/// fault excites w. In sampled time (current estimator) the eigenvalues are e^(-sigma T) and e^(-gamma T).
///
/// `gains`: `K_x`, `K_f` and the estimator are used; `rate`: the rate of the other errors, in 1/s, see
/// [`DirectForm::observer_gain`], whose P proves the stability for all positive Gamma and sigma in continuous time.
///
/// In the resulting [`Gains`], `F_a` `f_hat_i` takes the place of `F_a` `f_hat`, and `L_x` is the gain above plus `F_a`
/// Gamma F.
///
/// Source: K. Zhang, B. Jiang and V. Cocquempot, Adaptive observer-based fast fault estimation, Int. J. Control,
/// Automation, and Systems 6 (2008): `f_hat`' = -Gamma F (`e_y`' + sigma `e_y`) with `e_y` = C `x_hat` - y,
/// theorem 1 with E'P = F C. Their P and `L_x` solve linear matrix inequalities; here they follow from the form. The
/// law for sampled controllers is our own.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`DirectForm::observer_gain`]; [`Error::OutOfRange`] for a parameter that is not
/// above zero, for faults that are not modelled as constant, or for a sampled prediction estimator;
/// [`Error::Overflow`] if a sampled A or I - C `L_x` is singular.
pub fn fast_adaptive(
    plant: &FaultyPlant,
    form: &DirectForm,
    gains: &Gains,
    law: &FastAdaptive,
    rate: f64,
) -> Result<Gains, Error> {
    let domain = form.domain;
    require_constant_faults(plant, domain)?;
    gains.check(plant)?;
    let q = plant.f_a.ncols();
    check::column("gamma", &law.gamma, q)?;
    check::positive("sigma", law.sigma)?;
    check::positive("rate", rate)?;
    law.gamma.iter().try_for_each(|&gamma| check::positive("gamma", gamma))?;
    let pole = eigenvalue(law.sigma, domain);
    let gamma = law.gamma.iter().map(|&gamma| domain.constant() - eigenvalue(gamma, domain));
    let gamma = DMatrix::from_diagonal(&DVector::from_iterator(q, gamma));
    let direct = gamma * &form.m_1;
    let l_x = form.observer_gain(pole, rate)? + &plant.f_a * &direct;
    let l_f = &direct * (domain.constant() - pole);
    if domain == Domain::Continuous {
        return Ok(Gains { l_x, l_f, p_f: Some(direct), ..gains.clone() });
    }
    let is_current = gains.estimator == Estimator::Current;
    let rule = "a current estimator: f_hat uses the newest measurement";
    check::that(is_current, "the estimator", f64::NAN, rule)?;
    // L = A_aug M with A_aug = [A, F_a; 0, I]: M_f = L_f, A M_x = L_x - F_a L_f.
    let product = &l_x - &plant.f_a * &l_f;
    let m_x = plant.a.clone().lu().solve(&product).ok_or(Error::Overflow { what: "A^-1 L_x" })?;
    let mut gains = Gains { l_x: m_x, l_f, p_f: None, ..gains.clone() };
    let p_f = (direct - &gains.l_f) * before_correction(plant, &gains)?;
    gains.p_f = Some(check::in_range("P_f", p_f)?);
    Ok(gains)
}
