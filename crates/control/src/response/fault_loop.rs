//! Plant and controller of [`crate::aso`] as one system with the fault as its input.

use super::peak_gain;
use crate::blocks::{beside, stacked};
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::tracking::{IntegralAction, integration};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// The closed loop as a system from the fault f to [x; e; eps].
///
/// ```text
/// x' = (A + B K_x) x - B K_x e + B K_f f_hat + F_a f
/// [e; f_hat]' = (A_0 - L C_0) [e; f_hat] + [F_a; 0] f
/// z = [x; e; f_hat - f]
/// ```
///
/// e = x - `x_hat`, eps = `f_hat` - f; the state is [x; e; `f_hat`], 2 n + q. With integral action B `K_i` `x_i` is
/// added to the first line, and the t integrals of [`crate::tracking`], `x_i`' = -H C x + H `F_s` eps, follow in the
/// state. In sampled time the left sides are the values at the next sample. With a current estimator the matrix of the
/// second line is `A_0` - L `C_0` `A_0`, f enters by (I - L `C_0`) [`F_a`; 0], and the estimates are the corrected
/// ones. With a direct term `P_f` (see [`Gains`]) the state is [x; e; `f_hat_i`], and `f_hat` = `f_hat_i` + `P_f` C e
/// in the first and the last line. The commands are within the limits of the actuators. The fault f may be any function
/// of time, jumps included.
///
/// Source: (1) to (11) of the paper named in [`crate::aso`].
///
/// # Errors
///
/// Same as [`Gains::check`].
pub fn fault_system(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
) -> Result<StateSpace, Error> {
    gains.check(plant)?;
    let (n, q) = plant.f_a.shape();
    let mut errors = plant.f_a.clone().resize_vertically(n + q, 0.0);
    if gains.estimator == Estimator::Current {
        errors -= gains.observer_gain() * &plant.c * &plant.f_a;
    }
    let b = with_integrals(gains, &stacked(&plant.f_a, &errors), -integration(domain).0);
    let d = stacked(&DMatrix::zeros(2 * n, q), &-DMatrix::identity(q, q));
    let c = outputs(plant, gains);
    Ok(StateSpace { a: loop_dynamics(plant, gains, domain), b, c, d, domain })
}

/// Appends to `b`, the effect of a fault on [x; e; `f_hat`], the effect of the fault on the integrals: `factor` H
/// `F_s`.
pub(super) fn with_integrals(gains: &Gains, b: &DMatrix<f64>, factor: f64) -> DMatrix<f64> {
    let none = DMatrix::zeros(0, b.ncols());
    stacked(b, &gains.integral.as_ref().map_or(none, |integral| &integral.faults * factor))
}

/// The closed loop as a system from [r; f] to [x; e; eps], with r = f' - `A_f` f the part of the
/// fault's rate that the fault model does not predict; r = f' for a constant fault.
///
/// ```text
/// x' = (A + B K_x) x - B K_x e + B K_f eps + (F_a + B K_f) f
/// [e; eps]' = (A_0 - L C_0) [e; eps] - [0; r]
/// z = [x; e; eps]
/// ```
///
/// In sampled time `r[k] = f[k+1] - A_f f[k]`. f acts only through the part that the compensation cannot cancel. For an
/// f without jumps this is the loop of [`fault_system`] in other coordinates. With a direct term the state eps is
/// `f_hat_i` - f; the first and the last line have eps + `P_f` C e in place of eps.
///
/// # Errors
///
/// Same as [`Gains::check`].
pub fn fault_rate_system(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
) -> Result<StateSpace, Error> {
    gains.check(plant)?;
    let (n, q) = plant.f_a.shape();
    let order = 2 * n + q + gains.integrals();
    let mut b = DMatrix::zeros(order, 2 * q);
    b.view_mut((2 * n, 0), (q, q)).copy_from(&-DMatrix::identity(q, q));
    b.view_mut((0, q), (n, q)).copy_from(&(&plant.f_a + &plant.b * &gains.k_f));
    let (c, d) = (outputs(plant, gains), DMatrix::zeros(2 * n + q, 2 * q));
    Ok(StateSpace { a: loop_dynamics(plant, gains, domain), b, c, d, domain })
}

