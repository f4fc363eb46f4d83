//! The small process that supervises a run, on Linux: it waits, passes signals on, and judges how the process
//! of the run ended.

use std::process::ExitCode;

use fmu_import::supervise::{self, End, Ended};

use crate::crash::{ADVICE, LOST, NOT_STARTED};
use crate::run;

/// Splits the command into two processes. Returns the exit status in the process that supervises, and `None` in the
/// process that does the run; with `--in-process`, or if the split fails, there is only the latter.
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

/// Returns the exit status of the command. Reports an unexpected end of the process of the run. Unless the run
/// chose a status other than 0, also completes its results file and reports that.
fn judge(ended: &Ended) -> u8 {
    let status = judge_end(ended);
    if !has_chosen_end(ended) {
        fmu_description::package::remove_abandoned_folders();
    }
    let chose_error = ended.status.is_some_and(|status| status != 0);
    let file = supervise::memory().filter(|_| !chose_error).and_then(results::ledger::complete);
    let Some(file) = file else { return status };
    let path = file.path.display();
    if let Some(damage) = file.damage {
        tracing::error!("{path}: {damage}; with --isolate no FMU reaches the files of the run");
        return status.max(LOST);
    }
    if !file.was_complete {
        tracing::error!("the results up to this step are in {path}");
    }
    status
}

/// Whether the process ended by the exit status that the program chose, after it removed its temporary folders.
fn has_chosen_end(ended: &Ended) -> bool {
    ended.status.is_some_and(|status| ended.end == End::Exited(status.into()))
}

/// Returns the exit status for the end of the process, and reports an end that the program did not choose.
fn judge_end(ended: &Ended) -> u8 {
    let end = ended.end;
    match (ended.status, end) {
        (Some(status), _) if has_chosen_end(ended) => status,
        (Some(status), _) => {
            tracing::error!(
                "after the end of the run, something that an FMU or a library of --preload has left in the process \
                 (an exit handler, a destructor or a thread) {end}; nothing of the run is lost; {ADVICE}"
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

/// Lists the calls that had not returned; if there are none, names the code outside of calls.
fn calls(ended: &Ended) -> String {
    if ended.calls.is_empty() {
        return "outside of the calls of FMUs the program or a thread of an FMU".to_owned();
    }
    let calls: Vec<_> = ended.calls.iter().map(ToString::to_string).collect();
    calls.join(", or ")
}

/// SIGKILL, SIGTERM and SIGINT, which usually come from outside of the FMU.
const FROM_OUTSIDE: [i32; 3] = [9, 15, 2];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temporary_folders_remain_after_each_end_that_the_program_did_not_choose() {
        for (end, status, is_chosen) in [
            (End::Exited(1), Some(1), true),
            (End::Exited(3), Some(1), false),
            (End::Exited(3), None, false),
            (End::Killed(11), Some(0), false),
            (End::Stuck, Some(0), false),
            (End::Stuck, None, false),
        ] {
            let ended = Ended { end, status, calls: Vec::new(), has_begun_steps: true };
            assert_eq!(has_chosen_end(&ended), is_chosen, "{ended:?}");
        }
    }
}
