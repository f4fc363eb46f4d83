//! The interface of an FMU that a run uses.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// An interface of FMI that a run can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interface {
    /// The FMU integrates its states.
    CoSimulation,
    /// The master integrates the states of the FMU.
    ModelExchange,
}

impl Interface {
    /// Returns the name in a `system.toml` and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Interface::CoSimulation => "co-simulation",
            Interface::ModelExchange => "model-exchange",
        }
    }
}

impl FromStr for Interface {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Interface::CoSimulation, Interface::ModelExchange];
        let named = all.into_iter().find(|interface| interface.name() == text);
        named.ok_or_else(|| format!("expected co-simulation or model-exchange, found {text:?}"))
    }
}
