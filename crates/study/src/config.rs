//! `system.toml`: what a run is told. The command line puts its own over it.

mod every;
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
pub use memory::Memory;
pub use ordered::{Ordered, Settings};
pub use tables::{CheckpointSettings, ConnectionEntry, Experiment, Isolation, Results};

use files::{Place, PlaceError, Source};

/// The content of a `system.toml`; what is not stated is chosen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Config {
    /// An SSP, an SSD or a folder with one, to begin with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub system: Option<PathBuf>,
    /// Shared libraries whose symbols the FMUs shall see.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub preload: Vec<String>,
    /// FMUs by name.
    #[serde(skip_serializing_if = "Ordered::is_empty")]
    pub fmus: Ordered<PathBuf>,
    /// Connections; not stated: equal names, where `system` is not stated either.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connections: Option<Vec<Spanned<ConnectionEntry>>>,
    /// Values before the initialization.
    #[serde(skip_serializing_if = "Settings::is_empty")]
    pub settings: Settings,
    /// The algorithm.
    pub algorithm: AlgorithmRequest,
    /// Times and tolerance that the FMUs are told.
    pub experiment: Experiment,
    /// What is written.
    pub results: Results,
    /// FMUs in processes of their own.
    #[serde(skip_serializing_if = "is_default")]
    pub isolation: Isolation,
    /// Checkpoints.
    #[serde(skip_serializing_if = "is_default")]
    pub checkpoint: CheckpointSettings,
    /// What is done to the system while it runs.
    #[serde(skip_serializing_if = "is_default")]
    pub scenario: Scenario,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A configuration and the text that it was read from, to which errors may point.
#[derive(Default)]
pub struct LoadedConfig {
    /// The configuration.
    pub config: Config,
    /// Its text, where it comes from a file.
    pub source: Option<Source>,
}

impl LoadedConfig {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let source = Source::read(path).map_err(Error::file("read", path))?;
        let config = parse(source.text(), path)?;
        let table: toml::Table = source.text().parse().unwrap_or_default();
        if table.get("algorithm").is_some_and(|algorithm| algorithm.get("course").is_some()) {
            tracing::warn!("{}: algorithm.course is now called extrapolation", path.display());
        }
        Ok(Self { config, source: Some(source) })
    }

    /// `error`, pointing at `place` of the file; what the command line stated has no place.
    #[must_use]
    pub fn point(&self, place: &Place, error: impl Into<Error>) -> Error {
        let error = error.into();
        match &self.source {
            Some(source) if !place.is_empty() => source.error(place, error.sentence()).into(),
            _ => error,
        }
    }
}

/// Reads `text`, the content of the file at `path`, beside which the paths in it begin. Opens no
/// file.
///
/// # Errors
///
/// [`PlaceError`] with line and column: no TOML, an entry that is not known, a value of a wrong
/// type or out of its range.
pub fn parse(text: &str, path: &Path) -> Result<Config, PlaceError> {
    let source = Source::new(path, text.to_owned());
    let mut config: Config = toml::from_str(text).map_err(|error| {
        let end = text.len();
        source.error(&error.span().unwrap_or(end..end), error.message())
    })?;
    config.check().map_err(|(place, message)| source.error(&place, message))?;
    config.rebase(path.parent().unwrap_or(Path::new("")));
    Ok(config)
}

impl Config {
    /// As a `system.toml`.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn render(&self) -> Result<String, Error> {
        toml::to_string(self).map_err(|error| Error::Invalid(error.to_string()))
    }

    fn check(&self) -> Result<(), (Place, String)> {
        self.experiment.check()?;
        self.isolation.check()?;
        self.checkpoint.check()?;
        let mut wires = self.connections.iter().flatten();
        wires.try_for_each(|wire| wire.get_ref().check(&wire.span()))
    }

    /// Lets relative paths begin at `folder`.
    pub fn rebase(&mut self, folder: &Path) {
        self.each_path(|path| *path = folder.join(&*path));
    }

    /// Makes every path absolute, so that the configuration holds wherever it is written to.
    ///
    /// # Errors
    ///
    /// [`Error`] with the reason.
    pub fn make_absolute(&mut self) -> std::io::Result<()> {
        let mut done = Ok(());
        self.each_path(|path| match std::path::absolute(&*path) {
            Ok(absolute) => *path = absolute,
            Err(error) => done = Err(error),
        });
        done
    }

    fn each_path(&mut self, mut change: impl FnMut(&mut PathBuf)) {
        let fmus = self.fmus.0.iter_mut().map(|(_, path)| path);
        let files = [
            self.system.as_mut(),
            self.results.file.as_mut(),
            self.results.plot_file.as_mut(),
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
            // A file name that is no Unicode cannot stand in TOML, so nothing is lost.
            *file.get_mut() = path.to_string_lossy().into_owned();
        }
    }
}

#[cfg(test)]
mod tests;
