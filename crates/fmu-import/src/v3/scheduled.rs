//! Scheduled execution (FMI 3.0.2, section 5): a tick of an input clock activates its model partition. The master takes
//! such an FMU for one of co-simulation whose steps do nothing and whose events run the partitions.

use super::Instance;
use crate::library::v3::{DoStepResult, Interface};
use slave::{CallError, EventInfo};

impl Instance {
    pub(super) fn is_scheduled(&self) -> bool {
        self.interface == Interface::ScheduledExecution
    }

    /// Steps from `time` over `size` s. In scheduled execution the step is complete at once.
    pub(super) fn advance(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<DoStepResult, CallError> {
        if self.is_scheduled() {
            let reached = time + size;
            return Ok(DoStepResult { event: false, terminate: false, early: false, reached });
        }
        self.component.do_step(time, size, never_back)
    }

    /// Runs the model partitions of the input clocks that tick, in the order of their priorities. The clocks that tick
    /// as a result do so until the next call.
    pub(super) fn run_partitions(&mut self) -> Result<EventInfo, CallError> {
        let time = self.state.time;
        for clock in self.state.clocks.take_partitions() {
            self.component.activate_model_partition(clock, time)?;
        }
        self.state.clocks.end_ticks();
        self.state.clocks.read_outputs(&mut self.component)?;
        self.state.clocks.ask_intervals(&mut self.component, time)?;
        self.tick()?;
        Ok(EventInfo {
            discrete_states_need_update: self.state.clocks.any_active(),
            next_event_time: self.next_event_time(),
            ..EventInfo::default()
        })
    }
}
