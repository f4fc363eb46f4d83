//! Options of an assembly that are not part of the configuration.

use std::path::{Path, PathBuf};

use fmu_import::CallLog;

use crate::store::Store;
use crate::table::Table;

/// Options of [`crate::assemble()`] that are not part of the configuration.
#[derive(Clone, Copy, Debug, Default)]
pub struct AssemblyOptions<'a> {
    /// Whether the FMUs log messages of all categories.
    pub logging: bool,
    /// Whether outputs and inputs of equal units are connected if the configuration states no connections.
    pub by_unit: bool,
    /// The log of FMI calls, if any.
    pub log_calls: Option<&'a CallLog>,
    /// FMUs and system structures that several runs share, if any.
    pub store: Option<&'a Store>,
    /// The program to start as the separate process of an FMU; default: this program.
    pub worker: Option<&'a Path>,
    /// Tables in memory that the scenario reads instead of files, each with the path of the file.
    pub tables: &'a [(PathBuf, Table)],
}
