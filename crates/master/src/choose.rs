//! Chooses the settings of the algorithm that the user has not stated, from the capabilities of the
//! FMUs.

use std::borrow::Borrow;

use serde::{Deserialize, Serialize};

use crate::algorithm::{
    Algorithm, Coupling, EventSource, Extrapolation, Method, PowerBond, StepControl,
};
use crate::error::SystemError;
use crate::order::by_direct_dependencies;
use crate::signal_type::SignalType;
use crate::system::{Connection, Port, System};
use fmu_description::Version;

/// Default communication step in s for runs of up to [`STEPS`] steps; used if neither the user nor
/// an FMU states one.
const STEP: f64 = 1e-3;
/// Largest number of steps of a run with the default step.
const STEPS: f64 = 1e5;

/// The settings of an [`Algorithm`] that the user states; [`choose`] completes the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct AlgorithmRequest {
    /// `jacobi` or `gauss-seidel`.
    pub method: Option<Method>,
    /// Extrapolation of the inputs.
    pub extrapolation: Option<Extrapolation>,
    /// Iteration of a step.
    pub coupling: Option<Coupling>,
    /// Choice of the step size.
    pub step_control: Option<StepControl>,
    /// Communication step in s.
    pub step: Option<f64>,
    /// Relative tolerance of iteration and step control.
    pub relative_tolerance: Option<f64>,
    /// Absolute tolerance, as a fraction of nominal values.
    pub absolute_tolerance: Option<f64>,
    /// Smallest step of the step control in s.
    pub smallest_step: Option<f64>,
    /// Largest step of the step control in s.
    pub largest_step: Option<f64>,
    /// Largest number of iterations of a step.
    pub iterations: Option<u32>,
    /// Whether a step whose iteration fails is made once without iteration; default: true if
    /// `coupling` is not stated.
    pub fallback: Option<bool>,
    /// FMUs by name, each with the number of communication steps in one of its steps.
    #[serde(skip_serializing_if = "std::collections::BTreeMap::is_empty", default)]
    pub every: std::collections::BTreeMap<String, u32>,
    /// Outputs, `slave.variable`, whose value is the time in s of the next event of their FMU.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub next_event: Vec<String>,
    /// Outputs, `slave.variable`, whose zero crossing ends a step.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub crossing: Vec<String>,
    /// Variables, `slave.variable`, that change at events or communication points only, although their FMU does not
    /// say so.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub discrete: Vec<String>,
    /// Pairs of inputs, `slave.variable`, whose product is a power.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub power_bonds: Vec<(String, String)>,
    /// Number of threads; 0: number of processors; default: 1.
    pub jobs: Option<usize>,
    /// Save FMU states before every step, so that all FMUs repeat a step that one FMU completed
    /// only in part.
    pub rollback: Option<bool>,
    /// Allow NaN and infinity on connections.
    pub allow_nan: Option<bool>,
}

/// A complete algorithm with the reasons for the settings that were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct AlgorithmChoice {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// One sentence for each of step, coupling, method and extrapolation that the user did not state,
    /// and for each way in which connections that are not continuous are passed on.
    pub reasons: Vec<String>,
}

