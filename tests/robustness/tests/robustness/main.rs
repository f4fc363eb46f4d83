//! No call and no file from outside crashes an exported model.
#![expect(clippy::float_cmp, reason = "values that are set and read back")]
#![expect(clippy::unwrap_used, reason = "tests")]

#[cfg(not(miri))]
mod hook;
mod mutations;
mod replay;
mod sequences;
mod sequences3;
#[cfg(not(miri))]
mod system_files;
#[cfg(not(miri))]
mod system_toml;
mod threads;
mod uninitialised;
