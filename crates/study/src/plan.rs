//! Chooses the settings that a configuration leaves open: algorithm, times, interval between rows.

use crate::error::Error;
use fmu_description::number::{rounded, seconds};
use fmu_description::{DefaultExperiment, Experiment};
use master::{
    Algorithm, AlgorithmRequest, Coupling, Extrapolation, Method, StepControl, System,
    by_direct_dependencies, check_stop_time, choose,
};
use toml::Spanned;

use crate::assemble::AssembledSystem;
use crate::config::{Config, ConnectionEntry, Every};

/// Largest default number of intervals between rows with fixed steps.
const ROWS: f64 = 1e4;
/// Default length of a run in s if no stop time after its start is stated, as in FMPy.
const LENGTH: f64 = 1.0;
/// A step of fewer spacings between neighbouring floating-point times gives a warning.
const STEP_RESOLUTION: f64 = 50.0;
/// Relative tolerance with which a proposed step counts as a multiple of the communication step, and the length of a
/// run as [`ROWS`] steps.
const NEAR: f64 = 1e-6;

/// All settings of a run, stated or chosen.
pub struct Plan {
    /// The algorithm.
    pub algorithm: Algorithm,
    /// Start time, stop time and tolerance for the FMUs.
    pub experiment: Experiment,
    /// Stop time in s.
    pub stop: f64,
    /// Interval between rows.
    pub every: Every,
    /// Sentences on the settings that the user did not state, with the reason for each choice.
    pub reasons: Vec<String>,
}

/// Chooses all settings that are not stated and completes `config` with them, also with the connections of the system
/// unless the configuration builds on a system structure or states connections.
///
/// # Errors
///
/// Returns an error if a setting is invalid or needs a capability that an FMU lacks.
pub fn plan(config: &mut Config, assembled: &AssembledSystem) -> Result<Plan, Error> {
    let system = &assembled.system;
    let mut reasons = Vec::new();
    propose_algorithm(&mut config.algorithm, assembled, &mut reasons);
    propose_steps(&mut config.algorithm, assembled, &mut reasons);
    check_step(&config.algorithm)?;
    let (start, stop) = times(config, assembled, &mut reasons);
    check_stop_time(start, stop)?;
    let chosen = choose(system, &config.algorithm, stop - start)?;
    reasons.extend(chosen.reasons);
    let algorithm = chosen.algorithm;
    warn_of_resolution(algorithm.step, start.abs().max(stop.abs()));
    let tolerance = config.experiment.tolerance.as_ref().map(|tolerance| *tolerance.get_ref());
    explain_tolerances(system, tolerance, &mut reasons);
    reasons.extend(assembled.integrated.iter().map(|(name, method)| {
        let method = method.name();
        format!("{name} runs by model exchange: the master integrates it, solver {method}")
    }));
    let experiment = Experiment { start_time: start, stop_time: Some(stop), tolerance };
    let every =
        config.results.every.unwrap_or_else(|| rows(&algorithm, stop - start, &mut reasons));
    complete(&mut config.algorithm, &algorithm, system);
    config.experiment.start_time = Some(Spanned::new(0..0, start));
    config.experiment.stop_time = Some(Spanned::new(0..0, stop));
    config.results.every = Some(every);
    config.isolation.isolate.get_or_insert(false);
    if config.system.is_none() && config.connections.is_none() {
        let wire = |connection: &master::Connection| {
            ConnectionEntry::new(system.name(connection.from), system.name(connection.to))
        };
        config.connections = Some(system.connections.iter().map(wire).collect());
    }
    Ok(Plan { algorithm, experiment, stop, every, reasons })
}

/// If no tolerance is stated, explains the tolerance that an FMU receives from its `DefaultExperiment`.
fn explain_tolerances(system: &System, stated: Option<f64>, reasons: &mut Vec<String>) {
    if stated.is_some() {
        return;
    }
    for (name, slave) in &system.slaves {
        let default = slave.description().default_experiment.as_ref();
        if let Some(tolerance) = default.and_then(DefaultExperiment::usable_tolerance) {
            reasons.push(format!("tolerance {tolerance:e} for {name}: from its DefaultExperiment"));
        }
    }
}

