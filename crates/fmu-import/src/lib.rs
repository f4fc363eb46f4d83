//! Loads FMUs of FMI 1.0, 2.0 and 3.0 and calls them, in this process or in a separate process for each instance.
//!
//! [`Fmu::open`] unpacks an FMU, reads its description and loads its library; [`Fmu::instantiate`]
//! returns an [`Instance`], which implements [`slave::Slave`]; [`Fmu::instantiate_equations`] returns an instance for
//! model exchange. [`isolate`] runs each instance in a separate process: a crash of the FMU ends only that process.
//!
//! [`crash`] reports a crash of an FMU that runs in the process of the program. On Linux, the module `supervise` runs
//! the program under the supervision of a second process.
#![deny(unsafe_code)]

mod call_log;
mod compile;
pub mod crash;
mod described;
mod error;
mod fmu;
mod instance;
pub mod isolate;
mod library;
#[cfg(target_os = "linux")]
pub mod supervise;
mod v1;
mod v2;
mod v3;

pub use call_log::{CallLog, LoggedSlave};
pub use compile::{CompileError, compile};
pub use described::{DescriptionError, described_as};
pub use error::LoadError;
pub use fmu::{Fmu, FmuError};
pub use instance::Instance;
pub use library::{Interface, describe, preload};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
