//! Co-simulation master: connects FMU instances (slaves) and advances them together in time.
//!
//! A [`System`] holds the slaves and their connections. A [`Simulation`] initialises the system and
//! advances it with an [`Algorithm`]. A [`Probe`] or a [`Readout`] reads values between steps. A
//! [`drive::Drive`] makes a variable follow a signal; a [`fault::FaultChain`] disturbs the values
//! on a connection.
//!
//! # One communication step, from the top
//!
//! 1. [`Simulation::step`] (`simulation.rs`) plans a step with `step_control.rs` and makes it. The
//!    modules of 2 to 4 call each other in this order.
//! 2. `events.rs` ends the step at an event within it, if the algorithm has sources of events.
//! 3. `step_control.rs` repeats a step whose error is too large; `coupling.rs` repeats it until
//!    inputs and outputs agree. A repetition needs slaves whose state can be saved and restored.
//! 4. `engine.rs` makes a sweep: it steps every slave once, in the sequence of `engine/groups.rs`,
//!    except slaves whose last step goes on; `engine/threads.rs` uses threads where they are faster.
//! 5. For each slave, `exchange.rs` gathers the inputs (extrapolation, transformation, fault), sets
//!    them, calls `fmi2DoStep` and reads the outputs.
//! 6. `engine/instants.rs` iterates the events at the end of the step over all slaves.
//! 7. When the communication point is final, faults and driven variables record it (`commit`).
//!
//! The crate reads no files and loads no libraries: the crate `fmu-import` turns FMUs into slaves,
//! the crate `study` runs a `system.toml` or an SSP.
#![forbid(unsafe_code)]

pub mod algorithm;
mod capabilities;
mod choose;
mod coupling;
pub mod drive;
mod engine;
mod error;
mod events;
mod exchange;
pub mod fault;
mod grid;
mod initial;
mod limits;
mod order;
mod probe;
mod readout;
pub mod signal;
mod signal_type;
mod simulation;
mod slow_values;
mod step_control;
mod system;

pub use algorithm::{Algorithm, Coupling, Extrapolation, Method, StepControl};
pub use choose::{AlgorithmChoice, AlgorithmRequest, choose};
pub use coupling::Fallbacks;
pub use drive::Scenario;
pub use error::SystemError;
pub use grid::{EarlyEnd, check_stop_time};
pub use order::{Order, by_direct_dependencies};
pub use probe::Probe;
pub use readout::Readout;
pub use signal_type::SignalType;
pub use simulation::{Checkpoint, KeptState, Simulation};
pub use slave::{
    Background, CallError, CommunicationStep, Failure, Slave, StepRequest, StepResult,
    Transformation, Value, ValueType, to_hex,
};
pub use slow_values::{SlowState, SlowValues};
pub use system::{Connection, EventObserver, Port, System, read_value};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
