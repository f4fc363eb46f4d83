//! The configuration `system.toml`. Options of the command line take precedence over this file.

mod every;
mod interface;
mod memory;
mod ordered;
mod tables;

use crate::error::Error;
use std::path::{Path, PathBuf};

use crate::scenario::Scenario;
use master::AlgorithmRequest;
use serde::{Deserialize, Serialize};
use toml::Spanned;

pub use every::Every;
pub use integrate::Method as Solver;
pub use interface::Interface;
pub use memory::Memory;
pub use ordered::{Ordered, Settings};
pub use tables::{CheckpointSettings, ConnectionEntry, Experiment, Isolation, Results};

use files::{Place, PlaceError, Source};
use fmu_description::limits::{HELP, in_force};

/// Largest size of a file in bytes. Reading takes 40 times as much memory.
const LARGEST_FILE: u64 = 64 << 20;

/// The content of a `system.toml`. Settings that are not stated are chosen for the system; `None` has no entry in
/// the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Config {
    /// A system structure on which the configuration builds: an SSP, an SSD, an `OspSystemStructure.xml`, or a folder
    /// with an SSD or an `OspSystemStructure.xml`.
    pub system: Option<PathBuf>,
    /// Shared libraries to load before the FMUs, which can then use the symbols of these libraries.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub preload: Vec<String>,
    /// Whether the libraries of FMUs that have source code only are built.
    #[serde(skip_serializing_if = "is_default")]
    pub compile: bool,
    /// Paths of FMUs by name.
    #[serde(skip_serializing_if = "is_default")]
    pub fmus: Ordered<PathBuf>,
    /// The interfaces of FMUs, by name; default: the interface that the system structure states, otherwise
    /// co-simulation if offered.
    #[serde(skip_serializing_if = "is_default")]
    pub interface: Ordered<Interface>,
    /// The integration methods of FMUs that run by model exchange, by name; default: automatic.
    #[serde(skip_serializing_if = "is_default")]
    pub solver: Ordered<Solver>,
    /// Connections. Without `connections` and `system`, variables of equal names are connected.
    pub connections: Option<Vec<Spanned<ConnectionEntry>>>,
    /// Values of variables, set before the initialization.
    #[serde(skip_serializing_if = "is_default")]
    pub settings: Settings,
    /// The algorithm.
    pub algorithm: AlgorithmRequest,
    /// Times and tolerance for `fmi2SetupExperiment`.
    pub experiment: Experiment,
    /// Results: file, variables, interval, plot.
    pub results: Results,
    /// Isolation: FMUs in separate processes.
    #[serde(skip_serializing_if = "is_default")]
    pub isolation: Isolation,
    /// Checkpoints.
    #[serde(skip_serializing_if = "is_default")]
    pub checkpoint: CheckpointSettings,
    /// Signals and faults during the run.
    #[serde(skip_serializing_if = "is_default")]
    pub scenario: Scenario,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A configuration with the text from which it was read, so that errors can point at a line.
#[derive(Default)]
pub struct LoadedConfig {
    /// The configuration.
    pub config: Config,
    /// The text and the path of the file, if the configuration comes from one.
    pub source: Option<Source>,
}

impl LoadedConfig {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, is larger than 64 MiB or is not a valid
    /// `system.toml`.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
        if length > in_force(LARGEST_FILE) {
            let sentence = format!("expected at most {LARGEST_FILE} bytes, found {length}{HELP}");
            return Err(Error::Invalid(format!("{}: {sentence}", path.display())));
        }
        let source = Source::read(path).map_err(Error::file("read", path))?;
        let config = parse(source.text(), path)?;
        Ok(Self { config, source: Some(source) })
    }

    /// Adds the location `place` in the file to `error`. Returns `error` unchanged if the configuration comes from no
    /// file or if `place` is empty, which is the case for values of the command line.
    #[must_use]
    pub fn point(&self, place: &Place, error: impl Into<Error>) -> Error {
        let error = error.into();
        match &self.source {
            Some(source) if !place.is_empty() => source.error(place, error.sentence()).into(),
            _ => error,
        }
    }
}

/// Parses `text`, the content of the file at `path`. Relative paths start at the folder of `path`.
/// Opens no file.
///
/// # Errors
///
/// Returns [`PlaceError`] with line and column if `text` is not TOML, or if an entry is unknown,
/// has the wrong type or is out of range.
pub fn parse(text: &str, path: &Path) -> Result<Config, PlaceError> {
    let source = Source::new(path, text.to_owned());
    let mut config: Config = toml::from_str(text).map_err(|error| {
        let end = text.len();
        let message = format!("{}{}", error.message(), advice(text));
        source.error(&error.span().unwrap_or(end..end), message)
    })?;
    config.check().map_err(|(place, message)| source.error(&place, message))?;
    config.rebase(path.parent().unwrap_or(Path::new("")));
    Ok(config)
}

