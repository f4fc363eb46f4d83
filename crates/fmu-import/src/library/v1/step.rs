//! `fmiDoStep` and the evaluation of its status.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_int;
use std::time::{Duration, Instant};

use fmu_description::abi::{Status, StatusKind};

use super::super::calls::function;
use super::Component;
use slave::{CallError, Failure, StepResult, absent};

const NAME: &str = "fmiDoStep";

/// Longest pause between two status queries of a pending step.
const PAUSE: Duration = Duration::from_millis(1);

impl Component {
    /// Calls `fmiDoStep` from `time` with the step `size`, both in s. The last step is accepted
    /// (`newStep`).
    #[inline]
    pub(crate) fn do_step(&mut self, time: f64, size: f64) -> Result<StepResult, CallError> {
        let function = function!(self.do_step, NAME);
        self.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.pointer, time, size, 1) };
        self.place.leave();
        if status == Status::OK as c_int {
            return Ok(StepResult::Whole);
        }
        self.finish_step(status, time, size)
    }

    /// Evaluates a step whose status is not `fmiOK`: waits while it is pending, and asks for the time
    /// reached if it was discarded.
    #[cold]
    fn finish_step(
        &mut self,
        mut status: c_int,
        time: f64,
        size: f64,
    ) -> Result<StepResult, CallError> {
        let (start, mut pause) = (Instant::now(), Duration::from_micros(1));
        while status == Status::Pending as c_int {
            if let Some(limit) = self.time_limit.filter(|limit| start.elapsed() > *limit) {
                self.cancel();
                return Err(self.failed(NAME, Failure::TimedOut(limit.as_secs_f64())));
            }
            std::thread::sleep(pause);
            pause = (2 * pause).min(PAUSE);
            status = self.status()?;
        }
        if status != Status::Discard as c_int {
            return self.check(NAME, status).map(|()| StepResult::Whole);
        }
        let reached = match self.last_successful_time() {
            Ok(reached) => reached,
            Err(CallError { messages, .. }) => {
                let failure = Failure::Status(Status::Discard);
                return Err(CallError { function: NAME, failure, messages });
            }
        };
        let rounding = 1e-9 * (size.abs() + time.abs());
        if !(reached >= time - rounding && reached <= time + size + rounding) {
            let what = format!(
                "returned fmiDiscard with the last successful time {reached} s, expected one from \
                 {time} to {} s",
                time + size
            );
            return Err(self.failed(NAME, Failure::InvalidAnswer(what)));
        }
        Ok(StepResult::Part { reached, terminated: false })
    }

    /// Calls `fmiCancelStep`. The instance may be freed only if this succeeds.
    fn cancel(&mut self) {
        self.place.enter(&"fmiCancelStep");
        // SAFETY: the instance is alive.
        let canceled = self
            .functions
            .cancel_step
            .is_some_and(|function| unsafe { function(self.pointer) == Status::OK as c_int });
        self.place.leave();
        self.abandoned = !canceled;
    }

    fn status(&mut self) -> Result<c_int, CallError> {
        const NAME: &str = "fmiGetStatus";
        let mut value = 0;
        let function = function!(self.get_status, NAME);
        let kind = StatusKind::DoStepStatus as c_int;
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind, &raw mut value) };
        self.check(NAME, status)?;
        Ok(value)
    }

    fn last_successful_time(&mut self) -> Result<f64, CallError> {
        const NAME: &str = "fmiGetRealStatus";
        let mut value = f64::NAN;
        let function = function!(self.get_real_status, NAME);
        let kind = StatusKind::LastSuccessfulTime as c_int;
        // SAFETY: the instance is alive; one place to write to.
        let status = unsafe { function(self.pointer, kind, &raw mut value) };
        self.check(NAME, status)?;
        Ok(value)
    }
}
