//! FMUs: an opened archive, and its instances as [`Slave`]s.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fmi2::Experiment;
use fmi2::description::ModelDescription;
use fmi2::location::{LocationError, file_uri};
use fmi2::package::{PackageError, Unpacked};

use crate::error::LoadError;
use crate::library::{Component, Library};
use crate::slave::{CallError, Slave};

/// Why an FMU could not be opened or instantiated.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// The archive or its model description.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The place it was unpacked to cannot be written as a URI.
    #[error(transparent)]
    Location(#[from] LocationError),
    /// The library.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// There is no co-simulation in it.
    #[error("{path}: the FMU offers no co-simulation, expected the element CoSimulation")]
    NoCoSimulation {
        /// The FMU.
        path: PathBuf,
    },
    /// The library fails, and `needsExecutionTool` may be why.
    #[error("{source}\nneedsExecutionTool is true: the FMU may run only beside {tool}")]
    NeedsTool {
        /// `generationTool`, or a word for it.
        tool: String,
        /// What failed.
        source: LoadError,
    },
}

impl From<PackageError> for FmuError {
    fn from(error: PackageError) -> Self {
        FmuError::Package(Box::new(error))
    }
}

/// An opened FMU: unpacked for as long as it or an instance of it lives.
#[derive(Clone)]
pub struct Fmu {
    content: Arc<Content>,
}

/// The library is unloaded before its file is removed: the fields are dropped in this order.
struct Content {
    library: Arc<Library>,
    unpacked: Unpacked,
}

impl Fmu {
    /// Unpacks the FMU at `path`, reads its description and loads its library.
    ///
    /// # Errors
    ///
    /// [`FmuError`]: not an FMU of version 2.0, no co-simulation, no library for this platform, or
    /// a library that does not load.
    pub fn open(path: &Path) -> Result<Self, FmuError> {
        let unpacked = Unpacked::open(path)?;
        let description = &unpacked.description;
        let Some(co_simulation) = &description.co_simulation else {
            return Err(FmuError::NoCoSimulation { path: path.to_owned() });
        };
        let library = unpacked.library(&co_simulation.model_identifier)?;
        let library = Library::open(&library).map_err(|error| explained(description, error))?;
        let library = Arc::new(library);
        Ok(Self { content: Arc::new(Content { library, unpacked }) })
    }

    /// The model description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.content.unpacked.description
    }

    /// An instance called `name`.
    ///
    /// # Errors
    ///
    /// [`LoadError::Instantiate`] with what the FMU said.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        let resources = file_uri(&self.content.unpacked.resources())?;
        let guid = &self.description().guid;
        let made = self.content.library.instantiate(name, guid, &resources);
        let component = made.map_err(|error| explained(self.description(), error))?;
        Ok(Instance { component, fmu: self.clone() })
    }
}

/// `error`, with the tool that the FMU says it needs.
fn explained(description: &ModelDescription, error: LoadError) -> FmuError {
    if !description.co_simulation.as_ref().is_some_and(|flags| flags.needs_execution_tool) {
        return FmuError::Load(error);
    }
    let tool = description.generation_tool.clone();
    let tool = tool.unwrap_or_else(|| "the tool that exported it".to_owned());
    FmuError::NeedsTool { tool, source: error }
}

/// An instance of an FMU, by its C functions.
pub struct Instance {
    component: Component,
    fmu: Fmu,
}

impl Slave for Instance {
    fn description(&self) -> &ModelDescription {
        self.fmu.description()
    }

    fn setup_experiment(&mut self, experiment: &Experiment) -> Result<(), CallError> {
        self.component.setup_experiment(experiment)
    }

    fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        self.component.enter_initialization_mode()
    }

    fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        self.component.exit_initialization_mode()
    }

    fn terminate(&mut self) -> Result<(), CallError> {
        self.component.terminate()
    }

    fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallError> {
        self.component.get_real(references, values)
    }

    fn set_real(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallError> {
        self.component.set_real(references, values)
    }

    fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.component.get_integer(references, values)
    }

    fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.component.set_integer(references, values)
    }

    fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Result<(), CallError> {
        self.component.get_boolean(references, values)
    }

    fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Result<(), CallError> {
        self.component.set_boolean(references, values)
    }

    fn set_string(&mut self, reference: u32, value: &str) -> Result<(), CallError> {
        self.component.set_string(reference, value)
    }

    fn set_input_slopes(&mut self, references: &[u32], slopes: &[f64]) -> Result<(), CallError> {
        self.component.set_input_slopes(references, slopes)
    }

    fn get_output_slopes(
        &mut self,
        references: &[u32],
        slopes: &mut [f64],
    ) -> Result<(), CallError> {
        self.component.get_output_slopes(references, slopes)
    }

    fn do_step(&mut self, time: f64, size: f64) -> Result<(), CallError> {
        self.component.do_step(time, size)
    }
}
