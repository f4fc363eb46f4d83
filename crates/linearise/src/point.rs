//! An FMU instance at the operating point.

use fmu_description::{Causality, DefaultExperiment, Experiment};

use super::parts::{Part, Parts, Setting, State};
use super::{Linearise, LineariseError};
use fmu_import::Fmu;
use slave::{CallError, ModelExchange, Slave, Value};

/// Maximum number of calls of `fmi2NewDiscreteStates` per event.
const EVENT_ITERATIONS: usize = 1000;

pub(super) const NAME: &str = "linearise";

/// Initialises an instance with the operating point, except states without a start value: these are set later.
pub(super) fn initialise(
    component: &mut (impl Slave + ?Sized),
    parts: &Parts,
    request: &Linearise,
) -> Result<(), LineariseError> {
    let default = parts.description.default_experiment.as_ref();
    let tolerance = default.and_then(DefaultExperiment::usable_tolerance);
    let experiment = Experiment { start_time: request.start_time, stop_time: None, tolerance };
    component.setup_experiment(&experiment)?;
    let settable = parts.settings.iter().filter(|setting| setting.settable);
    for setting in settable.clone().filter(|setting| !setting.is_input) {
        set(component, setting)?;
    }
    component.enter_initialization_mode()?;
    for setting in settable.filter(|setting| setting.is_input) {
        set(component, setting)?;
    }
    component.exit_initialization_mode()?;
    Ok(())
}

fn set(component: &mut (impl Slave + ?Sized), setting: &Setting) -> Result<(), LineariseError> {
    let reference = [setting.reference];
    let result = match &setting.value {
        Value::Real(value) => component.set_real(&reference, &[*value]),
        Value::Integer(value) => component.set_integer(&reference, &[*value]),
        Value::Boolean(value) => component.set_boolean(&reference, &[i32::from(*value)]),
        Value::String(value) => component.set_string(&reference, std::slice::from_ref(value)),
        Value::Binary(_) => Err(slave::absent("fmi3SetBinary")),
    };
    result.map_err(|source| refused(&setting.name, &setting.text, source))
}

fn refused(name: &str, value: &impl ToString, source: CallError) -> LineariseError {
    LineariseError::Refused { name: name.to_owned(), value: value.to_string(), source }
}

/// Returns an error if a setting is no input, has no start value that may be set, and is none of `states`.
pub(super) fn all_settable(parts: &Parts, states: &[State]) -> Result<(), LineariseError> {
    let is_state = |name: &String| states.iter().any(|state| state.part.name == *name);
    let is_fixed = |setting: &&Setting| !setting.settable && !is_state(&setting.name);
    let Some(setting) = parts.settings.iter().find(is_fixed) else { return Ok(()) };
    let variable = super::parts::find(parts.description, &setting.name)?;
    let causality = variable.causality;
    let expected = match causality {
        Causality::Local | Causality::Output => {
            "one with a start value, or an FMU for model exchange if it is a state: \
             set the parameter that it starts from"
        }
        _ => "a parameter, an input, a start value or a state",
    };
    let actual = format!("a variable of causality {} that cannot be set", causality.as_str());
    Err(LineariseError::Role { name: setting.name.clone(), actual, expected })
}

/// Reads Reals and checks that they are finite.
pub(super) fn read<'p>(
    component: &mut (impl Slave + ?Sized),
    parts: impl Iterator<Item = &'p Part> + Clone,
) -> Result<Vec<f64>, LineariseError> {
    let references: Vec<u32> = parts.clone().map(|part| part.reference).collect();
    let mut values = vec![0.0; references.len()];
    if !references.is_empty() {
        component.get_real(&references, &mut values)?;
    }
    for (part, &value) in parts.zip(&values) {
        finite(&part.name, value)?;
    }
    Ok(values)
}

/// Returns `value`, or an error that names it if it is NaN or infinite.
pub(super) fn finite(name: &str, value: f64) -> Result<f64, LineariseError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(LineariseError::NotFinite { name: name.to_owned(), value })
}

/// A model exchange instance in continuous-time mode at the operating point.
pub(super) struct Equations<'p> {
    pub(super) component: Box<dyn ModelExchange>,
    pub(super) parts: &'p Parts<'p>,
    pub(super) states: &'p [State],
    pub(super) x: Vec<f64>,
    pub(super) u: Vec<f64>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// Whether the FMU can save and restore its state.
    can_restore: bool,
}

