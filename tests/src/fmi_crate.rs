//! The second way in: FMUs through the crate `fmi`, as an independent check of our own loader.
//!
//! What that crate does not do well is kept away from it. [`Fmu::open`] goes first: its model
//! description is the one in use, and it refuses archives that lead out of their folder and
//! libraries that lack a function which no instance can do without. Panics of the crate become
//! errors: it panics where another function is called that the library lacks.
//!
//! Two things stay as they are. The FMU's messages go to the crate `log` and are not in the
//! errors. An FMU that logs with a null category, or with the status `fmi2Pending`, ends the
//! process; logging is therefore off, as it is with our own loader.

use std::ffi::CString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use fmi::fmi2::Fmi2Error;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation as _, Common, InstanceCS};
use fmu_description::Experiment;
use fmu_description::ModelDescription;
use fmu_description::abi::Status;

use crate::fmu::{Fmu, FmuError};
use crate::slave::{CallError, Failure, Slave, Stepped};

/// Why an FMU could not be opened or instantiated through the crate `fmi`.
#[derive(Debug, thiserror::Error)]
pub enum FmiCrateError {
    /// Our own loader refuses it already.
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
        /// What it panics with.
        message: String,
    },
}

/// An instance of an FMU, by the crate `fmi`.
///
/// That crate has no function for the derivatives of inputs and outputs. So the description says
/// that the FMU has none, whatever it says itself, and the master holds its inputs.
pub struct FmiSlave {
    // Freed before its folder goes.
    instance: InstanceCS,
    _folder: Fmi2Import,
    description: ModelDescription,
}

impl FmiSlave {
    /// Opens the FMU at `path` and instantiates it as `name`.
    ///
    /// # Errors
    ///
    /// [`FmiCrateError`]: as [`Fmu::open`], and where the crate does not understand the model
    /// description or the FMU refuses the instance.
    pub fn open(path: &Path, name: &str) -> Result<Self, FmiCrateError> {
        let mut description = Fmu::open(path)?.description().clone();
        if let Some(co_simulation) = &mut description.co_simulation {
            co_simulation.can_interpolate_inputs = false;
            co_simulation.max_output_derivative_order = 0;
        }
        let name = name.replace('\0', "");
        let opened = fenced(|| {
            let folder: Fmi2Import = fmi::import::from_path(path)?;
            let instance = folder.instantiate_cs(&name, false, false)?;
            Ok((instance, folder))
        });
        let path = path.to_owned();
        match opened {
            Ok(Ok((instance, folder))) => Ok(Self { instance, _folder: folder, description }),
            Ok(Err(source)) => Err(FmiCrateError::Refused { path, source: Box::new(source) }),
            Err(message) => Err(FmiCrateError::Panic { path, message }),
        }
    }

    fn call<T>(
        &mut self,
        function: &'static str,
        call: impl FnOnce(&mut InstanceCS) -> Result<T, Fmi2Error>,
    ) -> Result<(), CallError> {
        let status = match fenced(|| call(&mut self.instance)) {
            Ok(Ok(_)) => return Ok(()),
            Ok(Err(Fmi2Error::Discard)) => Status::Discard,
            Ok(Err(Fmi2Error::Fatal)) => Status::Fatal,
            Ok(Err(Fmi2Error::Error | Fmi2Error::TypesPlatformMismatch(_))) => Status::Error,
            // The crate knows no fmi2Pending, nor what the standard does not know.
            Err(message) => {
                let (failure, messages) = (Failure::Panicked(message), Vec::new());
                return Err(CallError { function, failure, messages });
            }
        };
        Err(CallError { function, failure: Failure::Status(status), messages: Vec::new() })
    }
}

/// The result of `action`, or what it panicked with.
fn fenced<T>(action: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(action)).map_err(|payload| {
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        text.unwrap_or("without a message").to_owned()
    })
}

impl Slave for FmiSlave {
    fn description(&self) -> &ModelDescription {
        &self.description
    }

    fn setup_experiment(&mut self, e: &Experiment) -> Result<(), CallError> {
        self.call("fmi2SetupExperiment", |instance| {
            instance.setup_experiment(e.tolerance, e.start_time, e.stop_time)
        })
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        self.call("fmi2EnterInitializationMode", Common::enter_initialization_mode)
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.call("fmi2ExitInitializationMode", Common::exit_initialization_mode)
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.call("fmi2Terminate", Common::terminate)
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.call("fmi2GetReal", |instance| instance.get_real(references, values))
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.call("fmi2SetReal", |instance| instance.set_real(references, values))
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.call("fmi2GetInteger", |instance| instance.get_integer(references, values))
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call("fmi2SetInteger", |instance| instance.set_integer(references, values))
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.call("fmi2GetBoolean", |instance| instance.get_boolean(references, values))
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.call("fmi2SetBoolean", |instance| instance.set_boolean(references, values))
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        let text = |value: &String| CString::new(value.replace('\0', "")).unwrap_or_default();
        let values: Vec<_> = values.iter().map(text).collect();
        self.call("fmi2SetString", |instance| instance.set_string(references, &values))
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<Stepped, CallError> {
        self.call("fmi2DoStep", |instance| instance.do_step(time, size, never_back))?;
        Ok(Stepped::Whole)
    }
}
