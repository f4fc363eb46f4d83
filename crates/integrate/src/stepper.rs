//! Adaptive steps between events: step size, choice of the method, continuous extension.

use serde::{Deserialize, Serialize};
use slave::{CallError, Failure, Status};
use solve::Scale;

use crate::explicit::Explicit;
use crate::method::Method;
use crate::rosenbrock::Rosenbrock;
use crate::start::StepStart;

/// Ratio of the chosen step to the largest step that meets the tolerance.
const SAFETY: f64 = 0.9;
/// The smallest and the largest ratio of two consecutive steps.
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;
/// Ratio of the next trial step to a trial step that cannot be evaluated.
const RETREAT: f64 = 0.25;
/// A remaining distance that exceeds the step by less than this factor is made in one step.
const STRETCH: f64 = 1.01;
/// The perturbation of a state for a difference quotient is relative to its absolute value, but at least to this
/// fraction of its nominal value. The fraction is small for states of reactions far below their nominal value.
const SMALL: f64 = 1e-3;
/// `size |lambda|` at the border of stability of the explicit method.
const BORDER: f64 = 3.25;
/// Number of steps beyond [`BORDER`] after which the equations are stiff.
const STIFF_STEPS: u32 = 15;
/// After this number of successive steps within [`BORDER`], earlier steps beyond [`BORDER`] no longer count.
const OTHER_STEPS: u32 = 6;
/// `size |lambda|` at which the explicit method is stable with some room.
const STABLE: f64 = 2.0;
/// Number of steps within [`STABLE`], in a row, after which the explicit method is used again.
const STABLE_STEPS: u32 = 5;

/// Results of the last steps on which the size and the method of the next step depend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Memory {
    /// The proposed size of the next step in s; 0 without a proposal.
    size: f64,
    /// The error of the last step; 0 without an error.
    error: f64,
    is_stiff: bool,
    /// Number of steps of the explicit method beyond [`BORDER`] since the count was last reset.
    suspicious: u32,
    /// Number of steps within [`BORDER`] since the last step beyond [`BORDER`] or the last reset, below
    /// [`OTHER_STEPS`].
    others: u32,
    /// Number of steps of the stiff method within [`STABLE`], in a row.
    stable: u32,
}

/// The reason why no step was made.
#[derive(Debug)]
pub(crate) enum StepError {
    /// The FMU failed.
    Call(CallError),
    /// The step would be too small.
    Size {
        /// The size of the step in s.
        size: f64,
        /// The state with the largest error, or the first one without a finite value or derivative.
        state: usize,
        /// Whether the error of this state is finite.
        is_finite: bool,
        /// Why the FMU refused the last trial step, if it did.
        cause: Option<CallError>,
    },
}

impl From<CallError> for StepError {
    fn from(error: CallError) -> Self {
        StepError::Call(error)
    }
}

/// Integrates step by step; keeps the last step, so that states within it can be interpolated.
pub(crate) struct Stepper {
    pub(crate) memory: Memory,
    method: Method,
    scale: Scale,
    explicit: Explicit,
    /// The memory of the stiff method, allocated when it is first used.
    stiff: Option<Rosenbrock>,
    /// The states at the start of the last step.
    start: Vec<f64>,
    /// The derivative at the start of the last step; after a step of the explicit method, at its end.
    slope: Vec<f64>,
    /// Whether `slope` is the derivative at the start of the next step.
    has_slope: bool,
    /// The size of the last step in s.
    size: f64,
    last_is_stiff: bool,
}

impl Stepper {
    pub(crate) fn new(method: Method, scale: Scale) -> Self {
        let n = scale.len();
        let memory = Memory { is_stiff: method == Method::Stiff, ..Memory::default() };
        Self {
            memory,
            method,
            explicit: Explicit::new(n),
            stiff: (method == Method::Stiff).then(|| Rosenbrock::new(n)),
            start: vec![0.0; n],
            slope: vec![0.0; n],
            has_slope: false,
            size: 0.0,
            last_is_stiff: false,
            scale,
        }
    }

    pub(crate) fn set_scale(&mut self, scale: Scale) {
        self.scale = scale;
    }

    pub(crate) fn nominals(&self) -> &[f64] {
        self.scale.nominals()
    }

    /// Sets the nominal values to `nominals`, which [`Stepper::nominals`] has returned before.
    pub(crate) fn set_nominals(&mut self, nominals: &[f64]) {
        self.scale.set_nominals(nominals);
    }

    /// Forgets the derivative at the present point, because inputs may have changed.
    pub(crate) fn forget_slope(&mut self) {
        self.has_slope = false;
    }

