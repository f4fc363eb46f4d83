//! The delay margin for a common delay in all channels.

use super::channel::{loop_modulus, loop_transfer};
use super::crossing::{Evaluation, narrow};
use super::held::hold_inputs;
use super::sweep::Sweep;
use super::{Loop, Point, held_plant};
use crate::blocks::{beside, block_diagonal, stacked};
use crate::eigen::complex_eigenvalues;
use crate::response::KnownResponse;
use crate::stability::instability;
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::{PI, TAU};

/// Number of whole samples up to which the delay of a sampled loop is refined.
const REFINED_SAMPLES: u32 = 20;
/// Number of delays per sample at which loops with a continuous plant are tested.
const PARTS: u32 = 4;
/// Instability above which a delay counts as unstable; less may be a rounding error of modes close to z = 1.
const CLEAR: f64 = 1e-6;
/// Instability above which a delay counts as unstable, relative to the decay of the loop without a delay.
const RELATIVE: f64 = 0.1;
/// Above this number of states of the loop, the delay of a channel is that of whole samples.
const LARGE: usize = 50;

/// Computes the delay margin: the smallest delay, common to all commands (or to all measurements),
/// at which the loop is on the limit of stability; infinite if there is none.
///
/// ```text
/// det(I + L(j w) e^(-j w tau)) = 0
/// ```
///
/// has a solution where an eigenvalue of L(j w) has the modulus 1. Method: the moduli of the
/// eigenvalues on 60 frequencies for each decade and at the resonances of the closed and of the opened loop, up to
/// frequencies where T is small, located by bisection.
///
/// In sampled time the loop is stable for every delay of whole samples up to the result. It may be stable for longer
/// ones, because the limit may be a fraction of a sample: [`sampled_delay_margin`] decides by eigenvalues. If an
/// eigenvalue of L at z = -1 has a modulus above 1, the loop is unstable with a delay of one sample, because each
/// sample of delay adds an encirclement of -1. The result is then zero, unless the moduli give a limit below one
/// sample.
///
/// # Errors
///
/// [`Error::NotHurwitz`], [`Error::NotSchur`] for a loop that is not stable;
/// [`Error::NotConverged`], [`Error::Overflow`].
pub fn delay_margin(closed: &Loop) -> Result<f64, Error> {
    delay_of(&KnownResponse::new(closed.complementary(Point::Input))?)
}

/// The delay margin of the loop whose T is `complementary`.
pub(super) fn delay_of(complementary: &KnownResponse) -> Result<f64, Error> {
    let sweep = Sweep::of_loop(complementary)?;
    let all = sweep.values.iter().map(loci).collect::<Result<Vec<_>, _>>()?;
    let mut delay = f64::INFINITY;
    for rank in 0..complementary.system.d.nrows() {
        let excess: Vec<_> = all.iter().map(|loci| loci[rank].excess).collect();
        let value = |t: &DMatrix<Complex<f64>>| Ok(loci(t)?[rank].excess);
        for frequency in sweep.crossings_of(&excess, value)? {
            let locus = loci(&complementary.gain(frequency)?)?[rank].value;
            delay = delay.min((-locus).arg().rem_euclid(TAU) / frequency);
        }
    }
    if let Domain::Sampled { period } = complementary.system.domain
        && delay >= period
        && loci(&complementary.gain(PI / period)?)?.iter().any(|locus| locus.excess > 0.0)
    {
        delay = 0.0;
    }
    Ok(delay)
}

/// An eigenvalue of L at a frequency.
struct Locus {
    value: Complex<f64>,
    /// The modulus less 1; infinite for a pole of L.
    excess: f64,
}

/// The eigenvalues of L = T (I - T)^-1, t / (1 - t) for each eigenvalue t of T, by ascending modulus.
fn loci(t: &DMatrix<Complex<f64>>) -> Result<Vec<Locus>, Error> {
    let locus = |t| Locus { value: loop_transfer(t), excess: loop_modulus(t) - 1.0 };
    let mut loci: Vec<_> = complex_eigenvalues(t)?.into_iter().map(locus).collect();
    loci.sort_by(|x, y| x.excess.total_cmp(&y.excess));
    Ok(loci)
}

