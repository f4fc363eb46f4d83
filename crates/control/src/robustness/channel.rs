//! Margins of one channel, the others closed.

use super::crossing::stability_limit;
use super::sweep::Sweep;
use super::{Loop, Point};
use crate::eigen::RankOne;
use crate::response::KnownResponse;
use crate::stability::largest_excess;
use crate::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix};
use std::f64::consts::{PI, TAU};

/// Gain limits are searched from 1 / `LARGEST_GAIN` to `LARGEST_GAIN`; stability is tested at `TESTED_GAINS` gains on
/// each side of 1.
const LARGEST_GAIN: f64 = 1e6;
const TESTED_GAINS: u32 = 40;
/// Number of tested gains on each side for loops with more than `LARGE` states.
const TESTED_GAINS_IF_LARGE: u32 = 8;
const LARGE: usize = 100;
/// Where Im T changes its sign, L crosses the real axis if |Im L / Re L| is at most this; otherwise L has a pole there.
const ON_AXIS: f64 = 1e-6;

/// The margins of one channel while the other channels are closed and exact.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ChannelMargins {
    /// The gain factors between which the loop is stable: the lower one is zero if no limit down to
    /// 1e-6 was found, the upper one infinite if none up to 1e6 was found.
    pub gain: [f64; 2],
    /// The largest lag or lead, in rad, below which the loop is stable; infinite if |L| is never 1.
    pub phase: f64,
    /// The frequency of `phase`, in rad per unit of time; zero if |L| is never 1.
    pub phase_frequency: f64,
    /// The delay, in the unit of time, below which the loop is stable; infinite if |L| is never 1. In sampled
    /// time delays are whole samples, and longer ones may be stable, too; see [`super::delay_margin`], and
    /// [`super::sampled_channel_delay`] for fractions of a sample.
    pub delay: f64,
}

/// Computes gain, phase and delay margin of the channel `channel` at `at`.
///
/// With the other channels closed the loop transfer of the channel is L = T / S, with the diagonal
/// entries of T and S. Gain limits are at real negative L, phase margins at |L| = 1. Method: changes
/// of sign between 60 frequencies for each decade and the resonances of the closed and of the opened
/// loop, up to frequencies where |T| is small, located by bisection; the gain limits are confirmed by
/// the eigenvalues of the loop at 40 gains on each side, at 8 if the loop has more than 100 states. Two
/// crossings between adjacent frequencies are missed.
///
/// # Errors
///
/// [`Error::NotHurwitz`], [`Error::NotSchur`] for a loop that is not stable; same as
/// [`crate::response::frequency_response`].
///
/// # Panics
///
/// If there is no such channel.
pub fn channel_margins(closed: &Loop, at: Point, channel: usize) -> Result<ChannelMargins, Error> {
    margins_of(&KnownResponse::new(closed.complementary(at).path(channel, channel))?)
}

/// The margins of the channel whose T is `complementary`.
pub(super) fn margins_of(complementary: &KnownResponse) -> Result<ChannelMargins, Error> {
    let sweep = Sweep::of_loop(complementary)?;
    let transfer = |t: &DMatrix<Complex<f64>>| loop_transfer(t[(0, 0)]);
    // Im L has the sign of Im T, also where L has a pole.
    let crossings = sweep.crossings(|t| t[(0, 0)].im)?;
    let mut limits = vec![];
    let ends = [0, sweep.frequencies.len() - 1].map(|end| sweep.frequencies[end]);
    for frequency in crossings.into_iter().chain(ends) {
        let l = transfer(&complementary.gain(frequency)?);
        let limit = -1.0 / l.re;
        let is_in_range = (1.0 / LARGEST_GAIN..LARGEST_GAIN).contains(&limit);
        if is_in_range && l.im.abs() <= ON_AXIS * l.re.abs() {
            limits.push(limit);
        }
    }
    let gain = gain_limits(&complementary.system, &limits)?;
    let (mut phase, mut phase_frequency, mut delay) = (f64::INFINITY, 0.0, f64::INFINITY);
    for frequency in sweep.crossings(|t| loop_modulus(t[(0, 0)]) - 1.0)? {
        let lag = (-transfer(&complementary.gain(frequency)?)).arg();
        if lag.abs() < phase {
            (phase, phase_frequency) = (lag.abs(), frequency);
        }
        delay = delay.min(lag.rem_euclid(TAU) / frequency);
    }
    if let Domain::Sampled { period } = complementary.system.domain
        && delay >= period
        && transfer(&complementary.gain(PI / period)?).norm() > 1.0
    {
        delay = 0.0;
    }
    Ok(ChannelMargins { gain, phase, phase_frequency, delay })
}

/// The loop transfer L = T / (1 - T).
pub(super) fn loop_transfer(t: Complex<f64>) -> Complex<f64> {
    t / (Complex::new(1.0, 0.0) - t)
}

/// The modulus of L; infinite at a pole of L.
pub(super) fn loop_modulus(t: Complex<f64>) -> f64 {
    t.norm() / (Complex::new(1.0, 0.0) - t).norm()
}

/// The gains about 1 between which the loop of the channel with T = `system` is stable: on each side the nearest of
/// `candidates`, or one that the tests find.
fn gain_limits(system: &StateSpace, candidates: &[f64]) -> Result<[f64; 2], Error> {
    let StateSpace { a, b, c, domain, .. } = system;
    // With T = c (s I - A)^-1 b of the channel, the loop with gain g has the dynamics A - (g - 1) b c.
    let family = RankOne::new(a, b, c);
    let instability =
        |gain: f64| Ok::<_, Error>(largest_excess(&family.eigenvalues(1.0 - gain)?, *domain));
    let count = if a.nrows() > LARGE { TESTED_GAINS_IF_LARGE } else { TESTED_GAINS };
    // The first unstable gain on the way from 1 to `end`, or `end`.
    let confirmed = |end: f64| {
        let far = end.clamp(1.0 / LARGEST_GAIN, LARGEST_GAIN);
        let gains = (1..count).map(|step| far.powf(f64::from(step) / f64::from(count)));
        Ok::<_, Error>(stability_limit(1.0, gains, instability)?.unwrap_or(end))
    };
    let below = candidates.iter().copied().filter(|gain| *gain < 1.0).fold(0.0, f64::max);
    let above = candidates.iter().copied().filter(|gain| *gain > 1.0);
    Ok([confirmed(below)?, confirmed(above.fold(f64::INFINITY, f64::min))?])
}
