//! The arguments of `fmi2SetupExperiment`.

use serde::{Deserialize, Serialize};

/// The arguments of `fmi2SetupExperiment`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// `startTime` in s.
    pub start_time: f64,
    /// `stopTime` in s, if defined: no step may end after it.
    pub stop_time: Option<f64>,
    /// `tolerance`, relative, if defined.
    pub tolerance: Option<f64>,
}
