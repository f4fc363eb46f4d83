//! Input files whose errors point at the place, and atomic output files.
//!
//! [`document`] reads TOML: each value knows its name and its place in the text. [`whole`] writes a
//! file beside its target and renames it.
#![forbid(unsafe_code)]

pub mod document;
pub mod whole;

pub use document::{Entry, Place, PlaceError, Source, Table};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
