//! The data of a comparison of the laws that estimate faults.

use std::path::PathBuf;

use serde::Serialize;

use crate::Estimation;
use crate::robustness::Verdict;

/// A comparison of the laws that estimate faults, on one plant and for the same requirement.
#[derive(Serialize)]
pub struct Comparison {
    /// Name of the plant file.
    pub plant_file: String,
    /// The laws. A law that does not exist has the reason.
    pub laws: Vec<LawResult>,
    /// The text that every file about this plant contains.
    #[serde(skip)]
    pub identity: String,
    /// The FMU of the plant, if the plant file names one.
    #[serde(skip)]
    pub model: Option<PathBuf>,
}

/// A law on the plant.
#[derive(Serialize)]
pub struct LawResult {
    /// Name of the law in the plant file.
    pub law: String,
    /// Authors of the law.
    pub sources: String,
    /// Reason, in a sentence, why the law does not exist; none for an existing law.
    pub reason: Option<String>,
    /// Results of the law on this plant; none if the law does not exist.
    pub result: Option<LawFigures>,
}

/// The results of a law on the plant.
#[derive(Serialize)]
pub struct LawFigures {
    /// Equations, parameters, conditions, errors of the estimates.
    pub estimation: Estimation,
    /// Disk margin alpha, all channels together, at the commands and at the measurements; none if the
    /// loop is not stable.
    pub disk_margin: Option<[f64; 2]>,
    /// The verdict on the design with this law.
    pub verdict: Verdict,
}