/// Checks that a stated communication step is finite and above 0, before other settings are derived from it.
fn check_step(request: &AlgorithmRequest) -> Result<(), Error> {
    match request.step {
        Some(step) if !(step > 0.0 && step.is_finite()) => {
            let rule = "expected a finite number, more than 0";
            Err(Error::Invalid(format!("the communication step is {step} s, {rule}")))
        }
        _ => Ok(()),
    }
}

/// Warns if `step` is so small that rounding at the time `latest`, both in s, changes the step by a percent or more.
fn warn_of_resolution(step: f64, latest: f64) {
    let resolution = latest.next_up() - latest;
    if step < STEP_RESOLUTION * resolution {
        tracing::warn!(
            "the step of {step:e} s is near or below the resolution of time: at t = {} s, times differ by at least \
             {} s, so steps become longer and shorter than stated; a start time nearer to 0 or a larger --step helps",
            seconds(latest),
            rounded(resolution, 3)
        );
    }
}

/// If the system structure requests libcosim's fixed-step algorithm, fills in method, extrapolation and coupling of
/// that algorithm where the user states nothing else.
fn propose_algorithm(
    request: &mut AlgorithmRequest,
    assembled: &AssembledSystem,
    reasons: &mut Vec<String>,
) {
    if !assembled.fixed_step {
        return;
    }
    let is_incomplete =
        request.method.is_none() || request.extrapolation.is_none() || request.coupling.is_none();
    request.method.get_or_insert(Method::Jacobi);
    request.extrapolation.get_or_insert(Extrapolation::Hold);
    request.coupling.get_or_insert(Coupling::Once);
    if is_incomplete {
        let sentence = "the system structure asks for libcosim's fixed steps: jacobi, extrapolation hold, \
             coupling once, where nothing else is stated";
        reasons.push(sentence.to_owned());
    }
}

/// Fills in the steps that the system structure proposes. Without a stated communication step, this step becomes the
/// base step or, without one, the smallest step proposed for an FMU. FMUs step every several communication steps if the
/// request states neither such multiples nor step control, iteration, rollback or events, and if no algebraic loop is
/// to be iterated.
fn propose_steps(
    request: &mut AlgorithmRequest,
    assembled: &AssembledSystem,
    reasons: &mut Vec<String>,
) {
    let is_valid = |step: &f64| *step > 0.0 && step.is_finite();
    let hints = assembled.steps.iter().filter(|(_, step)| is_valid(step));
    if request.step.is_none() {
        let least = hints.clone().map(|(_, step)| *step).reduce(f64::min);
        request.step = assembled.experiment.step_size.filter(is_valid).or(least);
        if let Some(step) = request.step {
            reasons.push(format!("step {step} s: from the system structure"));
        }
    }
    let allows_multiples = request.step_control.is_none_or(|control| control == StepControl::Fixed)
        && request.coupling.is_none_or(|coupling| coupling == Coupling::Once)
        && request.rollback != Some(true)
        && request.next_event.is_empty()
        && request.crossing.is_empty()
        && (request.coupling.is_some()
            || by_direct_dependencies(&assembled.system).looped.is_empty());
    let Some(step) = request.step.filter(|_| allows_multiples && request.every.is_empty()) else {
        return;
    };
    for (name, proposed) in hints {
        let multiple = (proposed / step).round();
        if multiple >= 2.0 && (proposed / step - multiple).abs() < NEAR * multiple {
            reasons.push(format!(
                "{name} steps every {multiple} communication steps: the system structure proposes \
                 {proposed} s for it"
            ));
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturates"
            )]
            request.every.insert(name.clone(), multiple as u32);
        }
    }
}

