//! An opened FMU archive and its instances, which implement [`Slave`].

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use fmu_description::Experiment;
use fmu_description::location::{LocationError, file_uri};
use fmu_description::package::{PackageError, Unpacked};
use fmu_description::{Kind, ModelDescription};

use crate::error::LoadError;
use crate::library::{Component, Interface, Library, Names};
use slave::{CallError, Slave, StepResult};

/// Why an FMU could not be opened or instantiated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FmuError {
    /// The archive or its model description cannot be read.
    #[error(transparent)]
    Package(Box<PackageError>),
    /// The path of the unpacked resources cannot be written as a URI.
    #[error(transparent)]
    Location(#[from] LocationError),
    /// The library cannot be loaded or instantiated.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The FMU has no co-simulation interface.
    #[error("{path}: the FMU offers no co-simulation, expected the element CoSimulation")]
    NoCoSimulation {
        /// The FMU.
        path: PathBuf,
    },
    /// The FMU sets `canBeInstantiatedOnlyOncePerProcess` and already has an instance.
    #[error(
        "{instance}: {model} can be instantiated only once per process \
         (canBeInstantiatedOnlyOncePerProcess) and already has an instance; --isolate runs each \
         instance in a process of its own"
    )]
    OnlyOnce {
        /// Name of the second instance.
        instance: String,
        /// `modelName`.
        model: String,
    },
    /// The FMU has no interface, or lacks the requested one.
    #[error(
        "{path}: the FMU lacks an interface, expected the element CoSimulation or ModelExchange"
    )]
    NoInterface {
        /// The FMU.
        path: PathBuf,
    },
    /// The library fails; a possible cause is `needsExecutionTool`.
    #[error("{source}\nneedsExecutionTool is true: the FMU may need {tool} to be installed")]
    NeedsTool {
        /// `generationTool`, or a description if the attribute is absent.
        tool: String,
        /// The failure.
        source: LoadError,
    },
}

impl From<PackageError> for FmuError {
    fn from(error: PackageError) -> Self {
        FmuError::Package(Box::new(error))
    }
}

/// An opened FMU. Its unpacked files are removed when it and all its instances have been dropped.
#[derive(Clone)]
pub struct Fmu {
    content: Arc<Content>,
}

/// The library and the unpacked files of an FMU.
///
/// Fields are dropped in this order, which unloads the library before its file is removed.
struct Content {
    /// The library for co-simulation; `None` if the FMU offers model exchange only.
    library: Option<Arc<Library>>,
    unpacked: Unpacked,
    /// Whether an instance has been created.
    instantiated: AtomicBool,
    /// Positions of variables by type and value reference; filled at the first message that needs one.
    names: OnceLock<HashMap<(char, u32), usize>>,
}

impl Fmu {
    /// Unpacks the FMU at `path`, reads its description and loads its library for co-simulation.
    /// `path` is an archive or a folder with an unpacked FMU.
    ///
    /// # Errors
    ///
    /// [`FmuError`] if the FMU is not of version 2.0, has no co-simulation interface or no library
    /// for this platform, or if the library does not load.
    pub fn open(path: &Path) -> Result<Self, FmuError> {
        let fmu = Self::open_any(path)?;
        if fmu.content.library.is_none() {
            return Err(FmuError::NoCoSimulation { path: path.to_owned() });
        }
        Ok(fmu)
    }

    /// Opens an FMU like [`Fmu::open`], but does not log warnings about the archive and the
    /// description.
    ///
    /// # Errors
    ///
    /// Same as [`Fmu::open`].
    pub fn open_quietly(path: &Path) -> Result<Self, FmuError> {
        let unpacked =
            if path.is_dir() { Unpacked::in_folder(path)? } else { Unpacked::open(path)? };
        let fmu = Self::load(path, unpacked)?;
        if fmu.content.library.is_none() {
            return Err(FmuError::NoCoSimulation { path: path.to_owned() });
        }
        Ok(fmu)
    }

