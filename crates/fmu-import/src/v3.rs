//! FMUs of FMI 3.0 as slaves: types, arrays, events, clocks and model partitions.
//!
//! In co-simulation the slave uses Event Mode if the FMU has it, and lets the FMU return early. Unless the master
//! handles the events, the slave handles them and continues the step, so that the master sees one whole communication
//! step (FMI 3.0.2, section 4.2). In model exchange the caller handles the events, in which input clocks tick.

mod access;
mod buffer;
mod clocked;
mod clocks;
mod derivatives;
mod elements;
mod modes;
mod plan;
mod states;

use std::collections::HashMap;
use std::sync::Arc;

use fmu_description::abi::Status;
use fmu_description::{CoSimulation, Experiment, ModelDescription};

use crate::error::{LoadError, refused};
use crate::library::v3::{Component, Instantiation, Interface, Library};
use buffer::Buffer;
use clocked::ClockedRuns;
use clocks::Clocks;
pub(crate) use elements::ElementView;
use modes::Mode;
use plan::Plans;
use slave::{CallError, Failure};
use states::State;

/// The categories of messages that explain a status (FMI 3.0.2, section 2.4.5). These categories are switched on: with
/// `loggingOn = false` alone an FMU is silent about its errors.
const STATUS_CATEGORIES: [&str; 4] =
    ["logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"];

/// An instance of an FMU of FMI 3.0 in this process.
pub(crate) struct Instance {
    pub(crate) component: Component,
    view: ElementView,
    plans: Plans,
    interface: Interface,
    /// Whether the FMU was instantiated with `eventModeUsed`.
    event_mode: bool,
    experiment: Experiment,
    /// Whether the master handles the events.
    hands_over_events: bool,
    /// Whether a step ends at the first event, if the master handles the events.
    stops_at_events: bool,
    state: State,
    clocked: ClockedRuns,
    /// The state of the slave for each slot of FMU states.
    slots: Vec<State>,
    /// Values of structural parameters, by value reference.
    sizes: HashMap<u32, u64>,
}

/// Defines methods that get and set values. A row has the methods, the type of a value and, for get and set, the C
/// function that errors name and the function that copies a value from or to a buffer.
macro_rules! values {
    ($(
        $get:ident $set:ident: $type:ty =
            ($get_name:literal, $fill:expr) ($set_name:literal, $put:expr);
    )*) => {
        $(pub(crate) fn $get(
            &mut self,
            list: &[u32],
            values: &mut [$type],
        ) -> Result<(), CallError> {
            self.read($get_name, list, values, $fill)
        }

        pub(crate) fn $set(&mut self, list: &[u32], values: &[$type]) -> Result<(), CallError> {
            self.write($set_name, list, values, $put)
        })*
    };
}

impl Instance {
    /// Creates the instance `name` for `interface`. `resources` is the folder of the resources, if the FMU
    /// has one.
    pub(crate) fn new(
        library: &Arc<Library>,
        description: &ModelDescription,
        interface: Interface,
        name: &str,
        resources: Option<&str>,
    ) -> Result<Self, LoadError> {
        let flags = match interface {
            Interface::ModelExchange => CoSimulation::default(),
            Interface::CoSimulation | Interface::ScheduledExecution => {
                description.stepped().unwrap_or_default()
            }
        };
        let sizes = HashMap::new();
        let view = ElementView::new(description, &sizes).map_err(|reason| {
            LoadError::Unsupported { model: description.model_name.clone(), reason }
        })?;
        let followed = view.variables.iter().filter(|variable| variable.intermediate);
        let intermediate: Vec<u32> = followed.map(|variable| variable.reference).collect();
        let arguments = Instantiation {
            interface,
            name,
            token: &description.guid,
            resources,
            event_mode: flags.has_event_mode,
            early_return: flags.has_event_mode || flags.might_return_early_from_do_step,
            intermediate: &intermediate,
        };
        let (mut component, event_mode) = match library.instantiate(&arguments) {
            Ok(component) => (component, arguments.event_mode),
            // Some FMUs promise Event Mode and lack it.
            Err(error) if arguments.event_mode => {
                let early_return = flags.might_return_early_from_do_step;
                let without = Instantiation { event_mode: false, early_return, ..arguments };
                let component = library.instantiate(&without).map_err(|_| error)?;
                tracing::warn!(
                    "{name}: the FMU runs without Event Mode, although its hasEventMode is true: it \
                     instantiates only without eventModeUsed"
                );
                (component, false)
            }
            Err(error) => return Err(error),
        };
        let known =
            |name: &&str| description.log_categories.iter().any(|category| category.name == *name);
        let categories: Vec<&str> = STATUS_CATEGORIES.into_iter().filter(known).collect();
        if !categories.is_empty() {
            // An FMU that refuses this call logs no messages.
            let _ = component.set_debug_logging(true, &categories);
        }
        let state = State {
            held: vec![None; view.shadows],
            clocks: Clocks::new(description),
            ..State::default()
        };
        let experiment = Experiment { start_time: 0.0, stop_time: None, tolerance: None };
        let (plans, slots, clocked) = (Plans::default(), Vec::new(), ClockedRuns::new(&view));
        Ok(Self {
            component,
            hands_over_events: false,
            stops_at_events: false,
            clocked,
            view,
            plans,
            interface,
            event_mode,
            experiment,
            state,
            slots,
            sizes,
        })
    }

