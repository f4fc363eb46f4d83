//! What a thread does for one slave.

use slave::{Advance, CallError, Slave, StepResult};

/// The step of one slave.
pub(crate) struct Task<'a> {
    pub(crate) slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) step: Advance<'a>,
    pub(crate) done: Result<StepResult, CallError>,
}
