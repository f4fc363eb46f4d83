//! Errors of calls that the importer refuses without the FMU.

use fmu_description::abi::Status;
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

/// Returns whether the FMU is in the same mode as before a call that failed: the call was refused, or returned
/// `fmi3Discard` (FMI 3.0.2, section 2.2.4). After `fmi3Error` it is in state Terminated (section 2.3.1).
pub(super) fn keeps_mode(error: &CallError) -> bool {
    use Failure as F;
    matches!(error.failure, F::InvalidAnswer(_) | F::Missing | F::Status(Status::Discard))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_or_discarded_value_keeps_the_mode_and_an_error_does_not() {
        assert!(keeps_mode(&refused("fmi3SetUInt64", "cannot take the value -1".to_owned())));
        let of_status = |status| CallError {
            function: "fmi3SetUInt64",
            failure: Failure::Status(status),
            messages: Vec::new(),
        };
        assert!(keeps_mode(&of_status(Status::Discard)));
        assert!(!keeps_mode(&of_status(Status::Error)));
        assert!(!keeps_mode(&of_status(Status::Fatal)));
    }
}
