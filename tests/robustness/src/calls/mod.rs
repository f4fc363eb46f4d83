//! One call of each function: chosen arguments, the returned status, the status that the standard
//! requires, and the changes to expect after `fmi2OK`.

mod exchange;
mod simulation;
mod states;
mod values;

use std::ffi::c_int;

use fmu::call_order::{Function, State};

use crate::choice::{Choice, usable};
use crate::importer::{Importer, Saved};
use crate::prediction::{Core, ERROR, OK};

/// A state that the importer holds, and its predicted content; `None` for null.
pub struct SavedState {
    pub saved: Saved,
    pub of: Option<Core>,
}

/// A serialised state.
#[derive(Clone)]
pub struct Record {
    pub bytes: Vec<u8>,
    pub of: Core,
}

/// The saved and the serialised states that the importer holds.
pub struct Stores {
    pub saved_states: [SavedState; 3],
    pub records: [Option<Record>; 2],
}

/// The instance, states and prediction that a call works with.
pub struct Call<'a> {
    pub importer: &'a Importer,
    pub core: &'a Core,
    pub stores: &'a mut Stores,
    pub choice: Choice<'a>,
}

type Effect = Box<dyn FnOnce(&mut Core, &mut Stores)>;

/// The outcome of a call.
pub struct Outcome {
    pub status: c_int,
    /// The statuses that the standard allows for the arguments.
    pub verdict: u8,
    pub effect: Effect,
    /// The time at which a step ends that stops half way.
    pub half_way: f64,
    /// The categories that `fmi2SetDebugLogging` chose, if it is `fmi2OK`.
    pub chosen: Option<Vec<String>>,
    /// Differences between values read and values predicted.
    pub complaint: Option<String>,
}

impl Outcome {
    fn new(status: c_int, verdict: u8) -> Self {
        let effect: Effect = Box::new(|_, _| {});
        Self { status, verdict, effect, half_way: 0.0, chosen: None, complaint: None }
    }

    /// `fine`: whether the arguments are valid.
    fn if_fine(status: c_int, fine: bool) -> Self {
        Self::new(status, if fine { OK } else { ERROR })
    }

    fn with(self, effect: impl FnOnce(&mut Core, &mut Stores) + 'static) -> Self {
        Self { effect: Box::new(effect), ..self }
    }

    fn to(self, state: State) -> Self {
        self.with(move |core, _| core.state = state)
    }

    fn claim(self, holds: bool, what: impl FnOnce() -> String) -> Self {
        if self.status != 0 || holds { self } else { Self { complaint: Some(what()), ..self } }
    }
}

/// Combines the verdicts on all elements: the union of those that are not `OK`.
fn together(verdicts: impl IntoIterator<Item = u8>) -> u8 {
    let bad =
        verdicts.into_iter().filter(|verdict| *verdict != OK).fold(0, |all, verdict| all | verdict);
    if bad == 0 { OK } else { bad }
}

type Caller = fn(&mut Call) -> Outcome;

