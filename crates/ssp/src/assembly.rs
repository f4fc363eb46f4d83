//! What to couple, as plain data: read from an SSP, a `system.toml` or the command line.

use std::path::{Path, PathBuf};

use crate::function::Function;
use slave::Transformation;

/// FMUs by name, the connections between them, settings, times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assembly {
    /// Name of the system, where it has one.
    pub name: Option<String>,
    /// The FMUs, in the order in which they are instantiated.
    pub elements: Vec<Element>,
    /// Functions that are computed between the steps, by name.
    pub functions: Vec<(String, Function)>,
    /// The connections.
    pub links: Vec<Link>,
    /// Start time in s, where it is stated.
    pub start_time: Option<f64>,
    /// Stop time in s, where it is stated.
    pub stop_time: Option<f64>,
}

/// One instance of an FMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Element {
    /// Name of the instance; those of nested systems are joined by dots, `drive.motor`.
    pub name: String,
    /// The archive, or a folder with the unpacked FMU.
    pub fmu: PathBuf,
    /// Name of the FMU for the user, where `fmu` is an unpacked copy: `system.ssp/resources/m.fmu`.
    pub shown: Option<PathBuf>,
    /// Values before the initialization, in this order; later ones win.
    pub settings: Vec<Setting>,
}

impl Element {
    /// The name of the FMU for the user.
    #[must_use]
    pub fn shown(&self) -> &Path {
        self.shown.as_deref().unwrap_or(&self.fmu)
    }
}

/// A value for a variable before the initialization.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the variable in the FMU.
    pub variable: String,
    /// The value as text; for an enumeration the number or the name of an item.
    pub value: String,
}

/// One end of a link.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Terminal {
    /// [`Element::name`].
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
    /// What becomes of the value on its way.
    pub transformation: Transformation,
    /// Units are taken care of by `transformation`, or shall be left alone; otherwise units of the
    /// two variables that differ are converted.
    pub units_settled: bool,
}
