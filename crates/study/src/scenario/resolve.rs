//! From a [`Scenario`] to what the engine calls.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use fmu_description::{Causality, Kind, ModelDescription, ScalarVariable, Variability};
use serde_spanned::Spanned;

use super::{Reason, Scenario, ScenarioError};
use crate::table::{self, Table};
use master::SystemError;
use master::drive::{Drive, DriveKind, DriveSource, Drives};
use master::{Port, System};

/// What a scenario asks of a system.
pub trait Lookup {
    /// The variable called `name`, `slave.variable`.
    ///
    /// # Errors
    ///
    /// Where there is none.
    fn port(&self, name: &str) -> Result<Port, SystemError>;

    /// `slave.variable`.
    fn name(&self, port: Port) -> String;

    /// The model description of a slave.
    fn description(&self, slave: usize) -> &ModelDescription;

    /// The output that an input is connected to.
    fn source(&self, input: Port) -> Option<Port>;
}

impl Lookup for System {
    fn port(&self, name: &str) -> Result<Port, SystemError> {
        System::port(self, name)
    }

    fn name(&self, port: Port) -> String {
        System::name(self, port)
    }

    fn description(&self, slave: usize) -> &ModelDescription {
        self.slaves[slave].1.description()
    }

    fn source(&self, input: Port) -> Option<Port> {
        System::source(self, input).map(|connection| connection.from)
    }
}

/// What else a scenario needs to know.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// Paths of files start here.
    pub folder: &'a Path,
    /// Start of the simulation in s.
    pub start: f64,
    /// Communication step in s, or the first one.
    pub step: f64,
}

/// A scenario that fits its system.
#[derive(Clone, Debug, Default)]
pub struct ResolvedScenario {
    /// What the engine takes.
    pub scenario: master::Scenario,
    /// Columns of `[[scenario.table]]` that drive nothing, with their file.
    pub unused: Vec<(PathBuf, String)>,
}

impl Scenario {
    /// Finds the variables and reads the files.
    ///
    /// # Errors
    ///
    /// [`ScenarioError`]: the first entry that cannot be, with its place and why.
    pub fn resolve(
        &self,
        names: &dyn Lookup,
        setup: &Setup<'_>,
    ) -> Result<ResolvedScenario, ScenarioError> {
        let mut resolver = Resolver {
            names,
            setup: *setup,
            files: HashMap::new(),
            drives: Vec::new(),
            unused: Vec::new(),
        };
        resolver.settings(&self.set)?;
        for (index, entry) in self.signal.iter().enumerate() {
            let path = format!("scenario.signal[{}]", index + 1);
            resolver.signal(entry.get_ref(), &path).map_err(at(entry, &path))?;
        }
        let others = resolver.drives.len();
        for (index, entry) in self.table.iter().enumerate() {
            let path = format!("scenario.table[{}]", index + 1);
            resolver.table(entry.get_ref(), &path, others).map_err(at(entry, &path))?;
        }
        let faults = resolver.faults(&self.fault)?;
        let drives = Drives::new(resolver.drives.into_iter().map(|(drive, _)| drive).collect());
        let scenario = master::Scenario { drives, faults };
        Ok(ResolvedScenario { scenario, unused: resolver.unused })
    }
}

/// An error with the place of the entry that it is about.
pub(super) fn at<T>(entry: &Spanned<T>, path: &str) -> impl FnOnce(Reason) -> ScenarioError {
    let (place, entry) = (entry.span(), path.to_owned());
    move |reason| ScenarioError { place, entry, reason: Box::new(reason) }
}

/// Work in progress.
pub(super) struct Resolver<'a> {
    pub(super) names: &'a dyn Lookup,
    pub(super) setup: Setup<'a>,
    files: HashMap<PathBuf, Rc<Table>>,
    /// Each with the path of its entry.
    pub(super) drives: Vec<(Drive, String)>,
    pub(super) unused: Vec<(PathBuf, String)>,
}

/// A variable with what is known of it.
pub(super) struct Target<'a> {
    pub(super) port: Port,
    pub(super) name: String,
    pub(super) variable: &'a ScalarVariable,
    pub(super) description: &'a ModelDescription,
}

