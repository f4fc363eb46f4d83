//! Step and ramp responses, on a time grid that is adapted to the modes.

use crate::balance::power_of_two;
use crate::check::as_number;
use crate::hold::FirstOrderHold;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::SQRT_2;

/// A mode is followed until it has decayed to e^-25, about 1e-11.
const FOLLOWED: f64 = 25.0;
/// Steps per time constant and per radian of an oscillation; the second value for `LARGE` systems.
const STEPS: [f64; 2] = [10.0, 4.0];
/// The largest number of points of a response, and the number reserved for each mode that has not been followed yet.
const MOST_POINTS: f64 = 200_000.0;
const RESERVED: f64 = 500.0;
/// From this order on, the outputs at all times are computed together and at fewer points.
const LARGE: usize = 48;

/// The outputs of a system over time.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeResponse {
    /// Times, ascending from 0, in the unit of time of A or of the period.
    pub time: Vec<f64>,
    /// z at the times `time`, with a row for each output; at time 0 after the jump of the input.
    pub output: DMatrix<f64>,
    /// The limit of z for large times, p.
    pub final_value: DVector<f64>,
    /// z' at the times `time`; no columns in sampled time, or if the points do not follow every oscillation.
    pub(super) slope: DMatrix<f64>,
}

impl TimeResponse {
    /// The response to an input that is `factor` times as large.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self {
            output: self.output * factor,
            final_value: self.final_value * factor,
            slope: self.slope * factor,
            ..self
        }
    }
}

/// Computes the response to a unit step of one input, from rest.
///
/// `input`: the index of the input, from 0. The system must be stable. The grid has ten steps (four from 48 states on)
/// per time constant or radian of the fastest mode that has not yet decayed; a mode counts as decayed after 25 time
/// constants. A real mode adds about 250 points. Each point is exact up to rounding for every step size: it is computed
/// by matrix exponentials, in sampled time by powers of A, with steps of whole samples. A response has at most about
/// 200000 points: an oscillation damped so lightly that it needs more gets fewer per radian, and a peak between them is
/// missed. Rates 1e5 apart lose about four digits. Cost: about 20 (n + 2 m)^3 multiplications per mode, n (n + p) per
/// point; from 48 states on the outputs are products of large matrices, whose last bits depend on the processor.
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] for `input`; [`Error::NotHurwitz`],
/// [`Error::NotSchur`]; [`Error::Overflow`].
pub fn step_response(system: &StateSpace, input: usize) -> Result<TimeResponse, Error> {
    response(system, input, None)
}

/// Computes the response to an input that rises linearly from 0 to 1 over `duration`, then stays at 1.
///
/// Same as [`step_response`], with a new grid at the end of the ramp. In sampled time the input has the
/// values of the ramp at the samples; the end of the ramp may lie between two of them.
///
/// # Errors
///
/// Same as [`step_response`]; [`Error::OutOfRange`] for `duration`.
pub fn ramp_response(
    system: &StateSpace,
    input: usize,
    duration: f64,
) -> Result<TimeResponse, Error> {
    check::positive("duration", duration)?;
    response(system, input, Some(duration))
}

/// Computes the final value of [`step_response`], p: the limit of z for large times.
///
/// # Errors
///
/// Same as [`step_response`].
pub fn settled_output(system: &StateSpace, input: usize) -> Result<DVector<f64>, Error> {
    system.stable_eigenvalues()?;
    check_input(system, input)?;
    let mut constant = DVector::zeros(system.b.ncols());
    constant[input] = 1.0;
    settled(system, &constant)
}

/// C (s I - A)^-1 B w + D w for a constant signal w: s = 0, in sampled time s = 1.
fn settled(system: &StateSpace, input: &DVector<f64>) -> Result<DVector<f64>, Error> {
    let rest = system.dc_matrix().lu().solve(&(&system.b * input));
    let rest = rest.ok_or(Error::Overflow { what: "the settled output" })?;
    Ok(&system.c * rest + &system.d * input)
}

fn check_input(system: &StateSpace, input: usize) -> Result<(), Error> {
    let rule = "an index below the number of columns of B";
    check::that(input < system.b.ncols(), "input", as_number(input), rule)
}

/// The response to a unit step, or to a ramp that lasts `rise`.
fn response(system: &StateSpace, input: usize, rise: Option<f64>) -> Result<TimeResponse, Error> {
    let eigenvalues = system.stable_eigenvalues()?;
    check_input(system, input)?;
    let modes = Modes::new(&eigenvalues, system.domain);
    let mut simulation = GridSimulation::from_rest(system);
    if let Some(rise) = rise {
        let (whole, rest) = modes.samples_in(rise);
        simulation.slope[input] = 1.0 / rise;
        if whole > 0.0 {
            simulation.follow(&modes.segments(whole))?;
        }
        if rest > 0.0 {
            simulation.slope[input] = (1.0 - whole / rise) / rest;
            simulation.follow(&[Segment { step: rest, count: 1, is_coarse: false }])?;
        }
        simulation.slope[input] = 0.0;
    }
    simulation.input[input] = 1.0;
    simulation.follow(&modes.segments(f64::INFINITY))?;
    simulation.into_response()
}

