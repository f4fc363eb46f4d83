//! Executes the commands of the master: reads the arguments from shared memory, calls the FMU and
//! writes the results.

use std::sync::atomic::Ordering;

use fmu_description::Experiment;

use super::command::{Command, DONE};
use super::layout::Shared;
use super::strings;
use super::words::{Reader, Word, Writer};
use crate::fmu::{Fmu, Instance};
use slave::{CallError, Slave, StepResult};

/// The result of a command; `None` if its arguments are invalid.
type CommandResult = Option<Result<(), CallError>>;

/// An instance and the buffers of its calls, kept so that a step does not allocate.
pub(super) struct Executor {
    instance: Instance,
    references: Vec<u32>,
    knowns: Vec<u32>,
    orders: Vec<i32>,
    reals: Vec<f64>,
    changes: Vec<f64>,
    integers: Vec<i32>,
    step: Step,
    /// Bytes received for the next command.
    uploaded: Vec<u8>,
    /// Bytes of the last command that the master will download.
    to_download: Vec<u8>,
}

/// The arguments and results of [`Slave::advance`].
#[derive(Default)]
struct Step {
    span: (f64, f64),
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
    pub(super) fn new(mut instance: Instance, logging: bool) -> Self {
        if logging {
            // An FMU without the function logs by its own rules.
            let _ = instance.set_debug_logging(true);
        }
        Self {
            instance,
            references: Vec::new(),
            knowns: Vec::new(),
            orders: Vec::new(),
            reals: Vec::new(),
            changes: Vec::new(),
            integers: Vec::new(),
            step: Step::default(),
            uploaded: Vec::new(),
            to_download: Vec::new(),
        }
    }

    /// Returns the FMU of the instance.
    pub(super) fn fmu(&self) -> Fmu {
        self.instance.fmu().clone()
    }

