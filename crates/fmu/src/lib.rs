//! Exports a Rust model as an FMU for co-simulation and model exchange (FMI 2.0 and 3.0).
//!
//! The author of a model implements [`Model`] for a struct, declares its variables as
//! [`Variable`]s, and ends the library with [`export!`]. The crate derives the C functions,
//! `modelDescription.xml` and the value references from this.
//!
//! # A tour
//!
//! 1. **A crate with a `cdylib`.** `aso-ftc new NAME` writes one: `Cargo.toml` with
//!    `crate-type = ["cdylib", "rlib"]`, this crate and `serde`, and a model to change.
//! 2. **The struct** holds parameters, inputs, outputs and states. It derives `Clone`, `Serialize` and
//!    `Deserialize`: a copy of it is the FMU state (`fmi2GetFMUstate`), its bytes are the serialised
//!    FMU state. Mark a field that is not part of the state (a cache) with `#[serde(skip)]`.
//! 3. **[`Model::new`]** returns the struct as it is after `fmi2Instantiate` and after `fmi2Reset`; its
//!    values become the `start` values. A data-driven model reads its `resources` here.
//! 4. **[`Model::variables`]** returns the table of variables: name, role, unit and field of each, in
//!    the order of `modelDescription.xml`.
//! 5. **[`Model::initialize`]** runs in initialization mode, whenever a value is read after another
//!    value was set.
//! 6. **[`Model::step`]** implements `fmi2DoStep`. Return [`Failure::Incomplete`] with the time reached
//!    if the model cannot complete the step.
//! 7. **[`Model::update`]** recomputes outputs that depend directly on inputs, between steps.
//! 8. **Model exchange** (optional): name the derivatives of the states
//!    ([`Variable::derivative_of`]), compute them in `update`, return [`Model::model_exchange`], and
//!    implement [`Model::event_indicators`] and [`Model::event`] if the model has events.
//! 9. **Directional derivatives** (optional): implement [`Model::differentiate`].
//! 10. **The first test** calls [`problems`], which returns the rules of the standard that the table
//!     breaks, each with its section. `aso-ftc pack` rejects such a model with the same messages.
//! 11. **`aso-ftc pack PATH`** builds the crate and writes the `.fmu`.
//!
//! The crate checks pointers, call order, value references, limits and NaN before it calls the
//! model. A panic in the model becomes `fmi2Fatal` of that one instance, with a message that names
//! file and line.
//!
//! The documentation of [`export!`] contains a complete model; the folder `examples` of the repository
//! contains more.
#![deny(unsafe_code)]

#[cfg(test)]
extern crate self as fmu;

mod about;
mod fence;
#[doc(hidden)]
pub mod ffi;
mod instance;
mod interface;
mod log;
mod model;
mod simulation;
pub mod solver;
mod stepper;
mod variable;
mod variables;

pub use fmu_derive::{Variables, model};
pub use fmu_description::{self as description, Experiment};
#[doc(hidden)]
pub use fmu_description::{abi, abi3, call_order, call_order3};
pub use interface::{describe, describe_3, problems};
pub use log::Log;
pub use model::{About, At, Event, Failure, Model, ModelExchange, Step};
pub use simulation::Simulation;
pub use variable::{Enumeration, Variable};
pub use variables::Variables;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
