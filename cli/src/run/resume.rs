//! Runs that go on from a checkpoint.

use std::path::Path;

use anyhow::anyhow;
use master::Scenario;
use master::{Checkpoint, Simulation, System, SystemError};

use super::plan::Plan;

/// The simulation where `checkpoint` left it. What is another than in its run is refused or said.
pub(super) fn resume(
    system: System,
    plan: &Plan,
    scenario: Scenario,
    checkpoint: &Checkpoint,
) -> anyhow::Result<Simulation> {
    let Plan { algorithm, experiment, stop, .. } = plan;
    let resumed = Simulation::resume(system, algorithm, experiment, scenario, checkpoint);
    let simulation = resumed.map_err(|error| match error {
        SystemError::Resume { name, taken, given } => anyhow!(
            "resume: the checkpoint was taken with {name} {taken}; --{name} {given} is not possible"
        ),
        other => anyhow!(other).context("resume"),
    })?;
    if let Some(told) = checkpoint.told_stop_time().filter(|told| told < stop) {
        tracing::warn!(
            "resume: the stop time {stop} s is later than {told} s, which the FMUs were told at \
             their start: an FMU may refuse to step beyond {told} s"
        );
    }
    if simulation.is_finished() && simulation.ended_by().is_none() {
        let time = checkpoint.time();
        tracing::warn!(
            "resume: the checkpoint was taken at t = {time} s, which is the end of the run; \
             --stop-time SECONDS gives a later one"
        );
    }
    Ok(simulation)
}

/// The end of a sentence: the command line that goes on from the checkpoint at `path`, as seen from
/// the folder `here`.
pub(super) fn hint(path: &Path, here: &Path) -> String {
    let command = std::env::args().next().unwrap_or_else(|| "aso-ftc".to_owned());
    let path = path.strip_prefix(here).unwrap_or(path).display().to_string();
    format!("; to go on: {} run --resume {}", quoted(&command), quoted(&path))
}

/// An argument as a shell takes it: in quotation marks where it has other letters than those of
/// common paths.
fn quoted(argument: &str) -> String {
    let plain = |letter: char| letter.is_alphanumeric() || "-_./:+@%=,".contains(letter);
    if !argument.is_empty() && argument.chars().all(plain) {
        argument.to_owned()
    } else if cfg!(windows) {
        format!("\"{argument}\"")
    } else {
        format!("'{}'", argument.replace('\'', "'\\''"))
    }
}
