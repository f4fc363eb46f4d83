//! The motion of the friction pendulum: integration between events, and the events.
//!
//! While sliding the friction is a smooth function of the state; while sticking the cart is held
//! and the pendulum moves alone. Each segment between two events is integrated by Dormand-Prince steps of adaptive
//! length. In every step the polynomial of the margin to the next event is searched for its first
//! sign change, and the step is repeated with the length that ends at the event.

use crate::dynamics::{Force, State};
use crate::friction::Regime;
use crate::functions::Memory;
use crate::parameters::{Parameters, Refusal, require};
use crate::plant::{Crossing, NotFinite, Plant};
use crate::response::Response;
use fmu::solver::{self, search};
use segment::Segment;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub(crate) use tolerance::Tolerance;

pub(crate) mod exchange;
mod segment;
mod tolerance;

/// Suggested length in s of the first integration step.
const FIRST_STEP: f64 = 1e-3;

/// Longest integration step in s.
const LONGEST_STEP: f64 = 0.1;

/// Shortest length in s to which a rejected integration step is reduced.
const SHORTEST_STEP: f64 = 1e-13;

/// Width in s to which an event is located.
const EVENT_WIDTH: f64 = 1e-15;

/// The largest number of integration steps, rejected ones included, in one call of `advance`.
const STEP_LIMIT: u32 = 200_000;

/// The largest number of events in one call of `advance`.
const EVENT_LIMIT: u32 = 10_000;

/// The reason why the motion could not be integrated to the end of the interval.
///
/// The state of the motion is then the one at [`Failure::time`].
#[derive(Clone, Debug, PartialEq, Error)]
pub(crate) enum Failure {
    /// Start or duration is not finite, or the duration is negative.
    #[error("interval from {start} s of {duration} s: must be finite and not negative")]
    Interval { start: f64, duration: f64 },
    /// The force, the state or its derivative is infinite or not a number.
    #[error("force, state or its derivative is not finite after t = {time} s")]
    NotFinite { time: f64 },
    /// No step is short enough for the tolerance.
    #[error("the integration step fell below {SHORTEST_STEP} s at t = {time} s")]
    StepUnderflow { time: f64 },
    /// The interval needs too many integration steps: the parameters make the motion too fast.
    #[error("more than {STEP_LIMIT} integration steps in one communication step, at t = {time} s")]
    TooManySteps { time: f64 },
    /// The cart stops and starts too often.
    #[error("more than {EVENT_LIMIT} stick-slip events in one communication step, at t = {time} s")]
    TooManyEvents { time: f64 },
}

impl Failure {
    /// The time in s to which the motion was integrated.
    pub(crate) fn time(&self) -> f64 {
        match self {
            Self::Interval { start: time, .. }
            | Self::NotFinite { time }
            | Self::StepUnderflow { time }
            | Self::TooManySteps { time }
            | Self::TooManyEvents { time } => *time,
        }
    }
}

/// The state of the plant between steps; a copy continues with the same bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Motion {
    state: State,
    regime: Regime,
    suggested_step: f64,
    /// Whether [`Motion::advance`] integrates the motion; otherwise an importer does.
    advances: bool,
    /// The last interval, if it ended at an event.
    interrupted: Option<Interrupted>,
    #[serde(skip)]
    memory: Memory,
}

/// An interval of the motion; times in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Interval {
    start: f64,
    duration: f64,
    /// The duration of the part that is integrated.
    elapsed: f64,
}

impl Interval {
    /// The time reached.
    fn time(&self) -> f64 {
        self.start + self.elapsed
    }

    /// Whether `rest` is the part of this interval that is not integrated. The ends of both may differ by rounding.
    fn ends_with(&self, rest: &Self) -> bool {
        let (end, end_of_rest) = (self.start + self.duration, rest.start + rest.duration);
        self.time().to_bits() == rest.start.to_bits()
            && (end - end_of_rest).abs() <= 4.0 * f64::EPSILON * end.abs()
    }
}

/// An interval that ended at an event, under a constant force in N.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Interrupted {
    interval: Interval,
    force: f64,
    parameters: Parameters,
}

impl Default for Motion {
    /// The cart at rest at the origin, and the pendulum at rest at the angle 0.
    fn default() -> Self {
        Self {
            state: [0.0; 4],
            regime: Regime::Stick,
            suggested_step: FIRST_STEP,
            advances: false,
            interrupted: None,
            memory: Memory::default(),
        }
    }
}