    /// Opens an FMU like [`Fmu::open`], but also accepts one that offers model exchange only.
    ///
    /// # Errors
    ///
    /// [`FmuError`] if the FMU is not of version 2.0, has neither interface
    /// ([`FmuError::NoInterface`]) or no library for this platform, or if the library does not load.
    pub fn open_any(path: &Path) -> Result<Self, FmuError> {
        let unpacked =
            if path.is_dir() { Unpacked::in_folder(path)? } else { Unpacked::open(path)? };
        for warning in &unpacked.archive_warnings {
            tracing::warn!("{}: {warning}", path.display());
        }
        for warning in &unpacked.warnings {
            tracing::warn!("{}: {warning}", path.display());
        }
        Self::load(path, unpacked)
    }

    fn load(path: &Path, unpacked: Unpacked) -> Result<Self, FmuError> {
        let description = &unpacked.description;
        if description.co_simulation.is_none() && description.model_exchange.is_none() {
            return Err(FmuError::NoInterface { path: path.to_owned() });
        }
        let library = description.co_simulation.as_ref().map(|flags| {
            let library = unpacked.library(&flags.model_identifier)?;
            open_library(description, &library, Interface::CoSimulation)
        });
        let library = library.transpose()?;
        let (instantiated, names) = (AtomicBool::new(false), OnceLock::new());
        Ok(Self { content: Arc::new(Content { library, unpacked, instantiated, names }) })
    }

    /// Returns the model description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.content.unpacked.description
    }

    /// Creates a co-simulation instance called `name`.
    ///
    /// # Errors
    ///
    /// [`FmuError::OnlyOnce`] for a forbidden second instance; [`LoadError::Instantiate`] with the
    /// FMU's messages if `fmi2Instantiate` fails; [`FmuError::NoInterface`] without co-simulation.
    pub fn instantiate(&self, name: &str) -> Result<Instance, FmuError> {
        let description = self.description();
        let once = description.co_simulation.as_ref();
        let once = once.is_some_and(|flags| flags.can_be_instantiated_only_once_per_process);
        if once && self.content.instantiated.swap(true, Ordering::Relaxed) {
            let (instance, model) = (name.to_owned(), description.model_name.clone());
            return Err(FmuError::OnlyOnce { instance, model });
        }
        let component = self.component(Interface::CoSimulation, name)?;
        Ok(Instance { component, fmu: self.clone() })
    }

    /// Returns the lookup of variable names for messages. Of several aliases it gives the one declared
    /// first.
    fn names(&self) -> Names {
        let content = self.content.clone();
        Arc::new(move |kind, reference| {
            let variables = &content.unpacked.description.variables;
            let by_reference = content.names.get_or_init(|| {
                let mut found = HashMap::new();
                for (position, variable) in variables.iter().enumerate() {
                    let key = (letter(&variable.kind), variable.value_reference);
                    found.entry(key).or_insert(position);
                }
                found
            });
            by_reference.get(&(kind, reference)).map(|position| variables[*position].name.clone())
        })
    }

    /// Creates an instance for `interface`, with access to its C functions.
    ///
    /// # Errors
    ///
    /// [`FmuError::NoInterface`] if the FMU lacks `interface`; [`LoadError`] if the library does not load
    /// or `fmi2Instantiate` fails.
    pub fn component(&self, interface: Interface, name: &str) -> Result<Component, FmuError> {
        let unpacked = &self.content.unpacked;
        let description = &unpacked.description;
        let library = match (interface, &self.content.library, &description.model_exchange) {
            (Interface::CoSimulation, Some(library), _) => library.clone(),
            (Interface::ModelExchange, _, Some(flags)) => {
                let library = unpacked.library(&flags.model_identifier)?;
                open_library(description, &library, interface)?
            }
            _ => return Err(FmuError::NoInterface { path: unpacked.folder().to_owned() }),
        };
        let resources = file_uri(&unpacked.resources())?;
        let names = self.names();
        let component = library.instantiate(interface, name, &description.guid, &resources, names);
        component.map_err(|error| with_tool_hint(description, error))
    }
}

