//! What the worker does for each command: arguments out of the shared memory, the call, results in.

use std::sync::atomic::Ordering;

use fmu_description::Experiment;

use super::command::{Command, DONE};
use super::layout::Shared;
use super::strings;
use super::words::{Reader, Word, Writer};
use crate::fmu::{Fmu, Instance};
use slave::{CallError, Slave, StepResult};

/// What came of a command; none where its arguments make no sense.
type Done = Option<Result<(), CallError>>;

/// An instance and the arrays that its calls need, kept so that a step allocates nothing.
pub(super) struct Work {
    instance: Instance,
    references: Vec<u32>,
    knowns: Vec<u32>,
    orders: Vec<i32>,
    reals: Vec<f64>,
    changes: Vec<f64>,
    integers: Vec<i32>,
    step: Step,
    /// Bytes brought for the next command, and those that the last one left to be fetched.
    brought: Vec<u8>,
    left: Vec<u8>,
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

impl Work {
    pub(super) fn new(mut instance: Instance, logging: bool) -> Self {
        if logging {
            // An FMU without the function says what it likes without.
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
            brought: Vec::new(),
            left: Vec::new(),
        }
    }

    /// The FMU of the instance.
    pub(super) fn fmu(&self) -> Fmu {
        self.instance.fmu().clone()
    }

    /// Does `command` with the arguments in `reader`; the results go to `writer`.
    #[inline]
    pub(super) fn perform(
        &mut self,
        command: Command,
        shared: &Shared,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Done {
        if command == Command::Advance {
            return self.advance(shared, reader, writer);
        }
        let done = self
            .values(command, reader, writer)
            .or_else(|| self.courses(command, reader, writer))
            .or_else(|| self.phases(command, reader, writer))
            .or_else(|| self.bytes(command, reader, writer));
        done?
    }

    /// Values of Real, Integer and Boolean variables; the outer none for other commands.
    fn values(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<Done> {
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

    /// Derivatives and steps; the outer none for other commands.
    fn courses(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<Done> {
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
                return Some(done.map(|done| write_stepped(done, writer)));
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

    /// From phase to phase, states in slots; the outer none for other commands.
    fn phases(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<Done> {
        let instance = &mut self.instance;
        let done = match command {
            Command::EnterInitializationMode => Some(instance.enter_initialization_mode()),
            Command::ExitInitializationMode => Some(instance.exit_initialization_mode()),
            Command::Terminate => Some(instance.terminate()),
            Command::SetDebugLogging => reader.take().map(|on| instance.set_debug_logging(on)),
            Command::SetupExperiment => {
                experiment(reader).map(|experiment| instance.setup_experiment(&experiment))
            }
            Command::SaveState => reader.take().map(|slot| instance.save_state(slot)),
            Command::RestoreState => reader.take().map(|slot| instance.restore_state(slot)),
            _ => return None,
        };
        writer.put(DONE);
        Some(done)
    }

    /// What is too long for one turn.
    fn bytes(
        &mut self,
        command: Command,
        reader: &mut Reader<'_>,
        writer: &mut Writer<'_>,
    ) -> Option<Done> {
        Some(match command {
            Command::Bring => self.bring(reader, writer),
            Command::Fetch => self.fetch(reader, writer),
            Command::GetString => self.get_string(reader, writer),
            Command::SetString => self.set_string(reader, writer),
            Command::SerializeState => {
                let done = self.instance.serialize_state();
                Some(done.map(|bytes| self.leave(bytes, writer)))
            }
            Command::DeserializeState => {
                let bytes = std::mem::take(&mut self.brought);
                let whole = reader.take() == Some(bytes.len());
                writer.put(DONE);
                whole.then(|| self.instance.deserialize_state(&bytes))
            }
            _ => return None,
        })
    }

    fn bring(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> Done {
        let first: bool = reader.take()?;
        if first {
            self.brought.clear();
        }
        reader.take_bytes(&mut self.brought)?;
        writer.put(DONE);
        Some(Ok(()))
    }

    /// Keeps `bytes` to be fetched and announces them.
    fn leave(&mut self, bytes: Vec<u8>, writer: &mut Writer<'_>) {
        writer.put(DONE);
        writer.put(bytes.len());
        self.left = bytes;
    }

    fn fetch(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> Done {
        let offset: usize = reader.take()?;
        let rest = self.left.get(offset..)?;
        writer.put(DONE);
        let most = 8 * writer.room().saturating_sub(1);
        writer.put_bytes(&rest[..rest.len().min(most)]);
        Some(Ok(()))
    }

    fn get_string(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> Done {
        reader.take_list(&mut self.references)?;
        let mut values = vec![String::new(); self.references.len()];
        let done = self.instance.get_string(&self.references, &mut values);
        Some(done.map(|()| self.leave(strings::write(&values), writer)))
    }

    fn set_string(&mut self, reader: &mut Reader<'_>, writer: &mut Writer<'_>) -> Done {
        reader.take_list(&mut self.references)?;
        let bytes = std::mem::take(&mut self.brought);
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
    ) -> Done {
        self.step.read(reader)?;
        let Self { instance, step, .. } = self;
        Some(step.make(instance, shared).map(|done| {
            write_stepped(done, writer);
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

    /// The calls of [`Slave::advance`], each with its place left for the master to find.
    fn make(&mut self, instance: &mut Instance, shared: &Shared) -> Result<StepResult, CallError> {
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
) -> Done {
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
) -> Done {
    reader.take_list(references)?;
    reader.take_counted(references.len(), values)?;
    writer.put(DONE);
    Some(call(references, values))
}

fn experiment(reader: &mut Reader<'_>) -> Option<Experiment> {
    let start_time = reader.take()?;
    let mut optional = || {
        let (defined, value): (bool, f64) = (reader.take()?, reader.take()?);
        Some(defined.then_some(value))
    };
    Some(Experiment { start_time, stop_time: optional()?, tolerance: optional()? })
}

fn write_stepped(done: StepResult, writer: &mut Writer<'_>) {
    let (whole, reached, terminated) = match done {
        StepResult::Whole => (true, 0.0, false),
        StepResult::Part { reached, terminated } => (false, reached, terminated),
    };
    writer.put(DONE);
    writer.put(whole);
    writer.put(reached);
    writer.put(terminated);
}
