//! FMI 2.0 for Rust: export a model as a co-simulation FMU; read and write model descriptions.
//!
//! The author of a model implements [`Model`] for a struct, states its variables as
//! [`Variable`]s, and ends the library with [`export!`]. Everything that an importer sees follows
//! from that one statement: the C functions, `modelDescription.xml`, the value references.
#![deny(unsafe_code)]

pub mod abi;
pub mod call_order;
pub mod description;
pub mod documentation;
#[doc(hidden)]
pub mod ffi;
mod instance;
mod interface;
pub mod location;
mod model;
#[cfg(feature = "package")]
pub mod package;
pub mod unit;
mod variable;

pub use interface::problems;
pub use model::{About, At, Event, Experiment, Failure, Model, ModelExchange, Step};
pub use variable::{Enumeration, Variable};
