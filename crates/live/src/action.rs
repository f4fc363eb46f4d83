//! The requests that a page sends to a run.

use std::sync::mpsc::SyncSender;

/// An action that a page requests of the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Pause at the next communication point.
    Pause,
    /// Continue after a pause.
    Continue,
    /// Make one communication step and pause again.
    Step,
    /// End the run.
    Stop,
    /// Add the entries of this TOML text to the scenario of the run.
    Intervene(String),
}

/// A request of a page. The page waits a short time for the answer.
pub struct Request {
    /// The action requested.
    pub action: Action,
    pub(crate) answer: SyncSender<Result<String, String>>,
}

impl Request {
    /// Answers with a sentence: `Ok` if the run has performed the action, otherwise `Err` with the reason.
    pub fn answer(self, answer: Result<String, String>) {
        // The page may no longer wait.
        let _ = self.answer.try_send(answer);
    }
}
