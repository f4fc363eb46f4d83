//! Runs what a file asks for: `system.toml`, SSP, scenarios with signals and faults.
#![forbid(unsafe_code)]

mod link;
pub mod scenario;
pub mod table;

pub use link::link;
