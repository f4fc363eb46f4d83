//! The facts about a run that do not change during the run.

use serde::Serialize;

/// The subject of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// A run: a sample is a communication point.
    #[default]
    Run,
    /// A campaign: a sample is a run, its time is the number of finished runs, and a message has the
    /// status of a run in the place of an FMU.
    Campaign,
}

/// The facts about a run or a campaign that a page loads once.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Facts {
    /// The subject of the page.
    pub subject: Subject,
    /// The system: the title of the page.
    pub system: String,
    /// Start time in s.
    pub start: f64,
    /// Stop time in s.
    pub stop: f64,
    /// The factor of real time at which the run is paced, if it is.
    pub pace: Option<f64>,
    /// The signals, in the order of the values of a [`crate::Sample`].
    pub signals: Vec<Variable>,
    /// The variables that can be set during the run.
    pub settings: Vec<Variable>,
    /// The inputs on which a fault can act.
    pub inputs: Vec<Source>,
    /// The file that repeats the run with its interventions.
    pub file: String,
    /// The command that repeats the run from this file.
    pub repeat: String,
}

/// A variable.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Variable {
    /// Its name, `fmu.variable`.
    pub name: String,
    /// Its unit; empty if it has none.
    pub unit: String,
    /// Its type, as in the model description: `Real`, `Boolean` and so on.
    pub kind: String,
    /// Its description; empty if it has none.
    pub description: String,
}

/// An input with its source.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Source {
    /// The input.
    pub input: Variable,
    /// The output that is connected to it.
    pub output: String,
}