impl Target<'_> {
    /// A Real input that may change at any time.
    pub(super) fn is_continuous(&self) -> bool {
        self.variable.causality == Causality::Input
            && self.variable.variability == Variability::Continuous
            && self.is_real()
    }

    pub(super) fn is_real(&self) -> bool {
        matches!(self.variable.kind, Kind::Real(_))
    }
}

impl<'a> Resolver<'a> {
    /// The variable called `name`.
    pub(super) fn target(&self, name: &str) -> Result<Target<'a>, Reason> {
        let names = self.names;
        let port = names.port(name)?;
        let description = names.description(port.slave);
        let variable = &description.variables[port.variable];
        Ok(Target { port, name: names.name(port), variable, description })
    }

    /// The variable called `name`, which nothing else sets.
    pub(super) fn free(&self, name: &str) -> Result<Target<'a>, Reason> {
        let target = self.target(name)?;
        let (causality, variability) = (target.variable.causality, target.variable.variability);
        let tunable = causality == Causality::Parameter && variability == Variability::Tunable;
        if causality != Causality::Input && !tunable {
            let found = format!("{} {}", variability.as_str(), causality.as_str());
            return Err(Reason::NotSettable { name: target.name, found: with_article(&found) });
        }
        if let Some(source) = self.names.source(target.port) {
            let source_name = self.names.name(source);
            return Err(Reason::Connected { name: target.name, source_name });
        }
        Ok(target)
    }

    /// Adds a drive; `path` is that of its entry.
    pub(super) fn add(
        &mut self,
        target: &Target<'_>,
        following: DriveSource,
        path: &str,
    ) -> Result<(), Reason> {
        if let Some((_, first)) = self.driver(target.port) {
            return Err(Reason::Twice { name: target.name.clone(), first: first.clone() });
        }
        let takes = target.description.co_simulation.as_ref();
        let derivatives =
            target.is_continuous() && takes.is_some_and(|takes| takes.can_interpolate_inputs);
        let kind = DriveKind::of(&target.variable.kind, derivatives);
        let drive = Drive::new(target.port, target.variable.value_reference, kind, following);
        self.drives.push((drive, path.to_owned()));
        Ok(())
    }

    /// What drives a variable, with the path of its entry.
    pub(super) fn driver(&self, port: Port) -> Option<&(Drive, String)> {
        self.drives.iter().find(|(drive, _)| drive.port() == port)
    }

    /// A file, read once.
    pub(super) fn file(&mut self, name: &str) -> Result<(PathBuf, Rc<Table>), Reason> {
        let path = self.setup.folder.join(name);
        if let Some(known) = self.files.get(&path) {
            return Ok((path, known.clone()));
        }
        let table = table::read(&path)
            .map_err(|error| Reason::File { path: path.clone(), error })
            .map(Rc::new)?;
        self.files.insert(path.clone(), table.clone());
        Ok((path, table))
    }
}

/// `a tunable parameter`, `an independent variable`.
fn with_article(noun: &str) -> String {
    let article = if noun.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {noun}")
}

/// A finite number.
pub(super) fn finite(what: &'static str, found: f64) -> Result<f64, Reason> {
    require(what, found, found.is_finite(), "a finite number")
}

/// A finite number above 0.
pub(super) fn positive(what: &'static str, found: f64) -> Result<f64, Reason> {
    require(what, found, found.is_finite() && found > 0.0, "a number above 0")
}

/// A number, if it holds that it is what is `expected`.
pub(super) fn require(
    what: &'static str,
    found: f64,
    holds: bool,
    expected: &'static str,
) -> Result<f64, Reason> {
    if holds { Ok(found) } else { Err(Reason::Number { what, found, expected }) }
}

/// The one kind of an entry; more or fewer are refused.
pub(super) fn only(
    kinds: &[(&'static str, bool)],
    expected: &'static str,
) -> Result<&'static str, Reason> {
    let found: Vec<_> = kinds.iter().filter(|(_, there)| *there).map(|(name, _)| *name).collect();
    match found[..] {
        [one] => Ok(one),
        _ => Err(Reason::Kinds { found, expected }),
    }
}
