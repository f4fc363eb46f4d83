//! Writes the plant file of a plant given by matrices, an FMU or logs, with bandwidths for feedback and observer.

mod draft;
mod fmu;
mod labelled;
mod log;
mod mat;

use std::path::{Path, PathBuf};

use files::Source;

use crate::Error;
use crate::assess::bandwidths;
use crate::budget::{Budget, TimeLimits};
use crate::progress::{Observer, Progress};
use draft::{Bandwidths, Draft, Settings};
use plant_file::PlantFile;

pub use log::LogOptions;

/// Rates of the measurement filter, in 1/s, that are tried in turn for a plant with direct feedthrough.
const FILTERS: [f64; 4] = [10.0, 100.0, 1000.0, 1.0];

/// A new plant file.
pub struct NewPlantFile {
    /// Content of the plant file.
    pub text: String,
    /// Why no controller was found for the plant, if there is none.
    pub refusal: Option<String>,
    /// Reasons for which the plant may be useless.
    pub warnings: Vec<String>,
}

/// Writes a plant file for the plant at `sources`: an FMU (`.fmu`), MATLAB variables A, B, C, D and Ts (`.mat`), a
/// table of them with names (`.csv`, see the book's page on plant files), or logs of its signals over time, which
/// `options` describe and from which the plant is identified. `out` is where the file will be: its folder is where the
/// path of an FMU starts.
///
/// The faults are those of all actuators, or of as many as the measurements can tell apart. Feedback and observer have
/// the bandwidths that a design without requirements would have. If no controller is found, the file has the faults of
/// all actuators and no bandwidths, and states the reason. `observer` is called when a step begins.
///
/// # Errors
///
/// [`Error`]: there is no source; one cannot be read, or is no plant; no plant can be identified from a log.
pub fn new_plant_file(
    sources: &[PathBuf],
    options: &LogOptions,
    out: &Path,
    limits: &TimeLimits,
    observer: &Observer<'_>,
) -> Result<NewPlantFile, Error> {
    observer(Progress { step: "plant", done: 0.0 });
    let draft = draft(sources, options, out)?.without_unknown_units();
    let warnings = draft.identification.warnings.clone();
    let budget = limits.of_gains();
    observer(Progress { step: "bandwidths", done: 0.5 });
    let mut refusal = None;
    for settings in attempts(&draft) {
        let text = draft.text(&settings, &[]);
        match bandwidths(out, &text, &budget) {
            Ok(bandwidths) => {
                let settings = Settings { bandwidths, ..settings };
                let text = draft.text(&settings, &[]);
                return Ok(NewPlantFile { text, refusal: None, warnings });
            }
            Err(error) => refusal = refusal.or_else(|| Some(files::sentence(&error))),
        }
        if budget.is_over() {
            break;
        }
    }
    let refusal = refusal.unwrap_or_default();
    let faulty = (0..draft.actuators.len()).collect();
    let settings = Settings { faulty, filter: None, bandwidths: None };
    let text = draft.text(&settings, &refusal.lines().collect::<Vec<_>>());
    Ok(NewPlantFile { text, refusal: Some(refusal), warnings })
}

/// Reads the plant, by the kind of its sources.
fn draft(sources: &[PathBuf], options: &LogOptions, out: &Path) -> Result<Draft, Error> {
    let [source, others @ ..] = sources else {
        return Err(Error::Invalid("expected the file of a plant, found none".to_owned()));
    };
    let ending = source.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let is_plant = ["fmu", "mat"].contains(&ending.as_str());
    if log::is_log(source, &ending) || !options.inputs.is_empty() && !is_plant {
        return log::draft(sources, options);
    }
    if let Some(other) = others.first() {
        let (source, other) = (source.display(), other.display());
        return Err(Error::Invalid(format!(
            "{source} is one plant, expected no further file {other}: several files are several logs, tables with a column `time`"
        )));
    }
    let draft = match ending.as_str() {
        "fmu" => fmu::draft(source, out)?,
        "mat" => mat::draft(source)?,
        "csv" | "tsv" | "txt" => labelled::draft(source)?,
        _ => {
            return Err(Error::Invalid(format!(
                "{}: expected an FMU (.fmu), a file of MATLAB (.mat), or a table (.csv) of matrices or of signals (also .parquet)",
                source.display()
            )));
        }
    };
    match options.stated() {
        None => Ok(draft),
        Some(option) => Err(Error::Invalid(format!(
            "{}: {option} belongs to a log, a table with a column `time`; found {}: expected the command without it",
            source.display(),
            draft.origin
        ))),
    }
}

/// Returns the faults and filters to try: first the faults of all actuators, then of fewer, last of one.
fn attempts(draft: &Draft) -> Vec<Settings> {
    let all = draft.actuators.len();
    let one = |faulty: Vec<usize>, filter| Settings { faulty, filter, bandwidths: None };
    let sets = (1..=all).rev().flat_map(|count| {
        // Sets of several actuators begin at the first one; a single actuator may be any.
        let starts = if count == 1 { 0..all } else { 0..1 };
        starts.map(move |start| (start..start + count).collect::<Vec<_>>())
    });
    let filters = |set: Vec<usize>| {
        let filters = if draft.has_feedthrough { FILTERS.map(Some).to_vec() } else { vec![None] };
        filters.into_iter().map(move |filter| one(set.clone(), filter))
    };
    sets.flat_map(filters).collect()
}

/// Returns the bandwidths that the design of a plant file without requirements has.
fn bandwidths(path: &Path, text: &str, budget: &Budget) -> Result<Option<Bandwidths>, Error> {
    let source = Source::new(path, text.to_owned());
    let file = PlantFile::read(&source)?;
    let file = bandwidths::chosen(&file, budget)?;
    let both = file.feedback.bandwidth().zip(file.observer.bandwidth());
    Ok(both.map(|(feedback, observer)| Bandwidths { feedback, observer }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_logs_are_refused_for_matrices() {
        let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/plant-file");
        let sources = [book.join("trolley.csv")];
        let refusal = |options: &LogOptions| {
            let read = draft(&sources, options, Path::new("plant.toml"));
            read.err().map_or_else(String::new, |error| error.to_string())
        };
        assert_eq!(refusal(&LogOptions::default()), "");
        let outputs = LogOptions { outputs: vec!["y".to_owned()], ..LogOptions::default() };
        let order = LogOptions { order: Some(3), ..LogOptions::default() };
        for (options, name) in [(outputs, "--outputs"), (order, "--order")] {
            let message = refusal(&options);
            let expected = format!("trolley.csv: {name} belongs to a log");
            assert!(message.contains(&expected), "{message}");
        }
    }
}
