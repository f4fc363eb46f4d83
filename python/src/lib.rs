//! The extension module of the Python package `aso_ftc`: a thin layer on the crates `study`, `design` and
//! `fmu-description`. The package's Python modules build the public interface on top of it.
#![deny(unsafe_code)]
#![expect(clippy::needless_pass_by_value, reason = "functions receive owned values from Python")]

mod configuration;
mod description;
mod designed;
mod error;
mod guard;
mod live;
mod lock;
mod logging;
mod node;
mod python_slave;
mod run;
mod stepper;
mod table;
mod value;
mod watch;

use pyo3::prelude::*;

/// The extension module of `aso_ftc`.
#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::configuration::{check_configuration, parse_toml, read_configuration, render_toml};
    #[pymodule_export]
    use super::description::{compile, read_model_description};
    #[pymodule_export]
    use super::designed::{Designed, design_file, design_plant, identify};
    #[pymodule_export]
    use super::live::LiveView;
    #[pymodule_export]
    use super::lock::{FileLock, lock_file};
    #[pymodule_export]
    use super::run::{Study, clear, open_fmus, set_worker};
    #[pymodule_export]
    use super::stepper::Stepper;
    #[pymodule_export]
    use super::table::{Numbers, Table, table_from_bytes};
    #[pymodule_export]
    use super::watch::Cancel;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::logging::start();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
