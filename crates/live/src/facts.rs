//! The facts about a run that do not change during the run.

use serde::Serialize;

/// The subject of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Subject {
    /// A run: a sample is a communication point.
    #[default]
    Run,
    /// A campaign: a sample is a finished run, the time of a sample is the number of finished runs, and a message has
    /// the status of a run in place of the name of an FMU.
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
    /// The speed to which the run is paced, as a factor of real time; `None` for a run that is not paced.
    pub pace: Option<f64>,
    /// The signals, in the order of the values of a [`crate::Sample`].
    pub signals: Vec<Variable>,
    /// The variables that can be set during the run.
    pub settings: Vec<Variable>,
    /// The inputs on which a fault can act.
    pub inputs: Vec<Source>,
    /// Name of the file that repeats the run with its interventions.
    pub file: String,
    /// The command that repeats the run from this file.
    pub repeat: String,
}

/// A variable.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Variable {
    /// The name, `fmu.variable`.
    pub name: String,
    /// The unit; empty if the variable has none.
    pub unit: String,
    /// The type of the variable in the model description: `Real`, `Boolean` and so on.
    pub kind: String,
    /// The description; empty if the variable has none.
    pub description: String,
}

/// An input with the output that is connected to it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Source {
    /// The input.
    pub input: Variable,
    /// The output that is connected to the input.
    pub output: String,
}
