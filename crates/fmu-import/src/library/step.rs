//! `fmi2DoStep` and the evaluation of its status.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::{c_int, c_void};
use std::time::{Duration, Instant};

use fmu_description::abi::{Status, StatusKind};

use super::Component;
use super::base::Base;
use super::calls::{function, same_length};
use slave::{CallError, CommunicationStep, Failure, StepResult, absent};

const NAME: &str = "fmi2DoStep";
const SET: &str = "fmi2SetReal";
const GET: &str = "fmi2GetReal";

/// Longest pause between two status queries of a pending step.
pub(super) const PAUSE: Duration = Duration::from_millis(1);

impl Component {
    /// Calls `fmi2DoStep` from `time` with the step `size`, both in s. An error if the step fails or exceeds the time
    /// limit, or if the FMU reports an impossible time for a discarded step.
    #[inline]
    pub(crate) fn do_step(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let function = function!(self.do_step, NAME);
        self.base.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, time, size, never_back.into()) };
        self.base.place.leave();
        if status == Status::OK as c_int || self.base.is_warning(status) {
            return Ok(StepResult::Whole);
        }
        self.finish_step(status, time, size)
    }

    /// Sets inputs, steps and reads outputs, as [`slave::Slave::pass`] specifies.
    ///
    /// Handles `fmi2OK` and `fmi2Warning` inline, and every other status by the methods of the single calls.
    #[inline]
    pub(crate) fn pass(
        &mut self,
        inputs: &[u32],
        values: &[f64],
        step: CommunicationStep,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        let hot = &self.hot;
        let usual = |status| status == Status::OK as c_int || status == Status::Warning as c_int;
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

    /// Returns the error of a call in [`Component::pass`]; a separate function keeps the code of `pass` small.
    #[cold]
    fn refuse(&mut self, function: &'static str, status: c_int) -> Result<StepResult, CallError> {
        self.base.check(function, status).map(|()| StepResult::Whole)
    }

    /// Ends a pass whose step was pending or discarded, or failed.
    #[cold]
    fn finish_pass(
        &mut self,
        status: c_int,
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
}

/// A function that writes a property of the last step.
type Query<T> = unsafe extern "C" fn(*mut c_void, c_int, *mut T) -> c_int;

impl<F: Copy> Base<F> {
    /// Asks for a property of the last step by `function`, called `name`; returns `value` if the FMU writes none.
    pub(super) fn ask<T>(
        &self,
        function: Option<Query<T>>,
        name: &'static &'static str,
        kind: StatusKind,
        mut value: T,
    ) -> Result<T, CallError> {
        let function = function.ok_or_else(|| absent(name))?;
        self.place.enter(name);
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind as c_int, &raw mut value) };
        self.check(name, status)?;
        Ok(value)
    }
}

/// Defines the evaluation of the status of a step, for FMI 1.0 and 2.0. Only in FMI 2.0 can the FMU request the end
/// of the simulation (`get_boolean_status`).
macro_rules! finish_step {
    (
        do_step = $do_step:literal, discard = $discard:literal;
        cancel_step = $cancel:literal;
        get_status = $get_status:literal;
        get_real_status = $get_real_status:literal;
        $($get_boolean_status:ident = $terminated:literal;)?
    ) => {
        impl Component {
            /// Evaluates a step whose status is not OK: waits while it is pending, up to the time limit, and asks for
            /// the time reached if it was discarded. Cancels a pending step if a status query fails.
            #[cold]
            fn finish_step(
                &mut self,
                mut status: c_int,
                time: f64,
                size: f64,
            ) -> Result<StepResult, CallError> {
                let (start, mut pause) = (Instant::now(), Duration::from_micros(1));
                let fatal = Failure::Status(Status::Fatal);
                while status == Status::Pending as c_int {
                    let limit = self.base.time_limit.filter(|limit| start.elapsed() > *limit);
                    if let Some(limit) = limit {
                        self.cancel();
                        return Err(self.base.failed($do_step, Failure::TimedOut(limit.as_secs_f64())));
                    }
                    std::thread::sleep(pause);
                    pause = (2 * pause).min(PAUSE);
                    let function = self.base.functions.get_status;
                    let answer = self.base.ask(function, &$get_status, StatusKind::DoStepStatus, 0);
                    if answer.as_ref().is_err_and(|error| error.failure != fatal) {
                        self.cancel();
                    }
                    status = answer?;
                }
                if status != Status::Discard as c_int {
                    return self.base.check($do_step, status).map(|()| StepResult::Whole);
                }
                let (function, kind) =
                    (self.base.functions.get_real_status, StatusKind::LastSuccessfulTime);
                let answer = self.base.ask(function, &$get_real_status, kind, f64::NAN);
                let reached = answer.map_err(|error| {
                    if error.failure == fatal {
                        return error;
                    }
                    let failure = Failure::Status(Status::Discard);
                    CallError { function: $do_step, failure, ..error }
                })?;
                // A failed query counts as no request.
                let terminated = false $(|| {
                    let function = self.base.functions.$get_boolean_status;
                    match self.base.ask(function, &$terminated, StatusKind::Terminated, 0) {
                        Err(error) if error.failure == fatal => return Err(error),
                        answer => answer.is_ok_and(|value| value != 0),
                    }
                })?;
                let rounding = 1e-9 * (size.abs() + time.abs());
                if !(reached >= time - rounding && reached <= time + size + rounding) {
                    let what = format!(
                        "returned {} with the last successful time {reached} s, expected one from {time} to {} s",
                        $discard,
                        time + size
                    );
                    return Err(self.base.failed($do_step, Failure::InvalidAnswer(what)));
                }
                Ok(StepResult::Part { reached, terminated })
            }

            /// Cancels the step. The instance may be freed only if this succeeds (FMI 2.0.5, section 4.2.4);
            /// otherwise it is abandoned.
            fn cancel(&mut self) {
                self.base.place.enter(&$cancel);
                let pointer = self.base.pointer;
                // SAFETY: the instance is alive.
                let status = self.base.functions.cancel_step.map(|cancel| unsafe { cancel(pointer) });
                self.base.place.leave();
                self.base.abandoned = status != Some(Status::OK as c_int);
            }
        }
    };
}
pub(super) use finish_step;

finish_step! {
    do_step = "fmi2DoStep", discard = "fmi2Discard";
    cancel_step = "fmi2CancelStep";
    get_status = "fmi2GetStatus";
    get_real_status = "fmi2GetRealStatus";
    get_boolean_status = "fmi2GetBooleanStatus";
}
