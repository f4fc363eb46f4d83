//! Calls from Python to Rust, and their exceptions.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::PoisonError;

use pyo3::exceptions::PyException;
use pyo3::prelude::*;

use crate::error::Exception;
use crate::python_slave::Raised;

/// Calls `work` with the interpreter released. A panic becomes an exception.
pub(crate) fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    result.map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("unknown");
        let sentence = format!("aso_ftc failed by an internal error, please report it: {text}");
        Exception::new("Error", "Panic", sentence).raise(py)
    })
}

/// Returns `exception` as an error of Python whose cause is the exception that a Python slave raised, if any. Returns
/// the cause itself if it is a `BaseException` but no `Exception`, such as `KeyboardInterrupt`.
pub(crate) fn with_cause(py: Python<'_>, exception: Exception, raised: &Raised) -> PyErr {
    let cause = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    let Some(cause) = cause else { return exception.raise(py) };
    if !cause.is_instance_of::<PyException>(py) {
        return cause;
    }
    let error = exception.raise(py);
    error.set_cause(py, Some(cause));
    error
}
