//! Linearises an FMU with states x, inputs u, faults f and outputs y about an operating point, which has the index 0.
//!
//! x' = A (x - `x_0`) + B (u - `u_0`) + F (f - `f_0`) + x'_0, y = `y_0` + C (x - `x_0`) + D (u - `u_0`) + G (f - `f_0`)
//!
//! There are three methods. An FMU for model exchange is linearised in model exchange by the first or the second
//! method, any other FMU in co-simulation by the first or the third:
//!
//! 1. `fmi2GetDirectionalDerivative`, if the interface has it. In model exchange the result is compared with the
//!    second method.
//! 2. Model exchange: finite differences of `fmi2GetDerivatives` and of the outputs in continuous-time
//!    mode, with constant discrete states.
//! 3. Co-simulation with FMU states: a step map, fitted to the responses to small pulses of the inputs
//!    from the saved state, and its logarithm. The request must name the states.
#![forbid(unsafe_code)]

mod bench;
mod differences;
mod directional;
mod equations;
mod error;
mod fit;
mod parts;
mod point;
mod result;
mod steps;

use fmu_description::{Causality, Kind, ModelDescription, Variability};

pub use equations::PlantEquations;
pub use error::LineariseError;
pub use result::{Differences, Disagreement, Linearisation, Matrices, Method, Signal};

use fmu_import::{Fmu, Interface};
use parts::{Part, Parts, State};
use point::{Equations, NAME, all_settable, initialise, nominals, read};
use result::{MethodResult, RawResult, assemble};

/// Communication steps in s that are tried if the FMU states none.
const STEPS: [f64; 3] = [1e-3, 1e-2, 1e-4];
/// Relative error below which no further communication step is tried.
const ACCURATE: f64 = 1e-6;

/// A request: the FMU variables of the linear plant, and its operating point.
///
/// Inputs, faults, outputs and states are continuous Reals. The operating point need not be an equilibrium.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearise {
    /// The control inputs u.
    pub inputs: Vec<String>,
    /// The inputs that are faults f; may be empty.
    pub faults: Vec<String>,
    /// The measurements y: outputs, or local variables that can be differentiated.
    pub outputs: Vec<String>,
    /// The states x in the requested order; empty for all continuous states in the order of the
    /// FMU. States that are not named are left out; it is an error if a remaining state or output
    /// depends on them. The third method needs the names of all states.
    pub states: Vec<String>,
    /// The operating point as names and values: parameters, start values, inputs, and in model
    /// exchange the continuous states. All other variables have their start values.
    pub at: Vec<(String, String)>,
    /// Typical sizes of changes by name, in the unit of the variable. The default is `nominal`, otherwise
    /// the absolute value at the operating point, or 1 if that is zero. Steps and errors are relative to this size.
    pub typical: Vec<(String, f64)>,
    /// Time of the operating point in s.
    pub start_time: f64,
    /// The communication step in s of the third method; the default is `stepSize` of the
    /// `DefaultExperiment`. Without either, a thousandth of the experiment, 1 ms, 10 ms and 0.1 ms are
    /// tried until the relative error is below 1e-6, and the most accurate result is used.
    pub step: Option<f64>,
}

