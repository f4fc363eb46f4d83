//! The controller of [`crate::aso`] as one linear system, and the loop that it closes.

use crate::blocks::{beside, block_2x2, stacked};
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::tracking::integration;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// The observer and the feedback of [`crate::aso`] as one system from the measurement y to the command u.
///
/// ```text
/// z' = A z + B y,  u = C z + D y,  z = [x_hat; f_hat]; z[k+1] for z' in sampled time
///
/// G = [A_p + B_p K_x, F_a + B_p K_f; 0, A_f],  M = [L_x; L_f],  W = I - M [C_p, 0]
/// prediction:  A = G - M [C_p, 0],  B = M,    C = [K_x, K_f],    D = 0
/// current:     A = G W,             B = G M,  C = [K_x, K_f] W,  D = [K_x, K_f] M
/// ```
///
/// `A_p`, `B_p`, `C_p` are the matrices of the plant, `domain` is the domain of plant and gains. A current
/// estimator, for sampled plants, corrects z by M times the new residual, forms u from the corrected
/// z, then predicts; its state z is the prediction. With a direct term `P_f` (see [`Gains`])
///
/// ```text
/// u = (K - K_f P_f [C_p, 0]) z + K_f P_f y,  K = [K_x, K_f]
/// ```
///
/// with the corrected z, and the same u enters the model of the plant in A and B.
/// y is the input of the observer: the filtered measurements if there is a filter. The filter and integral action are
/// not part of this system; [`complete_controller`] has both.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix of plant or gains.
pub fn controller(plant: &FaultyPlant, gains: &Gains, domain: Domain) -> Result<StateSpace, Error> {
    gains.check(plant)?;
    let (n, q) = plant.f_a.shape();
    let mut g = block_2x2(
        [&gains.controlled_dynamics(plant), &(&plant.f_a + &plant.b * &gains.k_f)],
        [&DMatrix::zeros(q, n), &plant.a_f],
    );
    let m = stacked(&gains.l_x, &gains.l_f);
    let mut k = beside(&gains.k_x, &gains.k_f);
    let output = plant.augmented_output();
    let m_c = &m * &output;
    // The direct term K_f P_f in D, and its part of B.
    let direct = gains.p_f.as_ref().map(|p_f| &gains.k_f * p_f);
    let direct_b = direct.as_ref().map(|d| (&plant.b * d).resize_vertically(n + q, 0.0));
    if let (Some(direct), Some(direct_b)) = (&direct, &direct_b) {
        k -= direct * &output;
        g -= direct_b * &output;
    }
    let plus = |m: DMatrix<f64>, part: Option<DMatrix<f64>>| match part {
        Some(part) => m + part,
        None => m,
    };
    Ok(match gains.estimator {
        Estimator::Prediction => {
            let d = direct.unwrap_or_else(|| DMatrix::zeros(k.nrows(), m.ncols()));
            StateSpace { a: g - m_c, b: plus(m, direct_b), c: k, d, domain }
        }
        Estimator::Current => {
            let w = DMatrix::identity(n + q, n + q) - m_c;
            let (b, d) = (plus(&g * &m, direct_b), plus(&k * m, direct));
            StateSpace { a: g * &w, b, c: k * w, d, domain }
        }
    })
}

/// The system from y to the fault estimates, with A and B of `system`, the [`controller`].
///
/// ```text
/// f_hat = ([0, I] - P_f [C_p, 0]) z + P_f y
/// ```
///
/// with the corrected z = W z + M y for a current estimator; `P_f` is zero without a direct term.
fn fault_estimates(plant: &FaultyPlant, gains: &Gains, system: &StateSpace) -> StateSpace {
    let (n, q) = plant.f_a.shape();
    let mut c = DMatrix::identity(q, q).insert_columns(0, n, 0.0);
    let mut d = DMatrix::zeros(q, plant.c.nrows());
    if let Some(p_f) = &gains.p_f {
        c -= p_f * plant.augmented_output();
        d.copy_from(p_f);
    }
    if gains.estimator == Estimator::Current {
        let corrected = &c * stacked(&gains.l_x, &gains.l_f);
        c -= &corrected * plant.augmented_output();
        d += corrected;
    }
    StateSpace { c, d, ..system.clone() }
}

/// A controller from the unfiltered measurements to the commands.
#[derive(Debug, Clone, PartialEq)]
pub struct CompleteController {
    /// From y to u. The state is [`y_f`; `x_hat`; `f_hat`; `x_i`], `y_f` only with a filter, `x_i` only with integral
    /// action.
    pub commands: StateSpace,
    /// From y to `f_hat`, the estimate that u uses; same A and B as `commands`.
    pub estimates: StateSpace,
}

