//! [`Integrated`]: a model-exchange instance as a slave.

mod as_slave;
mod events;
mod state;
mod step;

use fmu_description::number::seconds;
use fmu_description::{CoSimulation, Kind, ModelDescription};
use serde::{Deserialize, Serialize};
use slave::{CallError, Failure, ModelExchange, Slave, Status};
use solve::Scale;

use crate::inputs::Inputs;
use crate::method::Method;
use crate::stepper::{Memory, StepError, Stepper};
use state::Saved;

/// Relative tolerance if neither the user nor the FMU states one.
const TOLERANCE: f64 = 1e-6;
/// Absolute tolerance of a state, relative to the relative tolerance and the nominal value.
const ABSOLUTE: f64 = 0.01;
/// The name of the integration in errors.
const INTEGRATION: &str = "the integration of the model-exchange FMU";

/// Options of [`Integrated`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The integration method.
    pub method: Method,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Mode {
    /// Before the end of initialization mode.
    #[default]
    Setup,
    Event,
    Continuous,
}

/// The state of the integration at the present time, except for the arrays of states, indicators and inputs.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Point {
    /// The present time in s.
    time: f64,
    mode: Mode,
    /// The time of the next time event in s.
    next_event: Option<f64>,
    /// Whether the FMU requested the end of the simulation.
    ends: bool,
    /// Whether an event has happened at this time and event mode must be entered.
    event: bool,
    /// Whether inputs may have changed since the event indicators were read.
    input_changed: bool,
    /// The memory of the integrator at the time of saving; not used in the present point.
    memory: Memory,
}

/// Returns the description of a model-exchange FMU with an element `CoSimulation` for [`Integrated`].
#[must_use]
pub fn description_of(equations: &ModelDescription) -> ModelDescription {
    let mut description = equations.clone();
    let flags = equations.model_exchange.clone().unwrap_or_default();
    description.co_simulation = Some(CoSimulation {
        model_identifier: flags.model_identifier,
        needs_execution_tool: flags.needs_execution_tool,
        can_be_instantiated_only_once_per_process: flags.can_be_instantiated_only_once_per_process,
        can_get_and_set_fmu_state: flags.can_get_and_set_fmu_state,
        can_serialize_fmu_state: flags.can_serialize_fmu_state,
        provides_directional_derivative: flags.provides_directional_derivative,
        can_handle_variable_communication_step_size: true,
        can_interpolate_inputs: true,
        has_event_mode: true,
        ..CoSimulation::default()
    });
    description
}

fn clocks_of(description: &ModelDescription) -> Vec<u32> {
    let clocks =
        description.variables.iter().filter(|variable| matches!(variable.kind, Kind::Clock(_)));
    clocks.map(|clock| clock.value_reference).collect()
}

/// A model-exchange instance that is integrated from one communication point to the next.
///
/// [`Slave::description`] returns the description of the FMU with an element `CoSimulation` for this slave: steps of
/// any size, inputs with derivatives up to order 3, event mode, and FMU states and directional derivatives if the FMU
/// has them.
///
/// The relative tolerance is given in `setup_experiment` or, if it is not finite and above zero, 1e-6; the absolute
/// tolerance of a state is 0.01 times the relative one and the nominal value. Continuous inputs that the master sets
/// follow their derivatives within the step. A new value of any other variable after initialization causes an event, as
/// FMI requires.
///
/// An event at the end of a step belongs to this step: the outputs have the values after the event. A master
/// that handles the events ([`Slave::hand_over_events`]) reads the outputs after it has iterated the event.
pub struct Integrated {
    instance: Box<dyn ModelExchange>,
    description: ModelDescription,
    options: Options,
    tolerance: f64,
    point: Point,
    stepper: Stepper,
    inputs: Inputs,
    /// Value references of clocks.
    clocks: Vec<u32>,
    /// Whether the master handles the events.
    hands_over: bool,
    /// Whether a step ends at its first event if the master handles the events.
    stops: bool,
    /// Whether the present event has changed the nominal values of the states.
    nominals_changed: bool,
    /// The continuous states at the present point.
    states: Vec<f64>,
    /// The event indicators at the present point.
    indicators: Vec<f64>,
    /// States and event indicators within a step.
    search: step::Search,
    /// The saved states of the integration, by slot.
    saved: Vec<Saved>,
    /// Memory for the present values of variables that the master sets; clocks count as Booleans.
    integers: Vec<i64>,
    booleans: Vec<i32>,
    reals: Vec<f64>,
}