/// Computes the delay margin of a sampled controller: the smallest delay of its held commands at
/// which the loop with the continuous plant becomes unstable.
///
/// `plant`: continuous, or sampled at the period of the controller; then the result is the longest stable delay of
/// whole samples. `controller`: sampled. Within a sample the plant first receives the previous command, then the new
/// one, so that the loop with any delay is a sampled system. Method: eigenvalues of this system for each quarter of a
/// sample up to 20 samples, except for delays that [`delay_margin`] of the loop with the same fraction of a sample
/// shows to be stable; then regula falsi below the first unstable delay. Above 20 samples the result is that of
/// [`delay_margin`].
///
/// # Errors
///
/// Same as [`Loop::new`], [`crate::hold::zero_order_hold`] and [`delay_margin`]; [`Error::OutOfRange`] when the
/// controller is continuous.
pub fn sampled_delay_margin(plant: &StateSpace, controller: &StateSpace) -> Result<f64, Error> {
    let period = period_of(controller)?;
    let estimate = delay_margin(&Loop::new(held_plant(plant, period)?, controller.clone())?)?;
    refine(plant, controller, estimate)
}

/// The period of a sampled controller; [`Error::OutOfRange`] for a continuous one.
pub(super) fn period_of(controller: &StateSpace) -> Result<f64, Error> {
    let rule = "that of a sampled controller";
    match controller.domain {
        Domain::Sampled { period } => Ok(period),
        Domain::Continuous => Err(Error::OutOfRange { name: "the domain", value: f64::NAN, rule }),
    }
}

/// [`sampled_delay_margin`] from `estimate`, the [`delay_margin`] of the loop.
pub(super) fn refine(
    plant: &StateSpace,
    controller: &StateSpace,
    estimate: f64,
) -> Result<f64, Error> {
    let period = period_of(controller)?;
    let shown = |part: f64| stable_delay(plant, controller, period, part);
    let instability = |count: usize, part: f64| {
        instability(&delayed(plant, controller, period, count, part)?, controller.domain)
    };
    first_unstable(plant.domain, period, estimate, shown, instability)
}

/// Computes the delay margin of one channel of a sampled loop: the smallest delay of this command, or of this
/// measurement alone, at which the loop with the continuous plant becomes unstable.
///
/// `plant`, `controller`: see [`sampled_delay_margin`]; `at`, `channel`: the place of the delay; `estimate`: the delay
/// of [`super::channel_margins`], which is right for whole samples. Method: eigenvalues, as for
/// [`sampled_delay_margin`]. Above 50 states of the loop the result is the estimate.
///
/// # Errors
///
/// Same as [`sampled_delay_margin`].
///
/// # Panics
///
/// If there is no such channel.
pub fn sampled_channel_delay(
    plant: &StateSpace,
    controller: &StateSpace,
    (at, channel): (Point, usize),
    estimate: f64,
) -> Result<f64, Error> {
    let period = period_of(controller)?;
    if plant.a.nrows() + controller.a.nrows() > LARGE {
        return Ok(estimate);
    }
    let instability = |count: usize, part: f64| {
        let late = late_channel(plant, period, (at, channel), count, part)?;
        instability(&Loop::new(late, controller.clone())?.dynamics(), controller.domain)
    };
    first_unstable(plant.domain, period, estimate, |_| Ok(f64::NEG_INFINITY), instability)
}

