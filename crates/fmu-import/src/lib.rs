//! Loads FMUs (FMI 2.0) and calls them: in this process, or each in a process of its own.
//!
//! [`Fmu::open`] unpacks an FMU, reads its description and loads its library; [`Fmu::instantiate`]
//! returns an [`Instance`], which is a [`slave::Slave`]. [`isolate`] does the same in processes of
//! their own, where a crash ends the process of the FMU and no other.
//!
//! [`crash`] is for programs that run FMUs in their own process and want to report a crash.
#![deny(unsafe_code)]

mod call_log;
pub mod crash;
mod described;
mod error;
mod fmu;
pub mod isolate;
mod library;

pub use call_log::{CallLog, LoggedSlave};
pub use described::{DescriptionError, described};
pub use error::LoadError;
pub use fmu::{Fmu, FmuError, Instance};
pub use library::{Component, Interface, describe, preload};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