/// All functions that take an instance, except `fmi2FreeInstance`.
pub const CALLS: [(Function, Caller); 40] = [
    (Function::EnterInitializationMode, enter_initialization_mode),
    (Function::ExitInitializationMode, exit_initialization_mode),
    (Function::DoStep, simulation::do_step),
    (Function::GetReal, values::get_real),
    (Function::SetReal, values::set_real),
    (Function::EnterEventMode, exchange::enter_event_mode),
    (Function::NewDiscreteStates, exchange::new_discrete_states),
    (Function::EnterContinuousTimeMode, exchange::enter_continuous_time_mode),
    (Function::SetTime, exchange::set_time),
    (Function::SetContinuousStates, exchange::set_continuous_states),
    (Function::GetDerivatives, exchange::get_derivatives),
    (Function::GetEventIndicators, exchange::get_event_indicators),
    (Function::GetContinuousStates, exchange::get_continuous_states),
    (Function::GetNominalsOfContinuousStates, exchange::get_nominals),
    (Function::CompletedIntegratorStep, exchange::completed_integrator_step),
    (Function::GetFMUstate, states::get),
    (Function::SetFMUstate, states::set),
    (Function::FreeFMUstate, states::free),
    (Function::SerializedFMUstateSize, states::size),
    (Function::SerializeFMUstate, states::serialize),
    (Function::DeSerializeFMUstate, states::de_serialize),
    (Function::Reset, reset),
    (Function::SetupExperiment, setup_experiment),
    (Function::SetDebugLogging, set_debug_logging),
    (Function::GetInteger, values::get_integer),
    (Function::SetInteger, values::set_integer),
    (Function::GetBoolean, values::get_boolean),
    (Function::SetBoolean, values::set_boolean),
    (Function::GetString, values::get_string),
    (Function::SetString, values::set_string),
    (Function::GetDirectionalDerivative, values::get_directional_derivative),
    (Function::SetRealInputDerivatives, simulation::set_real_input_derivatives),
    (Function::GetRealOutputDerivatives, simulation::get_real_output_derivatives),
    (Function::CancelStep, simulation::cancel_step),
    (Function::GetStatus, simulation::get_status),
    (Function::GetRealStatus, simulation::get_real_status),
    (Function::GetIntegerStatus, simulation::get_integer_status),
    (Function::GetBooleanStatus, simulation::get_boolean_status),
    (Function::GetStringStatus, simulation::get_string_status),
    (Function::Terminate, terminate),
];

fn enter_initialization_mode(call: &mut Call) -> Outcome {
    Outcome::new(call.importer.enter_initialization_mode(), OK).to(State::InitializationMode)
}

fn exit_initialization_mode(call: &mut Call) -> Outcome {
    let next = if call.core.exchange { State::EventMode } else { State::StepComplete };
    Outcome::new(call.importer.exit_initialization_mode(), OK).to(next)
}

fn terminate(call: &mut Call) -> Outcome {
    Outcome::new(call.importer.terminate(), OK).to(State::Terminated)
}

fn reset(call: &mut Call) -> Outcome {
    Outcome::new(call.importer.reset(), OK).with(|core, _| *core = Core::new(core.exchange))
}

fn setup_experiment(call: &mut Call) -> Outcome {
    let choice = &mut call.choice;
    let start = choice.either(&[0.0, 1.0, -2.5], &[f64::NAN, f64::INFINITY]);
    let stop =
        choice.either(&[None, Some(9.0), Some(1e9)], &[Some(-9.0), Some(f64::NAN), Some(start)]);
    let tolerance = choice.either(&[None, Some(1e-6)], &[Some(0.0), Some(-1.0), Some(f64::NAN)]);
    let status = call.importer.setup_experiment(tolerance, start, stop);
    let fine = start.is_finite()
        && stop.is_none_or(|stop| stop >= start)
        && tolerance.is_none_or(|tolerance| tolerance > 0.0);
    Outcome::if_fine(status, fine).with(move |core, _| {
        (core.start, core.time, core.stop) = (start, start, stop);
        (core.earliest, core.completed) = (start, start);
    })
}

fn set_debug_logging(call: &mut Call) -> Outcome {
    const NAMES: [&str; 4] = ["logStatusError", "logStatusDiscard", "logStatusFatal", "logEvents"];
    let count = call.choice.of(&[0, 1, 2, 4]);
    let categories = call.choice.array(count, |choice| {
        if choice.rarely() { choice.text() } else { std::ffi::CString::new(choice.of(&NAMES)).ok() }
    });
    let on = call.choice.byte().is_multiple_of(2);
    let status = call.importer.set_debug_logging(on, &categories);
    let named: Vec<_> =
        categories.items.iter().flatten().map(|category| category.to_string_lossy()).collect();
    let known = named.len() == count && named.iter().all(|name| NAMES.contains(&name.as_ref()));
    let chosen = named.iter().map(ToString::to_string).collect();
    let outcome = Outcome::if_fine(status, usable(&categories) && (known || count == 0));
    Outcome { chosen: Some(chosen), ..outcome }
}
