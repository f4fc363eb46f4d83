//! The gains without actuators that are gone, and the fall-back.

use serde::{Deserialize, Serialize};

use crate::matrix::Matrix;

/// The gains without an actuator, and when the actuator counts as gone; see `fmu-controller/src/reconfiguration.rs`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reconfiguration {
    /// The actuator that is gone.
    pub gone: String,
    /// The position of the actuator that is gone; set when the file is read.
    #[serde(default)]
    pub actuator: usize,
    /// The command at which the actuator is stuck.
    pub stuck_at: f64,
    /// K_x, m x n. `None`, like K_f and K_s, if only the fall-back serves this case.
    #[serde(rename = "K_x")]
    pub k_x: Option<Matrix>,
    /// K_f, m x q: the compensation of the estimated faults.
    #[serde(rename = "K_f")]
    pub k_f: Option<Matrix>,
    /// K_s, m numbers: the gains from the stuck command to the commands.
    #[serde(rename = "K_s")]
    pub k_s: Option<Vec<f64>>,
    /// The states of the fault model that restart at 0 when the actuator fails or comes back.
    #[serde(default)]
    pub restart: Vec<String>,
    /// The positions of the states in `restart`; set when the file is read.
    #[serde(default)]
    pub restarted: Vec<usize>,
    /// The actuator counts as gone after its estimated loss of effectiveness has been above `loss` for `time` s.
    /// Without `loss` and `time`, only an input of the FMU reports the failure.
    pub loss: Option<f64>,
    /// The time in s for which the estimated loss must be above `loss`.
    pub time: Option<f64>,
}

/// The gains without several actuators, each of which also has a [`Reconfiguration`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Combination {
    /// The actuators that are gone, in the order of the actuators.
    pub gone: Vec<String>,
    /// Bit j: actuator j is gone; set when the file is read.
    #[serde(default)]
    pub mask: u64,
    /// K_x, m x n: the feedback of the estimated states.
    #[serde(rename = "K_x")]
    pub k_x: Matrix,
    /// K_f, m x q: the compensation of the estimated faults.
    #[serde(rename = "K_f")]
    pub k_f: Matrix,
    /// K_s, m x (the number of actuators that are gone), columns in the order of `gone`.
    #[serde(rename = "K_s")]
    pub k_s: Matrix,
}

/// The fall-back; see `fmu-controller/src/reconfiguration.rs`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fallback {
    /// K_x, m x n: the feedback of the estimated states.
    #[serde(rename = "K_x")]
    pub k_x: Matrix,
    /// K_f, m x q; `None`: the estimated faults are not compensated.
    #[serde(rename = "K_f")]
    pub k_f: Option<Matrix>,
}

/// The gains that replace the gains of the intact plant.
#[derive(Clone, Copy)]
pub enum GainSet<'a> {
    /// The gains without one actuator.
    Single(&'a Reconfiguration),
    /// The gains without several actuators.
    Several(&'a Combination),
    /// The gains of the fall-back.
    Fallback(&'a Fallback),
}

impl<'a> GainSet<'a> {
    /// Row `j` of K_x; empty for an actuator that only the fall-back serves.
    #[must_use]
    pub fn k_x(self, j: usize) -> &'a [f64] {
        match self {
            Self::Single(case) => case.k_x.as_ref().map_or(&[], |k_x| k_x.row(j)),
            Self::Several(combination) => combination.k_x.row(j),
            Self::Fallback(fallback) => fallback.k_x.row(j),
        }
    }

    /// Row `j` of K_f; empty without compensation.
    #[must_use]
    pub fn k_f(self, j: usize) -> &'a [f64] {
        let k_f = match self {
            Self::Single(case) => case.k_f.as_ref(),
            Self::Several(combination) => Some(&combination.k_f),
            Self::Fallback(fallback) => fallback.k_f.as_ref(),
        };
        k_f.map_or(&[], |k_f| k_f.row(j))
    }

    /// Row `j` of K_s: a number for each stuck actuator, in the order of the actuators; empty in the fall-back.
    #[must_use]
    pub fn k_s(self, j: usize) -> &'a [f64] {
        match self {
            Self::Single(case) => case.k_s.as_ref().map_or(&[], |k_s| &k_s[j..=j]),
            Self::Several(combination) => combination.k_s.row(j),
            Self::Fallback(_) => &[],
        }
    }
}