    /// Executes `command` with the arguments in `reader`; writes the results to `writer`.
    #[inline]
    pub(super) fn perform(
        &mut self,
        command: Command,
        shared: &Shared,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> CommandResult {
        if command == Command::Advance {
            return self.advance(shared, reader, writer);
        }
        let done = self
            .values(command, reader, writer)
            .or_else(|| self.derivatives_and_steps(command, reader, writer))
            .or_else(|| self.modes_and_states(command, reader, writer))
            .or_else(|| self.transfers(command, reader, writer));
        done?
    }

    /// Gets and sets Real, Integer and Boolean variables; the outer `None` for other commands.
    fn values(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<CommandResult> {
        let Self { instance, references, reals, integers, .. } = self;
        Some(match command {
            Command::GetReal => {
                get(reader, writer, references, reals, |r, v| instance.get_real(r, v))
            }
            Command::GetInteger => {
                get(reader, writer, references, integers, |r, v| instance.get_integer(r, v))
            }
            Command::GetBoolean => {
                get(reader, writer, references, integers, |r, v| instance.get_boolean(r, v))
            }
            Command::SetReal => {
                set(reader, writer, references, reals, |r, v| instance.set_real(r, v))
            }
            Command::SetInteger => {
                set(reader, writer, references, integers, |r, v| instance.set_integer(r, v))
            }
            Command::SetBoolean => {
                set(reader, writer, references, integers, |r, v| instance.set_boolean(r, v))
            }
            _ => return None,
        })
    }

    /// Executes steps and the calls for derivatives; the outer `None` for other commands.
    fn derivatives_and_steps(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<CommandResult> {
        match command {
            Command::SetInputDerivatives
            | Command::GetOutputDerivatives
            | Command::DirectionalDerivative
            | Command::DoStep => {}
            _ => return None,
        }
        Some((|| {
            let Self { instance, references, knowns, orders, reals, changes, .. } = self;
            if command == Command::DoStep {
                let (time, size) = (reader.take()?, reader.take()?);
                let done = instance.do_step(time, size, reader.take()?);
                return Some(done.map(|done| write_step_result(done, writer)));
            }
            reader.take_list(references)?;
            let count = references.len();
            writer.put(DONE);
            Some(match command {
                Command::SetInputDerivatives => {
                    reader.take_counted(count, reals)?;
                    reader.take_counted(count, orders)?;
                    instance.set_input_derivatives(references, orders, reals)
                }
                Command::GetOutputDerivatives => {
                    reader.take_counted(count, orders)?;
                    reals.resize(count, 0.0);
                    let done = instance.get_output_derivatives(references, orders, reals);
                    done.map(|()| writer.put_all(reals))
                }
                _ => {
                    reader.take_list(knowns)?;
                    reader.take_counted(knowns.len(), reals)?;
                    changes.resize(count, 0.0);
                    let done = instance.directional_derivative(references, knowns, reals, changes);
                    done.map(|()| writer.put_all(changes))
                }
            })
        })())
    }

    /// Changes the mode, saves and restores states; the outer `None` for other commands.
    fn modes_and_states(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<CommandResult> {
        let instance = &mut self.instance;
        let done = match command {
            Command::EnterInitializationMode => Some(instance.enter_initialization_mode()),
            Command::ExitInitializationMode => Some(instance.exit_initialization_mode()),
            Command::Terminate => Some(instance.terminate()),
            Command::SetDebugLogging => reader.take().map(|on| instance.set_debug_logging(on)),
            Command::SetupExperiment => {
                read_experiment(reader).map(|experiment| instance.setup_experiment(&experiment))
            }
            Command::SaveState => reader.take().map(|slot| instance.save_state(slot)),
            Command::RestoreState => reader.take().map(|slot| instance.restore_state(slot)),
            _ => return None,
        };
        writer.put(DONE);
        Some(done)
    }

    /// Executes commands whose data may need several turns; the outer `None` for other commands.
    fn transfers(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<CommandResult> {
        Some(match command {
            Command::Upload => self.upload(reader, writer),
            Command::Download => self.download(reader, writer),
            Command::GetString => self.get_string(reader, writer),
            Command::SetString => self.set_string(reader, writer),
            Command::SerializeState => {
                let done = self.instance.serialize_state();
                Some(done.map(|bytes| self.offer(bytes, writer)))
            }
            Command::DeserializeState => {
                let bytes = std::mem::take(&mut self.uploaded);
                let whole = reader.take() == Some(bytes.len());
                writer.put(DONE);
                whole.then(|| self.instance.deserialize_state(&bytes))
            }
            _ => return None,
        })
    }

    /// Receives a piece of the data of the next command.
    fn upload(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> CommandResult {
        let first: bool = reader.take()?;
        if first {
            self.uploaded.clear();
        }
        reader.take_bytes(&mut self.uploaded)?;
        writer.put(DONE);
        Some(Ok(()))
    }

    /// Keeps `bytes` for download and writes their number.
    fn offer(&mut self, bytes: Vec<u8>, writer: &mut Writer<'_>) {
        writer.put(DONE);
        writer.put(bytes.len());
        self.to_download = bytes;
    }

    /// Sends a piece of the data of the last command.
    fn download(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> CommandResult {
        let offset: usize = reader.take()?;
        let rest = self.to_download.get(offset..)?;
        writer.put(DONE);
        let most = 8 * writer.room().saturating_sub(1);
        writer.put_bytes(&rest[..rest.len().min(most)]);
        Some(Ok(()))
    }

    fn get_string(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> CommandResult {
        reader.take_list(&mut self.references)?;
        let mut values = vec![String::new(); self.references.len()];
        let done = self.instance.get_string(&self.references, &mut values);
        Some(done.map(|()| self.offer(strings::write(&values), writer)))
    }

    fn set_string(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> CommandResult {
        reader.take_list(&mut self.references)?;
        let bytes = std::mem::take(&mut self.uploaded);
        let mut values = vec![String::new(); self.references.len()];
        strings::read(&bytes, &mut values)?;
        writer.put(DONE);
        Some(self.instance.set_string(&self.references, &values))
    }

    fn advance(
        &mut self,
        shared: &Shared,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> CommandResult {
        self.step.read(reader)?;
        let Self { instance, step, .. } = self;
        Some(step.run(instance, shared).map(|done| {
            write_step_result(done, writer);
            writer.put_all(&step.output_values);
            writer.put_all(&step.output_derivatives);
        }))
    }
}

impl Step {
    fn read(&mut self, reader: &mut Reader<'_>) -> Option<()> {
        self.span = (reader.take()?, reader.take()?);
        self.never_back = reader.take()?;
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

    /// Makes the calls of [`Slave::advance`]. Stores each function in shared memory, so that the
    /// master can name the function that crashed.
    fn run(&mut self, instance: &mut Instance, shared: &Shared) -> Result<StepResult, CallError> {
        let at = |command: Command| shared.place().store(command.to_word(), Ordering::Relaxed);
        if !self.inputs.is_empty() {
            at(Command::SetReal);
            instance.set_real(&self.inputs, &self.input_values)?;
        }
        if !self.derived_inputs.is_empty() {
            at(Command::SetInputDerivatives);
            let (references, orders) = (&self.derived_inputs, &self.input_orders);
            instance.set_input_derivatives(references, orders, &self.input_derivatives)?;
        }
        at(Command::DoStep);
        let done = instance.do_step(self.span.0, self.span.1, self.never_back)?;
        if !self.outputs.is_empty() {
            at(Command::GetReal);
            instance.get_real(&self.outputs, &mut self.output_values)?;
        }
        if !self.derived_outputs.is_empty() {
            at(Command::GetOutputDerivatives);
            let (references, orders) = (&self.derived_outputs, &self.output_orders);
            instance.get_output_derivatives(references, orders, &mut self.output_derivatives)?;
        }
        Ok(done)
    }
}

fn get<T: Word + Default>(
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
    references: &mut Vec<u32>,
    values: &mut Vec<T>,
    call: impl FnOnce(&[u32], &mut [T]) -> Result<(), CallError>,
) -> CommandResult {
    reader.take_list(references)?;
    values.resize(references.len(), T::default());
    writer.put(DONE);
    Some(call(references, values).map(|()| writer.put_all(values)))
}

fn set<T: Word>(
    reader: &mut Reader<'_>,
    writer: &mut Writer<'_>,
    references: &mut Vec<u32>,
    values: &mut Vec<T>,
    call: impl FnOnce(&[u32], &[T]) -> Result<(), CallError>,
) -> CommandResult {
    reader.take_list(references)?;
    reader.take_counted(references.len(), values)?;
    writer.put(DONE);
    Some(call(references, values))
}

fn read_experiment(reader: &mut Reader<'_>) -> Option<Experiment> {
    let start_time = reader.take()?;
    let mut optional = || {
        let (defined, value): (bool, f64) = (reader.take()?, reader.take()?);
        Some(defined.then_some(value))
    };
    Some(Experiment { start_time, stop_time: optional()?, tolerance: optional()? })
}

fn write_step_result(done: StepResult, writer: &mut Writer<'_>) {
    let (whole, reached, terminated) = match done {
        StepResult::Whole => (true, 0.0, false),
        StepResult::Part { reached, terminated } => (false, reached, terminated),
    };
    writer.put(DONE);
    writer.put(whole);
    writer.put(reached);
    writer.put(terminated);
}
