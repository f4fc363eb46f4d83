//! The choice of an integration method.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// An integration method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The explicit method; the stiff one while stability limits the steps of the explicit one.
    #[default]
    Automatic,
    /// Dormand and Prince, order 5(4).
    Explicit,
    /// RODAS, order 4(3), for stiff equations.
    Stiff,
}

impl Method {
    /// Returns the name in a `system.toml` and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Method::Automatic => "automatic",
            Method::Explicit => "explicit",
            Method::Stiff => "stiff",
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = [Method::Automatic, Method::Explicit, Method::Stiff];
        let named = all.into_iter().find(|method| method.name() == text);
        named.ok_or_else(|| format!("expected automatic, explicit or stiff, found {text:?}"))
    }
}
