//! Reads a `system.toml` given as text or as nested dicts, and merges the changes of a run into it.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyAny;
use study::config::parse;
use study::{Config, LoadedConfig};

use crate::error;
use crate::node::Node;

/// File name assumed for a configuration given as text or dicts; relative paths start in the folder of this file.
const NAME: &str = "system.toml";

/// Reads the `system.toml` at `path`; returns its content with absolute paths.
#[pyfunction]
pub(crate) fn read_configuration(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let loaded = py.detach(|| LoadedConfig::read(&path));
    let loaded = loaded.map_err(|error| error::study(&error).raise(py))?;
    plain(py, loaded.config)
}

/// Checks a configuration given as text or as nested dicts; returns it with absolute paths. Relative
/// paths start in `folder`.
#[pyfunction]
pub(crate) fn check_configuration<'py>(
    description: &Bound<'py, PyAny>,
    folder: PathBuf,
) -> PyResult<Bound<'py, PyAny>> {
    plain(description.py(), read(description, &folder)?)
}

/// Writes nested dicts as the text of a TOML file.
#[pyfunction]
pub(crate) fn render_toml(description: &Bound<'_, PyAny>) -> PyResult<String> {
    Node::from_python(description)?.render()
}

/// Reads the text of a TOML file as nested dicts, in the order of the text.
#[pyfunction]
pub(crate) fn parse_toml<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    let node = Node::parse(text);
    node.map_err(|error| invalid(error.message()).raise(py))?.to_python(py)
}

/// Reads a configuration given as text or as nested dicts. Relative paths start in `folder`. A `ConfigurationError`
/// names the table and the text of a wrong entry.
pub(crate) fn read(description: &Bound<'_, PyAny>, folder: &Path) -> PyResult<Config> {
    let py = description.py();
    let text = Node::text(description)?;
    parse(&text, &folder.join(NAME)).map_err(|place| {
        let shown = place.shown().trim();
        let before = text.lines().take(place.line().saturating_sub(1));
        // Unlike a table header, a line such as `[1, 2],` inside a list has a comma.
        let is_header = |line: &&str| {
            line.starts_with('[') && line.split('#').next().is_some_and(|code| !code.contains(','))
        };
        let table = match before.filter(is_header).last() {
            Some(table) if !shown.starts_with('[') => format!(" {table}"),
            _ => String::new(),
        };
        let shown = if shown.is_empty() { String::new() } else { format!(", in{table}: {shown}") };
        invalid(&format!("{}{shown}", place.message())).raise(py)
    })
}

fn invalid(sentence: &str) -> error::Exception {
    error::Exception::new("ConfigurationError", "Entry", sentence)
}

/// Returns the configuration as nested dicts with absolute paths.
fn plain(py: Python<'_>, mut config: Config) -> PyResult<Bound<'_, PyAny>> {
    config.make_absolute()?;
    let text = config.render().map_err(|error| error::study(&error).raise(py))?;
    let node = Node::parse(&text).map_err(|error| invalid(error.message()).raise(py))?;
    node.to_python(py)
}

/// Applies `changes` to the entries of `base` that a run may change, which exclude the system itself. Replaces values,
/// lists, settings of the same name and entries of `algorithm.every`; appends entries of the scenario. `stated` has the
/// nested dicts of `changes`, which distinguish an empty list (which clears the list) from a list that is not stated.
pub(crate) fn merge(base: &mut Config, changes: Config, stated: &Bound<'_, PyAny>) {
    for (name, value, place) in changes.settings.0 {
        base.settings.0.retain(|(known, _, _)| *known != name);
        base.settings.0.push((name, value, place));
    }
    base.scenario.set.extend(changes.scenario.set);
    base.scenario.signal.extend(changes.scenario.signal);
    base.scenario.table.extend(changes.scenario.table);
    base.scenario.fault.extend(changes.scenario.fault);
    base.algorithm.every.extend(changes.algorithm.every);
    let is_stated = |table: &str, entry: &str| {
        let entries = stated.get_item(table);
        entries.and_then(|entries| entries.get_item(entry.replace('_', "-"))).is_ok()
    };
    // Replaces each entry that `stated` contains.
    macro_rules! replace {
        ($($table:ident [$($entry:ident)*])*) => {
            $($(if is_stated(stringify!($table), stringify!($entry)) {
                base.$table.$entry = changes.$table.$entry;
            })*)*
        };
    }
    replace! {
        results [record exclude every file bus_trace]
        experiment [start_time stop_time tolerance]
        isolation [isolate time_limit memory_limit]
        algorithm [
            method extrapolation coupling step_control step relative_tolerance absolute_tolerance
            smallest_step largest_step iterations fallback next_event crossing discrete power_bonds
            jobs rollback allow_nan
        ]
    }
}
