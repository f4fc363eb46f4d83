//! The friction pendulum: a pendulum on a cart whose rail has set-valued Stribeck friction.
#![forbid(unsafe_code)]

mod dynamics;
mod friction;
mod functions;
mod motion;
mod number;
mod parameters;
mod pendulum;
mod plant;
mod response;

pub use pendulum::FrictionPendulum;

#[cfg(feature = "export")]
fmu::export!(FrictionPendulum);