impl<'p> Equations<'p> {
    /// Initialises an instance, sets the states of the operating point and iterates the event that this causes. It is
    /// an error if the event changes a state.
    pub(super) fn at(
        fmu: &Fmu,
        parts: &'p Parts<'p>,
        states: &'p [State],
        request: &Linearise,
    ) -> Result<Self, LineariseError> {
        let mut component = fmu.instantiate_equations(NAME)?;
        initialise(&mut *component, parts, request)?;
        settle(&mut *component)?;
        let mut x = vec![0.0; states.len()];
        component.get_continuous_states(&mut x)?;
        if insert_states(parts, states, &mut x) {
            set_states(&mut *component, states, &x)?;
            component.enter_event_mode()?;
            settle(&mut *component)?;
            let mut after_event = x.clone();
            component.get_continuous_states(&mut after_event)?;
            for (state, (&required, &actual)) in states.iter().zip(x.iter().zip(&after_event)) {
                if (required - actual).abs() > 1e-12 * state.part.scale(required) {
                    let name = state.part.name.clone();
                    return Err(LineariseError::Moved { name, required, actual });
                }
            }
        }
        let u = read(&mut *component, parts.inputs.iter())?;
        let flags = fmu.description().model_exchange.as_ref();
        let can_restore = flags.is_some_and(|flags| flags.can_get_and_set_fmu_state);
        if can_restore {
            component.save_state(0)?;
        }
        let references = |parts: &[Part]| parts.iter().map(|part| part.reference).collect();
        let (inputs, outputs) = (references(&parts.inputs), references(&parts.outputs));
        Ok(Self { component, parts, states, x, u, inputs, outputs, can_restore })
    }

    /// Returns the state or input of a column of the Jacobian and its value at the operating point.
    pub(super) fn known(&self, column: usize) -> (&'p Part, f64) {
        match column.checked_sub(self.states.len()) {
            None => (&self.states[column].part, self.x[column]),
            Some(input) => (&self.parts.inputs[input], self.u[input]),
        }
    }

    /// Evaluates derivatives and outputs; `change`: a column of the Jacobian and another value of its variable.
    pub(super) fn evaluate(
        &mut self,
        change: Option<(usize, f64)>,
    ) -> Result<Vec<f64>, LineariseError> {
        if self.can_restore {
            self.component.restore_state(0)?;
        }
        let (mut x, mut u) = (self.x.clone(), self.u.clone());
        if let Some((column, value)) = change {
            match column.checked_sub(x.len()) {
                None => x[column] = value,
                Some(input) => u[input] = value,
            }
        }
        let mut values = vec![0.0; self.states.len() + self.outputs.len()];
        let (derivatives, outputs) = values.split_at_mut(self.states.len());
        let component = &mut self.component;
        // An FMU of OpenModelica 1.19 no longer computes its outputs once it has returned the derivatives.
        let result = component
            .set_continuous_states(&x)
            .and_then(|()| if u.is_empty() { Ok(()) } else { component.set_real(&self.inputs, &u) })
            .and_then(|()| {
                if outputs.is_empty() { Ok(()) } else { component.get_real(&self.outputs, outputs) }
            })
            .and_then(|()| component.get_derivatives(derivatives));
        result.map_err(|source| match change {
            Some((column, value)) => refused(&self.known(column).0.name, &value, source),
            None => LineariseError::Call(source),
        })?;
        for (row, &value) in values.iter().enumerate() {
            finite(&row_name(self.states, self.parts, row), value)?;
        }
        Ok(values)
    }
}

/// Returns the current nominal value of each of `count` states; 1 for all if the FMU does not state them.
pub(super) fn nominals(component: &mut dyn ModelExchange, count: usize) -> Vec<f64> {
    let mut nominals = vec![1.0; count];
    if component.get_nominals_of_continuous_states(&mut nominals).is_err() {
        nominals.fill(1.0);
    }
    nominals
}

/// Returns the name of a row of the Jacobian: a state derivative or an output.
pub(super) fn row_name(states: &[State], parts: &Parts, row: usize) -> String {
    match states.get(row) {
        Some(state) => format!("der({})", state.part.name),
        None => parts.outputs[row - states.len()].name.clone(),
    }
}

/// Inserts the states of the operating point into `x`; returns whether there are any.
fn insert_states(parts: &Parts, states: &[State], x: &mut [f64]) -> bool {
    let mut any = false;
    for (state, value) in states.iter().zip(x) {
        let setting = parts.settings.iter().find(|setting| setting.name == state.part.name);
        if let Some(Value::Real(required)) = setting.map(|setting| &setting.value) {
            *value = *required;
            any = true;
        }
    }
    any
}

fn set_states(
    component: &mut dyn ModelExchange,
    states: &[State],
    x: &[f64],
) -> Result<(), LineariseError> {
    component.set_continuous_states(x).map_err(|source| {
        let names: Vec<_> = states.iter().map(|state| state.part.name.as_str()).collect();
        let values: Vec<_> = x.iter().map(f64::to_string).collect();
        refused(&names.join(", "), &values.join(", "), source)
    })
}

/// Iterates the event and enters continuous-time mode; returns the time of the next time event, `None` without one. It
/// is an error if the events do not end or the FMU asks for the end of the simulation.
pub(super) fn settle(component: &mut dyn ModelExchange) -> Result<Option<f64>, LineariseError> {
    for _ in 0..EVENT_ITERATIONS {
        let info = component.update_discrete_states()?;
        if info.terminate_simulation {
            return Err(LineariseError::Ended);
        }
        if !info.discrete_states_need_update {
            component.enter_continuous_time_mode()?;
            return Ok(info.next_event_time);
        }
    }
    Err(LineariseError::EndlessEvents { iterations: EVENT_ITERATIONS })
}