    /// Returns the description with a scalar variable for each element of an array.
    pub(crate) fn description(&self) -> &ModelDescription {
        &self.view.description
    }

    /// Sets structural parameters in Configuration Mode, which resizes the arrays whose dimensions refer to them.
    /// `description` is the description of the FMU, with whole arrays. Does not call the FMU if the new sizes are
    /// impossible. The FMU keeps its sizes if a value is refused. States that were saved before are discarded.
    pub(crate) fn configure(
        &mut self,
        description: &ModelDescription,
        references: &[u32],
        values: &[i64],
    ) -> Result<(), CallError> {
        const NAME: &str = "fmi3EnterConfigurationMode";
        let mut sizes = self.sizes.clone();
        for (reference, value) in references.iter().zip(values) {
            // A negative number is no size; `write` refuses it for an unsigned type.
            if let Ok(value) = u64::try_from(*value) {
                sizes.insert(*reference, value);
            }
        }
        let view = ElementView::new(description, &sizes)
            .map_err(|reason| refused(NAME, format!("was not called: {reason}")))?;
        self.component.enter_configuration_mode()?;
        let set = self.write("fmi3SetUInt64", references, values, Buffer::put_integer);
        let configures = set.as_ref().err().is_none_or(keeps_mode);
        let exited = if configures { self.component.exit_configuration_mode() } else { Ok(()) };
        set.and(exited)?;
        // Saved states refer to the old positions of the elements.
        self.component.free_states();
        self.component.forget_inputs();
        self.slots.clear();
        self.state.held = vec![None; view.shadows];
        self.state.memory.clear();
        self.clocked = ClockedRuns::new(&view);
        (self.view, self.sizes) = (view, sizes);
        self.plans = Plans::default();
        Ok(())
    }

    pub(crate) fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        self.component.set_debug_logging(on, &[])
    }

    #[expect(clippy::unnecessary_wraps, reason = "as in FMI 2.0")]
    pub(crate) fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.experiment = *experiment;
        self.state.time = experiment.start_time;
        Ok(())
    }

    pub(crate) fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        self.component.enter_initialization_mode(&self.experiment)?;
        self.state.mode = Mode::Initialization;
        Ok(())
    }

    #[inline]
    pub(crate) fn get_real(&mut self, list: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        // The FMU itself refuses a value reference that no variable has.
        if self.view.plain || self.plans.find(&self.view, list).is_err() {
            return self.component.get_float64(list, values);
        }
        self.read("fmi3GetFloat64", list, values, |buffer, place, value| {
            fill(value, buffer.real(place))
        })
    }

    #[inline]
    pub(crate) fn set_real(&mut self, list: &[u32], values: &[f64]) -> Result<(), CallError> {
        if self.view.plain && !self.event_mode {
            return self.component.set_float64(list, values);
        }
        self.write("fmi3SetFloat64", list, values, Buffer::put_real)
    }

    values! {
        get_integer set_integer: i64 =
            ("fmi3GetInt64", |buffer, place, value| fill(value, buffer.integer(place)))
            ("fmi3SetInt64", Buffer::put_integer);
        get_boolean set_boolean: i32 =
            ("fmi3GetBoolean", |buffer, place, value| fill(value, buffer.boolean(place)))
            ("fmi3SetBoolean", Buffer::put_boolean);
        get_string set_string: String = ("fmi3GetString", Buffer::text) ("fmi3SetString", Buffer::put_text);
        get_binary set_binary: Vec<u8> = ("fmi3GetBinary", Buffer::bytes) ("fmi3SetBinary", Buffer::put_bytes);
    }
}

/// Sets `value` to a number, if there is one.
fn fill<T>(value: &mut T, number: Option<T>) -> Option<()> {
    *value = number?;
    Some(())
}

/// Returns the error of an access to a value reference that no variable has.
fn unknown(function: &'static str, reference: u32) -> CallError {
    refused(
        function,
        format!("cannot access the value reference {reference}, which no variable has"),
    )
}

/// Returns whether the FMU is in the same mode as before a call that failed: the call was refused, or returned
/// `fmi3Discard` (FMI 3.0.2, section 2.2.4). After `fmi3Error` the FMU is in state Terminated (section 2.3.1).
fn keeps_mode(error: &CallError) -> bool {
    use Failure as F;
    matches!(error.failure, F::InvalidAnswer(_) | F::Missing | F::Status(Status::Discard))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_or_discarded_value_keeps_the_mode_and_an_error_does_not() {
        assert!(keeps_mode(&refused("fmi3SetUInt64", "cannot take the value -1".to_owned())));
        let of_status = |status| CallError {
            function: "fmi3SetUInt64",
            failure: Failure::Status(status),
            messages: Vec::new(),
        };
        assert!(keeps_mode(&of_status(Status::Discard)));
        assert!(!keeps_mode(&of_status(Status::Error)));
        assert!(!keeps_mode(&of_status(Status::Fatal)));
    }
}
