#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod channel;
pub mod design;
mod interpolation;
mod matrix;

pub use channel::{channel, channels};
pub use design::{Design, DesignError};
pub use matrix::Matrix;
