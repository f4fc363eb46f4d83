//! Sends requests to a worker and receives their answers. Messages longer than the shared memory pass
//! in parts.

use std::mem::take;

use serde::de::DeserializeOwned;

use super::function::Function;
use super::isolated::Isolated;
use super::message::{RemoteError, decode, encode};
use super::perform::MESSAGE;
use super::request::Request;
use super::words::Reader;
use slave::{CallError, Failure};

/// Maximum number of bytes of an answer.
const MAX_ANSWER: u64 = u32::MAX as u64;
/// Number of bytes of memory that stay allocated for the next message.
const BUFFER: usize = 1 << 16;

impl Isolated {
    /// Sends `request`, in parts if it is longer than the shared memory; returns the answer. Panics if lists that
    /// belong together, such as references and values, have different lengths.
    pub(super) fn request<T: DeserializeOwned>(
        &mut self,
        request: &Request<'_>,
    ) -> Result<T, CallError> {
        assert!(request.has_matching_lists(), "references and values are equally many");
        let function = request.function();
        let mut message = take(&mut self.message);
        encode(request, &mut message);
        let sent = self.upload(function, &message);
        self.message = message;
        sent?;
        self.wait_for_answer(function)?;
        self.receive(function)
    }

    /// Posts an encoded request.
    fn upload(&mut self, function: Function, mut message: &[u8]) -> Result<(), CallError> {
        let capacity = 8 * self.channel.shared.area().len().saturating_sub(1);
        while message.len() > capacity {
            let (part, rest) = message.split_at(capacity);
            self.call(Function::Upload, |writer| writer.put_part(part), |_| Some(()))?;
            message = rest;
        }
        self.post(function, |writer| writer.put_part(message))
    }

    /// Returns the error that the worker sent as the answer to `function`.
    #[cold]
    pub(super) fn receive_error(&mut self, function: Function) -> CallError {
        match self.receive::<()>(function) {
            Ok(()) => self.invalid_answer(function),
            Err(error) => error,
        }
    }

    /// Reads an encoded answer.
    fn receive<T: DeserializeOwned>(&mut self, function: Function) -> Result<T, CallError> {
        let mut message = take(&mut self.message);
        message.clear();
        let answer = match self.download(&mut message)? {
            Some(()) => decode::<Result<T, RemoteError>>(&message),
            None => None,
        };
        message.shrink_to(BUFFER);
        self.message = message;
        match answer {
            Some(answer) => answer.map_err(|error| error.into_call_error(function, self.version)),
            None => Err(self.invalid_answer(function)),
        }
    }

    /// Appends the bytes of an encoded answer to `message`, in parts if the answer is longer than the shared memory;
    /// `None` if the answer is invalid.
    fn download(&mut self, message: &mut Vec<u8>) -> Result<Option<()>, CallError> {
        let mut reader = Reader::new(self.channel.shared.area());
        let head = (reader.take(), reader.take());
        let (Some(MESSAGE), Some(total @ ..=MAX_ANSWER)) = head else { return Ok(None) };
        if reader.take_bytes(message).is_none() {
            return Ok(None);
        }
        while (message.len() as u64) < total {
            let before = message.len();
            self.post(Function::Download, |writer| writer.put(before as u64))?;
            self.wait_for_answer(Function::Download)?;
            // An empty part would repeat for ever.
            if self.values(|reader| reader.take_bytes(message)).is_none() || message.len() == before
            {
                return Ok(None);
            }
        }
        Ok(Some(()))
    }

    /// Kills the worker because its answer to `function` cannot be decoded; returns the error.
    #[cold]
    pub(super) fn invalid_answer(&mut self, function: Function) -> CallError {
        let what = "returned an invalid answer: its process wrote over shared memory";
        self.abandon(function, Failure::InvalidAnswer(what.to_owned()))
    }
}
