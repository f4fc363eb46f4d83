//! The learning observer of a sampled controller.

use super::{DirectForm, OwnModel, eigenvalue, require_constant_faults, require_current};
use crate::faulty_plant::FaultyPlant;
use crate::gains::Gains;
use crate::{Error, check};
use nalgebra::DMatrix;

/// The parameter of [`learning`].
#[derive(Debug, Clone, PartialEq)]
pub struct Learning {
    /// `K_1`: the factor by which the previous estimate enters the new one, above 0 and at most 1.
    pub kept: f64,
}

/// Designs a learning observer whose learning interval is the sample time.
///
/// ```text
/// f_hat[k] = v[k] = K_1 v[k-1] + K_2 e[k],  e[k] = y[k] - C x_hat[k|k-1]
/// x_hat[k+1|k] = A x_hat[k|k-1] + B u[k] + F_a v[k] + L e[k]
/// s[k+1] = lambda s[k] + f[k] - v[k] + * w,  s = F e
/// ```
///
/// `K_2` = g F with F = `M_1` of [`DirectForm`], and L gives s the eigenvalue lambda; * w is the effect of the error of
/// the other states. The characteristic polynomial of s and v is (z - lambda) (z - `K_1`) + g z. It is (z - p)^2 with
/// p = e^(-rate T), lambda = p^2 / `K_1` and g = lambda + `K_1` - 2 p; lambda is stable for every `K_1` above p^2. The
/// estimate of a constant fault lacks the part (1 - lambda) (1 - `K_1`) / ((1 - lambda) (1 - `K_1`) + g) of the fault,
/// zero for `K_1` = 1, an integrator. The gain of the correction in the result is M with A M = L.
///
/// Source: W. Chen and M. Saif, An iterative learning observer-based approach to fault detection and accommodation in
/// nonlinear systems, Proc. 40th IEEE Conference on Decision and Control (2001), and An iterative learning observer for
/// fault detection and accommodation in nonlinear time-delay systems, Int. J. Robust and Nonlinear Control 16 (2006);
/// Q. Jia, W. Chen, Y. Zhang and H. Li, Fault reconstruction and fault-tolerant control via learning observers in
/// Takagi-Sugeno fuzzy descriptor systems with time delays, IEEE Transactions on Industrial Electronics 62 (2015):
/// v(t) = `K_1` v(t - tau) + `K_2` (y - C `x_hat`). The gains by pole placement with tau = T are our own.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`DirectForm::observer_gain`]; [`Error::OutOfRange`] for a `K_1` outside of its range,
/// faults that are not modelled as constant, a continuous plant or a prediction estimator; [`Error::NotSchur`] if
/// `K_1` is at most p^2; [`Error::Overflow`] if A is singular.
pub fn learning(
    plant: &FaultyPlant,
    form: &DirectForm,
    gains: &Gains,
    law: &Learning,
    rate: f64,
) -> Result<OwnModel, Error> {
    let domain = form.domain;
    require_constant_faults(plant, domain)?;
    require_current(domain, gains.estimator)?;
    gains.check(plant)?;
    let k_1 = law.kept;
    check::that(k_1 > 0.0 && k_1 <= 1.0, "K_1", k_1, "above 0 and at most 1")?;
    let fast = eigenvalue(rate, domain);
    let pole = fast * fast / k_1;
    if pole >= 1.0 {
        return Err(Error::NotSchur { matrix: "lambda = p^2 / K_1", radius: pole });
    }
    let l_x = form.observer_gain(pole, rate)?;
    let l_x = plant.a.clone().lu().solve(&l_x).ok_or(Error::Overflow { what: "A^-1 L_x" })?;
    let l_f = &form.m_1 * (pole + k_1 - 2.0 * fast);
    let (q, gains) = (plant.f_a.ncols(), Gains { l_x, l_f, p_f: None, ..gains.clone() });
    check::finite("L_f", &gains.l_f)?;
    Ok(OwnModel { gains, a_f: DMatrix::identity(q, q) * k_1 })
}
