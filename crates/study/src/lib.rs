//! Runs a study described by a file: `system.toml` or SSP, with signals and faults.
//!
//! [`LoadedConfig::read`] reads a `system.toml`. [`PreparedRun::new`] loads and connects the FMUs
//! and chooses the settings that the file leaves open. [`PreparedRun::start`] initialises the FMUs.
//! [`Run::advance`] steps to the end and writes the results. The command `aso-ftc run` is a thin
//! layer on top of this crate.
#![forbid(unsafe_code)]

#[cfg(feature = "load")]
mod assemble;
#[cfg(feature = "load")]
mod assembly_options;
mod bus_trace;
pub mod config;
#[cfg(feature = "load")]
mod content;
mod error;
mod from_toml;
#[cfg(feature = "load")]
mod instances;
mod link;
mod log_fields;
#[cfg(feature = "load")]
mod plan;
mod real_time;
#[cfg(feature = "load")]
mod record;
#[cfg(feature = "load")]
mod resume;
#[cfg(feature = "load")]
mod run;
#[cfg(feature = "load")]
mod saved;
pub mod scenario;
#[cfg(feature = "load")]
mod store;
pub mod table;

#[cfg(feature = "load")]
pub use assemble::{AssembledSystem, assemble, assemble_with};
#[cfg(feature = "load")]
pub use assembly_options::AssemblyOptions;
pub use config::{Config, ConnectionEntry, Every, Interface, LoadedConfig, Memory, Solver};
pub use error::Error;
pub use link::link;
pub use log_fields::LogFields;
#[cfg(feature = "load")]
pub use plan::{Plan, plan};
pub use real_time::{Overruns, RealTime, RealTimeFactor};
#[cfg(feature = "load")]
pub use record::{keep_results, select, unit};
#[cfg(feature = "load")]
pub use run::{Intervention, PreparedRun, Run, RunEnd, RunStatistics};
#[cfg(feature = "load")]
pub use saved::SavedRun;
#[cfg(feature = "load")]
pub use store::Store;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
