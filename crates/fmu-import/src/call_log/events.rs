//! The calls of event mode.

use fmu_description::Version;
use slave::{CallError, EventInfo, Events, Slave};

use super::LoggedSlave;
use crate::error::events;

impl<S: Slave + ?Sized> Events for LoggedSlave<S> {
    fn next_event(&mut self) -> Result<Option<f64>, CallError> {
        events(self.slave.as_mut())?.next_event()
    }

    fn enter_event_mode(&mut self) -> Result<(), CallError> {
        let call = |slave: &mut S| events(slave)?.enter_event_mode();
        self.change_mode("fmi2EnterEventMode", call)
    }

    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError> {
        let call = |slave: &mut S| events(slave)?.update_discrete_states();
        self.call("fmi2NewDiscreteStates", format_args!(""), call, |info| format!(" {info:?}"))
    }

    fn leave_event_mode(&mut self) -> Result<(), CallError> {
        let function = match self.version {
            Version::V3 => "fmi3EnterStepMode",
            _ => "fmi2EnterContinuousTimeMode",
        };
        let call = |slave: &mut S| events(slave)?.leave_event_mode();
        self.change_mode(function, call)
    }
}
