//! The end of the command where an FMU forces it: by a crash, by `exit`, by a call that does not
//! return after the command was told to end.

use fmu_description::package::remove_temporary_folders;
use fmu_import::crash::{self, Cause, Ending};

use crate::run;

/// Exit status of a run that is lost, and of one that has not begun.
const LOST: u8 = 1;
const NOT_STARTED: u8 = 2;
const ADVICE: &str = "with --isolate each FMU has a process of its own, and what it does to it is an \
                      error of the run";

/// From now on such an end is reported, and the results so far are kept.
pub(crate) fn watch() {
    if let Err(error) = crash::watch(ADVICE, end) {
        tracing::warn!("crashes of FMUs cannot be reported: {error}");
    }
}

/// Says what happened, keeps what there is, leaves nothing behind; the exit status.
fn end(ending: &Ending) -> u8 {
    let interrupted = ending.cause == Cause::GivenUp;
    if interrupted && ending.calls.is_empty() {
        tracing::error!("the run was interrupted");
    } else if interrupted {
        tracing::error!("the run was interrupted: {ending}");
    } else {
        tracing::error!("{ending}; {ADVICE}");
    }
    // A panic here is about memory that the FMU wrote over: it is told below as what it leads to.
    std::panic::set_hook(Box::new(|_| {}));
    for (path, kept) in study::keep_results() {
        match kept {
            Ok(()) => tracing::error!("the results up to there are in {}", path.display()),
            Err(error) => tracing::error!("the last rows are lost: {error}"),
        }
    }
    remove_temporary_folders();
    if interrupted {
        run::INTERRUPTED
    } else if run::has_started() {
        LOST
    } else {
        NOT_STARTED
    }
}
