//! Resolves a [`Scenario`]: finds variables and files and creates the drives and faults of the
//! master.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use fmu_description::{
    Causality, IntervalVariability, Kind, ModelDescription, ScalarVariable, Variability,
};
use serde_spanned::Spanned;

use super::{Literal, Reason, Scenario, ScenarioError};
use crate::table::{self, Table};
use master::drive::{Drive, DriveKind, DriveSource, Drives};
use master::fault::Window;
use master::{Port, System};

/// Settings of the run that a scenario needs.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// Folder at which relative paths start.
    pub folder: &'a Path,
    /// Start of the simulation in s.
    pub start: f64,
    /// Communication step in s; the first one if it varies.
    pub step: f64,
    /// Tables in memory that are read instead of files, each with the path of the file.
    pub tables: &'a [(PathBuf, Table)],
}

/// A scenario resolved for a system.
#[derive(Clone, Debug, Default)]
pub struct ResolvedScenario {
    /// The scenario for the master.
    pub scenario: master::Scenario,
    /// Columns of `[[scenario.table]]` that drive nothing, with their file: no variable that can be driven has their
    /// name, or another entry drives it.
    pub unused: Vec<(PathBuf, String)>,
    /// The faults in the order of the file: the input and the time of each.
    pub windows: Vec<(String, Window)>,
}

impl Scenario {
    /// Finds the variables and reads the files.
    ///
    /// # Errors
    ///
    /// Returns [`ScenarioError`] for the first invalid entry, with its location.
    pub fn resolve(
        &self,
        system: &System,
        setup: &Setup<'_>,
    ) -> Result<ResolvedScenario, ScenarioError> {
        let mut resolver = Resolver {
            system,
            setup: *setup,
            files: HashMap::new(),
            drives: Vec::new(),
            unused: Vec::new(),
            windows: Vec::new(),
        };
        resolver.settings(&self.set)?;
        for (index, entry) in self.signal.iter().enumerate() {
            let path = format!("scenario.signal[{}]", index + 1);
            resolver.signal(entry.get_ref(), &path).map_err(at(entry, &path))?;
        }
        let first_table_drive = resolver.drives.len();
        for (index, entry) in self.table.iter().enumerate() {
            let path = format!("scenario.table[{}]", index + 1);
            resolver.table(entry.get_ref(), &path, first_table_drive).map_err(at(entry, &path))?;
        }
        let faults = resolver.faults(&self.fault)?;
        let drives = Drives::new(resolver.drives.into_iter().map(|(drive, _)| drive).collect());
        let scenario = master::Scenario { drives, faults };
        Ok(ResolvedScenario { scenario, unused: resolver.unused, windows: resolver.windows })
    }
}

/// Adds the location of an entry to an error.
pub(super) fn at<T>(entry: &Spanned<T>, path: &str) -> impl FnOnce(Reason) -> ScenarioError {
    let (place, entry) = (entry.span(), path.to_owned());
    move |reason| ScenarioError { place, entry, reason: Box::new(reason) }
}

/// The state of the resolution.
pub(super) struct Resolver<'a> {
    pub(super) system: &'a System,
    pub(super) setup: Setup<'a>,
    files: HashMap<PathBuf, Rc<Table>>,
    /// The drives, each with the path of its entry.
    pub(super) drives: Vec<(Drive, String)>,
    pub(super) unused: Vec<(PathBuf, String)>,
    pub(super) windows: Vec<(String, Window)>,
}

/// A variable with its description.
pub(super) struct Target<'a> {
    /// The port of the variable. Of several aliases, the port that is connected, or else the port that holds the value.
    pub(super) port: Port,
    /// The name of the variable, as stated.
    pub(super) name: String,
    pub(super) variable: &'a ScalarVariable,
    pub(super) description: &'a ModelDescription,
}

impl Target<'_> {
    /// Returns whether the variable is a continuous input of a floating-point type.
    pub(super) fn is_continuous(&self) -> bool {
        self.variable.causality == Causality::Input
            && self.variable.variability == Variability::Continuous
            && self.is_real()
    }

    pub(super) fn is_real(&self) -> bool {
        self.variable.kind.as_real().is_some()
    }

    /// Returns the error for a value that does not fit the variable; `expected` describes the values that fit.
    pub(super) fn value_error(&self, value: &Literal, expected: impl Into<String>) -> Reason {
        let (name, actual) = (self.name.clone(), value.to_string());
        Reason::Value { name, actual, expected: expected.into() }
    }
}

