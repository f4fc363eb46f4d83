//! Executes the commands of the master: calls the FMU with the arguments in shared memory, and writes
//! the results.

use fmu_description::Version;
use serde::Serialize;

use super::Integrator;
use super::function::Function;
use super::message::{RemoteError, Request, encode};
use super::words::{Reader, Word, Writer};
use crate::{Fmu, FmuError};
use slave::{CallError, Events, Failure, Slave, StepResult, absent};

/// First word of an answer that consists of words.
pub(super) const VALUES: u64 = 0;
/// First word of an encoded answer or error. The number of all its bytes and its first bytes follow.
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
    instance: Box<dyn Slave>,
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
    /// Whether the instances get copies of arrays, with canaries.
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

/// The arguments and results of a step, as in [`Slave::advance`].
#[derive(Default)]
struct Step {
    time: f64,
    size: f64,
    never_back: bool,
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
            // An FMU without the function logs by its own rules.
            let _ = instance.set_debug_logging(true);
        }
        let (references, reals, integers) = (Vec::new(), Vec::new(), Vec::new());
        let booleans = Vec::new();
        Self { instance, maker, references, reals, integers, booleans, step: Step::default() }
    }

    /// Steps, or gets or sets numbers: reads the arguments from `reader`, writes the results to
    /// `writer`. Other functions are executed by [`Executor::execute`].
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

    /// Executes a request for the instance and encodes the answer.
    pub(super) fn execute(&mut self, request: Request<'_>, answer: &mut Vec<u8>) {
        let instance = &mut self.instance;
        let done = match request {
            Request::SetDebugLogging(on) => instance.set_debug_logging(on),
            Request::SetupExperiment(experiment) => instance.setup_experiment(&experiment),
            Request::EnterInitializationMode => instance.enter_initialization_mode(),
            Request::ExitInitializationMode => instance.exit_initialization_mode(),
            Request::Terminate => instance.terminate(),
            Request::SetString(values) => {
                let (references, values): (Vec<u32>, Vec<String>) = values
                    .into_iter()
                    .map(|(reference, value)| (reference, value.to_owned()))
                    .unzip();
                instance.set_string(&references, &values)
            }
            Request::SetInputDerivatives(values) => {
                let (references, orders, values): (Vec<_>, Vec<_>, Vec<_>) =
                    values.into_iter().collect();
                instance.set_input_derivatives(&references, &orders, &values)
            }
            Request::SaveState(slot) => instance.save_state(slot),
            Request::RestoreState(slot) => instance.restore_state(slot),
            Request::DeserializeState(bytes) => instance.deserialize_state(bytes),
            Request::Configure(values) => {
                let (references, values): (Vec<_>, Vec<_>) = values.into_iter().unzip();
                instance.configure(&references, &values)
            }
            Request::SetBinary(values) => {
                let values =
                    values.into_iter().map(|(reference, bytes)| (reference, bytes.to_vec()));
                let (references, values): (Vec<u32>, Vec<Vec<u8>>) = values.unzip();
                instance.set_binary(&references, &values)
            }
            Request::GetBinary(references) => {
                let mut values = vec![Vec::new(); references.len()];
                let done = instance.get_binary(&references, &mut values);
                return reply(done.map(|()| values), answer);
            }
            Request::GetString(references) => {
                let mut values = vec![String::new(); references.len()];
                let done = instance.get_string(&references, &mut values);
                return reply(done.map(|()| values), answer);
            }
            Request::GetOutputDerivatives(derivatives) => {
                let (references, orders): (Vec<_>, Vec<_>) = derivatives.into_iter().unzip();
                let mut values = vec![0.0; references.len()];
                let done = instance.get_output_derivatives(&references, &orders, &mut values);
                return reply(done.map(|()| values), answer);
            }
            Request::DirectionalDerivative { unknowns, knowns } => {
                let (knowns, seed): (Vec<_>, Vec<_>) = knowns.into_iter().unzip();
                let mut changes = vec![0.0; unknowns.len()];
                let done = instance.directional_derivative(&unknowns, &knowns, &seed, &mut changes);
                return reply(done.map(|()| changes), answer);
            }
            Request::SerializeState => return reply(instance.serialize_state(), answer),
            Request::HandOverEvents(stop) => {
                return reply(instance.hand_over_events(stop), answer);
            }
            Request::NextEvent => {
                let next = events(instance.as_mut()).and_then(Events::next_event);
                return reply(next, answer);
            }
            Request::UpdateDiscreteStates => {
                let events = events(instance.as_mut());
                return reply(events.and_then(Events::update_discrete_states), answer);
            }
            Request::EnterEventMode => events(instance.as_mut()).and_then(Events::enter_event_mode),
            Request::LeaveEventMode => events(instance.as_mut()).and_then(Events::leave_event_mode),
            Request::Open(_) | Request::Renew { .. } | Request::ProcessChanges | Request::Free => {
                Err(invalid_command(request.function()))
            }
        };
        reply(done, answer);
    }
}

/// Returns the interface for the events of an instance; an error if it has none.
fn events(instance: &mut dyn Slave) -> Result<&mut dyn Events, CallError> {
    instance.events().ok_or_else(|| absent("fmi3EnterEventMode"))
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
        self.read(reader)?;
        Some(self.run(instance).map(|done| {
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

    fn read(&mut self, reader: &mut Reader<'_>) -> Option<()> {
        self.time = reader.take()?;
        self.size = reader.take()?;
        self.never_back = reader.take::<u64>()? != 0;
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
        Some(())
    }

    /// Makes the calls of [`Slave::advance`].
    fn run(&mut self, instance: &mut dyn Slave) -> Result<StepResult, CallError> {
        if !self.inputs.is_empty() {
            instance.set_real(&self.inputs, &self.input_values)?;
        }
        if !self.derived_inputs.is_empty() {
            let (references, orders) = (&self.derived_inputs, &self.input_orders);
            instance.set_input_derivatives(references, orders, &self.input_derivatives)?;
        }
        let done = instance.do_step(self.time, self.size, self.never_back)?;
        if !self.outputs.is_empty() {
            instance.get_real(&self.outputs, &mut self.output_values)?;
        }
        if !self.derived_outputs.is_empty() {
            let (references, orders) = (&self.derived_outputs, &self.output_orders);
            instance.get_output_derivatives(references, orders, &mut self.output_derivatives)?;
        }
        Ok(done)
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

/// Returns the error of a command whose arguments are invalid or that comes out of order.
#[cold]
pub(super) fn invalid_command(function: Function) -> CallError {
    invalid(function, "received an invalid command: the shared memory is corrupted")
}

pub(super) fn invalid(function: Function, what: &str) -> CallError {
    let failure = Failure::InvalidAnswer(what.to_owned());
    CallError { function: function.name(Version::V2), failure, messages: Vec::new() }
}
