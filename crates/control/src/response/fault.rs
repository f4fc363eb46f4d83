//! The effect of bounded faults and of reversals of friction on the closed loop.

use super::{TimeResponse, Transient, fault_gains, fault_system, ramp_response, step_response};
use crate::faulty_plant::FaultyPlant;
use crate::gains::Gains;
use crate::{Domain, Error, check};

/// Relative width of the brackets of the peak gains; [`FaultBounds`] uses the upper end of each bracket.
const WIDTH: f64 = 1e-3;

/// Bounds of states and errors at all times, for faults that start from rest; each in the unit of its quantity.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct FaultBounds {
    /// Bounds of |`x_i`|, n.
    pub states: Vec<f64>,
    /// Bounds of |`x_i` - `x_hat_i`|, n.
    pub state_errors: Vec<f64>,
    /// Bounds of |`f_hat_j` - `f_j`|, q.
    pub fault_errors: Vec<f64>,
}

/// The peak-to-peak (L1) bounds of states and estimation errors under bounded faults.
///
/// ```text
/// |z_i| <= sum over j of min(gain_f[i,j] F_j, gain_r[i,j] R_j + gain_d[i,j] F_j)
/// ```
///
/// z = [x; e; eps]; `gain_f` has the [`super::peak_gain`] of [`fault_system`], `gain_r` and `gain_d` have the peak
/// gains of the two halves of the inputs of [`super::fault_rate_system`]. `magnitudes`: F, q, bounds of |`f_j`|, above
/// zero; `rates`: R, q, bounds of |`r_j`|, r = f' - `A_f` f, above zero, infinite if the fault may jump (in sampled
/// time `r[k] = f[k+1] - A_f f[k]`). The bounds hold for the linear loop from rest, with commands within the limits of
/// the actuators. Each of the two terms alone is the least upper bound for its class of faults. Unlike delta of
/// [`crate::theorem1`], each quantity has its own bound in its own unit. The bounds are the upper ends of brackets of
/// relative width 1e-3.
///
/// Comparison with a simulation of the pendulum of [`crate::aso`]'s source (|f| <= 30 N, observer poles -1200 to -3000
/// / s): half of peak to peak of cart and pendulum after compensation is 0.96 mm and 1.75 mrad in the simulation, and
/// the bounds from |f| alone are 1.98 mm and 4.22 mrad. The bounds of the velocities are 4.3 and 6.1 times the
/// simulated values, because the worst fault jumps. Useful bounds of the errors need a rate: without one the worst
/// fault jumps by 60 N, and the bound of |eps| is 60 N. In the simulation the friction reverses while the cart sticks,
/// at up to 521 N/s; with that rate the bounds are within 1 % of the largest simulated errors.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`super::peak_gain`]; [`Error::Shape`], [`Error::OutOfRange`] for
/// `magnitudes` and `rates`; [`Error::NotHurwitz`], [`Error::NotSchur`] for an unstable loop.
pub fn fault_bounds(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
    magnitudes: &[f64],
    rates: &[f64],
) -> Result<FaultBounds, Error> {
    let (n, q) = plant.f_a.shape();
    for (name, bounds) in [("magnitudes", magnitudes), ("rates", rates)] {
        check::length(name, bounds, q)?;
    }
    for (&magnitude, &rate) in magnitudes.iter().zip(rates) {
        check::positive("magnitude", magnitude)?;
        if rate < f64::INFINITY || rate.is_nan() {
            check::positive("rate", rate)?;
        }
    }
    let rows: Vec<usize> = (0..2 * n + q).collect();
    let [gain_of_fault, gain_of_rate, uncancelled] =
        fault_gains(plant, gains, domain, &rows, WIDTH)?;
    let bound = |output: usize| {
        let of_fault = |j: usize| {
            let by_size = gain_of_fault[(output, j)] * magnitudes[j];
            if rates[j] == f64::INFINITY {
                return by_size;
            }
            let remainder = uncancelled[(output, j)] * magnitudes[j];
            by_size.min(gain_of_rate[(output, j)] * rates[j] + remainder)
        };
        (0..q).map(of_fault).sum::<f64>()
    };
    Ok(FaultBounds {
        states: (0..n).map(bound).collect(),
        state_errors: (n..2 * n).map(bound).collect(),
        fault_errors: (2 * n..2 * n + q).map(bound).collect(),
    })
}

