//! A coupled system as plain data, read from an SSP, a `system.toml` or the command line.

use std::path::{Path, PathBuf};

use fmu_description::package::Unpacked;

use crate::function::Function;
use crate::structure::Implementation;
use slave::Transformation;

/// A coupled system: FMUs with settings, functions, connections, start and stop time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assembly {
    /// Name of the system; `None` if the file states none.
    pub name: Option<String>,
    /// The FMUs, in the order in which they are instantiated.
    pub elements: Vec<Element>,
    /// Functions evaluated at communication points, by name.
    pub functions: Vec<(String, Function)>,
    /// The connections.
    pub links: Vec<Link>,
    /// Start time in s, if stated.
    pub start_time: Option<f64>,
    /// Stop time in s, if stated.
    pub stop_time: Option<f64>,
}

/// One instance of an FMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Element {
    /// Name of the instance; names of nested systems are joined by dots: `drive.motor`.
    pub name: String,
    /// The archive, or a folder with the unpacked FMU.
    pub fmu: PathBuf,
    /// Name of the FMU for messages if `fmu` is an unpacked copy: `system.ssp/resources/m.fmu`.
    pub shown: Option<PathBuf>,
    /// The archive from which `fmu` was unpacked; ignored unless `fmu` is [`Origin::folder`].
    pub origin: Option<Origin>,
    /// Values set before the initialization, in this order; of several for the same variable the last one applies.
    pub settings: Vec<Setting>,
    /// The interface of the FMU to use, as stated in a system structure.
    pub implementation: Implementation,
}

impl Element {
    /// Returns the name of the FMU for messages.
    #[must_use]
    pub fn shown(&self) -> &Path {
        self.shown.as_deref().unwrap_or(&self.fmu)
    }

    /// Returns the path of the FMU with all its files: the archive from which `fmu` was unpacked, otherwise `fmu`.
    #[must_use]
    pub fn complete(&self) -> &Path {
        let origin = self.origin.as_ref().filter(|origin| origin.folder == self.fmu);
        origin.map_or(&self.fmu, |origin| &origin.archive)
    }
}

/// An archive, and the folder with the files unpacked from this archive: the files that a simulation on this platform
/// needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Path of the archive.
    pub archive: PathBuf,
    /// Path of the folder with the unpacked files.
    pub folder: PathBuf,
}

impl Origin {
    /// Returns archive and folder of an FMU; `None` for an FMU that was not unpacked.
    pub(crate) fn of(fmu: &Unpacked) -> Option<Self> {
        let folder = fmu.folder().to_owned();
        fmu.archive().map(|archive| Origin { archive: archive.to_owned(), folder })
    }
}

/// A value that a variable gets before the initialization.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the variable in the FMU.
    pub variable: String,
    /// The value as text; for an enumeration, the number or the name of an item.
    pub value: String,
}

/// One end of a link.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Terminal {
    /// The name of the element, [`Element::name`].
    pub element: String,
    /// Name of the variable in the FMU.
    pub variable: String,
}

impl std::fmt::Display for Terminal {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}.{}", self.element, self.variable)
    }
}

/// A connection from an output to an input.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// The output.
    pub from: Terminal,
    /// The input.
    pub to: Terminal,
    /// The transformation of the value.
    pub transformation: Transformation,
    /// Whether `transformation` includes the unit conversion, or the conversion is suppressed. If false, the value is
    /// also converted between the units of the two variables.
    pub units_settled: bool,
}
