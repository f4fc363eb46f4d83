//! An opened FMU archive, which creates instances.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use fmu_description::location::LocationError;
use fmu_description::package::{PackageError, Unpacked};
use fmu_description::{Kind, ModelDescription, Version};

use crate::error::LoadError;
use crate::library::{Binding, Interface, Library, Loading, Names, v1, v3};

/// Why an FMU could not be opened or instantiated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
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
    /// The FMU offers neither co-simulation nor scheduled execution.
    #[error("{path}: the FMU offers no co-simulation, expected the element CoSimulation")]
    NoCoSimulation { path: PathBuf },
    /// The FMU sets `canBeInstantiatedOnlyOncePerProcess` and already has an instance.
    #[error(
        "{instance}: {model} can be instantiated only once per process \
         (canBeInstantiatedOnlyOncePerProcess) and already has an instance; --isolate runs each \
         instance in a process of its own"
    )]
    OnlyOnce { instance: String, model: String },
    /// The FMU has no interface, or lacks the requested one.
    #[error("{path}: the FMU lacks an interface, expected the element {expected}")]
    NoInterface { path: PathBuf, expected: &'static str },
    /// The library of an FMU with `needsExecutionTool` does not load or instantiate; the missing tool may be the cause.
    #[error("the FMU may need {tool} to be installed (needsExecutionTool is true)\n{source}")]
    NeedsTool {
        /// `generationTool`, or a description if the attribute is absent.
        tool: String,
        source: LoadError,
    },
}

impl From<PackageError> for FmuError {
    fn from(error: PackageError) -> Self {
        FmuError::Package(Box::new(error))
    }
}

/// An opened FMU. The unpacked files are removed after the drop of the FMU and all its instances.
#[derive(Clone)]
pub struct Fmu {
    pub(crate) content: Arc<Content>,
}

/// The reservation of an FMU that allows one instance only (`canBeInstantiatedOnlyOncePerProcess`). After the drop of
/// this reservation another instance may be created.
pub(crate) struct OnlyInstance(Arc<Content>);

impl Drop for OnlyInstance {
    fn drop(&mut self) {
        self.0.instantiated.store(false, Ordering::Relaxed);
    }
}

/// The library and the unpacked files of an FMU.
///
/// Fields are dropped in the order of their declaration: the library is unloaded before its file is removed.
pub(crate) struct Content {
    /// The library for co-simulation or scheduled execution; `None` if the FMU offers model exchange only.
    library: Option<AnyLibrary>,
    pub(crate) unpacked: Unpacked,
    /// The name of the FMU's file or folder, for messages.
    name: String,
    binding: Binding,
    /// Whether the only instance of an FMU that allows one instance only exists.
    instantiated: AtomicBool,
    /// Positions of variables by type and value reference; filled by the first message that refers to a variable.
    names: OnceLock<HashMap<(char, u32), usize>>,
}

/// The library of an FMU for one interface, in the version of the FMU.
#[derive(Clone)]
pub(crate) enum AnyLibrary {
    V1(Arc<v1::Library>),
    V2(Arc<Library>),
    V3(Arc<v3::Library>),
}

impl Fmu {
    /// Unpacks the FMU at `path`, reads its description and loads its library for co-simulation or, if the FMU does not
    /// offer co-simulation, for scheduled execution. `path` is an archive or a folder with an unpacked FMU.
    ///
    /// # Errors
    ///
    /// Same as [`Fmu::open_any`], and [`FmuError::NoCoSimulation`] if the FMU offers model exchange only.
    pub fn open(path: &Path) -> Result<Self, FmuError> {
        let fmu = Self::open_any(path)?;
        if fmu.content.library.is_none() {
            return Err(FmuError::NoCoSimulation { path: path.to_owned() });
        }
        Ok(fmu)
    }

    /// Opens an FMU like [`Fmu::open_any`], but does not log warnings about the archive and the description.
    ///
    /// # Errors
    ///
    /// Same as [`Fmu::open_any`].
    pub fn open_quietly(path: &Path) -> Result<Self, FmuError> {
        Self::load(path, unpack(path)?, Binding::Lenient)
    }

