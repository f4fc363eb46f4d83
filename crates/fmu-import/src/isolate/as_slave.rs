//! Implements [`Slave`] for an isolated instance: one round trip to the worker per function.

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use serde::de::DeserializeOwned;

use super::function::Function;
use super::isolated::{Isolated, description_of_instance};
use super::perform::{EVENT, PART, TERMINATED, WHOLE};
use super::request::Request;
use super::words::{Reader, Word, Writer};
use slave::{
    Background, CallError, CommunicationStep, EventInfo, Events, Slave, StepRequest, StepResult,
};

/// Writes the references, then their values. Panics if the two lists have different lengths.
#[inline]
fn write_pairs<T: Word>(writer: &mut Writer<'_>, references: &[u32], values: &[T]) {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
    writer.put_list(references);
    writer.put_all(values);
}

fn read_step_result(reader: &mut Reader<'_>) -> Option<StepResult> {
    let end: u64 = reader.take()?;
    let reached = reader.take()?;
    Some(match end {
        WHOLE => StepResult::Whole,
        EVENT => StepResult::Event { reached },
        PART => StepResult::Part { reached, terminated: false },
        TERMINATED => StepResult::Part { reached, terminated: true },
        _ => return None,
    })
}

/// Defines the methods that send one request and return its answer.
macro_rules! requests {
    ($(fn $method:ident($($argument:ident: $type:ty),*) -> $result:ty = $request:expr;)*) => {
        $(fn $method(&mut self $(, $argument: $type)*) -> Result<$result, CallError> {
            self.request(&$request)
        })*
    };
}

/// Defines the methods that send one request and fill a list of `$value` with the answer.
macro_rules! lists {
    ($(fn $method:ident($($argument:ident: $type:ty),*; $value:ty) = $request:expr;)*) => {
        $(fn $method(
            &mut self,
            $($argument: $type,)*
            values: &mut [$value],
        ) -> Result<(), CallError> {
            self.request_all(&$request, values)
        })*
    };
}

/// Defines the methods that get and set numbers.
macro_rules! numbers {
    ($($get:ident $set:ident: $type:ty = $get_function:ident $set_function:ident;)*) => {
        $(fn $get(&mut self, references: &[u32], values: &mut [$type]) -> Result<(), CallError> {
            let read = |reader: &mut Reader<'_>| reader.take_all(values);
            self.call(Function::$get_function, |writer| writer.put_list(references), read)
        }

        fn $set(&mut self, references: &[u32], values: &[$type]) -> Result<(), CallError> {
            let write = |writer: &mut Writer<'_>| write_pairs(writer, references, values);
            self.call(Function::$set_function, write, |_| Some(()))
        })*
    };
}

impl Isolated {
    /// Requests one value for each element of `values`. Kills the worker if it returns another number of values.
    fn request_all<T: DeserializeOwned>(
        &mut self,
        request: &Request<'_>,
        values: &mut [T],
    ) -> Result<(), CallError> {
        let answers: Vec<T> = self.request(request)?;
        if answers.len() != values.len() {
            return Err(self.invalid_answer(request.function()));
        }
        values.iter_mut().zip(answers).for_each(|(value, answer)| *value = answer);
        Ok(())
    }
}

impl Background for Isolated {
    #[inline]
    fn begin_advance(&mut self, request: &StepRequest<'_>) -> Result<(), CallError> {
        let CommunicationStep { time, size, never_back } = request.step;
        self.place.set_time(time);
        self.post(Function::DoStep, |writer| {
            writer.put(time);
            writer.put(size);
            writer.put(u64::from(never_back));
            write_pairs(writer, request.inputs, request.input_values);
            write_pairs(writer, request.derived_inputs, request.input_derivatives);
            writer.put_all(request.input_orders);
            writer.put_list(request.outputs);
            writer.put_list(request.derived_outputs);
            writer.put_all(request.output_orders);
        })?;
        self.start_timer();
        Ok(())
    }

