//! FMUs: an opened archive, and its instances as [`Slave`]s.

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
    /// One instance is all that it can have in a process.
    #[error(
        "{instance}: {model} can be instantiated only once per process \
         (canBeInstantiatedOnlyOncePerProcess), and it has been; with --isolate each instance gets \
         a process of its own"
    )]
    OnlyOnce {
        /// Name of the second instance.
        instance: String,
        /// `modelName`.
        model: String,
    },
    /// There is no interface in it, or not the one wanted.
    #[error(
        "{path}: the FMU lacks an interface, expected the element CoSimulation or ModelExchange"
    )]
    NoInterface {
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
    /// For co-simulation; none where the FMU has model exchange only.
    library: Option<Arc<Library>>,
    unpacked: Unpacked,
    /// Whether there has been an instance.
    instantiated: AtomicBool,
    /// Positions of variables by type and value reference, made when a message needs one.
    names: OnceLock<HashMap<(char, u32), usize>>,
}

impl Fmu {
    /// Unpacks the FMU at `path`, which may also be a folder with an unpacked one, reads its
    /// description and loads its library for co-simulation.
    ///
    /// # Errors
    ///
    /// [`FmuError`]: not an FMU of version 2.0, no co-simulation, no library for this platform, or
    /// a library that does not load.
    pub fn open(path: &Path) -> Result<Self, FmuError> {
        let fmu = Self::open_any(path)?;
        if fmu.content.library.is_none() {
            return Err(FmuError::NoCoSimulation { path: path.to_owned() });
        }
        Ok(fmu)
    }

    /// As [`Fmu::open`], without warnings about what is odd in the FMU.
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

    /// As [`Fmu::open`] for an FMU to `linearise`, where model exchange alone will do.
    ///
    /// # Errors
    ///
    /// Those of [`Fmu::open`]; [`FmuError::NoInterface`] where the FMU has neither interface.
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

    /// The names of the variables, for messages: of an alias the one that is declared first.
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

    /// An instance for `interface`, by its C functions.
    ///
    /// # Errors
    ///
    /// [`CallError`]: the function is missing, or the FMU returns neither `fmi2OK` nor `fmi2Warning`.
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
        let made = library.instantiate(interface, name, &description.guid, &resources, names);
        made.map_err(|error| explained(description, error))
    }
}

/// The letter by which messages name a type (section 2.1.5).
fn letter(kind: &Kind) -> char {
    match kind {
        Kind::Real(_) => 'r',
        Kind::Integer(_) | Kind::Enumeration(_) => 'i',
        Kind::Boolean(_) => 'b',
        Kind::String(_) => 's',
    }
}

fn open_library(
    description: &ModelDescription,
    path: &Path,
    interface: Interface,
) -> Result<Arc<Library>, FmuError> {
    let library = Library::open(path, interface);
    Ok(Arc::new(library.map_err(|error| explained(description, error))?))
}

/// `error`, with the tool that the FMU says it needs.
fn explained(description: &ModelDescription, error: LoadError) -> FmuError {
    let simulation = description.co_simulation.as_ref().map(|flags| flags.needs_execution_tool);
    let exchange = description.model_exchange.as_ref().map(|flags| flags.needs_execution_tool);
    if simulation != Some(true) && exchange != Some(true) {
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
        inputs: (&[u32], &[f64]),
        span: (f64, f64),
        never_back: bool,
        outputs: (&[u32], &mut [f64]),
    ) -> Result<StepResult, CallError> {
        self.component.pass(inputs, span, never_back, outputs)
    }

    fn take_warning(&mut self) -> bool {
        self.component.take_warning()
    }
}

impl Instance {
    /// The FMU that it is of.
    #[must_use]
    pub fn fmu(&self) -> &Fmu {
        &self.fmu
    }

    /// How long an answer of `fmi2Pending` is waited for; none: as long as it takes.
    pub fn set_time_limit(&mut self, limit: Option<Duration>) {
        self.component.time_limit = limit;
    }
}
