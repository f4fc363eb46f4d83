//! Replaces isolation on operating systems that do not support it: every attempt returns an error.

use std::convert::Infallible;
use std::sync::Arc;

use fmu_description::ModelDescription;
use fmu_description::package::Unpacked;

use super::{Integrator, IsolateError, Options, WorkerError};
use slave::{CallError, Slave, StepResult};

/// An instance in a separate process, which cannot be created on this operating system.
#[derive(Debug)]
pub struct Isolated {
    never: Infallible,
}

impl Isolated {
    pub(super) fn start(_: Arc<Unpacked>, name: &str, _: &Options) -> Result<Self, IsolateError> {
        Err(IsolateError::Platform { instance: name.to_owned() })
    }

    /// Replaces the instance. It cannot be called on this operating system.
    ///
    /// # Errors
    ///
    /// None.
    pub fn renew(&mut self, _: &str, _: &Options) -> Result<(), IsolateError> {
        match self.never {}
    }
}

/// Returns the error that this operating system does not support workers.
pub(super) fn run(_: Option<Integrator>) -> Result<(), WorkerError> {
    Err(WorkerError::Platform)
}

impl Slave for Isolated {
    fn description(&self) -> &ModelDescription {
        match self.never {}
    }

    fn get_real(&mut self, _: &[u32], _: &mut [f64]) -> Result<(), CallError> {
        match self.never {}
    }

    fn set_real(&mut self, _: &[u32], _: &[f64]) -> Result<(), CallError> {
        match self.never {}
    }

    fn do_step(&mut self, _: f64, _: f64, _: bool) -> Result<StepResult, CallError> {
        match self.never {}
    }
}
