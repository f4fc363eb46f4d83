//! Isolation: each FMU instance runs in a separate process, so that a crash does not end the master.
//!
//! [`open`] starts a worker process: the same program with [`WORKER`] as its only argument, which calls [`worker()`].
//! The worker loads the FMU and executes the commands of the master's side, [`Isolated`]. Arguments, results and
//! messages pass through shared memory; master and worker take turns.
//!
//! Isolation works on Linux; on other systems [`open`] returns [`IsolateError::Platform`].

#[cfg(target_os = "linux")]
mod as_slave;
#[cfg(target_os = "linux")]
mod channel;
#[cfg(target_os = "linux")]
mod function;
#[cfg(target_os = "linux")]
mod isolated;
#[cfg(target_os = "linux")]
mod layout;
#[cfg(target_os = "linux")]
mod log;
#[cfg(target_os = "linux")]
mod memory;
#[cfg(target_os = "linux")]
mod message;
#[cfg(target_os = "linux")]
mod output;
#[cfg(target_os = "linux")]
mod perform;
#[cfg(target_os = "linux")]
mod process;
#[cfg(target_os = "linux")]
mod region;
#[cfg(target_os = "linux")]
mod request;
#[cfg(target_os = "linux")]
mod transfer;
#[cfg(not(target_os = "linux"))]
mod unsupported;
#[cfg(target_os = "linux")]
mod words;
#[cfg(target_os = "linux")]
mod worker;

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use fmu_description::ModelDescription;
use fmu_description::package::{PackageError, Unpacked};

use crate::fmu::{unpack, warnings};
use slave::{CallError, Failure, ModelExchange, Slave};

#[cfg(target_os = "linux")]
pub use isolated::Isolated;
#[cfg(not(target_os = "linux"))]
pub use unsupported::Isolated;
#[cfg(not(target_os = "linux"))]
use unsupported::run;
#[cfg(target_os = "linux")]
use worker::run;

/// The first and only argument of a program that is to become a worker.
pub const WORKER: &str = "--fmu-worker";

/// The environment variable that marks a process as a worker: the identifier of the process that started it.
#[cfg(target_os = "linux")]
const STARTED_BY: &str = "FMU_WORKER_STARTED_BY";

/// Options of isolation.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Time limit of each call; a worker that exceeds it is killed. `None`: no limit.
    pub time_limit: Option<Duration>,
    /// Limit of the address space of each worker in bytes, program included (`RLIMIT_AS`). `None`: no additional limit.
    pub memory_limit: Option<u64>,
    /// Libraries that the worker loads before the FMU, as [`crate::preload`] does.
    pub preload: Vec<OsString>,
    /// Whether to refuse an FMU whose library calls functions that no library defines.
    pub strict_binding: bool,
    /// Whether the FMU gets copies of arrays, with canaries ([`Slave::guard_arrays`]).
    pub guard_arrays: bool,
    /// Whether to call `fmi2SetDebugLogging` if the FMU has it.
    pub logging: bool,
    /// The program that becomes the worker; `None`: this program.
    pub executable: Option<PathBuf>,
    /// Integration of an instance for model exchange by the worker; `None`: co-simulation or scheduled execution.
    pub integration: Option<Integration>,
}

/// Integration of a model-exchange instance by a worker. The worker must have called [`worker_with`].
#[derive(Clone, Debug)]
pub struct Integration {
    /// The options, in the text form that the [`Integrator`] of the worker reads.
    pub options: String,
    /// Converts the description of the model-exchange instance to the description of the integrator's slave.
    pub describe: fn(&ModelDescription) -> ModelDescription,
}

/// Makes a slave that integrates an instance for model exchange, with options as text.
pub type Integrator = fn(Box<dyn ModelExchange>, &str) -> Box<dyn Slave>;

/// Why an FMU cannot run in a separate process.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum IsolateError {
    /// The archive or its model description cannot be read.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The FMU offers neither co-simulation nor scheduled execution, and [`Options::integration`] is not stated.
    #[error("{path}: the FMU offers no co-simulation, expected the element CoSimulation")]
    NoCoSimulation { path: PathBuf },
    /// The FMU has no model-exchange interface, although [`Options::integration`] is stated.
    #[error("{path}: the FMU offers no model exchange, expected the element ModelExchange")]
    NoModelExchange { path: PathBuf },
    /// The operating system refused shared memory or a connection.
    #[error("{what} for the process of {instance}")]
    System { what: &'static str, instance: String, source: io::Error },
    /// The process could not be started.
    #[error("cannot start {} for {instance}", executable.display())]
    Start { executable: PathBuf, instance: String, source: io::Error },
    /// The program started but did not become a worker.
    #[error(
        "{}, started for {instance} as `{WORKER}`, did not become a worker: it {failure}; either it \
         said why, or its `main` does not first call `fmu_import::isolate::worker()` if its first argument \
         is {WORKER}",
        executable.display()
    )]
    NoWorker { executable: PathBuf, instance: String, failure: Failure },
    /// This process was started as a worker, but tries to start workers itself.
    #[error(
        "this process was started as `{WORKER}` to run one FMU and did not become a worker; `main` must \
         first call `fmu_import::isolate::worker()` if the first argument is {WORKER}"
    )]
    InWorker,
    /// The worker cannot load a library of [`Options::preload`].
    #[error("{reason}")]
    Preload {
        /// The library and the reason.
        reason: String,
    },
    /// The worker cannot load or instantiate the FMU.
    #[error("{instance}: {reason}")]
    Refused {
        instance: String,
        /// The reason.
        reason: String,
    },
    /// The worker ended or did not answer while it loaded or instantiated the FMU.
    #[error("{instance}: {source}")]
    Call { instance: String, source: CallError },
    /// This operating system does not support isolation.
    #[error("{instance}: isolation is available on Linux only")]
    Platform { instance: String },
}

