//! Adaptive integration of a system up to an end or the first state event.

use std::cell::RefCell;

use super::indicators::Indicators;
use super::{Crossing, Step, search};
use crate::model::Failure;

/// Default of the relative tolerance, see [`Integrator::set_tolerance`].
pub(crate) const TOLERANCE: f64 = 1e-6;

/// Absolute tolerance of a state, divided by the relative tolerance and the nominal value of the state:
/// the recommendation of FMI 2.0.5, section 2.1.6.
const ABSOLUTE: f64 = 0.01;

/// Most integration steps, rejected ones included, in one call of `advance`.
const STEP_LIMIT: u32 = 1_000_000;

/// Resolution of time, relative to the time.
const RESOLUTION: f64 = 4.0 * f64::EPSILON;

/// A system of ordinary differential equations `y' = f(t, y)` with event indicators `z(t, y)`.
pub trait System {
    /// Computes the derivative of `state` at `time` in s.
    ///
    /// # Errors
    ///
    /// [`Failure::Discard`] if the derivative does not exist at this state: the integrator then tries a
    /// shorter step. Other failures end the integration.
    fn derivative(&mut self, time: f64, state: &[f64], slope: &mut [f64]) -> Result<(), Failure>;

    /// Computes the event indicators at `time` in s. The default implementation changes nothing, for a
    /// system without indicators.
    ///
    /// # Errors
    ///
    /// Every failure ends the integration, [`Failure::Discard`] too.
    fn indicators(
        &mut self,
        time: f64,
        state: &[f64],
        indicators: &mut [f64],
    ) -> Result<(), Failure> {
        let _ = (time, state, indicators);
        Ok(())
    }
}

/// The point at which [`Integrator::advance`] stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// At the requested end time.
    End,
    /// At a state event: an indicator changed between z > 0 and z <= 0.
    Event,
}

/// Integrates a [`System`] with steps of adaptive length, and stops at its state events.
///
/// Method: Dormand-Prince 5(4). The root mean square of the local errors of a step, each relative to
/// `tolerance (0.01 nominal + |y|)`, is at most 1. In each step, the polynomials through five values of
/// each indicator are searched for the first change of a sign; the step is then repeated with the length
/// that ends at the event, located to the resolution of time.
#[derive(Clone, Debug)]
pub struct Integrator {
    nominals: Vec<f64>,
    tolerance: f64,
    time: f64,
    step: Step<Vec<f64>>,
    /// Length in s that is suggested for the next step.
    suggested: f64,
    indicators: Indicators,
    /// Buffers for a state and its derivative.
    state: Vec<f64>,
    slope: Vec<f64>,
    /// Buffer for the indicators at the end of a step.
    values: Vec<f64>,
}

impl Integrator {
    /// Creates an integrator for as many states as there are `nominals`, their typical magnitudes, with `indicators`
    /// event indicators.
    #[must_use]
    pub fn new(nominals: Vec<f64>, indicators: usize) -> Self {
        let zero = vec![0.0; nominals.len()];
        Self {
            tolerance: TOLERANCE,
            time: 0.0,
            step: Step::new(zero.clone(), &zero),
            suggested: f64::INFINITY,
            indicators: Indicators::new(indicators),
            slope: zero.clone(),
            state: zero,
            values: vec![0.0; indicators],
            nominals,
        }
    }

    /// Sets the relative tolerance; the default is 1e-6. A value outside of 1e-12 to 1e-2 is replaced by the nearer of
    /// these limits.
    pub fn set_tolerance(&mut self, relative: f64) {
        self.tolerance = relative.clamp(1e-12, 1e-2);
    }

