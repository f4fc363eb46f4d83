//! `fmi2DoStep` and the evaluation of its status.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::time::{Duration, Instant};

use fmu_description::abi::{Status, StatusKind, fmi2Status};

use super::Component;
use super::calls::{function, same_length};
use slave::{CallError, CommunicationStep, Failure, StepResult, absent};

const NAME: &str = "fmi2DoStep";
const SET: &str = "fmi2SetReal";
const GET: &str = "fmi2GetReal";

/// Longest pause between two status queries of a pending step.
const PAUSE: Duration = Duration::from_millis(1);

impl Component {
    /// Calls `fmi2DoStep` from `time` with the step `size`, both in s.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks the function, if the step fails or exceeds the time limit, or if
    /// the FMU reports an impossible time for a discarded step.
    #[inline]
    pub fn do_step(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let function = function!(self.do_step, NAME);
        self.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, time, size, never_back.into()) };
        self.place.leave();
        if status == Status::OK as fmi2Status || self.is_warning(status) {
            return Ok(StepResult::Whole);
        }
        self.finish_step(status, time, size)
    }

    /// Sets inputs, steps and reads outputs, as [`slave::Slave::pass`] specifies.
    ///
    /// `fmi2OK` and `fmi2Warning` are handled inline; every other status goes through the methods of
    /// the single calls.
    ///
    /// # Errors
    ///
    /// [`CallError`] if the library lacks a function, if a call or the step fails, or if the step exceeds
    /// the time limit.
    #[inline]
    pub fn pass(
        &mut self,
        inputs: &[u32],
        values: &[f64],
        step: CommunicationStep,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        let hot = &self.hot;
        let usual =
            |status| status == Status::OK as fmi2Status || status == Status::Warning as fmi2Status;
        if !inputs.is_empty() {
            let Some(function) = hot.set_real else { return Err(absent(SET)) };
            let count = same_length(inputs, values);
            hot.place.enter(&SET);
            // SAFETY: the instance is alive; as many references as values.
            let status = unsafe { function(hot.pointer, inputs.as_ptr(), count, values.as_ptr()) };
            if !usual(status) {
                return self.refuse(SET, status);
            }
        }
        let Some(function) = hot.do_step else { return Err(absent(NAME)) };
        let CommunicationStep { time, size, never_back } = step;
        hot.place.set_time(time);
        hot.place.enter(&NAME);
        // SAFETY: the instance is alive.
        let status = unsafe { function(hot.pointer, time, size, never_back.into()) };
        if !usual(status) {
            return self.finish_pass(status, step, outputs, results);
        }
        if !outputs.is_empty() {
            let Some(function) = hot.get_real else { return Err(absent(GET)) };
            let count = same_length(outputs, results);
            hot.place.enter(&GET);
            // SAFETY: the instance is alive; as many references as values.
            let status =
                unsafe { function(hot.pointer, outputs.as_ptr(), count, results.as_mut_ptr()) };
            if !usual(status) {
                return self.refuse(GET, status);
            }
        }
        hot.place.leave();
        Ok(StepResult::Whole)
    }

    /// Returns the error of a call in [`Component::pass`]. A separate function keeps the pass small.
    #[cold]
    fn refuse(
        &mut self,
        function: &'static str,
        status: fmi2Status,
    ) -> Result<StepResult, CallError> {
        self.check(function, status).map(|()| StepResult::Whole)
    }

    /// Ends a pass whose step was pending or discarded, or failed.
    #[cold]
    fn finish_pass(
        &mut self,
        status: fmi2Status,
        step: CommunicationStep,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        let done = self.finish_step(status, step.time, step.size)?;
        if !outputs.is_empty() {
            self.get_real(outputs, results)?;
        }
        Ok(done)
    }

    /// Evaluates a step whose status is not `fmi2OK`: waits while it is pending, and asks for the time
    /// reached if it was discarded.
    #[cold]
    fn finish_step(
        &mut self,
        mut status: fmi2Status,
        time: f64,
        size: f64,
    ) -> Result<StepResult, CallError> {
        let (start, mut pause) = (Instant::now(), Duration::from_micros(1));
        while status == Status::Pending as fmi2Status {
            if let Some(limit) = self.time_limit.filter(|limit| start.elapsed() > *limit) {
                self.cancel();
                return Err(self.failed(NAME, Failure::TimedOut(limit.as_secs_f64())));
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(PAUSE);
            status = self.status(StatusKind::DoStepStatus)?;
        }
        if status != Status::Discard as fmi2Status {
            return self.check(NAME, status).map(|()| StepResult::Whole);
        }
        let reached = match self.real_status(StatusKind::LastSuccessfulTime) {
            Ok(reached) => reached,
            Err(CallError { messages, .. }) => {
                let failure = Failure::Status(Status::Discard);
                return Err(CallError { function: NAME, failure, messages });
            }
        };
        let terminated = self.boolean_status(StatusKind::Terminated).unwrap_or(false);
        let rounding = 1e-9 * (size.abs() + time.abs());
        if !(reached >= time - rounding && reached <= time + size + rounding) {
            let what = format!(
                "returned fmi2Discard with the last successful time {reached} s, expected one \
                 from {time} to {} s",
                time + size
            );
            return Err(self.failed(NAME, Failure::InvalidAnswer(what)));
        }
        Ok(StepResult::Part { reached, terminated })
    }

    /// Calls `fmi2CancelStep`. The instance may be freed only if this succeeds (section 4.2.4).
    fn cancel(&mut self) {
        self.place.enter(&"fmi2CancelStep");
        // SAFETY: the instance is alive.
        let canceled = self
            .functions
            .cancel_step
            .is_some_and(|function| unsafe { function(self.pointer) == Status::OK as fmi2Status });
        self.place.leave();
        self.abandoned = !canceled;
    }

    fn status(&mut self, kind: StatusKind) -> Result<fmi2Status, CallError> {
        const NAME: &str = "fmi2GetStatus";
        let mut value = 0;
        let function = function!(self.get_status, NAME);
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind as i32, &raw mut value) };
        self.check(NAME, status)?;
        Ok(value)
    }

    fn real_status(&mut self, kind: StatusKind) -> Result<f64, CallError> {
        const NAME: &str = "fmi2GetRealStatus";
        let mut value = f64::NAN;
        let function = function!(self.get_real_status, NAME);
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind as i32, &raw mut value) };
        self.check(NAME, status)?;
        Ok(value)
    }

    fn boolean_status(&mut self, kind: StatusKind) -> Result<bool, CallError> {
        const NAME: &str = "fmi2GetBooleanStatus";
        let mut value = 0;
        let function = function!(self.get_boolean_status, NAME);
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind as i32, &raw mut value) };
        self.check(NAME, status)?;
        Ok(value != 0)
    }
}
