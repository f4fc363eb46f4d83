//! The worker process of an isolated FMU: this program, started by itself.

use std::process::ExitCode;

use fmu_import::isolate::WORKER;

/// Serves the master that started this process as a worker, and returns the exit status, which is 2 after an error;
/// `None` if no master started it.
pub(crate) fn worker() -> Option<ExitCode> {
    if std::env::args_os().nth(1)? != WORKER {
        return None;
    }
    Some(match fmu_import::isolate::worker_with(integrate::Integrated::boxed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let cause = std::error::Error::source(&error);
            let cause = cause.map(|cause| format!(": {cause}")).unwrap_or_default();
            eprintln!("error: {error}{cause}");
            ExitCode::from(2)
        }
    })
}
