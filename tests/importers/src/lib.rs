//! Loads FMUs with the crate `fmi`, as an independent check of our own loader.
//!
//! Weaknesses of that crate are avoided. [`Fmu::open`] reads the FMU first: its model description
//! is used, and it refuses archives with paths outside of their folder and libraries that lack a
//! function which every instance needs. The crate panics if another missing function is called;
//! such a panic becomes an error.
//!
//! Two limitations remain. The crate passes messages of FMUs to the crate `log`, so errors do not
//! contain them. An FMU that logs with a null category, or with the status `fmi2Pending`, ends the
//! process; logging is therefore off, as with our own loader.

use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use fmi::fmi2::Fmi2Error;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation as _, Common as _, InstanceCS};
use fmu_description::Experiment;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;
use fmu_import::{Fmu, FmuError};
use master::{CallError, Failure, Slave, StepResult};

/// The reason why an FMU could not be opened or instantiated through the crate `fmi`.
#[derive(Debug, thiserror::Error)]
pub enum FmiCrateError {
    /// Our own loader already refuses it.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The crate refuses it.
    #[error("{path}: the crate fmi: {source}")]
    Refused {
        /// The FMU.
        path: PathBuf,
        /// The crate's reason.
        source: Box<fmi::Error>,
    },
    /// The crate panics.
    #[error("{path}: the crate fmi panics: {message}")]
    Panic {
        /// The FMU.
        path: PathBuf,
        /// The message of the panic.
        message: String,
    },
}

/// An instance of an FMU, loaded by the crate `fmi`.
///
/// That crate has no function for the derivatives of inputs and outputs. So the description says
/// that the FMU has none, and the master holds its inputs. Its instances are bound to a thread, so
/// each has a thread of its own.
pub struct FmiSlave {
    jobs: Option<Sender<Job>>,
    thread: Option<JoinHandle<()>>,
    description: ModelDescription,
}

type Job = Box<dyn FnOnce(&mut InstanceCS) + Send>;
/// The outcome of opening: success, a refusal, or the message of a panic.
type Opened = Result<Result<(), Box<fmi::Error>>, String>;

impl FmiSlave {
    /// Opens the FMU at `path` and instantiates it as `name`.
    ///
    /// # Errors
    ///
    /// [`FmiCrateError`]: the FMU cannot be opened, the crate does not understand the model
    /// description, or the FMU refuses the instance.
    ///
    /// # Panics
    ///
    /// If no thread can be started.
    pub fn open(path: &Path, name: &str) -> Result<Self, FmiCrateError> {
        let mut description = Fmu::open(path)?.description().clone();
        if let Some(co_simulation) = &mut description.co_simulation {
            co_simulation.can_interpolate_inputs = false;
            co_simulation.max_output_derivative_order = 0;
        }
        let (name, path) = (name.replace('\0', ""), path.to_owned());
        let (jobs, waiting) = channel();
        let (tell, opened) = channel();
        let file = path.clone();
        let thread = thread::spawn(move || serve(&file, &name, &tell, &waiting));
        match opened.recv().expect("the thread answers") {
            Ok(Ok(())) => Ok(Self { jobs: Some(jobs), thread: Some(thread), description }),
            Ok(Err(source)) => Err(FmiCrateError::Refused { path, source }),
            Err(message) => Err(FmiCrateError::Panic { path, message }),
        }
    }

    fn call<T: Send + 'static>(
        &mut self,
        function: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error> + Send + 'static,
    ) -> Result<T, CallError> {
        let (tell, done) = channel();
        let job: Job = Box::new(move |instance| {
            // If the slave has been dropped, nobody receives the answer.
            let _ = tell.send(fenced(|| call(instance)));
        });
        let jobs = self.jobs.as_ref().expect("open until it is dropped");
        jobs.send(job).expect("the thread lives");
        let status = match done.recv().expect("the thread answers") {
            Ok(Ok(done)) => return Ok(done),
            Ok(Err(Fmi2Error::Discard)) => Status::Discard,
            Ok(Err(Fmi2Error::Fatal)) => Status::Fatal,
            Ok(Err(Fmi2Error::Error | Fmi2Error::TypesPlatformMismatch(_))) => Status::Error,
            // The crate knows neither fmi2Pending nor statuses that the standard does not have.
            Err(message) => {
                let (failure, messages) = (Failure::Panicked(message), Vec::new());
                return Err(CallError { function, failure, messages });
            }
        };
        Err(CallError { function, failure: Failure::Status(status), messages: Vec::new() })
    }
}