/// Completes `request` for a run of `system` over `length` s.
///
/// # Errors
///
/// Returns an error if a name does not exist, or if [`Algorithm::check`] does: a requested setting needs
/// a capability that an FMU lacks, settings contradict each other, or a number is not above 0.
pub fn choose(
    system: &System,
    request: &AlgorithmRequest,
    length: f64,
) -> Result<AlgorithmChoice, SystemError> {
    let mut reasons = Vec::new();
    let step = request.step.unwrap_or_else(|| default_step(system, length, &mut reasons));
    let base = Algorithm::new(step);
    let control = request.step_control.unwrap_or(StepControl::Fixed);
    let coupling = request.coupling.unwrap_or_else(|| default_coupling(system, &mut reasons));
    let method = request.method.unwrap_or_else(|| {
        let order = by_direct_dependencies(system);
        let names: Vec<_> = order.sequence.iter().map(|&k| system.slaves[k].0.as_str()).collect();
        reasons.push(format!(
            "gauss-seidel, in the order of the direct dependencies: {}",
            shortened(&names)
        ));
        Method::GaussSeidel
    });
    let extrapolation =
        request.extrapolation.unwrap_or_else(|| default_extrapolation(system, &mut reasons));
    let discrete = request.discrete.iter().map(|name| system.port(name));
    let discrete = discrete.collect::<Result<Vec<_>, _>>()?;
    explain_signals(system, &discrete, &mut reasons);
    let loose = matches!(control, StepControl::Increment | StepControl::Energy);
    let default_relative = if loose { 1e-2 } else { base.relative_tolerance };
    let algorithm = Algorithm {
        method,
        extrapolation,
        coupling,
        control,
        step,
        multiples: multiples(system, request)?,
        relative_tolerance: request.relative_tolerance.unwrap_or(default_relative),
        absolute_tolerance: request.absolute_tolerance.unwrap_or(base.absolute_tolerance),
        smallest_step: request.smallest_step.unwrap_or(base.smallest_step),
        largest_step: request.largest_step.unwrap_or(base.largest_step),
        iterations: request.iterations.unwrap_or(base.iterations),
        fallback: request.fallback.unwrap_or(request.coupling.is_none()),
        events: events(system, request)?,
        discrete,
        bonds: bonds(system, request)?,
        jobs: match request.jobs {
            Some(0) => std::thread::available_parallelism().map_or(1, usize::from),
            Some(jobs) => jobs,
            None => 1,
        },
        rollback: request.rollback.unwrap_or(false),
        allow_nan: request.allow_nan.unwrap_or(false),
    };
    algorithm.check(system)?;
    Ok(AlgorithmChoice { algorithm, reasons })
}

/// Returns the smallest `stepSize` of the FMUs' default experiments. Without any, returns 1 ms, or
/// the power of ten with which a run of `length` s has at most [`STEPS`] steps.
fn default_step(system: &System, length: f64, reasons: &mut Vec<String>) -> f64 {
    let stated = system.slaves.iter().filter_map(|(name, slave)| {
        let step = slave.description().default_experiment.as_ref()?.step_size?;
        (step > 0.0 && step.is_finite()).then_some((name, step))
    });
    if let Some((name, step)) = stated.min_by(|a, b| a.1.total_cmp(&b.1)) {
        reasons.push(format!(
            "step {step} s: the smallest stepSize of all DefaultExperiments ({name})"
        ));
        step
    } else {
        let step =
            if length > STEPS * STEP { 10_f64.powf((length / STEPS).log10().ceil()) } else { STEP };
        reasons.push(format!("step {step} s: no FMU states a stepSize"));
        step
    }
}

/// Chooses an iteration if direct dependencies form a loop and the state of every FMU can be
/// restored: Newton's method if all FMUs have directional derivatives, otherwise quasi-Newton.
fn default_coupling(system: &System, reasons: &mut Vec<String>) -> Coupling {
    let order = by_direct_dependencies(system);
    if order.looped.is_empty() {
        reasons.push("coupling once: no direct dependencies form a loop".to_owned());
        return Coupling::Once;
    }
    let names: Vec<_> = order.looped.iter().map(|&k| system.slaves[k].0.as_str()).collect();
    let names = shortened(&names);
    if let Some(unable) = system.first_without(|flags| flags.can_get_and_set_fmu_state) {
        reasons.push(format!(
            "coupling once, although direct dependencies form a loop through {names}: the FMU \
             state of {unable} cannot be set (canGetAndSetFMUstate)"
        ));
        Coupling::Once
    } else if system.first_without(|flags| flags.provides_directional_derivative).is_none() {
        reasons.push(format!(
            "coupling newton: direct dependencies form a loop through {names}, and all FMUs have \
             directional derivatives"
        ));
        Coupling::Newton
    } else {
        reasons.push(format!(
            "coupling quasi-newton: direct dependencies form a loop through {names}, and not all \
             FMUs have directional derivatives"
        ));
        Coupling::QuasiNewton
    }
}

