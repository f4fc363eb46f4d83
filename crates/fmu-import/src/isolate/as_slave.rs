//! Implements [`Slave`] for an isolated instance: one round trip to the worker per function.

use fmu_description::Experiment;
use fmu_description::ModelDescription;
use serde::de::DeserializeOwned;

use super::function::Function;
use super::isolated::{Isolated, description_of_instance};
use super::message::Request;
use super::perform::{EVENT, PART, TERMINATED, WHOLE};
use super::words::{Reader, Word, Writer};
use slave::{
    Background, CallError, CommunicationStep, EventInfo, Events, Slave, StepRequest, StepResult,
};

/// Writes references and one value for each.
#[inline]
fn write_pairs<T: Word>(writer: &mut Writer<'_>, references: &[u32], values: &[T]) {
    assert_equally_many(references, values);
    writer.put_list(references);
    writer.put_all(values);
}

/// Panics if the caller passes another number of values than references.
#[inline]
fn assert_equally_many<T>(references: &[u32], values: &[T]) {
    assert_eq!(references.len(), values.len(), "references and values are equally many");
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
    ($(fn $method:ident($($argument:ident: $type:ty)?) -> $result:ty = $request:expr;)*) => {
        $(fn $method(&mut self $(, $argument: $type)?) -> Result<$result, CallError> {
            self.request(&$request)
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
    /// Requests one value for each element of `values`. Another number of values ends the worker.
    fn request_all<T: DeserializeOwned>(
        &mut self,
        request: &Request<'_>,
        values: &mut [T],
    ) -> Result<(), CallError> {
        let answers: Vec<T> = self.request(request)?;
        if answers.len() != values.len() {
            return Err(self.invalid_answer(request.function()));
        }
        for (value, answer) in values.iter_mut().zip(answers) {
            *value = answer;
        }
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
        fn enter_initialization_mode() -> () = Request::EnterInitializationMode;
        fn exit_initialization_mode() -> () = Request::ExitInitializationMode;
        fn terminate() -> () = Request::Terminate;
        fn save_state(slot: usize) -> () = Request::SaveState(slot);
        fn restore_state(slot: usize) -> () = Request::RestoreState(slot);
        fn serialize_state() -> Vec<u8> = Request::SerializeState;
        fn deserialize_state(bytes: &[u8]) -> () = Request::DeserializeState(bytes);
        fn hand_over_events(stop: bool) -> bool = Request::HandOverEvents(stop);
    }

    numbers! {
        get_real set_real: f64 = GetReal SetReal;
        get_integer set_integer: i64 = GetInteger SetInteger;
        get_boolean set_boolean: i32 = GetBoolean SetBoolean;
    }

    fn description(&self) -> &ModelDescription {
        self.description.as_ref().unwrap_or(&self.package.description)
    }

    fn configure(&mut self, references: &[u32], values: &[i64]) -> Result<(), CallError> {
        assert_equally_many(references, values);
        let pairs = references.iter().copied().zip(values.iter().copied());
        self.request::<()>(&Request::Configure(pairs.clone().collect()))?;
        for (reference, value) in pairs {
            if let Ok(value) = u64::try_from(value) {
                self.sizes.insert(reference, value);
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

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        self.request_all(&Request::GetString(references.into()), values)
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        assert_equally_many(references, values);
        let values = references.iter().copied().zip(values.iter().map(String::as_str));
        self.request(&Request::SetString(values.collect()))
    }

    fn get_binary(&mut self, references: &[u32], values: &mut [Vec<u8>]) -> Result<(), CallError> {
        self.request_all(&Request::GetBinary(references.into()), values)
    }

    fn set_binary(&mut self, references: &[u32], values: &[Vec<u8>]) -> Result<(), CallError> {
        assert_equally_many(references, values);
        let values = references.iter().copied().zip(values.iter().map(Vec::as_slice));
        self.request(&Request::SetBinary(values.collect()))
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        assert_equally_many(references, orders);
        assert_equally_many(references, values);
        let derivatives = references.iter().zip(orders).zip(values);
        let derivatives =
            derivatives.map(|((reference, order), value)| (*reference, *order, *value));
        self.request(&Request::SetInputDerivatives(derivatives.collect()))
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        assert_equally_many(references, orders);
        let outputs = references.iter().copied().zip(orders.iter().copied()).collect();
        self.request_all(&Request::GetOutputDerivatives(outputs), values)
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        let step = CommunicationStep { time, size, never_back };
        self.advance(&mut StepRequest::held(&[], &[], step, &[], &mut []))
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        assert_equally_many(knowns, seed);
        let knowns = knowns.iter().copied().zip(seed.iter().copied()).collect();
        let unknowns = unknowns.into();
        self.request_all(&Request::DirectionalDerivative { unknowns, knowns }, changes)
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
        fn next_event() -> Option<f64> = Request::NextEvent;
        fn enter_event_mode() -> () = Request::EnterEventMode;
        fn update_discrete_states() -> EventInfo = Request::UpdateDiscreteStates;
        fn leave_event_mode() -> () = Request::LeaveEventMode;
    }
}
