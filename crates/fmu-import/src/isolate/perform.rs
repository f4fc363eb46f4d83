//! Executes the commands of the master: calls the FMU with the arguments in shared memory, and writes
//! the results.

use fmu_description::Version;
use serde::Serialize;

use super::Integrator;
use super::function::Function;
use super::message::{RemoteError, encode};
use super::words::{Reader, Word, Writer};
use crate::error::refused;
use crate::{Fmu, FmuError};
use slave::{CallError, CommunicationStep, Slave, StepRequest, StepResult};

/// First word of an answer whose results are encoded by the module `words`.
pub(super) const VALUES: u64 = 0;
/// First word of an answer or error that `postcard` encoded. The number of its bytes and its first bytes follow.
pub(super) const MESSAGE: u64 = 1;

/// The end of a step: complete, at an event, partial, or partial at the request of the FMU.
pub(super) const WHOLE: u64 = 0;
pub(super) const EVENT: u64 = 1;
pub(super) const PART: u64 = 2;
pub(super) const TERMINATED: u64 = 3;

/// The result of a command; `None` if its arguments are invalid.
pub(super) type CommandResult = Option<Result<(), CallError>>;

/// An instance and the buffers of its calls, kept so that a step does not allocate.
pub(super) struct Executor {
    pub(super) instance: Box<dyn Slave>,
    /// Creates another instance of the same kind.
    pub(super) maker: Maker,
    references: Vec<u32>,
    reals: Vec<f64>,
    integers: Vec<i64>,
    booleans: Vec<i32>,
    step: Step,
}

/// Creates instances of an FMU.
#[derive(Clone)]
pub(super) struct Maker {
    pub(super) fmu: Fmu,
    /// The integrator and its options, for model exchange.
    pub(super) integration: Option<(Integrator, String)>,
    /// Whether calls pass copies of arrays with canaries to the FMU, to detect writes outside an array.
    pub(super) guards: bool,
}

impl Maker {
    pub(super) fn make(&self, name: &str) -> Result<Box<dyn Slave>, FmuError> {
        match &self.integration {
            None => {
                let mut instance = self.fmu.instantiate(name)?;
                if self.guards {
                    instance.guard_arrays();
                }
                Ok(Box::new(instance))
            }
            Some((integrator, options)) => {
                let mut instance = self.fmu.instantiate_equations(name)?;
                if self.guards {
                    instance.guard_arrays();
                }
                Ok(integrator(instance, options))
            }
        }
    }
}

/// The lists of a [`StepRequest`].
#[derive(Default)]
struct Step {
    inputs: Vec<u32>,
    input_values: Vec<f64>,
    derived_inputs: Vec<u32>,
    input_orders: Vec<i32>,
    input_derivatives: Vec<f64>,
    outputs: Vec<u32>,
    output_values: Vec<f64>,
    derived_outputs: Vec<u32>,
    output_orders: Vec<i32>,
    output_derivatives: Vec<f64>,
}

impl Executor {
    pub(super) fn new(mut instance: Box<dyn Slave>, maker: Maker, logging: bool) -> Self {
        if logging {
            // An FMU without `fmi2SetDebugLogging` logs by its own rules.
            let _ = instance.set_debug_logging(true);
        }
        let (references, reals, integers) = (Vec::new(), Vec::new(), Vec::new());
        let booleans = Vec::new();
        Self { instance, maker, references, reals, integers, booleans, step: Step::default() }
    }