/// Returns the limited extrapolation; the reason names the FMUs that take constant inputs only.
fn default_extrapolation(system: &System, reasons: &mut Vec<String>) -> Extrapolation {
    let mut receivers: Vec<usize> =
        system.connections.iter().map(|connection| connection.to.slave).collect();
    receivers.sort_unstable();
    receivers.dedup();
    if receivers.is_empty() {
        reasons.push("extrapolation limited: no input is connected".to_owned());
        return Extrapolation::Limited;
    }
    // FMI 3.0 has no canInterpolateInputs: an FMU asks for the inputs that have intermediateUpdate.
    let is_fmi3 = |&k: &usize| system.slaves[k].1.description().version() == Version::V3;
    let (fmi3, others): (Vec<usize>, Vec<usize>) = receivers.into_iter().partition(is_fmi3);
    let unable = |slaves: &[usize]| -> Vec<&str> {
        let can = |k: usize| system.can(k, |flags| flags.can_interpolate_inputs);
        let held = slaves.iter().filter(|&&k| !can(k));
        held.map(|&k| system.slaves[k].0.as_str()).collect()
    };
    let causes = [
        (unable(&others), "canInterpolateInputs is false"),
        (unable(&fmi3), "no input of theirs has intermediateUpdate"),
    ];
    let causes = causes.iter().filter(|(slaves, _)| !slaves.is_empty());
    let exceptions: Vec<_> =
        causes.map(|(slaves, why)| format!(", held for {}: {why}", shortened(slaves))).collect();
    reasons.push(match (exceptions.is_empty(), fmi3.is_empty()) {
        (false, _) => format!("extrapolation limited{}", exceptions.join("")),
        (true, true) => {
            "extrapolation limited: all connected FMUs take input derivatives (canInterpolateInputs)"
                .to_owned()
        }
        (true, false) => {
            "extrapolation limited: all connected FMUs take inputs that vary within a step".to_owned()
        }
    });
    Extrapolation::Limited
}

/// Adds a reason for each way in which connections that are not continuous are passed on.
fn explain_signals(system: &System, discrete: &[Port], reasons: &mut Vec<String>) {
    let signal_type = |port: Port| {
        if discrete.contains(&port) { SignalType::Discrete } else { system.signal_type(port) }
    };
    let of_connection = |connection: &Connection| match (
        signal_type(connection.from),
        signal_type(connection.to),
    ) {
        (SignalType::Clocked, _) | (_, SignalType::Clocked) => SignalType::Clocked,
        (SignalType::Discrete, _) | (_, SignalType::Discrete) => SignalType::Discrete,
        _ => SignalType::Continuous,
    };
    let has_events = |port: Port| system.can(port.slave, |flags| flags.has_event_mode);
    for (chosen, events, what) in [
        (SignalType::Discrete, true, "discrete, passed on at the event at which they change"),
        (
            SignalType::Discrete,
            false,
            "discrete, passed on at the next communication point, as one of the FMUs has no event mode",
        ),
        (SignalType::Clocked, true, "clocked, passed on at the ticks of their clock"),
        (SignalType::Clocked, false, "clocked, but one of the FMUs has no event mode and no ticks"),
    ] {
        let is_such = |connection: &&Connection| {
            let both_have_events = has_events(connection.from) && has_events(connection.to);
            of_connection(connection) == chosen && both_have_events == events
        };
        let names = system.connections.iter().filter(is_such).map(|connection| {
            format!("{} -> {}", system.name(connection.from), system.name(connection.to))
        });
        let names: Vec<String> = names.collect();
        if !names.is_empty() {
            reasons.push(format!("{what}: {}", shortened(&names)));
        }
    }
}

/// Joins the first names of a list for a message, and adds the number of the remaining names.
fn shortened<N: Borrow<str>>(names: &[N]) -> String {
    const SHOWN: usize = 8;
    let more = names.len().saturating_sub(SHOWN);
    let shown = names[..names.len().min(SHOWN)].join(", ");
    if more == 0 { shown } else { format!("{shown} and {more} more") }
}

fn multiples(system: &System, request: &AlgorithmRequest) -> Result<Vec<u32>, SystemError> {
    if request.every.is_empty() {
        return Ok(Vec::new());
    }
    let mut multiples = vec![1; system.slaves.len()];
    for (name, multiple) in &request.every {
        multiples[system.slave(name)?] = *multiple;
    }
    Ok(multiples)
}

fn events(system: &System, request: &AlgorithmRequest) -> Result<Vec<EventSource>, SystemError> {
    let times = request.next_event.iter().map(|name| Ok(EventSource::NextTime(system.port(name)?)));
    let crossings =
        request.crossing.iter().map(|name| Ok(EventSource::Crossing(system.port(name)?)));
    times.chain(crossings).collect()
}

fn bonds(system: &System, request: &AlgorithmRequest) -> Result<Vec<PowerBond>, SystemError> {
    let bond = |(first, second): &(String, String)| {
        Ok(PowerBond { first: system.port(first)?, second: system.port(second)? })
    };
    request.power_bonds.iter().map(bond).collect()
}