impl Motion {
    /// The motion from an initial state `[x_p, theta, v_p, omega]` under the force at that time.
    ///
    /// The parameters must have passed their check. An error for the first initial value that is not finite.
    pub(crate) fn start(
        parameters: &Parameters,
        initial: State,
        force: f64,
    ) -> Result<Self, Refusal> {
        let names = ["x_p_0", "theta_0", "v_p_0", "omega_0"];
        for (name, value) in names.into_iter().zip(initial) {
            require(name, value, true, "finite")?;
        }
        let mut motion = Self { state: initial, ..Self::default() };
        let plant = Plant::new(parameters, Force::constant(force), &motion.memory);
        motion.regime = plant.regime(0.0, &initial);
        Ok(motion)
    }

    /// The state `[x_p, theta, v_p, omega]` in m, rad, m/s, rad/s.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// The state, for an importer that integrates it.
    pub(crate) fn state_mut(&mut self) -> &mut State {
        &mut self.state
    }

    /// The regime of the cart.
    pub(crate) fn regime(&self) -> Regime {
        self.regime
    }

    /// Friction and derivative of the state under the force `u + f_a` in N at this time.
    pub(crate) fn response(&self, parameters: &Parameters, force: f64) -> Response {
        Response::new(&self.memory, parameters, self.regime, &self.state, force)
    }

    /// Integrates the motion from the time `start` for `duration`, both in s, under a force that is a
    /// polynomial of time.
    ///
    /// Force and parameters may have changed since the last call: the regime is decided anew first.
    /// The parameters must have passed their check.
    ///
    /// Method: Dormand-Prince 5(4), the error of each step held below a tenth of the tolerance (2-norm
    /// of the components, each relative to its own size); events are located to 1e-15 s. Cost: an
    /// interval shorter than the suggested step takes one step: seven evaluations of the dynamics, of
    /// which the first finds sine, cosine and exponential remembered; nothing is allocated.
    ///
    /// After an error the state is the state at [`Failure::time`].
    pub(crate) fn advance(
        &mut self,
        parameters: &Parameters,
        force: &Force,
        start: f64,
        duration: f64,
        tolerance: &Tolerance,
    ) -> Result<(), Failure> {
        self.advance_until(parameters, force, start, duration, tolerance, false).map(|_| ())
    }

    /// Same as [`Motion::advance`], but stops at the first stop or break-away. Returns the time of this event in s;
    /// `None` at the end of the interval.
    ///
    /// If the next interval is the rest of this one under the same constant force, the motion has the same
    /// bits as without the stop.
    pub(crate) fn advance_to_event(
        &mut self,
        parameters: &Parameters,
        force: &Force,
        start: f64,
        duration: f64,
        tolerance: &Tolerance,
    ) -> Result<Option<f64>, Failure> {
        self.advance_until(parameters, force, start, duration, tolerance, true)
    }

    /// Integrates the motion over the interval or, if it `stops` there, to the first event at a later time than
    /// `start`. Returns the time of this event in s; `None` at the end of the interval.
    fn advance_until(
        &mut self,
        parameters: &Parameters,
        force: &Force,
        start: f64,
        duration: f64,
        tolerance: &Tolerance,
        stops: bool,
    ) -> Result<Option<f64>, Failure> {
        if !(start.is_finite() && (0.0..f64::INFINITY).contains(&duration)) {
            return Err(Failure::Interval { start, duration });
        }
        if !force.is_finite() {
            return Err(Failure::NotFinite { time: start });
        }
        let whole = Interval { start, duration, elapsed: 0.0 };
        let continued = self.interrupted.take().filter(|interrupted| {
            let alike = force.is_constant() && interrupted.force.to_bits() == force.value.to_bits();
            alike && interrupted.parameters == *parameters && interrupted.interval.ends_with(&whole)
        });
        let mut interval = continued.as_ref().map_or(whole, |interrupted| interrupted.interval);
        let memory = std::mem::take(&mut self.memory);
        let plant = Plant::new(parameters, force.seen_from(interval.start), &memory);
        if continued.is_none() {
            self.regime = plant.regime(0.0, &self.state);
        }
        self.advances = true;
        let stopped = self.integrate(&plant, &mut interval, tolerance, stops);
        self.memory = memory;
        if !stopped? {
            return Ok(None);
        }
        let (force, constant) = (force.value, force.is_constant());
        self.interrupted =
            constant.then(|| Interrupted { interval, force, parameters: parameters.clone() });
        Ok(Some(interval.time()))
    }

