//! `fmiDoStep` and the evaluation of its status.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::ffi::c_int;
use std::time::{Duration, Instant};

use fmu_description::abi::{Status, StatusKind};

use super::super::calls::function;
use super::super::step::{PAUSE, finish_step};
use super::Component;
use slave::{CallError, Failure, StepResult, absent};

const NAME: &str = "fmiDoStep";

impl Component {
    /// Calls `fmiDoStep` from `time` with the step `size`, both in s. The last step is accepted
    /// (`newStep`).
    #[inline]
    pub(crate) fn do_step(&mut self, time: f64, size: f64) -> Result<StepResult, CallError> {
        let function = function!(self.do_step, NAME);
        self.base.place.set_time(time);
        // SAFETY: the instance is alive.
        let status = unsafe { function(self.base.pointer, time, size, 1) };
        self.base.place.leave();
        if status == Status::OK as c_int {
            return Ok(StepResult::Whole);
        }
        self.finish_step(status, time, size)
    }
}

finish_step! {
    do_step = "fmiDoStep", discard = "fmiDiscard";
    cancel_step = "fmiCancelStep";
    get_status = "fmiGetStatus";
    get_real_status = "fmiGetRealStatus";
    terminated = never;
}

/// FMI 1.0 has no such request.
fn never(_: &mut Component) -> bool {
    false
}
