//! Model descriptions and archives of FMUs: FMI 2.0 and 3.0 are read, checked, written, packed and
//! unpacked; FMI 1.0 is read.
//!
//! Use this crate to look at an FMU, to check it or to make one, without running it:
//!
//! * [`ModelDescription::read`] parses `modelDescription.xml` as leniently as other importers do and
//!   returns a [`Warning`] for each defect that it accepts; [`ModelDescription::problems`] lists the rules
//!   of the standard that a description breaks; [`ModelDescription::to_xml`] writes one.
//! * `package` (feature `package`) unpacks and writes `.fmu` archives.
//! * [`abi`] (FMI 2.0) and [`abi3`] have the C types, [`abi1`] the names of the functions of FMI 1.0;
//!   [`call_order`] and [`call_order3`] have the states in which each function may be called.
//! * [`limits`] protect memory and disk against files that are too large.
//! * [`unit`](mod@unit) derives base units from names, [`location`] converts paths to `fmuResourceLocation` and
//!   back, [`documentation`] writes the documentation page of a model, [`number`] rounds numbers for messages.
//! * [`can`] has the operations of virtual ECUs on a CAN bus.
//!
//! To run an FMU use `fmu-import`; to write a model use `fmu`.
#![forbid(unsafe_code)]

pub mod abi;
pub mod abi1;
pub mod abi3;
pub mod call_order;
pub mod call_order3;
pub mod can;
mod defect;
mod description;
pub mod documentation;
mod experiment;
mod hash_form;
mod hex;
pub mod limits;
pub mod location;
pub mod number;
#[cfg(feature = "package")]
pub mod package;
pub mod similar;
mod terminal;
pub mod terminals;
pub mod unit;
pub mod xml;

pub use description::*;
pub use experiment::Experiment;
pub use hex::{from_hex, to_hex};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
