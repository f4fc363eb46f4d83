//! Linearises an FMU about an operating point.
//!
//! x' = A (x - `x_0`) + B (u - `u_0`) + F (f - `f_0`) + x'_0, y = `y_0` + C (x - `x_0`) + D (u - `u_0`) + G (f - `f_0`)
//!
//! Three ways, the first that the FMU offers:
//!
//! 1. `fmi2GetDirectionalDerivative`, in model exchange rather than in co-simulation. In model
//!    exchange the answer is compared with the second way.
//! 2. Model exchange: differences of `fmi2GetDerivatives` and of the outputs in
//!    continuous-time mode, that is with the discrete states held.
//! 3. Co-simulation with FMU states: a step map fitted to what small pulses of the inputs do
//!    from the saved state, and its logarithm. Here the states must be named.
#![forbid(unsafe_code)]

mod bench;
mod differences;
mod directional;
mod error;
mod fit;
mod logarithm;
mod parts;
mod point;
mod result;
mod steps;

use fmu_description::{Causality, Kind, ModelDescription, Variability};

pub use error::LineariseError;
pub use result::{Differences, Disagreement, Linearisation, Matrices, Method, Signal};

use fmu_import::Fmu;
use fmu_import::Interface;
use parts::{Part, Parts, State};
use point::{Equations, all_settable, initialised, read};
use result::{Findings, How, assemble};

/// What to linearise, and where.
///
/// Names are those of the FMU's variables: continuous Reals. The operating point is held as given;
/// it need not be an equilibrium.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearise {
    /// The inputs by which the plant is controlled, u.
    pub inputs: Vec<String>,
    /// The inputs that are faults, f; may be empty.
    pub faults: Vec<String>,
    /// The measurements, y: outputs, or local variables where they can be differentiated.
    pub outputs: Vec<String>,
    /// The states x and their order. Empty: all continuous states in the order of the FMU. Some of
    /// them: the others are left out, which is an error where something kept depends on one.
    pub states: Vec<String>,
    /// The operating point, variable and value as text: parameters, start values, inputs, and in
    /// model exchange the continuous states. What is not named has its start value.
    pub at: Vec<(String, String)>,
    /// Typical sizes of a change in the variable's unit, in place of `nominal`; without both it is
    /// the value at the operating point, or 1 where that is zero. Steps and errors are relative to
    /// them.
    pub typical: Vec<(String, f64)>,
    /// Time of the operating point in s.
    pub start_time: f64,
    /// The communication step in s of the third way; without it `stepSize` of the
    /// `DefaultExperiment`.
    pub step: Option<f64>,
}

/// The matrices of `fmu` about the operating point of `request`.
///
/// The ways are those of this [`crate`]: the first that the FMU offers is taken, and
/// [`Linearisation::method`] says which.
///
/// * Directional derivatives: exact as far as the FMU's are. One call per state and input.
/// * Differences in model exchange: to both sides (to one side at `min` or `max`), eight
///   steps from 1 % of the typical size down by factors of 4, extrapolated (Ridders 1982). The error
///   estimate of each entry is that of the extrapolation plus rounding plus half of a jump of the
///   slope; usually below 1e-9 of the entry.
/// * Steps in co-simulation: pulses of each input over 8 to 512 steps, central differences in their
///   height, least squares for the step map [Phi, Gamma], its logarithm; for steps of h, 2 h and 4 h,
///   extrapolated to h = 0. The record is made longer until the errors are small. The map must foretell
///   another course of the inputs within 1 %. About 60 runs for each input and length. Away from an
///   equilibrium the FMU drifts while it is tested: the map is then a polynomial of time, and its
///   value at the begin counts. That serves states on which the inputs act at once; for states
///   further from the inputs it tells too little and is refused. What the FMU's own integration
///   errs shows in the error estimates where its inner steps follow the communication step, and is
///   otherwise part of the plant.
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
/// [`LineariseError`]: a name or value that does not fit, a refusal of the FMU, or what is missing
/// for all three ways.
pub fn linearise(fmu: &Fmu, request: &Linearise) -> Result<Linearisation, LineariseError> {
    let description = fmu.description();
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

/// Model exchange: differences, and directional derivatives where the FMU has them.
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
    let mut with_nominals: Vec<Part> = states.iter().map(|state| state.part.clone()).collect();
    for (part, nominal) in with_nominals.iter_mut().zip(equations.nominals()) {
        let told = nominal.is_finite() && nominal > 0.0 && nominal.to_bits() != 1.0_f64.to_bits();
        if told && !request.typical.iter().any(|(name, _)| *name == part.name) {
            part.typical = Some(nominal);
        }
    }
    let scales = scales(&with_nominals, &equations.x, &parts.inputs, &equations.u);
    let derivatives = if differentiates {
        Some(directional::jacobian(&mut equations.component, parts, states)?)
    } else {
        None
    };
    let differences = differences::of_equations(&mut equations, &scales);
    let (jacobian, how) = match (derivatives, differences) {
        (Some(jacobian), differences) => {
            let disagreement = differences.ok().and_then(|differences| {
                result::disagreement(parts, states, &scales, &jacobian, &differences)
            });
            (jacobian, How::Derivatives(Interface::ModelExchange, disagreement))
        }
        (None, differences) => {
            let differences = differences?;
            let columns = with_nominals.iter().chain(&parts.inputs);
            let steps = columns.map(|part| part.name.clone()).zip(differences.steps).collect();
            let how = Differences::OfEquations { steps };
            (differences.jacobian, How::Differences(how, differences.errors))
        }
    };
    let (x, u) = (equations.x, equations.u);
    let found = Findings { states: with_nominals, x, u, y: outputs, rates: values, jacobian, how };
    assemble(parts, request, found)
}

