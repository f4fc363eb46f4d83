//! Fuzz targets, and random changes of their corpora. The tests of this crate run them a fixed
//! number of times, `fuzz` runs them without end.
//!
//! [`exporter`] drives a model through the C functions, [`system_files`] the readers of SSP and of
//! tables of signals, [`system_toml`] the reader of `system.toml`. Each target panics if a claim
//! does not hold.
#![expect(missing_docs, reason = "parts of tests")]
#![expect(
    clippy::float_cmp,
    clippy::missing_errors_doc,
    clippy::missing_panics_doc,
    clippy::must_use_candidate,
    clippy::unwrap_used,
    reason = "parts of tests; values that are set and read back"
)]

pub mod array;
pub mod calls;
#[cfg(not(miri))]
pub mod changes;
pub mod choice;
pub mod corpus;
pub mod exporter;
pub mod importer;
pub mod machine;
pub mod prediction;
pub mod sequence;
pub mod sequence3;
pub mod system_files;
pub mod system_toml;