/// A duration within this relative difference of a whole number of samples counts as this number.
const ON_A_SAMPLE: f64 = 1e-9;

/// The modes of a system, and its period.
struct Modes {
    /// The modes, the fastest decay first.
    list: Vec<Mode>,
    /// The sample period; zero in continuous time.
    period: f64,
}

struct Mode {
    /// The time at which the mode has decayed.
    end: f64,
    /// The modulus of the mode's eigenvalue in continuous time, in 1 / time.
    rate: f64,
}

/// Steps of one length.
struct Segment {
    step: f64,
    count: u64,
    /// Whether the steps are too long to follow the fastest oscillation.
    is_coarse: bool,
}

impl Modes {
    fn new(eigenvalues: &[Complex<f64>], domain: Domain) -> Self {
        let exponents = eigenvalues.iter().map(|value| match domain {
            Domain::Continuous => *value,
            Domain::Sampled { period } => {
                Complex::new(value.norm().max(f64::MIN_POSITIVE).ln(), value.arg()) / period
            }
        });
        let period = match domain {
            Domain::Continuous => 0.0,
            Domain::Sampled { period } => period,
        };
        let shift_register = period * as_number(eigenvalues.len());
        let mode = |exponent: Complex<f64>| Mode {
            end: (FOLLOWED / exponent.re.abs()).max(shift_register),
            rate: exponent.norm(),
        };
        let mut list: Vec<_> = exponents.map(mode).collect();
        list.sort_by(|x, y| x.end.total_cmp(&y.end));
        Self { list, period }
    }

    /// Divides the duration of a ramp into the time of the whole samples in it, and the time of one more sample
    /// that contains its end, 0 if it ends on a sample. In continuous time the result is `time` and 0.
    fn samples_in(&self, time: f64) -> (f64, f64) {
        if self.period == 0.0 {
            return (time, 0.0);
        }
        let samples = time / self.period;
        let nearest = samples.round();
        if nearest > 0.0 && (samples - nearest).abs() <= ON_A_SAMPLE * nearest {
            return (nearest * self.period, 0.0);
        }
        (samples.floor() * self.period, self.period)
    }

    /// Rounds a time to whole samples, at least one; in continuous time the same time.
    fn in_samples(&self, time: f64) -> f64 {
        if self.period > 0.0 { (time / self.period).round().max(1.0) * self.period } else { time }
    }

    /// Steps from 0 to `end`, or to the end of the slowest mode if `end` is infinite.
    fn segments(&self, end: f64) -> Vec<Segment> {
        let mut segments = Vec::new();
        let (mut from, mut remaining) = (0.0, MOST_POINTS);
        for first in 0..self.list.len() {
            let is_last = first + 1 == self.list.len();
            let mode_end = self.list[first].end;
            let until = if is_last && end.is_finite() { end } else { mode_end.min(end) };
            let until = self.in_samples(until);
            if until <= from {
                continue;
            }
            let rate = self.list[first..].iter().map(|mode| mode.rate).fold(0.0_f64, f64::max);
            let resolving = 1.0 / (STEPS[usize::from(self.list.len() >= LARGE)] * rate);
            let reserved = RESERVED * as_number(self.list.len() - first);
            let spacing = resolving.max((until - from) / (remaining - reserved).max(RESERVED));
            let is_coarse = spacing > resolving;
            if self.period == 0.0 && until + spacing < end {
                // Steps are powers of two, so that neighbours share a propagator. The last step may end after `until`.
                let step = power_of_two(spacing / SQRT_2);
                let count = ((until - from) / step).ceil();
                remaining -= count;
                from += count * step;
                segments.push(Segment { step, count: as_count(count), is_coarse });
                continue;
            }
            let count = if self.period > 0.0 {
                let stride = (spacing / self.period).floor().max(1.0) * self.period;
                ((until - from) / stride).ceil()
            } else {
                ((until - from) / spacing).ceil()
            };
            remaining -= count;
            self.push(&mut segments, until - from, count, is_coarse);
            from = until;
        }
        segments
    }