/// The thread of an instance: opens the instance, then does its jobs until the channel is closed.
fn serve(path: &Path, name: &str, tell: &Sender<Opened>, jobs: &Receiver<Job>) {
    let opened = fenced(|| {
        let folder: Fmi2Import = fmi::import::from_path(path)?;
        let instance = folder.instantiate_cs(name, false, false)?;
        Ok((instance, folder))
    });
    // The instance is freed before its folder is removed.
    let (mut instance, _folder) = match opened {
        Ok(Ok(both)) => both,
        Ok(Err(error)) => return drop(tell.send(Ok(Err(Box::new(error))))),
        Err(message) => return drop(tell.send(Err(message))),
    };
    let _ = tell.send(Ok(Ok(())));
    for job in jobs {
        job(&mut instance);
    }
    drop(instance);
}

impl Drop for FmiSlave {
    fn drop(&mut self) {
        drop(self.jobs.take());
        if let Some(thread) = self.thread.take() {
            // A panic during freeing has already been printed.
            let _ = thread.join();
        }
    }
}

/// The result of `action`, or the message of its panic.
fn fenced<T>(action: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(action)).map_err(|payload| {
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        text.unwrap_or("without a message").to_owned()
    })
}

/// Methods that read and write values of one type.
macro_rules! values {
    ($($get:ident $set:ident $type:ty as $converted:ty, $read:literal $write:literal;)*) => {$(
        fn $get(&mut self, references: &[u32], values: &mut [$type]) -> Result<(), CallError> {
            let (references, mut buffer) =
                (references.to_vec(), vec![<$converted>::default(); values.len()]);
            let read = self.call($read, move |instance| {
                instance.$get(&references, &mut buffer).map(|_| buffer)
            })?;
            for (value, converted) in values.iter_mut().zip(read) {
                *value = converted.into();
            }
            Ok(())
        }

        fn $set(&mut self, references: &[u32], values: &[$type]) -> Result<(), CallError> {
            let references = references.to_vec();
            // A test sets values of the type of the FMU only.
            let values: Vec<$converted> =
                values.iter().map(|value| (*value).try_into().unwrap_or_default()).collect();
            self.call($write, move |instance| instance.$set(&references, &values).map(drop))
        }
    )*};
}

impl Slave for FmiSlave {
    values! {
        get_real set_real f64 as f64, "fmi2GetReal" "fmi2SetReal";
        get_integer set_integer i64 as i32, "fmi2GetInteger" "fmi2SetInteger";
        get_boolean set_boolean i32 as i32, "fmi2GetBoolean" "fmi2SetBoolean";
    }

    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        let Experiment { start_time, stop_time, tolerance } = *experiment;
        self.call("fmi2SetupExperiment", move |instance| {
            instance.setup_experiment(tolerance, start_time, stop_time).map(drop)
        })
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        self.call("fmi2EnterInitializationMode", |instance| {
            instance.enter_initialization_mode().map(drop)
        })
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.call("fmi2ExitInitializationMode", |instance| {
            instance.exit_initialization_mode().map(drop)
        })
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.call("fmi2Terminate", |instance| instance.terminate().map(drop))
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        let text = |value: &String| CString::new(value.replace('\0', "")).unwrap_or_default();
        let values: Vec<_> = values.iter().map(text).collect();
        let references = references.to_vec();
        self.call("fmi2SetString", move |instance| {
            instance.set_string(&references, &values).map(drop)
        })
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        self.call("fmi2DoStep", move |instance| {
            instance.do_step(time, size, never_back).map(drop)
        })?;
        Ok(StepResult::Whole)
    }
}