/// Returns the letter of a type in the messages of an FMU (section 2.1.5).
fn letter(kind: &Kind) -> char {
    match kind {
        Kind::Real(_) => 'r',
        Kind::Boolean(_) => 'b',
        Kind::String(_) => 's',
        _ => 'i',
    }
}

fn open_library(
    description: &ModelDescription,
    path: &Path,
    interface: Interface,
) -> Result<Arc<Library>, FmuError> {
    let library = Library::open(path, interface);
    Ok(Arc::new(library.map_err(|error| with_tool_hint(description, error))?))
}

/// Adds the tool that the FMU declares to need (`needsExecutionTool`) to `error`.
fn with_tool_hint(description: &ModelDescription, error: LoadError) -> FmuError {
    let simulation = description.co_simulation.as_ref().map(|flags| flags.needs_execution_tool);
    let exchange = description.model_exchange.as_ref().map(|flags| flags.needs_execution_tool);
    if simulation != Some(true) && exchange != Some(true) {
        return FmuError::Load(error);
    }
    let tool = description.generation_tool.clone();
    let tool = tool.unwrap_or_else(|| "the tool that exported it".to_owned());
    FmuError::NeedsTool { tool, source: error }
}

/// A co-simulation instance of an FMU in this process.
pub struct Instance {
    component: Component,
    fmu: Fmu,
}

impl Slave for Instance {
    fn description(&self) -> &ModelDescription {
        self.fmu.description()
    }

    fn set_debug_logging(&mut self, on: bool) -> Result<(), CallError> {
        self.component.set_debug_logging(on)
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

    fn get_string(&mut self, references: &[u32], values: &mut [String]) -> Result<(), CallError> {
        self.component.get_string(references, values)
    }

    fn set_string(&mut self, references: &[u32], values: &[String]) -> Result<(), CallError> {
        self.component.set_string(references, values)
    }

    fn set_input_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        self.component.set_real_input_derivatives(references, orders, values)
    }

    fn get_output_derivatives(
        &mut self,
        references: &[u32],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        self.component.get_real_output_derivatives(references, orders, values)
    }

    fn do_step(&mut self, time: f64, size: f64, never_back: bool) -> Result<StepResult, CallError> {
        self.component.do_step(time, size, never_back)
    }

    fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        changes: &mut [f64],
    ) -> Result<(), CallError> {
        self.component.directional_derivative(unknowns, knowns, seed, changes)
    }

    fn save_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.save_state(slot)
    }

    fn restore_state(&mut self, slot: usize) -> Result<(), CallError> {
        self.component.restore_state(slot)
    }

    fn serialize_state(&mut self) -> Result<Vec<u8>, CallError> {
        self.component.serialize_state()
    }

    fn deserialize_state(&mut self, bytes: &[u8]) -> Result<(), CallError> {
        self.component.deserialize_state(bytes)
    }

    fn pass(
        &mut self,
        inputs: &[u32],
        values: &[f64],
        span: (f64, f64),
        never_back: bool,
        outputs: &[u32],
        results: &mut [f64],
    ) -> Result<StepResult, CallError> {
        self.component.pass(inputs, values, span, never_back, outputs, results)
    }

    fn take_warning(&mut self) -> bool {
        self.component.take_warning()
    }
}

impl Instance {
    /// Returns the FMU of this instance.
    #[must_use]
    pub fn fmu(&self) -> &Fmu {
        &self.fmu
    }

    /// Limits how long a step that returned `fmi2Pending` may take; `None`: no limit.
    pub fn set_time_limit(&mut self, limit: Option<Duration>) {
        self.component.time_limit = limit;
    }
}