    /// Like [`Fmu::open_quietly`], for a `folder`; refuses a library that calls functions that no library defines.
    #[cfg(target_os = "linux")]
    pub(crate) fn open_strictly(folder: &Path) -> Result<Self, FmuError> {
        Self::load(folder, Unpacked::in_folder(folder)?, Binding::Strict)
    }

    /// Opens an FMU like [`Fmu::open`], but also accepts an FMU that offers model exchange only. The library for model
    /// exchange is loaded with each instance.
    ///
    /// # Errors
    ///
    /// [`FmuError`] if the FMU cannot be read, is not of version 1.0, 2.0 or 3.0, has no interface
    /// ([`FmuError::NoInterface`]), or offers co-simulation or scheduled execution, but has no library for this
    /// platform or one that does not load.
    pub fn open_any(path: &Path) -> Result<Self, FmuError> {
        let unpacked = unpack(path)?;
        for warning in warnings(&unpacked) {
            tracing::warn!("{}: {warning}", path.display());
        }
        Self::load(path, unpacked, Binding::Lenient)
    }

    fn load(path: &Path, unpacked: Unpacked, binding: Binding) -> Result<Self, FmuError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let description = &unpacked.description;
        let stepped = description.stepped();
        if stepped.is_none() && description.model_exchange.is_none() {
            let expected = "CoSimulation or ModelExchange";
            return Err(FmuError::NoInterface { path: path.to_owned(), expected });
        }
        let library = stepped.map(|flags| {
            let library = unpacked.library(&flags.model_identifier)?;
            let loading = Loading { path: &library, fmu: &name, binding };
            open_library(description, &loading, &flags.model_identifier, Interface::CoSimulation)
        });
        let library = library.transpose()?;
        let (instantiated, names) = (AtomicBool::new(false), OnceLock::new());
        let content = Content { library, unpacked, name, binding, instantiated, names };
        Ok(Self { content: Arc::new(content) })
    }

    /// Returns the model description.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.content.unpacked.description
    }

    /// Returns the description whose variables the instances have. This is [`Fmu::description`] with a variable for
    /// each element of an array at the start values of its structural parameters (FMI 3.0), and a separate value
    /// reference for each negated alias (FMI 1.0). An array whose elements are listed as scalars, too, is left out.
    ///
    /// # Errors
    ///
    /// [`LoadError::Unsupported`] if the arrays have too many elements, if the size of an array is not known, if an
    /// element has the name of another variable, or if an array has the value reference of a scalar or of an array with
    /// another number of elements.
    pub fn elements(&self) -> Result<ModelDescription, FmuError> {
        let description = self.description();
        let scalar = scalar_description(description, &HashMap::new()).map_err(|reason| {
            LoadError::Unsupported { model: description.model_name.clone(), reason }
        })?;
        Ok(scalar.unwrap_or_else(|| description.clone()))
    }

    /// Returns the library for `interface`; the library for model exchange is loaded by this call. The error for a
    /// missing interface states the file name of the FMU, because its folder may be temporary.
    pub(crate) fn library(&self, interface: Interface) -> Result<AnyLibrary, FmuError> {
        let Content { library, unpacked, name, binding, .. } = &*self.content;
        let description = &unpacked.description;
        let expected = match (interface, description.version()) {
            (Interface::ModelExchange, _) => "ModelExchange",
            (Interface::CoSimulation, Version::V3) => "CoSimulation or ScheduledExecution",
            (Interface::CoSimulation, _) => "CoSimulation",
        };
        let missing = || FmuError::NoInterface { path: PathBuf::from(name), expected };
        match interface {
            Interface::CoSimulation => library.clone().ok_or_else(missing),
            Interface::ModelExchange => {
                let identifier =
                    &description.model_exchange.as_ref().ok_or_else(missing)?.model_identifier;
                let path = unpacked.library(identifier)?;
                let loading = Loading { path: &path, fmu: name, binding: *binding };
                open_library(description, &loading, identifier, interface)
            }
        }
    }

    /// Reserves an FMU that allows one instance only for `name`; [`FmuError::OnlyOnce`] if it is reserved.
    pub(crate) fn occupy(&self, name: &str) -> Result<OnlyInstance, FmuError> {
        if self.content.instantiated.swap(true, Ordering::Relaxed) {
            let (instance, model) = (name.to_owned(), self.description().model_name.clone());
            return Err(FmuError::OnlyOnce { instance, model });
        }
        Ok(OnlyInstance(self.content.clone()))
    }

    /// Returns the lookup of variable names for messages of the FMU. Of several aliases it returns the one declared
    /// first.
    pub(crate) fn names(&self) -> Names {
        let content = self.content.clone();
        Arc::new(move |kind, reference| {
            let variables = &content.unpacked.description.variables;
            let by_reference = content.names.get_or_init(|| {
                let mut positions = HashMap::new();
                for (position, variable) in variables.iter().enumerate() {
                    let key = (letter(&variable.kind), variable.value_reference);
                    positions.entry(key).or_insert(position);
                }
                positions
            });
            by_reference.get(&(kind, reference)).map(|position| variables[*position].name.clone())
        })
    }
}

