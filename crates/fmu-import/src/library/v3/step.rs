//! `fmi3DoStep` and `fmi3UpdateDiscreteStates`.
#![expect(unsafe_code, reason = "the boundary to C")]

use super::super::calls::function;
use super::Component;
use super::{InputElement, Inputs, ORDERS};
use slave::{CallError, EventInfo, Failure, absent};

const SET: &str = "fmi3SetFloat64";

/// The results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DoStepResult {
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
    ) -> Result<DoStepResult, CallError> {
        const NAME: &str = "fmi3DoStep";
        let function = function!(self.do_step, NAME);
        self.base.log_call(NAME, || format!("{time:?}, {size:?}, {never_back}"));
        self.base.place.set_time(time);
        let (mut event, mut terminate, mut early, mut reached) = (0, 0, 0, time + size);
        let pointer = self.base.pointer;
        let results = (&raw mut event, &raw mut terminate, &raw mut early, &raw mut reached);
        let (first, second, third, fourth) = results;
        let step = || {
            // SAFETY: the instance is alive; one place for each result.
            unsafe { function(pointer, time, size, never_back, first, second, third, fourth) }
        };
        let status = match self.base.functions.set_float64.filter(|_| self.inputs.is_set) {
            Some(set) => self.inputs.during((pointer, set), step),
            None => step(),
        };
        self.base.check_results(NAME, status, || {
            format!(
                " eventHandlingNeeded {event}, terminateSimulation {terminate}, earlyReturn {early}, \
                 lastSuccessfulTime {reached:?}"
            )
        })?;
        let (event, terminate, early) = (event != 0, terminate != 0, early != 0);
        Ok(DoStepResult { event, terminate, early, reached })
    }

    /// Sets the derivatives of the inputs for which `locate` returns an element, for the step from `start` s. Reads the
    /// present values of these inputs, the values at `start`. An order beyond [`ORDERS`] is an error.
    pub(crate) fn set_input_derivatives(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &[f64],
        start: f64,
        locate: impl Fn(u32) -> Option<InputElement>,
    ) -> Result<(), CallError> {
        self.inputs.is_set = false;
        self.inputs.derive(list, orders, values, locate).map_err(|order| {
            let what =
                format!("cannot follow a derivative of order {order}, expected 1 to {ORDERS}");
            self.base.failed(SET, Failure::InvalidAnswer(what))
        })?;
        let references = std::mem::take(&mut self.inputs.references);
        let mut present = std::mem::take(&mut self.inputs.values);
        let read = self.get_float64(&references, &mut present);
        let is_set = read.is_ok() && !references.is_empty();
        let inputs = &mut *self.inputs;
        (inputs.references, inputs.values) = (references, present);
        (inputs.start, inputs.is_set) = (start, is_set);
        read
    }

    /// Passes the values at `time`, in s, of the inputs whose derivatives are set.
    pub(crate) fn settle_inputs(&mut self, time: f64) -> Result<(), CallError> {
        if !self.inputs.is_set {
            return Ok(());
        }
        self.base.place.enter(&SET);
        let status = self.inputs.settle(time);
        self.base.check_status(SET, status)
    }

    /// Forgets the derivatives of the inputs, which hold for one step only.
    pub(crate) fn forget_input_derivatives(&mut self) {
        self.inputs.is_set = false;
    }

    /// Forgets the inputs that have had derivatives, whose sizes may have changed.
    pub(crate) fn forget_inputs(&mut self) {
        *self.inputs = Inputs::default();
    }

    pub(crate) fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        const NAME: &str = "fmi3UpdateDiscreteStates";
        let function = function!(self.update_discrete_states, NAME);
        self.base.log_call(NAME, String::new);
        let [mut need_update, mut terminate, mut nominals, mut values, mut defined] = [0_u8; 5];
        let mut next = 0.0;
        // SAFETY: the instance is alive; one place for each result.
        let status = unsafe {
            function(
                self.base.pointer,
                &raw mut need_update,
                &raw mut terminate,
                &raw mut nominals,
                &raw mut values,
                &raw mut defined,
                &raw mut next,
            )
        };
        self.base.check_results(NAME, status, || {
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
