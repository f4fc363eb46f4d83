//! The interval between recorded rows.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::from_toml::from_toml;

/// Name of [`Every::Step`].
const STEP: &str = "step";
/// Name of [`Every::Never`].
const NEVER: &str = "never";
const EXPECTED: &str = "seconds above 0, \"step\" (each communication point) or \"never\"";

/// The interval between recorded rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Every {
    /// A row at the first communication point at or after each multiple of this interval in s, counted from the start.
    Seconds(f64),
    /// A row at each communication point.
    Step,
    /// No rows, no results.
    Never,
}

impl Every {
    fn seconds(value: f64) -> Result<Self, String> {
        if value > 0.0 && value.is_finite() {
            Ok(Self::Seconds(value))
        } else {
            Err(format!("expected {EXPECTED}, found {value}"))
        }
    }

    fn named(text: &str) -> Result<Self, String> {
        match text {
            STEP => Ok(Self::Step),
            NEVER => Ok(Self::Never),
            _ => Err(format!("expected {EXPECTED}, found {text:?}")),
        }
    }
}

impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map_or_else(|_| Self::named(text), Self::seconds)
    }
}

impl fmt::Display for Every {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seconds(seconds) => write!(formatter, "{seconds}"),
            Self::Step => formatter.write_str(STEP),
            Self::Never => formatter.write_str(NEVER),
        }
    }
}

impl Serialize for Every {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Seconds(seconds) => serializer.serialize_f64(*seconds),
            Self::Step | Self::Never => serializer.collect_str(self),
        }
    }
}

from_toml! {
    Every, EXPECTED;
    visit_i64(value: i64) => Every::seconds(slave::to_real(value));
    visit_f64(value: f64) => Every::seconds(value);
    visit_str(text: &str) => Every::named(text);
}
