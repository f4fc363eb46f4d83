//! Handles an end of the process that an FMU forces: a crash, `exit`, or a call that does not
//! return after the command received a signal.

use fmu_description::package::remove_temporary_folders;
use fmu_import::crash::{self, Cause, Ending};

use crate::{logging, run};

/// Exit status of a run that an FMU ended after the start of the first step, or whose results are damaged.
pub(crate) const LOST: u8 = 1;
/// Exit status of a run that an FMU ended before the first step.
pub(crate) const NOT_STARTED: u8 = 2;
pub(crate) const ADVICE: &str = "with --isolate each FMU runs in a separate process, and its crash is an error of \
                      the run";

/// Installs the handler, which reports the end and keeps the results so far; warns if the handler cannot be installed.
pub(crate) fn watch() {
    if let Err(error) = crash::watch(ADVICE, logging::use_memory_of_thread, end) {
        tracing::warn!("crashes of FMUs cannot be reported: {error}");
    }
}

/// Reports the end, completes the results, removes temporary files; returns the exit status.
fn end(ending: &Ending) -> u8 {
    let interrupted = matches!(ending.cause, Cause::GivenUp(_));
    if interrupted && ending.calls.is_empty() {
        tracing::error!("the run was interrupted");
    } else if interrupted {
        tracing::error!("the run was interrupted: {ending}");
    } else {
        tracing::error!("{ending}; {ADVICE}");
    }
    // Suppress panic messages: memory that the FMU has overwritten can cause them; the failure is
    // reported below.
    std::panic::set_hook(Box::new(|_| {}));
    for (path, outcome) in study::keep_results() {
        match outcome {
            Ok(()) => tracing::error!("the results up to this step are in {}", path.display()),
            Err(error) => tracing::error!("the last rows are lost: {error}"),
        }
    }
    remove_temporary_folders();
    if interrupted {
        run::interrupted()
    } else if crash::has_begun_steps() {
        LOST
    } else {
        NOT_STARTED
    }
}