impl<'a> Resolver<'a> {
    /// Returns the variable called `name`, at the port of its connected alias if any; an error if it does not exist.
    pub(super) fn target(&self, name: &str) -> Result<Target<'a>, Reason> {
        let system = self.system;
        let stated = system.port(name)?;
        let (name, variable) = (system.name(stated), system.variable(stated));
        let connection = system.source(stated);
        let port = connection.map_or_else(|| system.holder(stated), |connection| connection.to);
        let description = system.slaves[port.slave].1.description();
        Ok(Target { port, name, variable, description })
    }

    /// Returns the variable called `name` if it can be driven: an input without a connection or a tunable parameter; a
    /// clock only if it is triggered.
    pub(super) fn drivable(&self, name: &str) -> Result<Target<'a>, Reason> {
        let target = self.target(name)?;
        let (causality, variability) = (target.variable.causality, target.variable.variability);
        let is_tunable = causality == Causality::Parameter && variability == Variability::Tunable;
        if causality != Causality::Input && !is_tunable {
            let description = format!("{} {}", variability.as_str(), causality.as_str());
            return Err(Reason::NotSettable {
                name: target.name,
                actual: with_article(&description),
            });
        }
        if let Kind::Clock(clock) = &target.variable.kind
            && clock.interval_variability != IntervalVariability::Triggered
        {
            let description = "a clock that ticks by itself".to_owned();
            return Err(Reason::NotSettable { name: target.name, actual: description });
        }
        if let Some(connection) = self.system.source(target.port) {
            let source_name = self.system.name(connection.from);
            return Err(Reason::Connected { name: target.name, source_name });
        }
        Ok(target)
    }

    /// Adds a drive; `path` is the path of its entry. Returns an error if another entry drives the variable.
    pub(super) fn add(
        &mut self,
        target: &Target<'_>,
        source: DriveSource,
        path: &str,
    ) -> Result<(), Reason> {
        if let Some((_, first)) = self.driver(target.port) {
            return Err(Reason::Twice { name: target.name.clone(), first: first.clone() });
        }
        let flags = target.description.co_simulation.as_ref();
        let derivatives = target.is_continuous()
            && matches!(target.variable.kind, Kind::Real(_))
            && flags.is_some_and(|flags| flags.can_interpolate_inputs);
        let kind = DriveKind::of(&target.variable.kind, target.description.version(), derivatives);
        let drive = Drive::new(target.port, target.variable.value_reference, kind, source);
        self.drives.push((drive, path.to_owned()));
        Ok(())
    }

    /// Returns the drive of a variable with the path of its entry, if there is one.
    pub(super) fn driver(&self, port: Port) -> Option<&(Drive, String)> {
        self.drives.iter().find(|(drive, _)| drive.port() == port)
    }

    /// Returns the path of the CSV file `name` and its table, which may be in memory. Reads each file once even
    /// if several entries use it.
    pub(super) fn file(&mut self, name: &str) -> Result<(PathBuf, Rc<Table>), Reason> {
        let path = self.setup.folder.join(name);
        if let Some(known) = self.files.get(&path) {
            return Ok((path, known.clone()));
        }
        let in_memory = self.setup.tables.iter().find(|(known, _)| *known == path);
        let table = match in_memory {
            Some((_, table)) => table.clone(),
            None => {
                table::read(&path).map_err(|error| Reason::File { path: path.clone(), error })?
            }
        };
        let table = Rc::new(table);
        self.files.insert(path.clone(), table.clone());
        Ok((path, table))
    }
}

/// Prepends the indefinite article to a noun.
fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {noun}")
}

/// Checks that a number is finite.
pub(super) fn finite(what: &'static str, number: f64) -> Result<f64, Reason> {
    require(what, number, number.is_finite(), "a finite number")
}

/// Checks that a number is finite and above 0.
pub(super) fn positive(what: &'static str, number: f64) -> Result<f64, Reason> {
    require(what, number, number.is_finite() && number > 0.0, "a number above 0")
}

/// Returns `number` if `is_valid`, otherwise an error with the text `expected`.
pub(super) fn require(
    what: &'static str,
    number: f64,
    is_valid: bool,
    expected: &'static str,
) -> Result<f64, Reason> {
    if is_valid { Ok(number) } else { Err(Reason::Number { what, actual: number, expected }) }
}

/// Lists the kinds that an entry can have: the name of each, and whether the entry states it.
macro_rules! kinds {
    ($entry:ident: $($kind:ident),*) => { [$((stringify!($kind), $entry.$kind.is_some())),*] };
}
pub(super) use kinds;

/// Returns the only kind of an entry, or an error if there are none or several.
pub(super) fn only(
    kinds: &[(&'static str, bool)],
    expected: &'static str,
) -> Result<&'static str, Reason> {
    let stated: Vec<_> =
        kinds.iter().filter(|(_, is_stated)| *is_stated).map(|(name, _)| *name).collect();
    match stated[..] {
        [one] => Ok(one),
        _ => Err(Reason::Kinds { actual: stated, expected }),
    }
}