/// The smallest unstable delay, by tests at parts of a sample.
///
/// `domain`: that of the plant; `estimate`: the delay up to which whole samples are stable; `shown`: from a fraction of
/// a sample, the longest delay in samples, with this fraction, that is known to be stable; `instability`: from whole
/// samples and a fraction of one.
fn first_unstable(
    domain: Domain,
    period: f64,
    estimate: f64,
    shown: impl Fn(f64) -> Result<f64, Error>,
    instability: impl Fn(usize, f64) -> Result<f64, Error>,
) -> Result<f64, Error> {
    let parts = if domain == Domain::Continuous { PARTS } else { 1 };
    let step = 1.0 / f64::from(parts);
    let value = |samples: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 20")]
        let count = samples as usize;
        instability(count, samples.fract())
    };
    // A mode that decays slowly without a delay, such as a resonance, grows slowly with one.
    let clear = CLEAR.min(RELATIVE * value(0.0)?.abs());
    // In samples: the first unstable tested delay, and the delay up to which sweeps show all tested ones to be stable.
    let (mut unstable, mut proven) = (f64::INFINITY, f64::INFINITY);
    for part in (0..parts).map(|at| f64::from(at) * step) {
        let stable = if part > 0.0 { shown(part)? } else { (estimate / period).floor() };
        proven = proven.min(stable);
        for delay in (0..=REFINED_SAMPLES).map(|samples| f64::from(samples) + part) {
            if delay >= unstable {
                break;
            }
            if delay > stable && value(delay)? > clear {
                unstable = delay;
            }
        }
    }
    if unstable.is_infinite() {
        let samples = (estimate / period).max(f64::from(REFINED_SAMPLES));
        return Ok(period * if parts > 1 { samples } else { samples.floor() });
    }
    let mut start = unstable - step;
    // At shorter delays an unstable mode may grow more slowly than `clear`.
    while start > proven.max(0.0) && value(start)? > 0.0 {
        (start, unstable) = (start - step, start);
    }
    if parts == 1 {
        return Ok(period * start);
    }
    // Rounding may hide that the loop is stable at the start.
    let start = Evaluation { at: start, value: value(start)?.min(-f64::MIN_POSITIVE) };
    let end = Evaluation { at: unstable, value: value(unstable)? };
    Ok(period * narrow(start, end, value)?.0)
}

/// The longest delay, in samples, for which a sweep of frequencies shows that the loop is stable; minus infinity if the
/// loop is unstable with the delay `part`. The delays examined are `part`, above 0 and below 1, plus whole samples.
fn stable_delay(
    plant: &StateSpace,
    controller: &StateSpace,
    period: f64,
    part: f64,
) -> Result<f64, Error> {
    let m = plant.b.ncols();
    let [a, old, new] = hold_late(plant, period, part)?;
    let a = beside(&a, &old).resize_vertically(a.nrows() + m, 0.0);
    let (b, c) = (stacked(&new, &DMatrix::identity(m, m)), beside(&plant.c, &plant.d));
    let late = StateSpace::strictly_proper(a, b, c, controller.domain);
    match delay_margin(&Loop::new(late, controller.clone())?) {
        Err(Error::NotSchur { .. }) => Ok(f64::NEG_INFINITY),
        delay => Ok(part + (delay? / period).floor()),
    }
}

/// Computes, over a sample, A and the effects of the previous and of the new command. The new command arrives after the
/// fraction `part` (0 to 1) of the sample; at a sampled plant it arrives at once.
fn hold_late(plant: &StateSpace, period: f64, part: f64) -> Result<[DMatrix<f64>; 3], Error> {
    let (n, m) = plant.b.shape();
    let none = DMatrix::zeros(n, m);
    if plant.domain != Domain::Continuous {
        return Ok([plant.a.clone(), none, plant.b.clone()]);
    }
    let (mut a, mut old, mut new) = (DMatrix::identity(n, n), none.clone(), none);
    if part > 0.0 {
        (a, old) = hold_inputs(&plant.a, &plant.b, part * period)?;
    }
    if part < 1.0 {
        let (rest, held) = hold_inputs(&plant.a, &plant.b, (1.0 - part) * period)?;
        (a, old, new) = (&rest * a, rest * old, held);
    }
    Ok([a, old, new])
}