/// The [`controller`] behind the measurement filter W, with the integral action of [`crate::tracking`] for r = 0.
///
/// ```text
/// y_f' = W (y - y_f)                              sampled: y_f[k+1] = y_f[k] + W (y[k] - y_f[k])
/// z'   = A z + B y_f + [B_p; 0] K_i x_i,          u = C z + D y_f + K_i x_i
/// x_i' = -H y + H F_s f_hat                       sampled: x_i[k+1] = x_i[k] + T (-H y[k] + H F_s f_hat)
/// ```
///
/// with A, B, C, D of [`controller`], H and `F_s` of [`crate::tracking`], the sample time T. `filter`: the diagonal of
/// W, p entries, in sampled time the gains of [`crate::sampled::filter`]; without it `y_f` = y. Integral action uses y,
/// not `y_f`.
///
/// # Errors
///
/// Same as [`controller`]; [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad filter.
pub fn complete_controller(
    plant: &FaultyPlant,
    gains: &Gains,
    filter: Option<&[f64]>,
    domain: Domain,
) -> Result<CompleteController, Error> {
    let system = controller(plant, gains, domain)?;
    let mut commands = filtered(&system, filter)?;
    let mut estimates = filtered(&fault_estimates(plant, gains, &system), filter)?;
    if let Some(integral) = &gains.integral {
        let b = plant.b.clone().resize_vertically(system.a.nrows(), 0.0);
        let filters = commands.a.nrows() - system.a.nrows();
        let integral_input = b.insert_rows(0, filters, 0.0) * &integral.gain;
        let (step, last) = integration(domain);
        let (k, t) = (commands.a.nrows(), gains.integrals());
        let identity = DMatrix::identity(t, t) * last;
        let from_faults = &integral.faults * &estimates.c * step;
        let a = block_2x2([&commands.a, &integral_input], [&from_faults, &identity]);
        let integrand = (&integral.faults * &estimates.d - &integral.h) * step;
        let b = stacked(&commands.b, &integrand);
        commands.c = beside(&commands.c, &integral.gain);
        estimates.c = estimates.c.resize_horizontally(k + t, 0.0);
        (commands.a, commands.b) = (a.clone(), b.clone());
        (estimates.a, estimates.b) = (a, b);
    }
    Ok(CompleteController { commands, estimates })
}

/// Puts a measurement filter before a controller. States: `y_f` of the filter, then the states of the controller.
fn filtered(controller: &StateSpace, filter: Option<&[f64]>) -> Result<StateSpace, Error> {
    let Some(filter) = filter else {
        return Ok(controller.clone());
    };
    let (p, k, m) = (filter.len(), controller.a.nrows(), controller.c.nrows());
    check::column("W", filter, controller.b.ncols())?;
    let w = DMatrix::from_diagonal(&filter.to_vec().into());
    let dynamics = match controller.domain {
        Domain::Continuous => -&w,
        Domain::Sampled { .. } => DMatrix::identity(p, p) - &w,
    };
    let a = block_2x2([&dynamics, &DMatrix::zeros(p, k)], [&controller.b, &controller.a]);
    let (b, d) = (w.resize_vertically(p + k, 0.0), DMatrix::zeros(m, p));
    let c = beside(&controller.d, &controller.c);
    Ok(StateSpace { a, b, c, d, domain: controller.domain })
}

/// Converts `controller`, designed for a plant with y = C x, for y = C x + D u: its new input is y - D u.
///
/// ```text
/// continuous:  z' = (A - B D C) z + B y,            u = C z
/// sampled:     z[k+1] = A z[k] + B (y[k] - D v[k]),  u[k] = C z[k],  v[k+1] = u[k]
/// ```
///
/// In sampled time, `y[k]` is taken just before `u[k]` is applied, so that it contains `D u[k-1]`; the state is [z; v].
/// `controller`: k states, p inputs, any outputs; its direct term is zero, as with a measurement filter; `feedthrough`:
/// D of the plant, p x m; `commands`: C of u, m x k.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for A or B of `controller`, for `commands` or for
/// `feedthrough`; [`Error::OutOfRange`] for a direct term of `controller`.
pub fn with_feedthrough(
    controller: &StateSpace,
    commands: &DMatrix<f64>,
    feedthrough: &DMatrix<f64>,
) -> Result<StateSpace, Error> {
    let (p, m) = feedthrough.shape();
    check::finite("D", feedthrough)?;
    let k = check::square("A", &controller.a)?;
    check::shape("B", &controller.b, (k, p))?;
    check::shape("C of the commands", commands, (m, k))?;
    let direct = controller.d.amax();
    check::that(direct <= 0.0, "the controller's D", direct, "zero")?;
    let b_d = &controller.b * feedthrough;
    if controller.domain == Domain::Continuous {
        return Ok(StateSpace { a: &controller.a - b_d * commands, ..controller.clone() });
    }
    Ok(StateSpace {
        a: block_2x2([&controller.a, &-b_d], [commands, &DMatrix::zeros(m, m)]),
        b: controller.b.clone().resize_vertically(k + m, 0.0),
        c: controller.c.clone().resize_horizontally(k + m, 0.0),
        ..controller.clone()
    })
}

/// Computes the dynamics of the closed loop with the state [x; z], where input i of the plant acts with the factor
/// `effectiveness[i]`.
///
/// ```text
/// x' = A_p x + B_p diag(effectiveness) u,  y = C_p x
/// [x; z]' = [A_p + B_e D C_p, B_e C; B C_p, A] [x; z],  B_e = B_p diag(effectiveness)
/// ```
///
/// `controller`: from p measurements to m commands, k states; `effectiveness`: m entries, 1 for an
/// intact actuator. The result is (n + k) x (n + k).
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix of plant or controller
/// or for `effectiveness`.
pub fn closed_loop(
    plant: &FaultyPlant,
    controller: &StateSpace,
    effectiveness: &[f64],
) -> Result<DMatrix<f64>, Error> {
    plant.check()?;
    let StateSpace { a, b, c, d, .. } = controller;
    let ((n, m), p, k) = (plant.b.shape(), plant.c.nrows(), a.nrows());
    check::shape("the controller's A", a, (k, k))?;
    check::shape("the controller's B", b, (k, p))?;
    check::shape("the controller's C", c, (m, k))?;
    check::shape("the controller's D", d, (m, p))?;
    check::column("effectiveness", effectiveness, m)?;
    let b_e = DMatrix::from_fn(n, m, |i, j| plant.b[(i, j)] * effectiveness[j]);
    Ok(block_2x2([&(&plant.a + &b_e * d * &plant.c), &(&b_e * c)], [&(b * &plant.c), a]))
}
