//! What the fuzz targets do with their bytes, and the corpora changed at random: used by the tests of this
//! crate, for a fixed count, and by `fuzz`, for as long as one likes.
//!
//! [`exporter`] drives a model through the C functions, [`system_files`] the readers of SSP and of tables of
//! signals, [`system_toml`] the reader of `system.toml`. Each target panics where a claim does not hold.
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
pub mod system_files;
pub mod system_toml;
