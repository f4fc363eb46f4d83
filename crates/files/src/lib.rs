//! Input files with errors that point at the wrong value, and atomic output files.
//!
//! [`document`] reads TOML: each value has its name and its place in the text. [`whole`] writes a temporary file beside
//! the target and renames it. [`check_distinct`] refuses an output that is also an input or another output.
//! [`sentence()`] joins an error and its causes.
#![forbid(unsafe_code)]

mod distinct;
pub mod document;
mod sentence;
pub mod whole;

pub use distinct::{OutputConflict, check_distinct};
pub use document::{Entry, Place, PlaceError, Source, Table};
pub use sentence::sentence;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