impl From<PackageError> for IsolateError {
    fn from(error: PackageError) -> Self {
        IsolateError::Package(Box::new(error))
    }
}

#[cfg(target_os = "linux")]
impl IsolateError {
    /// Adds the memory limit to the reason why the FMU does not load: the limit may be the cause.
    fn with_limit(mut self, limit: Option<u64>) -> Self {
        use std::fmt::Write as _;
        if let (Self::Refused { reason, .. } | Self::Preload { reason }, Some(limit)) =
            (&mut self, limit)
        {
            // Writing to a String does not fail.
            let _ = write!(reason, "; its process has a memory limit of {limit} bytes");
        }
        self
    }
}

/// An unpacked FMU, shared by all its isolated instances.
#[derive(Clone, Debug)]
pub struct Package {
    path: PathBuf,
    unpacked: Arc<Unpacked>,
}

impl Package {
    /// Unpacks the FMU at `path`, an archive or a folder with an unpacked FMU. This process does not load its library.
    ///
    /// # Errors
    ///
    /// [`IsolateError::Package`] if the FMU cannot be read.
    pub fn open(path: &Path) -> Result<Self, IsolateError> {
        Ok(Self { path: path.to_owned(), unpacked: Arc::new(unpack(path)?) })
    }

    /// Returns the model description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.unpacked.description
    }

    /// Returns the warnings about the archive, then the warnings about the description.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        warnings(&self.unpacked)
    }

    /// Starts a worker process and creates the instance `name` in it.
    ///
    /// # Errors
    ///
    /// [`IsolateError`] if the FMU lacks the interface, if no worker can be started, or if the FMU does not load, does
    /// not instantiate or ends its process.
    pub fn instantiate(&self, name: &str, options: &Options) -> Result<Isolated, IsolateError> {
        let (description, path) = (self.description(), self.path.clone());
        match options.integration {
            None if description.stepped().is_none() => {
                return Err(IsolateError::NoCoSimulation { path });
            }
            Some(_) if description.model_exchange.is_none() => {
                return Err(IsolateError::NoModelExchange { path });
            }
            _ => {}
        }
        Isolated::start(self.unpacked.clone(), name, options)
    }
}

/// Unpacks the FMU at `path` and creates the instance `name` in a separate process.
///
/// # Errors
///
/// Same as [`Package::open`] and [`Package::instantiate`].
pub fn open(path: &Path, name: &str, options: &Options) -> Result<Isolated, IsolateError> {
    Package::open(path)?.instantiate(name, options)
}

/// Why a program cannot become or remain a worker.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum WorkerError {
    /// No master started the program, or the worker's memory or connection cannot be set up.
    #[error("{WORKER} is for the master's own use: {what}")]
    Alone { what: &'static str, source: io::Error },
    /// The command in shared memory is invalid.
    #[error("the memory shared with the master is corrupted: found {actual}, expected a command")]
    Corrupted { actual: u64 },
    /// This operating system does not support isolation.
    #[error("isolation is available on Linux only")]
    Platform,
}

/// Runs this process as a worker of the master that started it. Returns when the master frees the instance or closes
/// the connection; if the master ends, the process is killed. Standard output is redirected to standard error.
///
/// # Errors
///
/// [`WorkerError::Alone`] if no master started this process, or if memory or connection of the worker cannot be set up;
/// [`WorkerError::Corrupted`] if the FMU overwrote the shared memory; [`WorkerError::Platform`] on another system than
/// Linux.
pub fn worker() -> Result<(), WorkerError> {
    run(None)
}

/// Like [`worker`], but also runs instances for model exchange, which `integrator` integrates.
///
/// # Errors
///
/// Same as [`worker`].
pub fn worker_with(integrator: Integrator) -> Result<(), WorkerError> {
    run(Some(integrator))
}