/// The dynamics of the loop whose commands are delayed by `samples` samples and the fraction `part` (0 to 1) of a
/// sample. States: the states of plant and controller, then the last `samples` + 1 commands, the newest first.
fn delayed(
    plant: &StateSpace,
    controller: &StateSpace,
    period: f64,
    samples: usize,
    part: f64,
) -> Result<DMatrix<f64>, Error> {
    let (n, m) = plant.b.shape();
    let k = controller.a.nrows();
    let [a, old, new] = hold_late(plant, period, part)?;
    let order = n + k + m * (samples + 1);
    let at = |age: usize| n + k + (age - 1) * m;
    let mut older = DMatrix::zeros(m, order);
    older.view_mut((0, at(samples + 1)), (m, m)).fill_with_identity();
    let measured = plant.c.clone().resize_horizontally(order, 0.0) + &plant.d * &older;
    let mut dynamics = block_diagonal([&a, &controller.a]).resize(order, order, 0.0);
    let controller_rows = dynamics.rows(n, k) + &controller.b * &measured;
    dynamics.rows_mut(n, k).copy_from(&controller_rows);
    let mut command = &controller.d * &measured;
    let states = command.columns(n, k) + &controller.c;
    command.columns_mut(n, k).copy_from(&states);
    let mut newer = command.clone();
    if samples > 0 {
        newer = DMatrix::zeros(m, order);
        newer.view_mut((0, at(samples)), (m, m)).fill_with_identity();
    }
    let plant_rows = dynamics.rows(0, n) + old * older + new * newer;
    dynamics.rows_mut(0, n).copy_from(&plant_rows);
    dynamics.rows_mut(at(1), m).copy_from(&command);
    for age in 2..=samples + 1 {
        dynamics.view_mut((at(age), at(age - 1)), (m, m)).fill_with_identity();
    }
    Ok(dynamics)
}

/// The sampled plant with a delay of `samples` samples and the fraction `part` (0 to 1) of a sample in one command or
/// one measurement. States: those of the plant, the previous commands, then the delayed signal, the newest first.
fn late_channel(
    plant: &StateSpace,
    period: f64,
    (at, channel): (Point, usize),
    samples: usize,
    part: f64,
) -> Result<StateSpace, Error> {
    let (n, m) = plant.b.shape();
    let [a, _, held] = hold_late(plant, period, 0.0)?;
    let (newest, oldest) = (n + m, n + m + samples);
    let order = oldest + 1;
    let mut late = StateSpace {
        a: a.clone().resize(order, order, 0.0),
        b: stacked(&held, &DMatrix::identity(m, m)).resize_vertically(order, 0.0),
        c: beside(&plant.c, &plant.d).resize_horizontally(order, 0.0),
        d: DMatrix::zeros(plant.c.nrows(), m),
        domain: Domain::Sampled { period },
    };
    for state in newest..oldest {
        late.a[(state + 1, state)] = 1.0;
    }
    match at {
        Point::Input => {
            let [_, old, new] = hold_late(plant, period, part)?;
            late.b.view_mut((0, channel), (n, 1)).fill(0.0);
            late.b[(newest, channel)] = 1.0;
            late.a.view_mut((0, oldest), (n, 1)).copy_from(&old.columns(channel, 1));
            let mut newer = if samples > 0 {
                late.a.view_mut((0, oldest - 1), (n, 1))
            } else {
                late.b.view_mut((0, channel), (n, 1))
            };
            newer.copy_from(&new.columns(channel, 1));
            late.c.column_mut(n + channel).fill(0.0);
            late.c.columns_mut(oldest, 1).copy_from(&plant.d.columns(channel, 1));
        }
        // The measurement at the fraction of a sample before the next one.
        Point::Output => {
            let (phi, gamma) = if part > 0.0 {
                hold_inputs(&plant.a, &plant.b, (1.0 - part) * period)?
            } else {
                (a, held)
            };
            let row = plant.c.rows(channel, 1);
            late.a.view_mut((newest, 0), (1, n)).copy_from(&(row * phi));
            late.b.rows_mut(newest, 1).copy_from(&(row * gamma + plant.d.rows(channel, 1)));
            late.c.row_mut(channel).fill(0.0);
            late.c[(channel, oldest)] = 1.0;
        }
    }
    Ok(late)
}