impl Integrated {
    /// Wraps a new instance.
    #[must_use]
    pub fn new(instance: Box<dyn ModelExchange>, options: Options) -> Self {
        let description = description_of(instance.description());
        let (inputs, clocks) = (Inputs::new(&description), clocks_of(&description));
        Self {
            instance,
            description,
            options,
            tolerance: TOLERANCE,
            point: Point::default(),
            stepper: Stepper::new(options.method, Scale::new(TOLERANCE, TOLERANCE, Vec::new())),
            inputs,
            clocks,
            hands_over: false,
            stops: false,
            nominals_changed: false,
            states: Vec::new(),
            indicators: Vec::new(),
            search: step::Search::default(),
            saved: Vec::new(),
            integers: Vec::new(),
            booleans: Vec::new(),
            reals: Vec::new(),
        }
    }

    /// Wraps a new instance as a slave, with the method called `method`, or the default if there is none of this name.
    ///
    /// This is the form of an integrator that a worker process of `fmu-import` calls.
    #[must_use]
    pub fn boxed(instance: Box<dyn ModelExchange>, method: &str) -> Box<dyn Slave> {
        let method = method.parse().unwrap_or_default();
        Box::new(Self::new(instance, Options { method }))
    }

    /// Reads the description again, after the sizes of arrays have changed.
    fn describe(&mut self) {
        self.description = description_of(self.instance.description());
        self.inputs = Inputs::new(&self.description);
        self.clocks = clocks_of(&self.description);
    }

    /// Allocates the arrays whose lengths are the numbers of states and event indicators.
    fn allocate(&mut self) -> Result<(), CallError> {
        self.states = vec![0.0; self.instance.number_of_continuous_states()?];
        self.indicators = vec![0.0; self.instance.number_of_event_indicators()?];
        self.search = step::Search::new(self.states.len(), self.indicators.len());
        let scale = self.scale()?;
        self.stepper = Stepper::new(self.options.method, scale);
        Ok(())
    }

    /// Returns the tolerances of the states. All nominal values are 1 if the FMU refuses to return them.
    fn scale(&mut self) -> Result<Scale, CallError> {
        let mut nominals = vec![1.0; self.states.len()];
        if !nominals.is_empty() {
            match self.instance.get_nominals_of_continuous_states(&mut nominals) {
                Ok(()) => {}
                Err(error) if error.leaves_the_instance_usable() => nominals.fill(1.0),
                Err(error) => return Err(error),
            }
        }
        Ok(Scale::new(self.tolerance, ABSOLUTE * self.tolerance, nominals))
    }

    /// Describes a continuous state for messages: by the name of its derivative, otherwise by its number, from 1.
    fn name_of_state(&self, index: usize) -> String {
        let variables = &self.description.variables;
        let at = |index: u32| variables.get((index as usize).checked_sub(1)?);
        let derivative = self.description.structure.derivatives.get(index);
        let derivative = derivative.and_then(|unknown| at(unknown.index));
        derivative.map_or_else(
            || format!("continuous state {}", index + 1),
            |variable| format!("the continuous state with the derivative {}", variable.name),
        )
    }

    /// Returns the error of an integration that stopped with `error`.
    fn stopped(&self, error: StepError) -> CallError {
        let (size, state, is_finite, cause) = match error {
            StepError::Call(error) => return error,
            StepError::Size { size, state, is_finite, cause } => (size, state, is_finite, cause),
        };
        let (refused, messages) = match cause {
            Some(CallError { function, messages, .. }) => (Some(function), messages),
            None => (None, Vec::new()),
        };
        let why = match refused {
            Some(function) => format!("{function} returned {}", Status::Discard.name()),
            None if !is_finite => {
                format!("{} is NaN or infinite, or its derivative", self.name_of_state(state))
            }
            None => format!(
                "{} is not within the tolerance {:e}; a larger tolerance or the solver `stiff` may \
                 help",
                self.name_of_state(state),
                self.tolerance
            ),
        };
        let time = seconds(self.point.time);
        let what = format!(
            "stops at t = {time} s: a step of {size:e} s is still too large, because {why}"
        );
        CallError { messages, ..failed(what) }
    }
}

fn failed(what: String) -> CallError {
    let failure = Failure::InvalidAnswer(what);
    CallError { function: INTEGRATION, failure, messages: Vec::new() }
}

#[cfg(test)]
mod tests;
