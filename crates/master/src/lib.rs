//! Couples co-simulation FMUs: loads them, connects their variables, advances them together.
//!
//! [`Fmu::open`] and [`Fmu::instantiate`] give a [`Slave`]; a [`System`] holds slaves and
//! connections; a [`Simulation`] initialises and steps it; a [`Probe`] reads what is of interest.
//! [`linearise()`] gives the matrices of an FMU about an operating point.
#![deny(unsafe_code)]

pub mod algorithm;
pub mod assembly;
mod call_log;
mod choose;
pub mod crash;
mod error;
mod exchange;
pub mod fault;
#[cfg(feature = "fmi")]
pub mod fmi_crate;
mod fmu;
pub mod function;
pub mod isolate;
mod library;
pub mod linearise;
mod nearest;
mod order;
mod probe;
mod readout;
pub mod results;
pub mod scenario;
pub mod signal;
mod simulation;
mod slave;
pub mod solve;
pub mod ssp;
mod system;
pub mod transformation;
mod value;

pub use algorithm::{Algorithm, Coupling, Course, StepControl, Sweep};
pub use call_log::{CallLog, LoggedSlave};
pub use choose::{Chosen, Wanted, choose};
pub use error::{LoadError, SystemError};
pub use fmu::{Fmu, FmuError, Instance};
pub use library::{Interface, describe, preload};
pub use linearise::{Linearisation, Linearise, LineariseError, linearise};
pub use order::{Order, by_direct_dependencies};
pub use probe::Probe;
pub use readout::{Readout, SlowState, SlowValues};
pub use simulation::{Checkpoint, EarlyEnd, Fallbacks, Simulation};
pub use slave::{Advance, Background, CallError, Failure, Slave, Stepped};
pub use system::{Connection, Port, System};