/// Returns the end of the error for a `text` that is a plant file; empty for other texts.
fn advice(text: &str) -> &'static str {
    let file: toml::Table = text.parse().unwrap_or_default();
    let is_plant = ["A", "actuators", "measurements"].iter().any(|key| file.contains_key(*key));
    if is_plant { ". This is a plant file: `aso-ftc design` reads it" } else { "" }
}

impl Config {
    /// Renders the configuration as a `system.toml`.
    ///
    /// # Errors
    ///
    /// Returns an error if a value has no form in TOML.
    pub fn render(&self) -> Result<String, Error> {
        toml::to_string(self).map_err(|error| Error::Invalid(error.to_string()))
    }

    fn check(&self) -> Result<(), (Place, String)> {
        self.experiment.check()?;
        self.isolation.check()?;
        self.checkpoint.check()?;
        let mut connections = self.connections.iter().flatten();
        connections.try_for_each(|entry| entry.get_ref().check(&entry.span()))
    }

    /// Prepends `folder` to relative paths, except paths in `preload`.
    pub fn rebase(&mut self, folder: &Path) {
        self.each_path(|path| *path = folder.join(&*path));
    }

    /// Makes every path absolute, except paths in `preload`, so that the configuration is valid in any folder.
    ///
    /// # Errors
    ///
    /// Returns an error if the current folder cannot be determined.
    pub fn make_absolute(&mut self) -> std::io::Result<()> {
        let mut result = Ok(());
        self.each_path(|path| match std::path::absolute(&*path) {
            Ok(absolute) => *path = absolute,
            Err(error) => result = Err(error),
        });
        result
    }

    /// Checks that a run writes no file that it reads, and no file twice. `inputs` and `outputs` are
    /// files that the configuration does not name, each with its role.
    ///
    /// # Errors
    ///
    /// Returns an error that names both files if they are the same.
    pub fn check_outputs(
        &self,
        inputs: &[(&str, &Path)],
        outputs: &[(&str, &Path)],
    ) -> Result<(), Error> {
        let signals = self.scenario.signal.iter();
        let signals = signals.filter_map(|signal| signal.get_ref().csv.as_ref());
        let signals = signals.map(|csv| ("the signal", Path::new(csv.get_ref().file.get_ref())));
        let tables = self.scenario.table.iter();
        let tables = tables.map(|table| ("the table", Path::new(table.get_ref().csv.get_ref())));
        let fmus = self.fmus.0.iter().map(|(_, path)| ("the FMU", path.as_path()));
        let system = self.system.iter().map(|path| ("the system", path.as_path()));
        let libraries = self.preload.iter().map(|path| ("the library", Path::new(path)));
        let read = inputs.iter().copied().chain(fmus).chain(system).chain(libraries);
        let read: Vec<_> = read.chain(signals).chain(tables).collect();
        let results = &self.results;
        let is_recorded = results.every != Some(Every::Never);
        let is_plotted = is_recorded && !results.plot.is_empty();
        let files = [
            ("the results file", results.file.as_ref().filter(|_| is_recorded)),
            ("the plot", results.plot_file.as_ref().filter(|_| is_plotted)),
            ("the bus trace", results.bus_trace.as_ref()),
            ("the checkpoint", self.checkpoint.file.as_ref()),
        ];
        let files =
            files.iter().filter_map(|(role, path)| Some((*role, path.map(PathBuf::as_path)?)));
        let written: Vec<_> = files.chain(outputs.iter().copied()).collect();
        Ok(files::check_distinct(&read, &written)?)
    }

    fn each_path(&mut self, mut change: impl FnMut(&mut PathBuf)) {
        let fmus = self.fmus.0.iter_mut().map(|(_, path)| path);
        let files = [
            self.system.as_mut(),
            self.results.file.as_mut(),
            self.results.plot_file.as_mut(),
            self.results.bus_trace.as_mut(),
            self.checkpoint.file.as_mut(),
        ];
        fmus.chain(files.into_iter().flatten()).for_each(&mut change);
        let signals = self.scenario.signal.iter_mut();
        let signals = signals
            .filter_map(|signal| signal.get_mut().csv.as_mut().map(|csv| &mut csv.get_mut().file));
        let tables = self.scenario.table.iter_mut().map(|table| &mut table.get_mut().csv);
        for file in signals.chain(tables) {
            let mut path = PathBuf::from(file.get_ref());
            change(&mut path);
            // Lossy only below a folder whose name is not Unicode, which TOML cannot hold.
            *file.get_mut() = path.to_string_lossy().into_owned();
        }
    }
}

#[cfg(test)]
mod tests;