/// Returns the description of an instance without integrator. In FMI 3.0 each element of an array is a scalar variable,
/// at the values `sizes` of structural parameters; in FMI 1.0 each negated alias has a separate value reference. `None`
/// in FMI 2.0: the description of the FMU. On failure returns the reason.
pub(crate) fn scalar_description(
    description: &ModelDescription,
    sizes: &HashMap<u32, u64>,
) -> Result<Option<ModelDescription>, String> {
    Ok(match description.version() {
        Version::V1 => Some(crate::v1::scalar_description(description)),
        Version::V2 => None,
        Version::V3 => Some(crate::v3::ElementView::new(description, sizes)?.description),
    })
}

/// Returns the letter of a type in the messages of an FMU (FMI 2.0.5, section 2.1.5).
fn letter(kind: &Kind) -> char {
    match kind {
        Kind::Real(_) => 'r',
        Kind::Boolean(_) => 'b',
        Kind::String(_) => 's',
        _ => 'i',
    }
}

/// Opens the library for `interface` in the version of the FMU.
fn open_library(
    description: &ModelDescription,
    loading: &Loading<'_>,
    model_identifier: &str,
    interface: Interface,
) -> Result<AnyLibrary, FmuError> {
    let library = match description.version() {
        Version::V1 => v1::Library::open(loading, model_identifier, interface).map(AnyLibrary::V1),
        Version::V2 => Library::open(loading, interface).map(AnyLibrary::V2),
        Version::V3 => {
            let interface = interface_of_3(description, interface);
            v3::Library::open(loading, interface).map(AnyLibrary::V3)
        }
    };
    library.map_err(|error| with_tool_hint(description, error))
}

/// Converts `interface` to FMI 3.0. An FMU without co-simulation gets scheduled execution instead.
pub(crate) fn interface_of_3(
    description: &ModelDescription,
    interface: Interface,
) -> v3::Interface {
    match interface {
        Interface::ModelExchange => v3::Interface::ModelExchange,
        Interface::CoSimulation if description.co_simulation.is_some() => {
            v3::Interface::CoSimulation
        }
        Interface::CoSimulation => v3::Interface::ScheduledExecution,
    }
}

/// Unpacks the FMU at `path`, an archive or a folder with an unpacked FMU.
pub(crate) fn unpack(path: &Path) -> Result<Unpacked, PackageError> {
    if path.is_dir() { Unpacked::in_folder(path) } else { Unpacked::open(path) }
}

/// Returns the warnings about the archive, then the warnings about the description.
pub(crate) fn warnings(unpacked: &Unpacked) -> impl Iterator<Item = String> {
    let description = unpacked.warnings.iter().map(ToString::to_string);
    unpacked.archive_warnings.iter().cloned().chain(description)
}

/// Converts `error`; adds the tool that the FMU declares to need (`needsExecutionTool`), if any.
pub(crate) fn with_tool_hint(description: &ModelDescription, error: LoadError) -> FmuError {
    let stepped = description.stepped().is_some_and(|flags| flags.needs_execution_tool);
    let exchange = description.model_exchange.as_ref();
    if !stepped && !exchange.is_some_and(|flags| flags.needs_execution_tool) {
        return FmuError::Load(error);
    }
    let tool = description.generation_tool.clone();
    let tool = tool.unwrap_or_else(|| "the tool that exported it".to_owned());
    FmuError::NeedsTool { tool, source: error }
}
