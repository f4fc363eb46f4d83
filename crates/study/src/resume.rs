//! Resumes a run from a checkpoint.

use fmu_description::number::seconds;
use master::{Checkpoint, Scenario, Simulation, System, SystemError};

use crate::error::Error;
use crate::plan::Plan;

/// Restores the simulation of `checkpoint`. Returns an error if the system or a setting does not fit the
/// checkpoint; logs a warning if the stop time is later than the stop time that the FMUs have received, or if the
/// run is already at its end.
pub(crate) fn resume(
    system: System,
    plan: &Plan,
    scenario: Scenario,
    checkpoint: &Checkpoint,
) -> Result<Simulation, Error> {
    let Plan { algorithm, experiment, stop, .. } = plan;
    let resumed = Simulation::resume(system, algorithm, experiment, scenario, checkpoint);
    let simulation = resumed.map_err(|error| match error {
        SystemError::Resume { name, saved, requested } => Error::Invalid(format!(
            "resume: the checkpoint was taken with {name} {saved}; --{name} {requested} is not possible"
        )),
        other => Error::from(other).within("resume"),
    })?;
    if let Some(fmu_stop) = checkpoint.fmu_stop_time().filter(|fmu_stop| fmu_stop < stop) {
        tracing::warn!(
            "resume: the stop time {stop} s is later than {fmu_stop} s, the stop time that the FMUs \
             received at their start; an FMU may refuse to step beyond it, or keep its values \
             without a message; a run whose checkpoint is to be resumed needs the later --stop-time"
        );
    }
    if simulation.is_finished() && simulation.ended_by().is_none() {
        let time = seconds(checkpoint.time());
        tracing::warn!(
            "resume: the checkpoint was taken at t = {time} s, which is the end of the run; \
             --stop-time SECONDS gives a later one"
        );
    }
    Ok(simulation)
}
