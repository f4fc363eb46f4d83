//! Couples slaves: connects their variables and advances them together.
//!
//! A [`System`] holds slaves and connections; a [`Simulation`] initialises and steps it by an
//! [`Algorithm`]; a [`Probe`] or a [`Readout`] reads what is of interest. [`drive`] makes variables
//! follow signals, [`fault`] disturbs connections.
//!
//! The crate reads no files and loads no libraries: `fmu-import` turns FMUs into slaves, `study` runs
//! what a file asks for.
#![forbid(unsafe_code)]

pub mod algorithm;
mod choose;
pub mod drive;
mod error;
mod exchange;
pub mod fault;
mod order;
mod probe;
mod readout;
pub mod signal;
mod simulation;
mod system;

pub use algorithm::{Algorithm, Coupling, Extrapolation, Method, StepControl};
pub use choose::{AlgorithmRequest, Chosen, choose};
pub use drive::Scenario;
pub use error::SystemError;
pub use order::{Order, by_direct_dependencies};
pub use probe::Probe;
pub use readout::{Readout, SlowState, SlowValues};
pub use simulation::{Checkpoint, EarlyEnd, Fallbacks, Simulation};
pub use slave::{Advance, Background, CallError, Failure, Slave, StepResult, Transformation};
pub use system::{Connection, Port, System};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
