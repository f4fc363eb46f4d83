//! The trait [`Events`]: the functions by which a master handles the events of a slave.

use crate::{CallError, EventInfo};

/// A slave whose events its master handles, after [`Slave::hand_over_events`](crate::Slave::hand_over_events).
///
/// Time is superdense (E. A. Lee and H. Zheng, HSCC 2005). When all slaves have reached the time of an event, the
/// master repeats: read outputs, set the connected inputs, update the discrete states, until nothing changes
/// (FMI 3.0.2, sections 2.3.5 and 4.2; FMI 2.0.5, section 3.2).
#[expect(clippy::missing_errors_doc, reason = "CallError as for every function of Slave")]
pub trait Events {
    /// Returns the time in s of the next event that is known before it happens: a time event, or the tick of an input
    /// clock; `None` without such an event.
    fn next_event(&mut self) -> Result<Option<f64>, CallError>;

    /// `fmi3EnterEventMode`, `fmi2EnterEventMode` at the time reached; input clocks that are due tick. If the slave is
    /// already in event mode, the clocks tick without a change of mode.
    fn enter_event_mode(&mut self) -> Result<(), CallError>;

    /// `fmi3UpdateDiscreteStates`, `fmi2NewDiscreteStates`: one iteration of an event. The iteration ends the ticks of
    /// all clocks. A clock to which the iteration gives an interval of 0 s ticks again in the next iteration.
    fn update_discrete_states(&mut self) -> Result<EventInfo, CallError>;

    /// `fmi3EnterStepMode`, `fmi2EnterContinuousTimeMode`, after the last iteration of an event.
    fn leave_event_mode(&mut self) -> Result<(), CallError>;
}
