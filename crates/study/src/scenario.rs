//! Scenarios: what is done to a system while it runs, as it stands in `system.toml`.
//!
//! [`Scenario`] is the plain data, [`Scenario::resolve`] finds the variables and connections and
//! gives what the engine calls: [`master::drive::Drives`] and fault lines.

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
pub use resolve::{Lookup, ResolvedScenario, Setup};

use serde::{Deserialize, Serialize};
use serde_spanned::Spanned;

/// The table `scenario`. Times are those of the simulation, in s.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// `[[scenario.set]]`: an input or a tunable parameter gets a value at a time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<Spanned<SetEntry>>,
    /// `[[scenario.signal]]`: an input or a tunable parameter follows a signal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub signal: Vec<Spanned<SignalEntry>>,
    /// `[[scenario.table]]`: all free inputs that have a column of their name follow it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub table: Vec<Spanned<TableEntry>>,
    /// `[[scenario.fault]]`: the values on a connection are disturbed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<Spanned<FaultEntry>>,
}

/// An entry of `[[scenario.set]]`. Before the first one of a variable it keeps its start value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetEntry {
    /// `slave.variable`: an input without a connection, or a tunable parameter.
    pub variable: Spanned<String>,
    /// From when on; it takes effect at the first communication point that is not before it.
    pub at: f64,
    /// The value.
    pub value: Spanned<Literal>,
    /// Unit of the value, if not that of the variable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Spanned<String>>,
}

/// Times in s and values.
pub type Steps = Vec<(f64, Spanned<Literal>)>;

/// An entry of `[[scenario.signal]]`: exactly one of the kinds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignalEntry {
    /// `slave.variable`: an input without a connection, or a tunable parameter.
    pub variable: Spanned<String>,
    /// Unit of the values, if not that of the variable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Spanned<String>>,
    /// One value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant: Option<Spanned<Literal>>,
    /// Times and values; each is held until the next one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<Spanned<Steps>>,
    /// Times and values with lines between; a time that stands twice is a jump.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Spanned<Vec<(f64, f64)>>>,
    /// A line between two constants.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ramp: Option<Spanned<Ramp>>,
    /// A sine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sine: Option<Spanned<Sine>>,
    /// A column of a CSV file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub csv: Option<Spanned<Csv>>,
}

/// An entry of `[[scenario.table]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableEntry {
    /// The CSV file, seen from the folder of the file that names it.
    pub csv: Spanned<String>,
    /// The slave whose variables the columns are named after; none: they are named
    /// `slave.variable`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element: Option<Spanned<String>>,
}

/// An entry of `[[scenario.fault]]`: exactly one of the kinds. Several entries for one connection act
/// in their order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultEntry {
    /// The input, `slave.variable`, or the connection, `slave.output=slave.input`.
    pub connection: Spanned<String>,
    /// Unit of the values, if not that of the input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Spanned<String>>,
    /// Something is added.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias: Option<Spanned<Bias>>,
    /// A wrong factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<Spanned<Gain>>,
    /// What is added grows with time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<Spanned<Drift>>,
    /// The value stays what it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stuck: Option<Spanned<Stuck>>,
    /// Values are lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout: Option<Spanned<Dropout>>,
    /// Values come late.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay: Option<Spanned<Delay>>,
    /// Only some values exist.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantisation: Option<Spanned<Quantisation>>,
    /// The range is too small.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saturation: Option<Spanned<Saturation>>,
    /// Something random is added.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Spanned<Noise>>,
    /// True becomes false.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inversion: Option<Spanned<Inversion>>,
}
