//! The small process that supervises a run, on Linux: it waits, passes signals on, and judges how the process
//! of the run ended.

use std::process::ExitCode;

use fmu_import::supervise::{self, End, Ended};

use crate::crash::{ADVICE, LOST, NOT_STARTED};
use crate::run;

/// Splits the command into two processes. Returns the exit status in the one that supervises, and `None` in the
/// one that shall do the run.
pub(crate) fn supervise(options: &run::Options) -> Option<ExitCode> {
    if options.is_in_process() {
        return None;
    }
    match supervise::split() {
        Ok(None) => {
            supervise::memory().into_iter().for_each(results::ledger::share);
            None
        }
        Ok(Some(ended)) => {
            options.start_logging();
            Some(ExitCode::from(judge(&ended)))
        }
        Err(error) => {
            options.start_logging();
            tracing::warn!("the run is not supervised: {error}");
            None
        }
    }
}

/// Returns the exit status of the command, reports what the process of the run did not report, and completes
/// the results.
fn judge(ended: &Ended) -> u8 {
    let status = judge_end(ended);
    if ended.end != ended.status.map_or(End::Stuck, |status| End::Exited(status.into())) {
        fmu_description::package::remove_abandoned_folders();
    }
    let reported = ended.status.is_some_and(|status| status != 0);
    let left = supervise::memory().filter(|_| !reported).and_then(results::ledger::complete);
    let Some(left) = left else { return status };
    let path = left.path.display();
    if let Some(damage) = left.damage {
        tracing::error!("{path}: {damage}; with --isolate no FMU reaches the files of the run");
        return status.max(LOST);
    }
    if !left.was_complete {
        tracing::error!("the results up to this step are in {path}");
    }
    status
}

fn judge_end(ended: &Ended) -> u8 {
    let end = ended.end;
    match (ended.status, end) {
        (Some(status), End::Exited(exited)) if exited == i32::from(status) => status,
        (Some(status), _) => {
            tracing::error!(
                "after the end of the run, something that an FMU has left in the process (an exit handler, a \
                 destructor or a thread) {end}; nothing of the run is lost; {ADVICE}"
            );
            status.max(LOST)
        }
        (None, End::Killed(signal)) if FROM_OUTSIDE.contains(&signal) => {
            tracing::error!(
                "another process, or the system for lack of memory, {end}{}",
                if ended.calls.is_empty() {
                    String::new()
                } else {
                    format!("; it was in {}", calls(ended))
                }
            );
            128 + u8::try_from(signal).unwrap_or(0)
        }
        (None, _) => {
            tracing::error!("{} {end}; {ADVICE}", calls(ended));
            if ended.has_begun_steps { LOST } else { NOT_STARTED }
        }
    }
}

/// The calls that had not returned.
fn calls(ended: &Ended) -> String {
    if ended.calls.is_empty() {
        return "outside of the calls of FMUs the program or a thread of an FMU".to_owned();
    }
    let calls: Vec<_> = ended.calls.iter().map(ToString::to_string).collect();
    calls.join(", or ")
}

/// SIGKILL, SIGTERM, SIGINT.
const FROM_OUTSIDE: [i32; 3] = [9, 15, 2];