    /// Forgets the derivative, the step size and the error of the last step, because of an event.
    pub(crate) fn restart(&mut self) {
        self.has_slope = false;
        (self.memory.size, self.memory.error) = (0.0, 0.0);
    }

    /// Makes one step from `states` at `time` to `limit` at most, after trial steps that are shortened until one
    /// meets the tolerance; returns the time reached. Without states it reaches `limit`.
    pub(crate) fn advance(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), CallError>,
        states: &[f64],
        time: f64,
        limit: f64,
    ) -> Result<f64, StepError> {
        self.start.copy_from_slice(states);
        if states.is_empty() {
            self.size = limit - time;
            return Ok(limit);
        }
        if !self.has_slope {
            derivative(time, &self.start, &mut self.slope)?;
        }
        let least = 16.0 * f64::EPSILON * time.abs().max(f64::MIN_POSITIVE / f64::EPSILON);
        if self.memory.size <= 0.0 {
            self.memory.size = self.first_size(derivative, time, limit - time)?.max(least);
        }
        let (mut rejected, mut linearised, mut cause) = (false, false, None);
        loop {
            let room = limit - time;
            let is_last = self.memory.size * STRETCH >= room;
            let size = if is_last { room } else { self.memory.size };
            if !is_last && size < least {
                let (state, is_finite) = self.worst();
                return Err(StepError::Size { size, state, is_finite, cause });
            }
            match self.attempt(derivative, time, size, &mut linearised) {
                Ok(error) if error <= 1.0 => {
                    self.accept(size, error, rejected);
                    return Ok(if is_last { limit } else { time + size });
                }
                Ok(error) if error.is_finite() => {
                    let ratio = SAFETY * error.powf(-1.0 / self.order());
                    (self.memory.size, cause) = (size * ratio.max(SHRINK), None);
                }
                Ok(_) => (self.memory.size, cause) = (size * RETREAT, None),
                Err(error) if error.failure == Failure::Status(Status::Discard) => {
                    self.memory.size = size * RETREAT;
                    cause = Some(error);
                }
                Err(error) => return Err(error.into()),
            }
            rejected = true;
        }
    }

    /// Attempts a step; returns its error relative to the tolerance, which is not finite if the step failed.
    fn attempt(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), CallError>,
        time: f64,
        size: f64,
        linearised: &mut bool,
    ) -> Result<f64, CallError> {
        let Self { explicit, stiff, start, slope, scale, .. } = self;
        (self.size, self.last_is_stiff) = (size, self.memory.is_stiff);
        let step_start = StepStart { time, states: start, slope };
        if !self.memory.is_stiff {
            explicit.attempt(derivative, step_start, size)?;
            return Ok(norm(scale, &explicit.error, start, &explicit.end));
        }
        let method = stiff.get_or_insert_with(|| Rosenbrock::new(start.len()));
        if !*linearised {
            let nominals = scale.nominals();
            method.linearise(derivative, step_start, size, |i| SMALL * nominals[i])?;
            *linearised = true;
        }
        if !method.attempt(derivative, step_start, size)? {
            return Ok(f64::INFINITY);
        }
        Ok(norm(scale, method.error(), start, &method.end))
    }

    /// The order of the error estimate.
    fn order(&self) -> f64 {
        if self.last_is_stiff { 4.0 } else { 5.0 }
    }

    /// Chooses the size (by a PI controller, Gustafsson 1991) and the method of the next step.
    fn accept(&mut self, size: f64, error: f64, rejected: bool) {
        let order = self.order();
        let memory = &mut self.memory;
        let error = error.max(1e-10);
        let before = if memory.error > 0.0 { memory.error } else { error };
        let target = SAFETY.powf(order);
        let ratio = (error / target).powf(-0.7 / order) * (before / target).powf(0.4 / order);
        let ratio = ratio.clamp(SHRINK, if rejected { 1.0 } else { GROW });
        // A step that was shortened to end at a limit does not reduce the proposed size.
        let shortened = size < memory.size && !rejected;
        memory.size = if shortened { memory.size.max(size * ratio) } else { size * ratio };
        memory.error = error;
        self.has_slope = !self.last_is_stiff;
        if self.last_is_stiff {
            self.look_for_end_of_stiffness(size);
        } else {
            self.look_for_stiffness(size);
            self.slope.copy_from_slice(self.explicit.last_slope());
        }
    }

    /// Selects the stiff method after [`STIFF_STEPS`] steps beyond the border of stability.
    fn look_for_stiffness(&mut self, size: f64) {
        if self.method != Method::Automatic {
            return;
        }
        let (scale, start, end) = (&self.scale, &self.start, &self.explicit.end);
        let memory = &mut self.memory;
        if self.explicit.stiffness(size, |i| scale.weight(i, start[i], end[i])) > BORDER {
            memory.others = 0;
            memory.suspicious += 1;
            if memory.suspicious == STIFF_STEPS {
                (memory.is_stiff, memory.suspicious, memory.stable) = (true, 0, 0);
            }
        } else {
            memory.others += 1;
            if memory.others == OTHER_STEPS {
                (memory.suspicious, memory.others) = (0, 0);
            }
        }
    }

    /// Selects the explicit method after [`STABLE_STEPS`] steps in a row in which it would be stable.
    fn look_for_end_of_stiffness(&mut self, size: f64) {
        let (Method::Automatic, Some(method)) = (self.method, &self.stiff) else { return };
        let (scale, start) = (&self.scale, &self.start);
        let bound = method.bound_of_eigenvalues(|i| scale.weight(i, start[i], method.end[i]));
        let memory = &mut self.memory;
        memory.stable = if size * bound < STABLE { memory.stable + 1 } else { 0 };
        if memory.stable == STABLE_STEPS {
            (memory.is_stiff, memory.stable) = (false, 0);
        }
    }

    /// The stiff method; `None` if it did not make the last step.
    fn last_stiff(&self) -> Option<&Rosenbrock> {
        self.stiff.as_ref().filter(|_| self.last_is_stiff)
    }

    /// The states at the end of the last step.
    pub(crate) fn end(&self) -> &[f64] {
        self.last_stiff().map_or(&self.explicit.end, |method| &method.end)
    }

    /// Computes the states at the fraction `part` of the last step.
    pub(crate) fn interpolate(&self, part: f64, states: &mut [f64]) {
        match self.last_stiff() {
            Some(method) => method.interpolate(part, &self.start, states),
            None => self.explicit.interpolate(part, self.size, &self.start, states),
        }
    }

    /// Chooses the first step after an event (Hairer, Norsett and Wanner 1993, section II.4).
    fn first_size(
        &mut self,
        derivative: &mut impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), CallError>,
        time: f64,
        room: f64,
    ) -> Result<f64, CallError> {
        let Self { explicit, start, slope, scale, .. } = self;
        let (value, rise) = (norm(scale, start, start, start), norm(scale, slope, start, start));
        let guess = if value < 1e-5 || rise < 1e-5 { 1e-6 } else { 0.01 * value / rise };
        let guess = if guess.is_finite() { guess.min(room) } else { 1e-6 * room };
        for (i, end) in explicit.end.iter_mut().enumerate() {
            *end = start[i] + guess * slope[i];
        }
        // `explicit.end` and `explicit.error` are free until the next attempt.
        let bend = match derivative(time + guess, &explicit.end, &mut explicit.error) {
            Ok(()) => {
                for (difference, slope) in explicit.error.iter_mut().zip(slope) {
                    *difference -= *slope;
                }
                norm(scale, &explicit.error, start, start) / guess
            }
            Err(error) if error.failure == Failure::Status(Status::Discard) => f64::NAN,
            Err(error) => return Err(error),
        };
        if !bend.is_finite() || !rise.is_finite() {
            return Ok(RETREAT * guess);
        }
        let most = rise.max(bend);
        let size = if most <= 1e-15 { (1e-3 * guess).max(1e-6) } else { (0.01 / most).powf(0.2) };
        Ok(size.min(100.0 * guess))
    }

    /// Returns the first state without a finite error in the last step, otherwise the state with the largest
    /// error; and whether the error of this state is finite.
    fn worst(&self) -> (usize, bool) {
        let error = self.last_stiff().map_or(self.explicit.error.as_slice(), Rosenbrock::error);
        let end = self.end();
        let ratio = |i: usize| error[i].abs() / self.scale.weight(i, self.start[i], end[i]);
        if let Some(broken) = (0..error.len()).find(|&i| !ratio(i).is_finite()) {
            return (broken, false);
        }
        let most = (0..error.len()).max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)));
        (most.unwrap_or(0), true)
    }
}

/// The root mean square of `values`, each relative to its tolerance in a step from the states `a` to `b`; NaN if `b` is
/// not finite.
fn norm(scale: &Scale, values: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let part = |(i, value): (usize, &f64)| (value / scale.weight(i, a[i], b[i])).powi(2);
    let sum: f64 = values.iter().enumerate().map(part).sum();
    // More states than 2^52 do not fit in memory.
    #[expect(clippy::cast_precision_loss, reason = "a length")]
    let count = values.len().max(1) as f64;
    let mean = (sum / count).sqrt();
    if b.iter().all(|end| end.is_finite()) { mean } else { f64::NAN }
}

#[cfg(test)]
mod tests;