/// Returns the matrices of `fmu` about the operating point of `request`.
///
/// The [crate documentation](crate) says which method is used; [`Linearisation::method`] names it.
///
/// * Directional derivatives: the values of the FMU. One call per state and input.
/// * Differences in model exchange: two-sided (one-sided at `min` or `max`), eight steps from 1 % of
///   the typical size down by factors of 4, extrapolated (Ridders 1982). The error estimate of each
///   entry is the sum of the extrapolation error, the rounding error and half of a jump of the slope;
///   usually below 1e-9 of the entry.
/// * Steps in co-simulation: pulses of each input over 8 to 512 steps, central differences in their
///   height, least squares for the step map [Phi, Gamma], its logarithm; for steps of h, 2 h and 4 h,
///   extrapolated to h = 0. The records get longer until the errors are small. The map must predict the
///   response to another input signal within 1 %. About 60 runs for each input and record length.
///
///   Away from an equilibrium the FMU drifts during the record. The map is then a polynomial of time,
///   and its value at the start is used. This works for states on which the inputs act directly; for
///   other states it is too inaccurate and returns an error. The FMU's integration error appears in the
///   error estimates if its internal steps follow the communication step, otherwise in the plant.
///
/// # Example
///
/// ```no_run
/// use fmu_import::Fmu;
/// use linearise::{Linearise, linearise};
/// let names = |list: &[&str]| list.iter().map(|name| (*name).to_owned()).collect();
/// let request = Linearise {
///     inputs: names(&["u"]),
///     outputs: names(&["x_p", "theta"]),
///     at: vec![("theta".to_owned(), "0.1".to_owned())],
///     ..Linearise::default()
/// };
/// let plant = linearise(&Fmu::open_any("Plant.fmu".as_ref())?, &request)?;
/// assert_eq!(plant.matrices.c.shape(), (2, plant.states.len()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// [`LineariseError`] if a name or value is invalid, if a function of the FMU fails, if the FMU offers
/// none of the three methods, if a state that is left out influences the others, or if the result of the third
/// method is not accurate enough.
pub fn linearise(fmu: &Fmu, request: &Linearise) -> Result<Linearisation, LineariseError> {
    let description = &fmu.elements()?;
    let parts = Parts::of(description, request)?;
    if !request.start_time.is_finite() {
        let (what, value) = ("the start time".to_owned(), request.start_time);
        return Err(LineariseError::Number { what, value, expected: "a finite time in s" });
    }
    let states = parts.states(request)?;
    let exchange = description.model_exchange.as_ref();
    let simulation = description.co_simulation.as_ref();
    if let Some(flags) = exchange {
        return by_equations(fmu, &parts, &states, request, flags.provides_directional_derivative);
    }
    let differentiates = simulation.is_some_and(|flags| flags.provides_directional_derivative);
    if differentiates && !states.is_empty() {
        return by_derivatives(fmu, &parts, &states, request);
    }
    if simulation.is_some_and(|flags| flags.can_get_and_set_fmu_state) {
        return by_steps(fmu, &parts, request);
    }
    Err(LineariseError::NoWay { model: description.model_name.clone() })
}

/// Linearises in model exchange: by differences, and by directional derivatives if there are any.
fn by_equations(
    fmu: &Fmu,
    parts: &Parts,
    states: &[State],
    request: &Linearise,
    differentiates: bool,
) -> Result<Linearisation, LineariseError> {
    if states.is_empty() {
        return Err(LineariseError::NoStates { model: parts.description.model_name.clone() });
    }
    all_settable(parts, states)?;
    let mut equations = Equations::at(fmu, parts, states, request)?;
    let mut values = equations.evaluate(None)?;
    let outputs = values.split_off(states.len());
    let nominals = nominals(&mut *equations.component, states.len());
    let mut with_nominals: Vec<Part> = states.iter().map(|state| state.part.clone()).collect();
    for (part, nominal) in with_nominals.iter_mut().zip(nominals) {
        // 1 is also the nominal value of states for which the FMU states none.
        let is_stated =
            nominal.is_finite() && nominal > 0.0 && nominal.to_bits() != 1.0_f64.to_bits();
        if is_stated && !request.typical.iter().any(|(name, _)| *name == part.name) {
            part.typical = Some(nominal);
        }
    }
    let scales = scales(&with_nominals, &equations.x, &parts.inputs, &equations.u);
    let derivatives = differentiates
        .then(|| directional::jacobian(&mut *equations.component, parts, states))
        .transpose()?;
    let differences = differences::of_equations(&mut equations, &scales);
    let (jacobian, method) = match (derivatives, differences) {
        (Some(jacobian), differences) => {
            let disagreement = differences.ok().and_then(|differences| {
                result::disagreement(parts, states, &scales, &jacobian, &differences)
            });
            (jacobian, MethodResult::Derivatives(Interface::ModelExchange, disagreement))
        }
        (None, differences) => {
            let differences = differences?;
            let columns = with_nominals.iter().chain(&parts.inputs);
            let steps = columns.map(|part| part.name.clone()).zip(differences.steps).collect();
            let how = Differences::OfEquations { steps };
            (differences.jacobian, MethodResult::Differences(how, differences.errors))
        }
    };
    let (x, u) = (equations.x, equations.u);
    let raw =
        RawResult { states: with_nominals, x, u, y: outputs, rates: values, jacobian, method };
    assemble(parts, request, raw)
}

/// Returns the typical sizes of the states, then of the inputs.
fn scales(states: &[Part], x: &[f64], inputs: &[Part], u: &[f64]) -> Vec<f64> {
    let pairs = states.iter().zip(x).chain(inputs.iter().zip(u));
    pairs.map(|(part, &value)| part.scale(value)).collect()
}

