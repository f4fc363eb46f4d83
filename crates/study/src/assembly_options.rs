//! Options of an assembly that are not part of the configuration.

use std::path::{Path, PathBuf};

use fmu_import::CallLog;

use crate::store::Store;
use crate::table::Table;

/// Options of [`crate::assemble()`] that are not part of the configuration.
#[derive(Clone, Copy, Debug, Default)]
pub struct AssemblyOptions<'a> {
    /// Whether the FMUs log everything.
    pub logging: bool,
    /// Whether free outputs and inputs of equal units are connected.
    pub by_unit: bool,
    /// The log of FMI calls, if any.
    pub log_calls: Option<&'a CallLog>,
    /// FMUs that are already open, which further runs may use too.
    pub store: Option<&'a Store>,
    /// The program that becomes the separate process of an FMU; default: this program.
    pub worker: Option<&'a Path>,
    /// Tables in memory that the scenario reads, each with the path of the file whose place it takes.
    pub tables: &'a [(PathBuf, Table)],
}
