//! `fmi3DoStep` and `fmi3UpdateDiscreteStates`.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::function;
use super::Component;
use slave::{CallError, EventInfo, absent};

/// The results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepDone {
    /// `eventHandlingNeeded`.
    pub(crate) event: bool,
    /// `terminateSimulation`.
    pub(crate) terminate: bool,
    /// `earlyReturn`.
    pub(crate) early: bool,
    /// `lastSuccessfulTime` in s.
    pub(crate) reached: f64,
}

impl Component {
    /// Calls `fmi3DoStep` from `time` over `size`, both in s.
    #[inline]
    pub(crate) fn do_step(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<StepDone, CallError> {
        const NAME: &str = "fmi3DoStep";
        let function = function!(self.do_step, NAME);
        self.log_call(NAME, || format!("{time:?}, {size:?}, {never_back}"));
        self.place.set_time(time);
        let (mut event, mut terminate, mut early, mut reached) = (0, 0, 0, time + size);
        // SAFETY: the instance is alive; one place for each result.
        let status = unsafe {
            function(
                self.pointer,
                time,
                size,
                never_back,
                &raw mut event,
                &raw mut terminate,
                &raw mut early,
                &raw mut reached,
            )
        };
        self.check_results(NAME, status, || {
            format!(
                " eventHandlingNeeded {event}, terminateSimulation {terminate}, earlyReturn {early}, \
                 lastSuccessfulTime {reached:?}"
            )
        })?;
        let (event, terminate, early) = (event != 0, terminate != 0, early != 0);
        Ok(StepDone { event, terminate, early, reached })
    }

    /// Calls `fmi3UpdateDiscreteStates`.
    pub(crate) fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmi3UpdateDiscreteStates";
        let function = function!(self.update_discrete_states, NAME);
        self.log_call(NAME, String::new);
        let [mut need_update, mut terminate, mut nominals, mut values, mut defined] = [0_u8; 5];
        let mut next = 0.0;
        // SAFETY: the instance is alive; one place for each result.
        let status = unsafe {
            function(
                self.pointer,
                &raw mut need_update,
                &raw mut terminate,
                &raw mut nominals,
                &raw mut values,
                &raw mut defined,
                &raw mut next,
            )
        };
        self.check_results(NAME, status, || {
            format!(
                " discreteStatesNeedUpdate {need_update}, terminateSimulation {terminate}, \
                 nextEventTimeDefined {defined}, nextEventTime {next:?}"
            )
        })?;
        Ok(EventInfo {
            discrete_states_need_update: need_update != 0,
            terminate_simulation: terminate != 0,
            nominals_changed: nominals != 0,
            values_changed: values != 0,
            next_event_time: (defined != 0).then_some(next),
        })
    }
}
