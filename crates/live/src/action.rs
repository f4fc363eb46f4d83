//! What a page asks of a run.

use std::sync::mpsc::SyncSender;

/// What a page asks of the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Hold at the next communication point.
    Pause,
    /// Go on.
    Continue,
    /// Make one communication step and hold again.
    Step,
    /// End the run.
    Stop,
    /// Add these entries, in TOML, to the scenario.
    Intervene(String),
}

/// A request of a page, which waits for its answer.
pub struct Request {
    /// What is asked.
    pub action: Action,
    pub(crate) answer: SyncSender<Result<String, String>>,
}

impl Request {
    /// Answers with a sentence, or with an error.
    pub fn answer(self, answer: Result<String, String>) {
        // The page may have given up.
        let _ = self.answer.try_send(answer);
    }
}