    /// The time reached in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state at the time reached.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        self.step.start()
    }

    /// Starts at the `state` at `time` in s: before the first step, and after each event or other discontinuity.
    ///
    /// Forgets all earlier steps, so that equal states continue with equal bits. `end` is the time in s up to
    /// which the system is integrated next.
    ///
    /// # Errors
    ///
    /// The failures of `system`, except [`Failure::Discard`] of the derivative beyond the start.
    ///
    /// # Panics
    ///
    /// If `state` has not as many components as there are nominal values.
    pub fn start(
        &mut self,
        system: &mut (impl System + ?Sized),
        time: f64,
        state: &[f64],
        end: f64,
    ) -> Result<(), Failure> {
        self.time = time;
        self.state.copy_from_slice(state);
        let mut result = Ok(());
        self.step.restart(&self.state, |y, slope| result = system.derivative(time, y, slope));
        result?;
        if !self.indicators.is_empty() {
            system.indicators(time, state, self.indicators.sample_mut(0))?;
            self.indicators.keep_signs();
        }
        self.suggested = self.first_length(system, end - time)?;
        Ok(())
    }

    /// Integrates to `end` in s, or to the first state event before it.
    ///
    /// At an event the state is the state directly after the change of the sign, at most the resolution of time later.
    /// Call [`Integrator::start`] before the next call of this function. Nothing is allocated.
    ///
    /// # Errors
    ///
    /// [`Failure::Incomplete`] with the time reached if the state, its derivative or an indicator is not finite, if
    /// even the shortest step exceeds the tolerance or reaches a state without a derivative, or after a million steps;
    /// the other failures of `system`.
    pub fn advance(
        &mut self,
        system: &mut (impl System + ?Sized),
        end: f64,
    ) -> Result<Reached, Failure> {
        for _ in 0..STEP_LIMIT {
            let remaining = end - self.time;
            if remaining <= 0.0 {
                return Ok(Reached::End);
            }
            let is_last = remaining <= 1.01 * self.suggested;
            let length = if is_last { remaining } else { self.suggested };
            if !self.try_step(system, length, !is_last)? {
                continue;
            }
            if let Some(fraction) = self.find_crossing(system)?
                && self.step_to_event(system, fraction, length)? == Reached::Event
            {
                return Ok(Reached::Event);
            }
            self.time = if is_last { end } else { self.time + length };
            self.step.proceed();
            self.indicators.proceed();
        }
        Err(self.stopped(format!("more than {STEP_LIMIT} integration steps")))
    }

    /// Takes a step of `length` from the state reached. Returns false, and suggests a shorter step, if its error is too
    /// large or a derivative does not exist. Otherwise suggests the length of the next step if `grows`.
    fn try_step(
        &mut self,
        system: &mut (impl System + ?Sized),
        length: f64,
        grows: bool,
    ) -> Result<bool, Failure> {
        let outcome = self.take(system, length);
        if let Err(failure) = &outcome
            && !matches!(failure, Failure::Discard(_))
        {
            return outcome.map(|()| false);
        }
        let error = if outcome.is_ok() { self.error() } else { f64::NAN };
        if error <= 1.0 {
            if grows {
                self.suggested = length * growth(error);
            }
            return Ok(true);
        }
        self.suggested = length * growth(error).min(0.9);
        if self.suggested > RESOLUTION * self.time.abs() && self.suggested > f64::MIN_POSITIVE {
            return Ok(false);
        }
        Err(match outcome {
            Err(failure) => self.stopped(failure.to_string()),
            Ok(()) if error.is_finite() => self
                .stopped(format!("no step is short enough for the tolerance {}", self.tolerance)),
            Ok(()) => self.stopped("a state or its derivative is not finite".to_owned()),
        })
    }

    /// Takes a step of `length` in s without a test of its error.
    fn take(&mut self, system: &mut (impl System + ?Sized), length: f64) -> Result<(), Failure> {
        let system_and_result = RefCell::new((system, Ok(())));
        let evaluate = |time: f64, state: &Vec<f64>, slope: &mut Vec<f64>| {
            let (system, result) = &mut *system_and_result.borrow_mut();
            if result.is_ok() {
                *result = system.derivative(time, state, slope);
            }
        };
        self.step.take(evaluate, evaluate, self.time, length);
        system_and_result.into_inner().1
    }

    /// The root mean square of the errors of the step, each relative to its bound.
    fn error(&self) -> f64 {
        let largest = |i: usize| self.step.start()[i].abs().max(self.step.end()[i].abs());
        self.norm(|i| (self.step.error(i), largest(i)))
    }

    /// The root mean square over all states of value / (tolerance (0.01 nominal + magnitude)). `of` returns
    /// value and magnitude for the index of a state.
    fn norm(&self, of: impl Fn(usize) -> (f64, f64)) -> f64 {
        if self.nominals.is_empty() {
            return 0.0;
        }
        let mut sum = 0.0;
        for (i, nominal) in self.nominals.iter().enumerate() {
            let (value, magnitude) = of(i);
            let scaled = value / (self.tolerance * (ABSOLUTE * nominal.abs() + magnitude));
            sum += scaled * scaled;
        }
        #[expect(clippy::cast_precision_loss, reason = "numbers of states are small")]
        (sum / self.nominals.len() as f64).sqrt()
    }

    /// The length in s of the first step of an interval of `remaining` s.
    ///
    /// The whole interval if the state changes by at most about 1 % in it. Otherwise the length follows from the method
    /// of Hairer, Norsett and Wanner, section II.4, which costs one evaluation.
    fn first_length(
        &mut self,
        system: &mut (impl System + ?Sized),
        remaining: f64,
    ) -> Result<f64, Failure> {
        let start = |i: usize| self.step.start()[i];
        let size = self.norm(|i| (start(i), start(i).abs()));
        let rate = self.norm(|i| (self.step.first_slope()[i], start(i).abs()));
        let small = if size < 1e-5 || rate < 1e-5 { 1e-6 } else { 0.01 * size / rate };
        if remaining <= small || rate == 0.0 {
            return Ok(remaining);
        }
        let small = small.max(RESOLUTION * self.time.abs());
        for (i, value) in self.state.iter_mut().enumerate() {
            *value = self.step.start()[i] + small * self.step.first_slope()[i];
        }
        match system.derivative(self.time + small, &self.state, &mut self.slope) {
            Ok(()) => {}
            Err(Failure::Discard(_)) => return Ok(small),
            Err(failure) => return Err(failure),
        }
        let bend = |i: usize| (self.slope[i] - self.step.first_slope()[i]) / small;
        let bend = self.norm(|i| (bend(i), self.step.start()[i].abs()));
        let fastest = rate.max(bend);
        let long = if fastest <= 1e-15 { small * 1e-3 } else { libm::pow(0.01 / fastest, 0.2) };
        Ok(if bend.is_finite() { long.min(100.0 * small) } else { small })
    }

    /// Returns the fraction of the step after which the first event is expected; `None` if none is.
    fn find_crossing(
        &mut self,
        system: &mut (impl System + ?Sized),
    ) -> Result<Option<f64>, Failure> {
        if self.indicators.is_empty() {
            return Ok(None);
        }
        let length = self.step.length();
        for (k, part) in [(1, 0.25), (2, 0.5), (3, 0.75)] {
            for (i, value) in self.state.iter_mut().enumerate() {
                *value = self.step.extension(i).value(part);
            }
            let place = self.indicators.sample_mut(k);
            system.indicators(self.time + part * length, &self.state, place)?;
        }
        let place = self.indicators.sample_mut(4);
        system.indicators(self.time + length, self.step.end(), place)?;
        if let Some((i, value)) = self.indicators.first_not_finite() {
            return Err(self.stopped(format!("event indicator {} is {value}", i + 1)));
        }
        Ok(self.indicators.first_crossing())
    }

    /// Repeats the step of `length` so that it ends directly after the event that is expected at
    /// `fraction`. Takes the whole step and returns `End` if no event happens in it.
    fn step_to_event(
        &mut self,
        system: &mut (impl System + ?Sized),
        fraction: f64,
        length: f64,
    ) -> Result<Reached, Failure> {
        let width = RESOLUTION * self.time.abs().max(length);
        let mut failure = None;
        let crossing = search(fraction, length, width, |length| {
            self.margin(system, length).unwrap_or_else(|reason| {
                failure.get_or_insert(reason);
                f64::NAN
            })
        });
        if let Some(failure) = failure {
            return Err(failure);
        }
        let (length, reached) = match crossing {
            Crossing::At(length) => (length, Reached::Event),
            Crossing::NoneUpTo(length) => (length, Reached::End),
        };
        self.take(system, length)?;
        if reached == Reached::Event {
            self.time += length;
            self.step.proceed();
        }
        Ok(reached)
    }

    /// The distance to an event at the end of a step of `length`; an error if an indicator is NaN there.
    fn margin(&mut self, system: &mut (impl System + ?Sized), length: f64) -> Result<f64, Failure> {
        self.take(system, length)?;
        system.indicators(self.time + length, self.step.end(), &mut self.values)?;
        match self.indicators.margin(&self.values) {
            margin if margin.is_nan() => Err(self.stopped("an event indicator is NaN".to_owned())),
            margin => Ok(margin),
        }
    }

    #[cold]
    fn stopped(&self, message: String) -> Failure {
        Failure::Incomplete { time: self.time, message }
    }
}

/// Factor from the length of a step with the scaled error `error` to the length of the next step.
fn growth(error: f64) -> f64 {
    if error.is_finite() { (0.9 * libm::pow(error, -0.2)).clamp(0.2, 5.0) } else { 0.1 }
}
