//! The ASO controller FMU: a fault-tolerant controller with an augmented state observer, its
//! design read from `resources/design.toml`.
#![forbid(unsafe_code)]

mod controller;
mod dense;
mod dependencies;
mod detection;
mod equations;
mod loss;
mod mode;
mod names;
mod number;
mod observer;
mod reconfiguration;
mod sampled;
mod shared;
mod signals;
mod transfer;
mod validity;

pub use controller::AsoController;

#[cfg(feature = "export")]
fmu::export!(AsoController);
