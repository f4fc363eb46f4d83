//! The friction pendulum: a pendulum on a cart whose rail has set-valued Stribeck friction.
#![forbid(unsafe_code)]

pub mod dynamics;
pub mod friction;
pub mod functions;
pub mod motion;
pub mod number;
pub mod parameters;
mod pendulum;
mod plant;
pub mod response;

pub use pendulum::FrictionPendulum;

#[cfg(feature = "export")]
fmu::export!(FrictionPendulum);