    /// Integrates the motion of `plant` to the end of the interval or, if it `stops` there, to the first
    /// event at a later time. Returns whether it has stopped at an event.
    fn integrate(
        &mut self,
        plant: &Plant<'_>,
        interval: &mut Interval,
        tolerance: &Tolerance,
        stops: bool,
    ) -> Result<bool, Failure> {
        let Interval { start, duration, mut elapsed } = *interval;
        let from = interval.time();
        let mut events = 0;
        for _ in 0..STEP_LIMIT {
            if elapsed >= duration {
                return Ok(false);
            }
            let time = start + elapsed;
            match self.take_step(plant, elapsed, duration - elapsed, tolerance) {
                Progress::Finished => elapsed = duration,
                Progress::Advanced(length) => elapsed += length,
                Progress::Event(length) => {
                    elapsed += length;
                    if stops && start + elapsed > from {
                        interval.elapsed = elapsed;
                        return Ok(true);
                    }
                    events += 1;
                    if events > EVENT_LIMIT {
                        return Err(Failure::TooManyEvents { time: start + elapsed });
                    }
                }
                Progress::Rejected => {}
                Progress::Underflow => return Err(Failure::StepUnderflow { time }),
                Progress::NotFinite => return Err(Failure::NotFinite { time }),
            }
        }
        Err(Failure::TooManySteps { time: start + elapsed })
    }

    /// Takes one integration step, at most to the end of the interval and to the next event.
    fn take_step(
        &mut self,
        plant: &Plant<'_>,
        elapsed: f64,
        remaining: f64,
        tolerance: &Tolerance,
    ) -> Progress {
        let segment = Segment::new(plant, self, elapsed);
        let limit = self.suggested_step.min(segment.resolving_length());
        let is_last = remaining <= 1.01 * limit;
        let length = if is_last { remaining } else { limit };
        let step = segment.step(length);
        let error = tolerance.squared_error(&step);
        if error.is_nan() || error > 1.0 {
            return self.reject(length, error);
        }
        if length >= self.suggested_step {
            self.suggested_step = (length * growth(error)).min(LONGEST_STEP);
        }
        match plant.first_crossing(segment.regime, elapsed, &step) {
            Err(NotFinite) => Progress::NotFinite,
            Ok(Some(crossing)) => self.step_to_event(&crossing, &segment, length, tolerance),
            Ok(None) => {
                self.state = *step.end();
                if is_last { Progress::Finished } else { Progress::Advanced(length) }
            }
        }
    }

    /// Suggests a shorter step after a step with this squared error; a failure if it would be too short.
    fn reject(&mut self, length: f64, error: f64) -> Progress {
        self.suggested_step = length * growth(error).min(0.9);
        if self.suggested_step >= SHORTEST_STEP {
            return Progress::Rejected;
        }
        self.suggested_step = FIRST_STEP;
        if error.is_finite() { Progress::Underflow } else { Progress::NotFinite }
    }

    /// Repeats a step of `length` so that it ends where the margin becomes negative.
    ///
    /// If the margin at the end of the repeated step is not negative, it only touched zero in the continuous extension,
    /// or by rounding. The crossing is then searched at doubled lengths, up to the whole step, so that every step makes
    /// progress. The error of the repeated step is tested, because it evaluates the friction at its end, which the
    /// longer step may have missed.
    fn step_to_event(
        &mut self,
        crossing: &Crossing,
        segment: &Segment,
        length: f64,
        tolerance: &Tolerance,
    ) -> Progress {
        let direction = crossing.direction;
        let margin = |length: f64| segment.margin(direction, &segment.step(length));
        let (length, happens) = match search(crossing.fraction, length, EVENT_WIDTH, margin) {
            solver::Crossing::At(length) => (length, true),
            solver::Crossing::NoneUpTo(length) => (length, false),
        };
        let step = segment.step(length);
        let error = tolerance.squared_error(&step);
        if error.is_nan() || error > 1.0 {
            return self.reject(length, error);
        }
        self.state = *step.end();
        if !happens {
            return Progress::Advanced(length);
        }
        if segment.regime == Regime::Stick {
            self.regime = direction;
        } else {
            self.state[2] = 0.0;
            self.regime = segment.plant.regime(segment.elapsed + length, &self.state);
        }
        Progress::Event(length)
    }
}

/// The result of one integration step; lengths are in s.
enum Progress {
    /// The end of the interval is reached.
    Finished,
    /// The motion was advanced by this length, without an event.
    Advanced(f64),
    /// The step of this length ended in an event.
    Event(f64),
    /// The error of the step is too large; it will be repeated with a shorter length.
    Rejected,
    /// No step is short enough for the tolerance.
    Underflow,
    /// The state, its derivative or the margin is not finite.
    NotFinite,
}

/// The length of the next step divided by that of a step with this squared scaled error.
fn growth(squared_error: f64) -> f64 {
    if squared_error.is_finite() {
        (0.9 * libm::pow(squared_error, -0.1)).clamp(0.2, 5.0)
    } else {
        0.1
    }
}

#[cfg(test)]
mod tests;
