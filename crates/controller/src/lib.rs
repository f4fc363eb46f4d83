#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod channel;
pub mod clock;
pub mod design;
mod interpolation;
pub mod kalman;
mod matrix;
#[expect(
    clippy::inline_always,
    reason = "in one function the compiler knows all sizes, and what a design lacks goes"
)]
pub mod sample;

pub use channel::{channel, channels};
pub use design::{Design, DesignError};
pub use matrix::Matrix;

/// The files of [`sample`], by their paths in `src`: no dependency, no standard library.
pub const SOURCES: [(&str, &str); 6] = [
    ("sample.rs", include_str!("sample.rs")),
    ("sample/detection.rs", include_str!("sample/detection.rs")),
    ("sample/matrix.rs", include_str!("sample/matrix.rs")),
    ("sample/measurements.rs", include_str!("sample/measurements.rs")),
    ("sample/number.rs", include_str!("sample/number.rs")),
    ("sample/reconfiguration.rs", include_str!("sample/reconfiguration.rs")),
];