/// Linearises in co-simulation by directional derivatives.
fn by_derivatives(
    fmu: &Fmu,
    parts: &Parts,
    states: &[State],
    request: &Linearise,
) -> Result<Linearisation, LineariseError> {
    all_settable(parts, &[])?;
    let mut component = fmu.instantiate(NAME)?;
    initialise(&mut component, parts, request)?;
    let rates: Vec<Part> = states
        .iter()
        .map(|state| {
            let name = format!("der({})", state.part.name);
            Part { name, reference: state.derivative, ..state.part.clone() }
        })
        .collect();
    let raw = RawResult {
        states: states.iter().map(|state| state.part.clone()).collect(),
        x: read(&mut component, states.iter().map(|state| &state.part))?,
        u: read(&mut component, parts.inputs.iter())?,
        y: read(&mut component, parts.outputs.iter())?,
        rates: read(&mut component, rates.iter())?,
        jacobian: directional::jacobian(&mut component, parts, states)?,
        method: MethodResult::Derivatives(Interface::CoSimulation, None),
    };
    assemble(parts, request, raw)
}

/// Linearises in co-simulation by communication steps from an FMU state.
fn by_steps(
    fmu: &Fmu,
    parts: &Parts,
    request: &Linearise,
) -> Result<Linearisation, LineariseError> {
    all_settable(parts, &[])?;
    let states = parts.named_states(request)?;
    if parts.inputs.is_empty() {
        return Err(LineariseError::Empty { list: "inputs" });
    }
    if states.is_empty() {
        let model = parts.description.model_name.clone();
        let candidates = candidates(parts.description);
        return Err(LineariseError::StatesNotNamed { model, candidates });
    }
    let preferred = parts.description.default_experiment.and_then(|default| default.step_size);
    let raw = match request.step.or(preferred) {
        None => by_derived_step(fmu, parts, &states, request)?,
        Some(step) if step.is_finite() && step > 0.0 => {
            steps::of_steps(fmu, parts, &states, request, step)?.raw
        }
        Some(value) => {
            let (what, expected) = ("the step".to_owned(), "a finite number of s above zero");
            return Err(LineariseError::Number { what, value, expected });
        }
    };
    assemble(parts, request, raw)
}

/// Linearises by communication steps of several sizes, for an FMU that states none, until a result is accurate;
/// returns the most accurate result. It is an error if no size gives one.
fn by_derived_step(
    fmu: &Fmu,
    parts: &Parts,
    states: &[Part],
    request: &Linearise,
) -> Result<RawResult, LineariseError> {
    let experiment = parts.description.default_experiment;
    let length = experiment
        .and_then(|experiment| Some(experiment.stop_time? - experiment.start_time.unwrap_or(0.0)))
        .filter(|length| length.is_finite() && *length > 0.0);
    let first = length.map(|length| length / 1000.0);
    let others = STEPS.into_iter().filter(|step| first != Some(*step));
    let tried: Vec<f64> = first.into_iter().chain(others).collect();
    let mut best: Option<steps::RecordResult> = None;
    let mut reason = None;
    for &step in &tried {
        match steps::of_steps(fmu, parts, states, request, step) {
            Ok(record) => {
                let is_accurate = record.relative < ACCURATE;
                if best.as_ref().is_none_or(|known| record.relative < known.relative) {
                    best = Some(record);
                }
                if is_accurate {
                    break;
                }
            }
            Err(error) => reason = reason.or(Some(error)),
        }
    }
    best.map(|record| record.raw).ok_or_else(|| {
        let model = parts.description.model_name.clone();
        let reason = reason.unwrap_or(LineariseError::Empty { list: "communication steps" });
        LineariseError::NoStep { model, tried, reason: Box::new(reason) }
    })
}

/// Lists up to ten continuous Reals that may be states, as part of a sentence; an empty text if there are none.
fn candidates(description: &ModelDescription) -> String {
    let readable = description.variables.iter().filter(|variable| {
        matches!(variable.causality, Causality::Output | Causality::Local)
            && variable.variability == Variability::Continuous
            && matches!(variable.kind, Kind::Real(_))
    });
    let names: Vec<&str> = readable.map(|variable| variable.name.as_str()).take(10).collect();
    if names.is_empty() { String::new() } else { format!(" among {}", names.join(", ")) }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