fn scales(states: &[Part], x: &[f64], inputs: &[Part], u: &[f64]) -> Vec<f64> {
    let pairs = states.iter().zip(x).chain(inputs.iter().zip(u));
    pairs.map(|(part, &value)| part.scale(value)).collect()
}

/// Co-simulation with directional derivatives.
fn by_derivatives(
    fmu: &Fmu,
    parts: &Parts,
    states: &[State],
    request: &Linearise,
) -> Result<Linearisation, LineariseError> {
    all_settable(parts, &[])?;
    let mut component = initialised(fmu, Interface::CoSimulation, parts, request)?;
    let rates: Vec<Part> = states
        .iter()
        .map(|state| Part { reference: state.derivative, ..state.part.clone() })
        .collect();
    let findings = Findings {
        states: states.iter().map(|state| state.part.clone()).collect(),
        x: read(&mut component, states.iter().map(|state| &state.part))?,
        u: read(&mut component, parts.inputs.iter())?,
        y: read(&mut component, parts.outputs.iter())?,
        rates: read(&mut component, rates.iter())?,
        jacobian: directional::jacobian(&mut component, parts, states)?,
        how: How::Derivatives(Interface::CoSimulation, None),
    };
    assemble(parts, request, findings)
}

/// Co-simulation with FMU states.
fn by_steps(
    fmu: &Fmu,
    parts: &Parts,
    request: &Linearise,
) -> Result<Linearisation, LineariseError> {
    all_settable(parts, &[])?;
    let model = parts.description.model_name.clone();
    let states = parts.named_states(request)?;
    if parts.inputs.is_empty() {
        return Err(LineariseError::Empty { list: "inputs" });
    }
    if states.is_empty() {
        let candidates = candidates(parts.description);
        return Err(LineariseError::StatesNotNamed { model, candidates });
    }
    let preferred = parts.description.default_experiment.and_then(|default| default.step_size);
    let step = request.step.or(preferred).ok_or(LineariseError::NoStep { model })?;
    if !(step.is_finite() && step > 0.0) {
        let (what, expected) = ("the step".to_owned(), "a finite number of s above zero");
        return Err(LineariseError::Number { what, value: step, expected });
    }
    let found = steps::of_steps(fmu, parts, &states, request, step)?;
    let heights = parts.inputs.iter().map(|part| part.name.clone()).zip(found.heights).collect();
    let how = Differences::OfSteps { step, count: found.count, heights, missed: found.missed };
    let findings = Findings {
        states,
        x: found.x,
        u: found.u,
        y: found.y,
        rates: found.rates,
        jacobian: found.jacobian,
        how: How::Differences(how, found.errors),
    };
    assemble(parts, request, findings)
}

/// The continuous Reals that may be states, as part of a sentence.
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
