//! Exports a Rust model as an FMU for co-simulation and model exchange (FMI 2.0 and 3.0).
//!
//! A struct is the model: its fields are the variables, `update` has the equations, and [`export!`] makes
//! the library. The crate derives the C functions, `modelDescription.xml` and the value references.
//!
//! ```
//! use fmu::{Event, Failure, Model, Variables};
//!
//! /// A bouncing ball: h' = v, v' = g; an impact on the ground turns v into -e v.
//! #[derive(Clone, Variables, serde::Serialize, serde::Deserialize)]
//! struct BouncingBall {
//!     /// Height
//!     #[fmu(output, reinit, unit = "m", start = 1)]
//!     h: f64,
//!     /// Velocity
//!     #[fmu(output, derivative_of = h, reinit, unit = "m/s", start = 0)]
//!     v: f64,
//!     /// Acceleration
//!     #[fmu(derivative_of = v, unit = "m/s2")]
//!     a: f64,
//!     /// Gravity
//!     #[fmu(parameter, unit = "m/s2", start = -9.81)]
//!     g: f64,
//!     /// Coefficient of restitution
//!     #[fmu(tunable, min = 0.5, max = 1, start = 0.7)]
//!     e: f64,
//! }
//!
//! #[fmu::model(event_indicators = 1, stop_time = 1)]
//! impl Model for BouncingBall {
//!     fn update(&mut self, _time: f64) -> Result<(), Failure> {
//!         self.a = self.g;
//!         Ok(())
//!     }
//!
//!     fn event_indicators(&self, _time: f64, z: &mut [f64]) {
//!         z[0] = self.h;
//!     }
//!
//!     fn event(&mut self, _time: f64) -> Result<Event, Failure> {
//!         let impact = self.h <= 0.0 && self.v < 0.0;
//!         if impact {
//!             (self.h, self.v) = (f64::MIN_POSITIVE, -self.e * self.v);
//!         }
//!         Ok(Event { values_of_continuous_states_changed: impact, ..Event::default() })
//!     }
//! }
//!
//! fmu::export!(BouncingBall);
//!
//! # fn main() -> Result<(), Failure> {
//! assert_eq!(fmu::problems::<BouncingBall>("resources".as_ref()), Ok(vec![]));
//! let mut ball = fmu::Simulation::<BouncingBall>::new("resources".as_ref())?;
//! ball.step(1.0)?;
//! assert!((ball.model().h - 0.225_059_760_719).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # A tour
//!
//! 1. **A crate with a `cdylib`.** `aso-ftc new NAME` writes one: `Cargo.toml` with
//!    `crate-type = ["cdylib", "rlib"]`, this crate and `serde`, and a model to change.
//! 2. **The struct** holds parameters, inputs, outputs and states. It derives `Clone`, `Serialize` and
//!    `Deserialize`: a copy of it is the FMU state (`fmi2GetFMUstate`), its bytes are the serialised
//!    FMU state. Mark a field that is not part of the state (a cache) with `#[serde(skip)]`.
//! 3. **[`derive@Variables`]** makes each field with `#[fmu(...)]` a variable; its doc comment is the
//!    description. Mistakes are errors of the compiler. A data-driven model, whose variables follow from
//!    its `resources`, returns a table of [`Variable`]s from [`Model::variables`] instead.
//! 4. **[`#[fmu::model]`](macro@model)** adds to the implementation of [`Model`] what follows from the
//!    struct: name, start values, table. [`about!`] takes the rest from `Cargo.toml`. An item that the
//!    author writes takes precedence.
//! 5. **[`Model::update`]** computes outputs and derivatives from states, inputs, parameters and time.
//! 6. **[`Model::event_indicators`] and [`Model::event`]** (optional) state when an event happens and what
//!    it changes.
//! 7. **Both interfaces follow.** In model exchange the importer integrates the derivatives. In
//!    co-simulation this crate integrates them and locates the events. A model that advances in another
//!    way, such as in closed form, implements [`Model::step`]; [`solver`] has the parts.
//! 8. **[`Model::initialize`]** runs in initialization mode, whenever a value is read after another
//!    value was set; [`Model::check`] runs before it.
//! 9. **Directional derivatives** (optional): implement [`Model::differentiate`].
//! 10. **Messages** (optional): a field of the type [`Log`] takes messages and warnings.
//! 11. **Structural parameters** (optional, FMI 3.0): extents of arrays that the importer chooses; see
//!     [`Variable::structural`] and [`Model::resize`].
//! 12. **The first test** calls [`problems`], which returns the rules of the standard that the
//!     variables break, each with its section. `aso-ftc pack` rejects such a model with the same
//!     messages. Further tests run the model by [`Simulation`].
//! 13. **`aso-ftc pack PATH`** builds the crate and writes the `.fmu`.
//!
//! The crate checks pointers, call order, value references, limits and NaN before it calls the
//! model. A panic in the model becomes `fmi2Fatal` of that one instance, with a message that names
//! file and line.
//!
//! The folder `examples` of the repository contains more models.
#![deny(unsafe_code)]

#[cfg(test)]
extern crate self as fmu;

mod about;
mod callbacks;
mod fence;
#[doc(hidden)]
pub mod ffi;
mod instance;
mod interface;
mod linked;
mod log;
mod model;
mod room;
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
pub use linked::Linked;
pub use log::Log;
pub use model::{About, At, Event, Failure, Model, ModelExchange, Step};
pub use simulation::Simulation;
pub use variable::{Enumeration, Variable};
pub use variables::Variables;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
