//! Nothing from outside can crash an exported model.
#![expect(clippy::float_cmp, reason = "values that are set and read back")]
#![expect(clippy::unwrap_used, reason = "tests")]

mod array;
mod calls;
#[cfg(not(miri))]
mod changes;
mod choice;
mod corpus;
#[cfg(not(miri))]
mod hook;
mod importer;
mod machine;
mod mutations;
mod prediction;
mod replay;
mod sequence;
mod sequences;
mod targets;
mod threads;
mod uninitialised;