/// The part of [`fault_system`] or [`fault_rate_system`] on which e and eps depend: its states are
/// [e; `f_hat`] or [e; eps], n + q. The states of the plant and the integrals do not act on e and eps, so that outputs
/// in e and eps keep their transfer functions; outputs in x do not.
#[must_use]
pub fn error_part(plant: &FaultyPlant, system: &StateSpace) -> StateSpace {
    let (n, q) = plant.f_a.shape();
    let order = n + q;
    StateSpace {
        a: system.a.view((n, n), (order, order)).into(),
        b: system.b.rows(n, order).into(),
        c: system.c.columns(n, order).into(),
        d: system.d.clone(),
        domain: system.domain,
    }
}

/// Computes upper bounds of the peak gains to [x; e; eps]: from faults, from their rates, and from the part of faults
/// that is not compensated.
///
/// The first result has the gains of [`fault_system`], the others have those of [`fault_rate_system`]. `rows`: the
/// positions in [x; e; eps] of the outputs, at least one; each result has a row for each output and q columns. `width`:
/// see [`peak_gain`]. Both systems have the same dynamics; one call of [`peak_gain`] serves both.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`peak_gain`]; [`Error::OutOfRange`] for a row beyond [x; e; eps].
pub fn fault_gains(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
    rows: &[usize],
    width: f64,
) -> Result<[DMatrix<f64>; 3], Error> {
    require_rows(plant, rows)?;
    let mut all = fault_system(plant, gains, domain)?;
    let of_rates = fault_rate_system(plant, gains, domain)?;
    let q = plant.f_a.ncols();
    all.b = beside(&all.b, &of_rates.b);
    all.c = all.c.select_rows(rows);
    all.d = beside(&all.d, &of_rates.d).select_rows(rows);
    if rows.iter().all(|row| *row >= plant.a.nrows()) {
        all = error_part(plant, &all);
    }
    let gains = peak_gain(&all, width)?.upper;
    Ok([0, 1, 2].map(|part| gains.columns(part * q, q).into_owned()))
}

/// Checks that `rows` are positions in [x; e; eps].
pub(super) fn require_rows(plant: &FaultyPlant, rows: &[usize]) -> Result<(), Error> {
    let (n, q) = plant.f_a.shape();
    let Some(row) = rows.iter().find(|row| **row >= 2 * n + q) else { return Ok(()) };
    let rule = "an index below the number of states and errors";
    Err(Error::OutOfRange { name: "rows", value: check::as_number(*row), rule })
}

/// C of the systems with output [x; e; `f_hat`] and [x; e; eps]: I without a direct term and integrals.
pub(super) fn outputs(plant: &FaultyPlant, gains: &Gains) -> DMatrix<f64> {
    let (n, q) = plant.f_a.shape();
    let mut c = DMatrix::identity(2 * n + q, 2 * n + q + gains.integrals());
    if let Some(direct) = gains.direct(plant) {
        c.view_mut((2 * n, n), (q, n)).copy_from(&direct);
    }
    c
}

/// The state matrix of the systems with output [x; e; `f_hat`] and [x; e; eps]: [A + B `K_x`, [-B `K_x`, B `K_f`]; 0,
/// `A_0` - L `C_0`]; with a direct term -B `K_x` + B `K_f` `P_f` C in place of -B `K_x`; with integral action the rows
/// and columns of `x_i` follow.
pub(super) fn loop_dynamics(plant: &FaultyPlant, gains: &Gains, domain: Domain) -> DMatrix<f64> {
    let (n, q) = plant.f_a.shape();
    let (first, t) = (2 * n + q, gains.integrals());
    let mut a = DMatrix::zeros(first + t, first + t);
    a.view_mut((0, 0), (n, n)).copy_from(&gains.controlled_dynamics(plant));
    a.view_mut((0, n), (n, n)).copy_from(&-(&plant.b * &gains.k_x));
    a.view_mut((0, 2 * n), (n, q)).copy_from(&(&plant.b * &gains.k_f));
    a.view_mut((n, n), (n + q, n + q)).copy_from(&gains.error_dynamics(plant));
    let direct = gains.direct(plant);
    if let Some(direct) = &direct {
        let mut of_error = a.view_mut((0, n), (n, n));
        of_error += &plant.b * &gains.k_f * direct;
    }
    if let Some(IntegralAction { output, faults, gain, .. }) = &gains.integral {
        let (step, last) = integration(domain);
        a.view_mut((0, first), (n, t)).copy_from(&(&plant.b * gain));
        a.view_mut((first, 0), (t, n)).copy_from(&(output * -step));
        a.view_mut((first, 2 * n), (t, q)).copy_from(&(faults * step));
        a.view_mut((first, first), (t, t)).fill_diagonal(last);
        if let Some(direct) = &direct {
            a.view_mut((first, n), (t, n)).copy_from(&(faults * direct * step));
        }
    }
    a
}
