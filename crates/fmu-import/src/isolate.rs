//! FMUs in processes of their own: what one does to its process leaves the master whole.
//!
//! [`open`] starts a worker, which is the same program called with [`WORKER`] as its only argument
//! and hands over to [`worker()`]. It loads the FMU and does what the master's side, [`Isolated`],
//! asks for. Both share memory for arguments, results and messages, and take turns.
//!
//! This works on Linux; elsewhere [`open`] says that it does not.

#[cfg(target_os = "linux")]
mod as_slave;
#[cfg(target_os = "linux")]
mod command;
#[cfg(not(target_os = "linux"))]
mod elsewhere;
#[cfg(target_os = "linux")]
mod isolated;
#[cfg(target_os = "linux")]
mod layout;
#[cfg(target_os = "linux")]
mod line;
#[cfg(target_os = "linux")]
mod log;
#[cfg(target_os = "linux")]
mod memory;
#[cfg(target_os = "linux")]
mod output;
#[cfg(target_os = "linux")]
mod perform;
#[cfg(target_os = "linux")]
mod process;
#[cfg(target_os = "linux")]
mod region;
#[cfg(target_os = "linux")]
mod strings;
#[cfg(target_os = "linux")]
mod words;
#[cfg(target_os = "linux")]
mod worker;

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use fmu_description::package::{PackageError, Unpacked};

use slave::{CallError, Failure};

#[cfg(not(target_os = "linux"))]
pub use elsewhere::{Isolated, worker};
#[cfg(target_os = "linux")]
pub use isolated::Isolated;
#[cfg(target_os = "linux")]
pub use worker::worker;

/// The first argument of a program that is to be a worker.
pub const WORKER: &str = "--fmu-worker";

/// The environment variable by which a process knows that it is to be a worker: the number of the
/// process that started it.
#[cfg(target_os = "linux")]
const STARTED_BY: &str = "FMU_WORKER_STARTED_BY";

/// How FMUs are isolated.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How long each call may take; its process is ended then. None: as long as it takes.
    pub time_limit: Option<Duration>,
    /// Most bytes of address space that the process of each FMU may take, the program in it included
    /// (`RLIMIT_AS`). None: no limit of its own.
    pub memory_limit: Option<u64>,
    /// Libraries to load before that of the FMU, as [`crate::preload`] does.
    pub preload: Vec<OsString>,
    /// Whether `fmi2SetDebugLogging` is called where the FMU has it.
    pub logging: bool,
    /// The program that becomes the worker; none: this one.
    pub executable: Option<PathBuf>,
}

/// Why an FMU could not be isolated.
#[derive(Debug, thiserror::Error)]
pub enum IsolateError {
    /// The archive or its model description.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// There is no co-simulation in it.
    #[error("{path}: the FMU offers no co-simulation, expected the element CoSimulation")]
    NoCoSimulation {
        /// The FMU.
        path: PathBuf,
    },
    /// The operating system refused shared memory or a connection.
    #[error("{what} for the process of {instance}")]
    System {
        /// What was wanted.
        what: &'static str,
        /// The instance.
        instance: String,
        /// What it said.
        source: io::Error,
    },
    /// The process could not be started.
    #[error("cannot start {} for {instance}", executable.display())]
    Start {
        /// The program.
        executable: PathBuf,
        /// The instance.
        instance: String,
        /// What the operating system said.
        source: io::Error,
    },
    /// The program was started and did not become a worker.
    #[error(
        "{}, started for {instance} as `{WORKER}`, did not become a worker: it {failure}; its `main` \
         has to begin with a call of `fmu_import::isolate::worker()` where its first argument is {WORKER}",
        executable.display()
    )]
    NoWorker {
        /// The program.
        executable: PathBuf,
        /// The instance.
        instance: String,
        /// What it did instead.
        failure: Failure,
    },
    /// This process was started to be a worker and starts others.
    #[error(
        "this process was started as `{WORKER}` to run one FMU and did not become a worker; `main` has \
         to begin with a call of `fmu_import::isolate::worker()` where the first argument is {WORKER}"
    )]
    InWorker,
    /// The worker could not load a library that was to be loaded before that of the FMU.
    #[error("{reason}")]
    Preload {
        /// Which, and why.
        reason: String,
    },
    /// The worker could not load or instantiate the FMU.
    #[error("{instance}: {reason}")]
    Refused {
        /// The instance.
        instance: String,
        /// Why.
        reason: String,
    },
    /// The worker ended or did not answer while it loaded or instantiated the FMU.
    #[error("{instance}: {source}")]
    Call {
        /// The instance.
        instance: String,
        /// What happened.
        source: CallError,
    },
    /// Not on this operating system.
    #[error("{instance}: FMUs are isolated on Linux only so far")]
    Platform {
        /// The instance.
        instance: String,
    },
}

impl From<PackageError> for IsolateError {
    fn from(error: PackageError) -> Self {
        IsolateError::Package(Box::new(error))
    }
}

#[cfg(target_os = "linux")]
impl IsolateError {
    /// The same; where the FMU was refused, with the limit of memory, which may be why.
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

/// An FMU, unpacked once for all of its isolated instances.
#[derive(Clone, Debug)]
pub struct Package {
    unpacked: Arc<Unpacked>,
}

impl Package {
    /// Unpacks the FMU at `path`, which may also be a folder with an unpacked one. Nothing of it is
    /// loaded into this process.
    ///
    /// # Errors
    ///
    /// [`IsolateError::Package`], [`IsolateError::NoCoSimulation`].
    pub fn open(path: &Path) -> Result<Self, IsolateError> {
        let unpacked =
            if path.is_dir() { Unpacked::in_folder(path)? } else { Unpacked::open(path)? };
        if unpacked.description.co_simulation.is_none() {
            return Err(IsolateError::NoCoSimulation { path: path.to_owned() });
        }
        Ok(Self { unpacked: Arc::new(unpacked) })
    }

    /// An instance called `name` in a process of its own.
    ///
    /// # Errors
    ///
    /// [`IsolateError`]: no process, or an FMU that does not load or that ends its process.
    pub fn instantiate(&self, name: &str, options: &Options) -> Result<Isolated, IsolateError> {
        Isolated::start(self.unpacked.clone(), name, options)
    }
}

/// An instance called `name` of the FMU at `path`, in a process of its own.
///
/// # Errors
///
/// Those of [`Package::open`] and [`Package::instantiate`].
pub fn open(path: &Path, name: &str, options: &Options) -> Result<Isolated, IsolateError> {
    Package::open(path)?.instantiate(name, options)
}

/// Why a program could not be a worker.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// It was not started by a master.
    #[error("{WORKER} is for the master's own use: {what}")]
    Alone {
        /// What is missing.
        what: &'static str,
        /// What the operating system said.
        source: io::Error,
    },
    /// The master wrote something else than a command.
    #[error("the memory shared with the master is corrupted: found {found}, expected a command")]
    Corrupted {
        /// What was found.
        found: u64,
    },
    /// Not on this operating system.
    #[error("FMUs are isolated on Linux only so far")]
    Platform,
}