/// The response of the loop to a step or a ramp of one fault.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Reversal {
    /// Peaks and settling times of the states, n.
    pub states: Vec<Transient>,
    /// Peaks and settling times of the errors x - `x_hat`, n.
    pub state_errors: Vec<Transient>,
    /// Peaks and settling times of the errors `f_hat` - f, q.
    pub fault_errors: Vec<Transient>,
    /// The outputs [x; e; eps] over time, for figures.
    pub trace: TimeResponse,
}

/// Computes the response of the loop, from rest, to a change of one fault, such as reversed friction.
///
/// `fault`: the index of the fault, from 0; `change`: the size of the change in the unit of the
/// fault, above zero, 2 `F_s` for friction that reverses from -`F_s` to `F_s`; `rate`: the rate of the change,
/// above zero, None for a jump; `fraction`: the band of the settling times, relative to the largest distance of the
/// quantity from its final value. The loop is linear, so that this is the step or ramp response of
/// [`fault_system`]. The peaks of the states predict the amplitude (half of peak to peak) of the
/// limit cycle that remains after compensation, provided that the loop settles between reversals.
///
/// For the pendulum of [`crate::aso`]'s source with 2 `F_s` = 60 N, the simulated amplitudes after compensation are
/// 0.96 mm, 1.75 mrad, 0.0100 m/s, 0.0205 rad/s, and the largest |eps| is 0.88 N. The predictions are:
///
/// | | cart | pendulum | cart velocity | angular velocity | eps |
/// |---|---|---|---|---|---|
/// | jump | 1.18 mm | 2.59 mrad | 0.0298 m/s | 0.0938 rad/s | 60 N |
/// | at 521 N/s | 1.17 mm | 2.17 mrad | 0.0098 m/s | 0.0225 rad/s | 0.88 N |
///
/// The jump predicts the positions well, since the integral of eps, the impulse that is not
/// compensated, does not depend on the rate. It does not predict errors and angular velocity: after
/// compensation the friction does not jump. The cart stops, and while it sticks the friction swings
/// from -30 N to 30 N in 0.26 s, at up to 521 N/s, as fast as the observer moves the command. That
/// rate is a property of the loop with friction; it must be known from a simulation or a
/// measurement, or assumed. The root mean square of eps (0.28 N) is not predicted either, only bounded.
///
/// # Example
///
/// ```
/// use control::placement::real_poles;
/// use control::{Domain, aso, response};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let plant = aso::FaultyPlant::with_constant_faults(one(0.5), one(1.0), one(1.0), one(-1.0));
/// let gains = aso::design(&plant, &real_poles(&[-1.0]), &real_poles(&[-20.0, -30.0]), None)?.gains;
/// let reversal = response::reversal(&plant, &gains, Domain::Continuous, 0, 2.0, None, 0.02)?;
/// assert!((reversal.fault_errors[0].peak + 2.0).abs() < 1e-12);
/// assert!(reversal.states[0].final_value.abs() < 1e-12);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`Gains::check`], [`step_response`]; [`Error::OutOfRange`] for `fault`, `change`, `rate`, `fraction`.
pub fn reversal(
    plant: &FaultyPlant,
    gains: &Gains,
    domain: Domain,
    fault: usize,
    change: f64,
    rate: Option<f64>,
    fraction: f64,
) -> Result<Reversal, Error> {
    let system = fault_system(plant, gains, domain)?;
    check::positive("change", change)?;
    check::positive("fraction", fraction)?;
    let unit = match rate {
        None => step_response(&system, fault)?,
        Some(rate) => {
            check::positive("rate", rate)?;
            ramp_response(&system, fault, change / rate)?
        }
    };
    let trace = unit.scaled(change);
    let (n, q) = plant.f_a.shape();
    let transients = |from: usize, count: usize| {
        (from..from + count).map(|output| trace.transient(output, fraction)).collect()
    };
    Ok(Reversal {
        states: transients(0, n),
        state_errors: transients(n, n),
        fault_errors: transients(2 * n, q),
        trace,
    })
}