/// Returns start and stop time in s: stated by the user, otherwise by the system structure, otherwise the earliest
/// start time of all FMUs, and their latest stop time after this start. Without any of them, a run starts at 0 s and
/// has the length [`LENGTH`].
fn times(config: &Config, assembled: &AssembledSystem, reasons: &mut Vec<String>) -> (f64, f64) {
    let stated = |time: &Option<Spanned<f64>>| time.as_ref().map(|time| *time.get_ref());
    let defaults = || {
        let slaves = assembled.system.slaves.iter();
        slaves.filter_map(|(name, slave)| {
            slave.description().default_experiment.as_ref().map(|default| (name, default))
        })
    };
    let finite = |time: &f64| time.is_finite();
    let known = stated(&config.experiment.start_time).or(assembled.experiment.start_time);
    let start = known.unwrap_or_else(|| {
        let stated = defaults().filter_map(|(name, one)| Some((name, one.start_time?)));
        match stated.filter(|(_, time)| finite(time)).min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((name, time)) => {
                reasons.push(format!("start time {time} s: from the DefaultExperiment of {name}"));
                time
            }
            None => 0.0,
        }
    });
    if let Some(stop) = stated(&config.experiment.stop_time).or(assembled.experiment.stop_time) {
        return (start, stop);
    }
    let latest = defaults()
        .filter_map(|(name, one)| Some((name, one.stop_time?)))
        .filter(|(_, time)| finite(time) && *time > start)
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((name, stop)) = latest else {
        let stop = start + LENGTH;
        let reason = format!(
            "stop time {stop} s: neither the system nor the DefaultExperiment of an FMU states one \
             after the start time {start} s"
        );
        tracing::warn!("{reason}; --stop-time SECONDS sets it");
        reasons.push(reason);
        return (start, stop);
    };
    reasons.push(format!(
        "stop time {stop} s: the latest stopTime of all DefaultExperiments ({name})"
    ));
    (start, stop)
}

/// Chooses the interval between rows: every communication point, unless fixed steps give more than
/// [`ROWS`] intervals.
fn rows(algorithm: &Algorithm, length: f64, reasons: &mut Vec<String>) -> Every {
    if algorithm.control == StepControl::Fixed && length > ROWS * algorithm.step * (1.0 + NEAR) {
        let interval = length / ROWS;
        reasons.push(format!("a row every {} s: {ROWS} intervals", seconds(interval)));
        Every::Seconds(interval)
    } else {
        Every::Step
    }
}

/// Writes the chosen algorithm into the configuration.
fn complete(request: &mut AlgorithmRequest, algorithm: &Algorithm, system: &System) {
    request.method = Some(algorithm.method);
    request.extrapolation = Some(algorithm.extrapolation);
    request.coupling = Some(algorithm.coupling);
    request.step_control = Some(algorithm.control);
    request.step = Some(algorithm.step);
    request.relative_tolerance = Some(algorithm.relative_tolerance);
    request.absolute_tolerance = Some(algorithm.absolute_tolerance);
    request.smallest_step = Some(algorithm.smallest_step);
    request.largest_step = Some(algorithm.largest_step);
    request.iterations = Some(algorithm.iterations);
    request.fallback = Some(algorithm.fallback);
    request.jobs = Some(request.jobs.unwrap_or(algorithm.jobs));
    request.rollback = Some(algorithm.rollback);
    request.allow_nan = Some(algorithm.allow_nan);
    let multiples = system.slaves.iter().zip(&algorithm.multiples);
    request.every = multiples.map(|((name, _), multiple)| (name.clone(), *multiple)).collect();
}

impl Plan {
    /// Returns the text of `--explain`.
    #[must_use]
    pub fn explanation(&self, system: &System) -> String {
        let algorithm = &self.algorithm;
        let mut lines = vec![
            format!(
                "algorithm: {}, extrapolation {}, coupling {}, {} step {} s",
                algorithm.method.name(),
                algorithm.extrapolation.name(),
                algorithm.coupling.name(),
                algorithm.control.name(),
                algorithm.step
            ),
            format!("time: {} to {} s", self.experiment.start_time, self.stop),
        ];
        for ((name, _), multiple) in system.slaves.iter().zip(&algorithm.multiples) {
            if *multiple != 1 {
                lines.push(format!("{name} steps every {multiple} communication steps"));
            }
        }
        lines.extend(self.reasons.iter().map(|reason| format!("- {reason}")));
        lines.join("\n")
    }
}
