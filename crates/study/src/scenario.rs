//! Scenarios: signals and faults during a run, as written in `system.toml`.
//!
//! [`Scenario`] holds the data of the file. [`Scenario::resolve`] finds the variables and
//! connections, and returns the drives ([`master::drive::Drives`]) and fault chains for the master.

mod body;
mod convert;
mod error;
mod faults;
mod literal;
mod resolve;
mod signals;

pub use body::{
    Bias, Csv, Delay, Drift, Dropout, Gain, Inversion, Noise, Quantisation, Ramp, Saturation, Sine,
    Stuck,
};
pub use error::{Reason, ScenarioError};
pub use literal::Literal;
pub use resolve::{ResolvedScenario, Setup};

use serde::{Deserialize, Serialize};
use serde_spanned::Spanned;

/// The table `scenario`. Times are simulation times in s.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// `[[scenario.set]]`: an input or a tunable parameter gets a value at a time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<Spanned<SetEntry>>,
    /// `[[scenario.signal]]`: an input or a tunable parameter follows a signal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub signal: Vec<Spanned<SignalEntry>>,
    /// `[[scenario.table]]`: every input without a connection and every tunable parameter follows the column of its
    /// name, unless an entry of `set` or `signal` drives it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub table: Vec<Spanned<TableEntry>>,
    /// `[[scenario.fault]]`: a fault acts on the values of a connection or of a driven input.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<Spanned<FaultEntry>>,
}

/// An entry of `[[scenario.set]]`. A variable keeps its start value until its first entry.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetEntry {
    /// `slave.variable`: an input without a connection, or a tunable parameter.
    pub variable: Spanned<String>,
    /// Time in s; the value takes effect at the first communication point at or after this time.
    pub at: f64,
    /// The value that the variable gets.
    pub value: Spanned<Literal>,
    /// Unit of the value; default: the unit of the variable.
    pub unit: Option<Spanned<String>>,
}

/// Pairs of time in s and value.
pub type Steps = Vec<(f64, Spanned<Literal>)>;

/// An entry of `[[scenario.signal]]`. States exactly one kind of signal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalEntry {
    /// `slave.variable`: an input without a connection, or a tunable parameter.
    pub variable: Spanned<String>,
    /// Unit of the values; default: the unit of the variable.
    pub unit: Option<Spanned<String>>,
    /// A constant.
    pub constant: Option<Spanned<Literal>>,
    /// Times and values; each value is held until the next one.
    pub steps: Option<Spanned<Steps>>,
    /// Times and values with linear interpolation; a time that occurs twice is a jump.
    pub points: Option<Spanned<Vec<(f64, f64)>>>,
    /// A ramp between two constants.
    pub ramp: Option<Spanned<Ramp>>,
    /// A sine.
    pub sine: Option<Spanned<Sine>>,
    /// A column of a CSV file.
    pub csv: Option<Spanned<Csv>>,
}

/// An entry of `[[scenario.table]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableEntry {
    /// The CSV file, relative to the folder of the `system.toml`.
    pub csv: Spanned<String>,
    /// The slave whose variables the columns name; if not stated, columns are named
    /// `slave.variable`.
    pub element: Option<Spanned<String>>,
}

/// An entry of `[[scenario.fault]]`. States exactly one kind of fault. Several faults of one
/// connection act in the order of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultEntry {
    /// The input, `slave.variable`, or the connection, `slave.output=slave.input`. The input has a connection
    /// or is driven by another entry.
    pub connection: Spanned<String>,
    /// Unit of the values; default: the unit of the input.
    pub unit: Option<Spanned<String>>,
    /// A constant is added.
    pub bias: Option<Spanned<Bias>>,
    /// The value is multiplied by a factor.
    pub gain: Option<Spanned<Gain>>,
    /// The added value grows linearly with time.
    pub drift: Option<Spanned<Drift>>,
    /// The value remains constant.
    pub stuck: Option<Spanned<Stuck>>,
    /// Values are lost.
    pub dropout: Option<Spanned<Dropout>>,
    /// Values arrive late.
    pub delay: Option<Spanned<Delay>>,
    /// Values are rounded to levels.
    pub quantisation: Option<Spanned<Quantisation>>,
    /// Values are limited to a range.
    pub saturation: Option<Spanned<Saturation>>,
    /// Random noise is added.
    pub noise: Option<Spanned<Noise>>,
    /// True and false are exchanged.
    pub inversion: Option<Spanned<Inversion>>,
}
