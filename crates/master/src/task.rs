//! What a thread does for one slave.

use slave::{CallError, Slave, StepRequest, StepResult};

/// The step of one slave.
pub(crate) struct Task<'a> {
    pub(crate) slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) request: StepRequest<'a>,
    pub(crate) done: Result<StepResult, CallError>,
}