    /// Steps, or gets or sets numbers: reads the arguments from `reader`, writes the results to `writer`.
    #[inline]
    pub(super) fn exchange(
        &mut self,
        function: Function,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> CommandResult {
        let Self { instance, references, reals, integers, booleans, step, .. } = self;
        macro_rules! values {
            ($transfer:ident, $values:ident, $method:ident) => {
                $transfer(reader, writer, references, $values, |r, v| instance.$method(r, v))
            };
        }
        match function {
            Function::DoStep => step.advance(instance.as_mut(), reader, writer),
            Function::GetReal => values!(get, reals, get_real),
            Function::GetInteger => values!(get, integers, get_integer),
            Function::GetBoolean => values!(get, booleans, get_boolean),
            Function::SetReal => values!(set, reals, set_real),
            Function::SetInteger => values!(set, integers, set_integer),
            Function::SetBoolean => values!(set, booleans, set_boolean),
            _ => None,
        }
    }
}

/// Encodes a result or an error as the answer to a request.
pub(super) fn reply(result: Result<impl Serialize, CallError>, answer: &mut Vec<u8>) {
    encode(&result.map_err(RemoteError::from), answer);
}

impl Step {
    /// Reads the arguments, steps, and writes the results; `None` if the arguments are invalid.
    fn advance(
        &mut self,
        instance: &mut dyn Slave,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> CommandResult {
        let mut request = StepRequest {
            step: self.read(reader)?,
            inputs: &self.inputs,
            input_values: &self.input_values,
            derived_inputs: &self.derived_inputs,
            input_orders: &self.input_orders,
            input_derivatives: &self.input_derivatives,
            outputs: &self.outputs,
            output_values: &mut self.output_values,
            derived_outputs: &self.derived_outputs,
            output_orders: &self.output_orders,
            output_derivatives: &mut self.output_derivatives,
        };
        Some(instance.advance(&mut request).map(|done| {
            let (end, reached) = match done {
                StepResult::Whole => (WHOLE, 0.0),
                StepResult::Event { reached } => (EVENT, reached),
                StepResult::Part { reached, terminated: false } => (PART, reached),
                StepResult::Part { reached, terminated: true } => (TERMINATED, reached),
            };
            writer.put(VALUES);
            writer.put(end);
            writer.put(reached);
            writer.put_all(&self.output_values);
            writer.put_all(&self.output_derivatives);
        }))
    }

    fn read(&mut self, reader: &mut Reader<'_>) -> Option<CommunicationStep> {
        let (time, size) = (reader.take()?, reader.take()?);
        let never_back = reader.take::<u64>()? != 0;
        reader.take_list(&mut self.inputs)?;
        reader.take_counted(self.inputs.len(), &mut self.input_values)?;
        reader.take_list(&mut self.derived_inputs)?;
        reader.take_counted(self.derived_inputs.len(), &mut self.input_derivatives)?;
        reader.take_counted(self.derived_inputs.len(), &mut self.input_orders)?;
        reader.take_list(&mut self.outputs)?;
        reader.take_list(&mut self.derived_outputs)?;
        reader.take_counted(self.derived_outputs.len(), &mut self.output_orders)?;
        self.output_values.resize(self.outputs.len(), 0.0);
        self.output_derivatives.resize(self.derived_outputs.len(), 0.0);
        Some(CommunicationStep { time, size, never_back })
    }
}

/// Reads references, gets the values of these variables by `call`, and writes them.
fn get<T: Word + Default>(
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
    references: &mut Vec<u32>,
    values: &mut Vec<T>,
    call: impl FnOnce(&[u32], &mut [T]) -> Result<(), CallError>,
) -> CommandResult {
    reader.take_list(references)?;
    values.resize(references.len(), T::default());
    writer.put(VALUES);
    Some(call(references, values).map(|()| writer.put_all(values)))
}

/// Reads references and values, and sets these variables by `call`.
fn set<T: Word>(
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
    references: &mut Vec<u32>,
    values: &mut Vec<T>,
    call: impl FnOnce(&[u32], &[T]) -> Result<(), CallError>,
) -> CommandResult {
    reader.take_list(references)?;
    reader.take_counted(references.len(), values)?;
    writer.put(VALUES);
    Some(call(references, values))
}

/// Returns the error of a command with invalid arguments or out of order.
#[cold]
pub(super) fn invalid_command(function: Function) -> CallError {
    invalid(function, "received an invalid command: the shared memory is corrupted")
}

pub(super) fn invalid(function: Function, what: &str) -> CallError {
    refused(function.name(Version::V2), what.to_owned())
}
