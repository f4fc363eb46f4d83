//! `system.toml` with arbitrary content.
#![expect(dead_code, reason = "only the parser is used")]

#[path = "../../../cli/src"]
mod sources {
    pub(crate) mod config;
    pub(crate) mod design {
        pub(crate) mod document;
    }
    pub(crate) mod logging;
}
#[path = "../../../cli/src/config/tests/target.rs"]
mod target;

// Where the sources look for each other.
use sources::{config, design, logging};

/// See `target.rs`.
pub fn system_toml(data: &[u8]) {
    target::system_toml(data);
}
