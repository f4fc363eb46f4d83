//! Errors of calls that the importer refuses without the FMU.

use slave::{CallError, Failure};

/// Returns the error of a call of `function` that is refused, or whose result is impossible, for the reason `what`.
#[cold]
pub(super) fn refused(function: &'static str, what: String) -> CallError {
    CallError { function, failure: Failure::InvalidAnswer(what), messages: Vec::new() }
}

/// Returns the error of an access to a value reference that no variable has.
pub(super) fn unknown(function: &'static str, reference: u32) -> CallError {
    refused(
        function,
        format!("cannot access the value reference {reference}, which no variable has"),
    )
}