    #[inline]
    fn finish_advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError> {
        self.answer(Function::DoStep, |reader| {
            let done = read_step_result(reader)?;
            reader.take_all(request.output_values)?;
            reader.take_all(request.output_derivatives)?;
            Some(done)
        })
    }
}

impl Slave for Isolated {
    requests! {
        fn process_changes() -> Vec<String> = Request::ProcessChanges;
        fn set_debug_logging(on: bool) -> () = Request::SetDebugLogging(on);
        fn enter_initialization_mode() -> () = Request::EnterInitializationMode();
        fn exit_initialization_mode() -> () = Request::ExitInitializationMode();
        fn terminate() -> () = Request::Terminate();
        fn save_state(slot: usize) -> () = Request::SaveState(slot);
        fn restore_state(slot: usize) -> () = Request::RestoreState(slot);
        fn serialize_state() -> Vec<u8> = Request::SerializeState();
        fn deserialize_state(bytes: &[u8]) -> () = Request::DeserializeState(bytes);
        fn hand_over_events(stop: bool) -> bool = Request::HandOverEvents(stop);
        fn set_string(references: &[u32], values: &[String]) -> () =
            Request::SetString(references.into(), values.into());
        fn set_binary(references: &[u32], values: &[Vec<u8>]) -> () =
            Request::SetBinary(references.into(), values.into());
        fn set_input_derivatives(references: &[u32], orders: &[i32], values: &[f64]) -> () =
            Request::SetInputDerivatives(references.into(), orders.into(), values.into());
    }

    numbers! {
        get_real set_real: f64 = GetReal SetReal;
        get_integer set_integer: i64 = GetInteger SetInteger;
        get_boolean set_boolean: i32 = GetBoolean SetBoolean;
    }

    fn description(&self) -> &ModelDescription {
        self.description.as_ref().unwrap_or(&self.package.description)
    }

    lists! {
        fn get_string(references: &[u32]; String) = Request::GetString(references.into());
        fn get_binary(references: &[u32]; Vec<u8>) = Request::GetBinary(references.into());
        fn get_output_derivatives(references: &[u32], orders: &[i32]; f64) =
            Request::GetOutputDerivatives(references.into(), orders.into());
        fn directional_derivative(unknowns: &[u32], knowns: &[u32], seed: &[f64]; f64) =
            Request::DirectionalDerivative(unknowns.into(), knowns.into(), seed.into());
    }

    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        self.request::<()>(&Request::Configure(references.into(), values.into()))?;
        for (reference, value) in references.iter().zip(values) {
            if let Ok(value) = u64::try_from(*value) {
                self.sizes.insert(*reference, value);
            }
        }
        match description_of_instance(&self.package.description, &self.sizes, self.describe) {
            Ok(description) => self.description = description,
            Err(_) => return Err(self.invalid_answer(Function::Configure)),
        }
        Ok(())
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.place.set_time(experiment.start_time);
        self.request(&Request::SetupExperiment(*experiment))
    }

    fn free(&mut self) -> Result<(), CallError> {
        self.free_instance()
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        let step = CommunicationStep { time, size, never_back };
        self.advance(&mut StepRequest::held(&[], &[], step, &[], &mut []))
    }

    fn advance(&mut self, request: &mut StepRequest<'_>) -> Result<StepResult, CallError> {
        self.begin_advance(request)?;
        self.finish_advance(request)
    }

    fn in_background(&mut self) -> Option<&mut dyn Background> {
        Some(self)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }
}

impl Events for Isolated {
    requests! {
        fn next_event() -> Option<f64> = Request::NextEvent();
        fn enter_event_mode() -> () = Request::EnterEventMode();
        fn update_discrete_states() -> EventInfo = Request::UpdateDiscreteStates();
        fn leave_event_mode() -> () = Request::LeaveEventMode();
    }
}
