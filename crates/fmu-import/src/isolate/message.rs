//! The answers of a worker and its errors, encoded by `postcard`. The FMU may have overwritten the shared memory:
//! messages are decoded from a copy, and [`decode`] returns `None` for invalid bytes.

use fmu_description::Version;
use fmu_description::abi::Status;
use serde::{Deserialize, Serialize};

use super::function::{Function, known_name};
use slave::{CallError, Failure};

/// Maximum number of bytes of one text in an error.
const TEXT: usize = 8192;

/// The result of an instantiation.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Opening {
    /// The instance exists.
    Instantiated,
    /// The FMU does not load or instantiate, for this reason.
    Refused(String),
    /// A library of `preload` does not load, for this reason.
    NotPreloaded(String),
}

/// A [`CallError`] in the form in which a worker sends it.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct RemoteError {
    function: String,
    failure: RemoteFailure,
    messages: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
enum RemoteFailure {
    Returned(i32),
    Missing,
    TimedOut(f64),
    Panicked(String),
    InvalidAnswer(String),
    Unrepresentable(String),
}

/// Returns the first [`TEXT`] bytes of `text`; a character that is cut becomes U+FFFD.
fn clipped(text: &str) -> String {
    String::from_utf8_lossy(&text.as_bytes()[..text.len().min(TEXT)]).into_owned()
}

impl From<CallError> for RemoteError {
    fn from(error: CallError) -> Self {
        let failure = match &error.failure {
            Failure::Status(status) => RemoteFailure::Returned(*status as i32),
            Failure::UnknownStatus(status) => RemoteFailure::Returned(*status),
            Failure::Missing => RemoteFailure::Missing,
            Failure::TimedOut(seconds) => RemoteFailure::TimedOut(*seconds),
            Failure::Panicked(text) => RemoteFailure::Panicked(clipped(text)),
            Failure::InvalidAnswer(text) => RemoteFailure::InvalidAnswer(clipped(text)),
            Failure::Unrepresentable(text) => RemoteFailure::Unrepresentable(clipped(text)),
            // All other failures are ends of a process, which only the master reports.
            other => RemoteFailure::InvalidAnswer(other.to_string()),
        };
        let messages = error.messages.iter().map(|text| clipped(text)).collect();
        Self { function: error.function.to_owned(), failure, messages }
    }
}

impl RemoteError {
    /// Returns the error of a call of `function` of an FMU of that version.
    pub(super) fn into_call_error(self, function: Function, version: Version) -> CallError {
        let failure = match self.failure {
            RemoteFailure::Returned(status) => {
                Status::from_c(status).map_or(Failure::UnknownStatus(status), Failure::Status)
            }
            RemoteFailure::Missing => Failure::Missing,
            RemoteFailure::TimedOut(seconds) => Failure::TimedOut(seconds),
            RemoteFailure::Panicked(text) => Failure::Panicked(text),
            RemoteFailure::InvalidAnswer(text) => Failure::InvalidAnswer(text),
            RemoteFailure::Unrepresentable(text) => Failure::Unrepresentable(text),
        };
        let function = known_name(&self.function).unwrap_or(function.name(version));
        CallError { function, failure, messages: self.messages }
    }
}

/// Replaces the content of `bytes` by the encoded `value`; allocates only if the capacity is too small.
pub(super) fn encode(value: &impl Serialize, bytes: &mut Vec<u8>) {
    let mut buffer = std::mem::take(bytes);
    buffer.clear();
    // Fails only for sequences of unknown length, which no message has; the empty result then fails to decode.
    *bytes = postcard::to_extend(value, buffer).unwrap_or_default();
}

/// Decodes `bytes`; `None` if they are not exactly one `T`.
pub(super) fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<T> {
    match postcard::take_from_bytes(bytes) {
        Ok((value, [])) => Some(value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::request::Request;
    use super::*;

    fn through(error: &CallError) -> CallError {
        let mut bytes = Vec::new();
        encode(&Err::<(), _>(RemoteError::from(error.clone())), &mut bytes);
        let answer: Result<(), RemoteError> = decode(&bytes).unwrap();
        answer.unwrap_err().into_call_error(Function::DoStep, Version::V2)
    }

    #[test]
    fn errors_pass_unchanged() {
        let failures = [
            Failure::Status(Status::Fatal),
            Failure::UnknownStatus(-77),
            Failure::Missing,
            Failure::TimedOut(0.25),
            Failure::Panicked("index 4".to_owned()),
            Failure::InvalidAnswer("returned fmi2Discard".to_owned()),
            Failure::Unrepresentable("2^63".to_owned()),
        ];
        for failure in failures {
            let messages = ["first", "", "zweite Äußerung"].map(str::to_owned).to_vec();
            let error = CallError { function: "fmi2GetRealStatus", failure, messages };
            assert_eq!(through(&error), error);
        }
    }

    #[test]
    fn long_texts_are_clipped_and_an_unknown_function_is_that_of_the_request() {
        let failure = Failure::Panicked("é".repeat(TEXT));
        let error =
            CallError { function: "another", failure, messages: vec!["x".repeat(TEXT + 1)] };
        let actual = through(&error);
        assert_eq!(actual.function, "fmi2DoStep");
        assert_eq!(actual.failure, Failure::Panicked("é".repeat(TEXT / 2)));
        assert_eq!(actual.messages, ["x".repeat(TEXT)]);
    }

    #[test]
    fn random_bytes_give_a_message_or_none_and_no_panic() {
        let mut state = 1_u64;
        let mut bytes = [0; 320];
        for _ in 0..20_000 {
            for byte in bytes.as_chunks_mut::<8>().0 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *byte = (state >> (state >> 58)).to_le_bytes();
            }
            let _ = decode::<Request<'_>>(&bytes);
            let _ = decode::<Result<Vec<String>, RemoteError>>(&bytes);
            let _ = decode::<Result<Opening, RemoteError>>(&bytes);
        }
    }

    #[test]
    fn a_reused_buffer_is_not_allocated_again() {
        let mut bytes = Vec::with_capacity(64);
        let address = bytes.as_ptr();
        encode(&Request::SaveState(3), &mut bytes);
        assert_eq!(bytes.as_ptr(), address);
        assert!(!bytes.is_empty());
    }
}
