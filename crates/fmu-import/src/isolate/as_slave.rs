//! The functions of the standard, each one round trip to the worker.

use fmu_description::Experiment;
use fmu_description::ModelDescription;

use super::command::Command;
use super::isolated::Isolated;
use super::strings;
use super::words::{Reader, Writer};
use slave::{Advance, Background, CallError, Slave, StepResult};

/// For commands without arguments, or without results.
fn nothing(_: &mut Writer<'_>) {}

#[expect(clippy::unnecessary_wraps, reason = "the form of what reads an answer")]
fn no_result(_: &mut Reader<'_>) -> Option<()> {
    Some(())
}

/// How many bytes are there to be fetched.
fn count(reader: &mut Reader<'_>) -> Option<usize> {
    reader.take()
}

/// References, and one value for each.
#[inline]
fn pairs<T: super::words::Word>(writer: &mut Writer<'_>, references: &[u32], values: &[T]) {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    writer.put_list(references);
    writer.put_all(values);
}

fn stepped(reader: &mut Reader<'_>) -> Option<StepResult> {
    let whole: bool = reader.take()?;
    let (reached, terminated) = (reader.take()?, reader.take()?);
    Some(if whole { StepResult::Whole } else { StepResult::Part { reached, terminated } })
}

impl Isolated {
    fn plain(&mut self, command: Command) -> Result<(), CallError> {
        self.call(command, nothing, no_result)
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
            pairs(writer, step.inputs, step.input_values);
            pairs(writer, step.derived_inputs, step.input_derivatives);
            writer.put_all(step.input_orders);
            writer.put_list(step.outputs);
            writer.put_list(step.derived_outputs);
            writer.put_all(step.output_orders);
        })?;
        self.left_alone();
        Ok(())
    }

    #[inline]
    fn finish_advance(&mut self, step: &mut Advance<'_>) -> Result<StepResult, CallError> {
        self.answer(Command::Advance, |reader| {
            let done = stepped(reader)?;
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
        self.call(Command::SetReal, |writer| pairs(writer, references, values), no_result)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::GetInteger, write, |reader| reader.take_all(values))
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call(Command::SetInteger, |writer| pairs(writer, references, values), no_result)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        self.call(Command::GetBoolean, write, |reader| reader.take_all(values))
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call(Command::SetBoolean, |writer| pairs(writer, references, values), no_result)
    }

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        let command = Command::GetString;
        let write = |writer: &mut Writer<'_>| writer.put_list(references);
        let total = self.call(command, write, count)?;
        let bytes = self.fetch(command, total)?;
        strings::read(&bytes, values).ok_or_else(|| self.senseless(command))
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        assert_eq!(references.len(), values.len(), "references and values are equally many");
        self.bring(&strings::write(values))?;
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
            pairs(writer, references, values);
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
        self.call(Command::DoStep, write, stepped)
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
            pairs(writer, knowns, seed);
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
        let total = self.call(command, nothing, count)?;
        self.fetch(command, total)
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.bring(bytes)?;
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
