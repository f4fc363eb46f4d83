#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod channel;
pub mod design;
mod interpolation;
mod matrix;
#[expect(
    clippy::inline_always,
    reason = "in one function the compiler knows all sizes, and what a design lacks goes"
)]
pub mod sample;

pub use channel::{channel, channels};
pub use design::{Design, DesignError};
pub use matrix::Matrix;

/// The sources of [`sample`], of `sample::detection` and of `sample::reconfiguration`: no dependency, no standard library.
pub const SOURCES: [&str; 3] = [
    include_str!("sample.rs"),
    include_str!("sample/detection.rs"),
    include_str!("sample/reconfiguration.rs"),
];