    /// Adds `count` steps that take `time` together; in sampled time steps of whole samples, with a shorter last step.
    fn push(&self, list: &mut Vec<Segment>, time: f64, count: f64, is_coarse: bool) {
        if self.period == 0.0 {
            list.push(Segment { step: time / count, count: as_count(count), is_coarse });
            return;
        }
        let samples = (time / self.period).round();
        let stride = (samples / count).ceil();
        let full = (samples / stride).floor();
        let rest = samples - full * stride;
        list.push(Segment { step: stride * self.period, count: as_count(full), is_coarse });
        if rest > 0.0 {
            list.push(Segment { step: rest * self.period, count: 1, is_coarse });
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of samples")]
fn as_count(samples: f64) -> u64 {
    samples as u64
}

struct GridSimulation<'a> {
    system: &'a StateSpace,
    state: DVector<f64>,
    input: DVector<f64>,
    slope: DVector<f64>,
    time: Vec<f64>,
    /// States, inputs and slopes of the inputs at all times, one time after the other.
    states: Vec<f64>,
    inputs: Vec<f64>,
    slopes: Vec<f64>,
    /// Whether the points follow every oscillation.
    is_resolved: bool,
}

impl<'a> GridSimulation<'a> {
    fn from_rest(system: &'a StateSpace) -> Self {
        let (n, m) = system.b.shape();
        Self {
            system,
            state: DVector::zeros(n),
            input: DVector::zeros(m),
            slope: DVector::zeros(m),
            time: Vec::new(),
            states: Vec::new(),
            inputs: Vec::new(),
            slopes: Vec::new(),
            is_resolved: true,
        }
    }

    /// Adds the present state, input and slope as a point of the grid.
    fn record(&mut self, time: f64) {
        self.time.push(time);
        self.states.extend(self.state.iter());
        self.inputs.extend(self.input.iter());
        self.slopes.extend(self.slope.iter());
    }

    /// Simulates the segments, from the point where the previous call ended.
    fn follow(&mut self, segments: &[Segment]) -> Result<(), Error> {
        if self.time.is_empty() {
            self.record(0.0);
        }
        let mut known: Option<(f64, FirstOrderHold)> = None;
        for segment in segments {
            self.is_resolved &= !segment.is_coarse;
            let begin = self.time[self.time.len() - 1];
            // Neighbouring segments often have the same step.
            let hold =
                match known.take().filter(|(step, _)| step.to_bits() == segment.step.to_bits()) {
                    Some((_, hold)) => hold,
                    None => hold(self.system, segment.step)?,
                };
            let mut next = DVector::zeros(self.state.len());
            for k in 1..=segment.count {
                let signals = [&self.state, &self.input, &self.slope];
                let [state, input, slope] = signals.map(DVector::as_slice);
                hold.step_into(state, input, slope, next.as_mut_slice())?;
                self.state.copy_from(&next);
                self.input.axpy(segment.step, &self.slope, 1.0);
                #[expect(clippy::cast_precision_loss, reason = "about 200000 at most")]
                self.record(begin + segment.step * k as f64);
            }
            known = Some((segment.step, hold));
        }
        Ok(())
    }

    fn into_response(self) -> Result<TimeResponse, Error> {
        let StateSpace { a, b, c, d, domain } = self.system;
        let (points, (n, m)) = (self.time.len(), b.shape());
        let states = DMatrix::from_vec(n, points, self.states);
        let inputs = DMatrix::from_vec(m, points, self.inputs);
        let slopes = DMatrix::from_vec(m, points, self.slopes);
        let sum = |[of_state, of_input]: [&DMatrix<f64>; 2],
                   (states, inputs): (&DMatrix<f64>, &DMatrix<f64>)| {
            if n >= LARGE {
                return of_state * states + of_input * inputs;
            }
            // One product for each time has the same bits on every processor.
            let mut all = DMatrix::zeros(of_state.nrows(), points);
            for (k, mut column) in all.column_iter_mut().enumerate() {
                column.copy_from(&(of_state * states.column(k) + of_input * inputs.column(k)));
            }
            all
        };
        let output = check::in_range("the response", sum([c, d], (&states, &inputs)))?;
        let slope = match domain {
            Domain::Continuous if self.is_resolved => {
                sum([c, d], (&sum([a, b], (&states, &inputs)), &slopes))
            }
            _ => DMatrix::zeros(output.nrows(), 0),
        };
        let final_value = settled(self.system, &self.input)?;
        Ok(TimeResponse { time: self.time, output, final_value, slope })
    }
}

/// The propagator of a step; in sampled time of a whole number of samples, by repeated squaring.
fn hold(system: &StateSpace, step: f64) -> Result<FirstOrderHold, Error> {
    let StateSpace { a, b, domain, .. } = system;
    let Domain::Sampled { period } = *domain else {
        return FirstOrderHold::new(a, b, step);
    };
    let mut remaining = as_count((step / period).round());
    let (n, m) = b.shape();
    let (zero, identity) = (DMatrix::zeros(n, m), DMatrix::identity(n, n));
    let mut total = FirstOrderHold { phi: identity, gamma_0: zero.clone(), gamma_1: zero.clone() };
    let mut power = FirstOrderHold { phi: a.clone(), gamma_0: b.clone(), gamma_1: zero };
    let (mut power_time, mut time) = (period, 0.0);
    while remaining > 0 {
        if remaining % 2 == 1 {
            total = chained(&total, time, &power);
            time += power_time;
        }
        power = chained(&power, power_time, &power);
        power_time *= 2.0;
        remaining /= 2;
    }
    Ok(total)
}

/// The propagator of step `one`, which takes `time`, followed by step `other`.
fn chained(one: &FirstOrderHold, time: f64, other: &FirstOrderHold) -> FirstOrderHold {
    FirstOrderHold {
        phi: &other.phi * &one.phi,
        gamma_0: &other.phi * &one.gamma_0 + &other.gamma_0,
        gamma_1: &other.phi * &one.gamma_1 + &other.gamma_0 * time + &other.gamma_1,
    }
}
