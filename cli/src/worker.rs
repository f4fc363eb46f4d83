//! The worker process of an isolated FMU: this program, started by itself.

use std::process::ExitCode;

use fmu_import::isolate::WORKER;

/// Serves the master that started this process as a worker, and returns the exit status, which is 2 after an error;
/// `None` if no master started this process.
pub(crate) fn worker() -> Option<ExitCode> {
    if std::env::args_os().nth(1)? != WORKER {
        return None;
    }
    Some(match fmu_import::isolate::worker_with(integrate::Integrated::boxed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", files::sentence(&error));
            ExitCode::from(2)
        }
    })
}
