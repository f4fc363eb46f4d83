//! Exports a Rust model as an FMU for co-simulation and model exchange (FMI 2.0).
//!
//! The author of a model implements [`Model`] for a struct, states its variables as
//! [`Variable`]s, and ends the library with [`export!`]. Everything that an importer sees follows
//! from that one statement: the C functions, `modelDescription.xml`, the value references.
//!
//! # A tour
//!
//! 1. **A crate with a `cdylib`.** `aso-ftc new NAME` writes one: `Cargo.toml` with
//!    `crate-type = ["cdylib", "rlib"]`, this crate and `serde`, and a model to change.
//! 2. **The struct** holds all there is: parameters, inputs, outputs, states. It derives `Clone`,
//!    `Serialize` and `Deserialize`, because a copy of it is the FMU state (`fmi2GetFMUstate`) and its
//!    bytes are the serialised one. What may not be part of the state (a cache) is `#[serde(skip)]`.
//! 3. **[`Model::new`]** gives the values that the struct has after `fmi2Instantiate` and after
//!    `fmi2Reset`; they become the `start` values. A data-driven model reads its `resources` here.
//! 4. **[`Model::variables`]** is the table: one line for each variable, with its name, role, unit and
//!    the field behind it. The order is that of `modelDescription.xml`.
//! 5. **[`Model::initialize`]** runs in initialization mode, each time that something was set and
//!    something else is to be read.
//! 6. **[`Model::step`]** is `fmi2DoStep`. [`Failure::Incomplete`] says how far it came.
//! 7. **[`Model::update`]** keeps outputs that depend directly on inputs up to date between steps.
//! 8. **Model exchange**, if wanted: name the derivatives of the states
//!    ([`Variable::derivative_of`]), let `update` compute them, return [`Model::model_exchange`], and
//!    write [`Model::event_indicators`] and [`Model::event`] where there are events.
//! 9. **Directional derivatives**, if wanted: [`Model::differentiate`].
//! 10. **The first test** asks [`problems`] for the rules of the standard that the table breaks; each
//!     comes with its section. Packing refuses such a model with the same words.
//! 11. **`aso-ftc pack PATH`** builds the crate and writes the `.fmu`.
//!
//! What the model need not do: check pointers, the order of the calls, value references, limits,
//! NaN; all of that is answered before the model is asked. A panic in the model becomes
//! `fmi2Fatal` of that one instance, with a message that has file and line.
//!
//! The documentation of [`export!`] has a whole model; the folder `examples` of the repository has
//! four more.
#![deny(unsafe_code)]

mod fence;
#[doc(hidden)]
pub mod ffi;
mod instance;
mod interface;
mod model;
mod variable;

pub use fmu_description::{self as description, Experiment};
#[doc(hidden)]
pub use fmu_description::{abi, call_order};
pub use interface::{describe, problems};
pub use model::{About, At, Event, Failure, Model, ModelExchange, Step};
pub use variable::{Enumeration, Variable};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
