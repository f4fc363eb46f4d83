//! Implements [`Slave`] for an isolated instance: one round trip to the worker per function.

use fmu_description::Experiment;
use fmu_description::ModelDescription;

use super::command::Command;
use super::isolated::Isolated;
use super::strings;
use super::words::{Reader, Writer};
use slave::{Advance, Background, CallError, Slave, StepResult};

/// Writes the arguments of a command without arguments.
fn no_arguments(_: &mut Writer<'_>) {}

/// Reads the results of a command without results.
#[expect(clippy::unnecessary_wraps, reason = "the signature of all readers of answers")]
fn no_result(_: &mut Reader<'_>) -> Option<()> {
    Some(())
}

/// Reads the number of bytes to download.
fn read_count(reader: &mut Reader<'_>) -> Option<usize> {
    reader.take()
}

/// Writes references and one value for each.
#[inline]
fn write_pairs<T: super::words::Word>(writer: &mut Writer<'_>, references: &[u32], values: &[T]) {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    writer.put_list(references);
    writer.put_all(values);
}

fn read_step_result(reader: &mut Reader<'_>) -> Option<StepResult> {
    let whole: bool = reader.take()?;
    let (reached, terminated) = (reader.take()?, reader.take()?);
    Some(if whole { StepResult::Whole } else { StepResult::Part { reached, terminated } })
}

impl Isolated {
    fn plain(&mut self, command: Command) -> Result<(), CallError> {
        self.call(command, no_arguments, no_result)
    }
}

impl Background for Isolated {
    #[inline]
    fn begin_advance(&mut self, step: &Advance<'_>) -> Result<(), CallError> {
        self.place.set_time(step.time);
        self.post(Command::Advance, |writer| {
            writer.put(step.time);
            writer.put(step.size);
            writer.put(step.never_back);
            write_pairs(writer, step.inputs, step.input_values);
            write_pairs(writer, step.derived_inputs, step.input_derivatives);
            writer.put_all(step.input_orders);
            writer.put_list(step.outputs);
            writer.put_list(step.derived_outputs);
            writer.put_all(step.output_orders);
        })?;
        self.start_timer();
        Ok(())
    }

    #[inline]
    fn finish_advance(&mut self, step: &mut Advance<'_>) -> Result<StepResult, CallError> {
        self.answer(Command::Advance, |reader| {
            let done = read_step_result(reader)?;
            reader.take_all(step.output_values)?;
            reader.take_all(step.output_derivatives)?;
            Some(done)
        })
    }
}

impl Slave for Isolated {
    fn description(&self) -> &ModelDescription {
        &self.package.description
    }

    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        self.call(Command::SetDebugLogging, |writer| writer.put(on), no_result)
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.place.set_time(experiment.start_time);
        let write = |writer: &mut Writer<'_>| {
            writer.put(experiment.start_time);
            for optional in [experiment.stop_time, experiment.tolerance] {
                writer.put(optional.is_some());
                writer.put(optional.unwrap_or_default());
            }
        };
        self.call(Command::SetupExperiment, write, no_result)
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        self.plain(Command::EnterInitializationMode)
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.plain(Command::ExitInitializationMode)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.plain(Command::Terminate)
    }

    fn free(&mut self) -> Result<(), CallError> {
        self.free_instance()
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::GetReal, write, |reader| reader.take_all(values))
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.call(Command::SetReal, |writer| write_pairs(writer, references, values), no_result)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::GetInteger, write, |reader| reader.take_all(values))
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call(Command::SetInteger, |writer| write_pairs(writer, references, values), no_result)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::GetBoolean, write, |reader| reader.take_all(values))
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call(Command::SetBoolean, |writer| write_pairs(writer, references, values), no_result)
    }

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        let command = Command::GetString;
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        let total = self.call(command, write, read_count)?;
        let bytes = self.download(command, total)?;
        strings::read(&bytes, values).ok_or_else(|| self.invalid_answer(command))
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len(), "references and values are equally many");
        self.upload(&strings::write(values))?;
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::SetString, write, no_result)
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| {
            write_pairs(writer, references, values);
            writer.put_all(orders);
        };
        self.call(Command::SetInputDerivatives, write, no_result)
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| {
            writer.put_list(references);
            writer.put_all(orders);
        };
        self.call(Command::GetOutputDerivatives, write, |reader| reader.take_all(values))
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        self.place.set_time(time);
        let write = |writer: &mut Writer<'_>| {
            writer.put(time);
            writer.put(size);
            writer.put(never_back);
        };
        self.call(Command::DoStep, write, read_step_result)
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| {
            writer.put_list(unknowns);
            write_pairs(writer, knowns, seed);
        };
        self.call(Command::DirectionalDerivative, write, |reader| reader.take_all(changes))
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.call(Command::SaveState, |writer| writer.put(slot), no_result)
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.call(Command::RestoreState, |writer| writer.put(slot), no_result)
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        let command = Command::SerializeState;
        let total = self.call(command, no_arguments, read_count)?;
        self.download(command, total)
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.upload(bytes)?;
        let write = |writer: &mut Writer<'_>| writer.put(bytes.len());
        self.call(Command::DeserializeState, write, no_result)
    }

    fn advance(&mut self, step: &mut Advance<'_>) -> Result<StepResult, CallError> {
        self.begin_advance(step)?;
        self.finish_advance(step)
    }

    fn in_background(&mut self) -> Option<&mut dyn Background> {
        Some(self)
    }
}
