//! The addresses of the page.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use figure::interactive::{BASE_STYLE, COLOURS, LINKED, LINKED_STYLE, UPLOT, UPLOT_STYLE, USAGE};
use serde_json::json;

use crate::action::{Action, Request};
use crate::answer::Answer;
use crate::guard::Guard;
use crate::request::HttpRequest;
use crate::shared::{Phase, Shared};
use crate::store::{Query, SHOWN};

/// Longest time to wait for an answer of the run, which may be in the middle of a step.
const PATIENCE: Duration = Duration::from_secs(2);
/// The content type of requests to the run. A page of another site can send this type only after a preflight request of
/// the browser, which this server refuses.
const TOML: &str = "application/toml";

const HTML: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = include_str!("page/page.js");

/// The content of the server, and its access to the run.
pub(crate) struct Site {
    pub(crate) guard: Guard,
    /// The facts, in JSON.
    pub(crate) facts: String,
    pub(crate) shared: Arc<Shared>,
    pub(crate) requests: SyncSender<Request>,
}

impl Site {
    pub(crate) fn answer(&self, request: &HttpRequest) -> Answer {
        let path = match self.guard.admit(request) {
            Ok(path) => path,
            Err((status, reason)) => return Answer::refusal(status, reason),
        };
        self.shared.store().record_request();
        let action = match path {
            "pause" => Some(Action::Pause),
            "continue" => Some(Action::Continue),
            "step" => Some(Action::Step),
            "stop" => Some(Action::Stop),
            "scenario" => Some(Action::Intervene(request.body.clone())),
            _ => None,
        };
        let is_read = ["", "page.css", "page.js", "plots.js", "facts", "state"].contains(&path);
        match (action, request.method.as_str()) {
            (Some(action), "POST") => self.perform(action, request),
            (Some(_), _) => Answer { allow: Some("POST"), ..Answer::refusal(405, "expected POST") },
            (None, "GET") if is_read => self.read(path, request),
            (None, _) if is_read => {
                Answer { allow: Some("GET"), ..Answer::refusal(405, "expected GET") }
            }
            (None, _) => Answer::refusal(404, "there is nothing at this address"),
        }
    }

    fn read(&self, path: &str, request: &HttpRequest) -> Answer {
        match path {
            "" => Answer::file("text/html", HTML),
            "page.css" => Answer {
                body: [UPLOT_STYLE, COLOURS, BASE_STYLE, LINKED_STYLE, STYLE].concat().into(),
                ..Answer::file("text/css", "")
            },
            "page.js" => Answer::file("text/javascript", SCRIPT),
            "plots.js" => Answer {
                body: [UPLOT, LINKED, "const USAGE = ", &json!(USAGE).to_string(), ";\n"]
                    .concat()
                    .into(),
                ..Answer::file("text/javascript", "")
            },
            "facts" => Answer::text_of_json(200, self.facts.clone()),
            _ => match query(&request.query) {
                Some(query) => self.state(&query),
                None => Answer::refusal(400, "expected state?rows=N&messages=N&show=N,N"),
            },
        }
    }

    fn state(&self, query: &Query) -> Answer {
        // Requests a sample at once, so that a page shows its first sample without delay.
        self.shared.call_for_sample();
        let dropped = self.shared.dropped.load(Ordering::Relaxed);
        // The phase is read before `store` takes the events, so that a page that sees the end has all events.
        let phase = self.shared.phase();
        let state = self.shared.store().state(query, &phase, dropped);
        Answer::json(200, &state)
    }

    fn perform(&self, action: Action, request: &HttpRequest) -> Answer {
        let kind = request.kind.as_deref().unwrap_or_default();
        if kind.split(';').next().unwrap_or_default().trim() != TOML {
            return Answer::refusal(415, "expected the Content-Type application/toml");
        }
        let (sender, answer) = sync_channel(1);
        let ended = || Answer::refusal(410, "the run has ended");
        if self.shared.phase() == Phase::Ended {
            return ended();
        }
        match self.requests.try_send(Request { action, answer: sender }) {
            Ok(()) => self.shared.call_for_request(),
            Err(TrySendError::Full(_)) => {
                return Answer::refusal(503, "the run has not answered the requests before");
            }
            Err(TrySendError::Disconnected(_)) => return ended(),
        }
        match answer.recv_timeout(PATIENCE) {
            Ok(Ok(sentence)) => Answer::json(200, &json!({ "answer": sentence })),
            Ok(Err(sentence)) => Answer::refusal(422, &sentence),
            Err(RecvTimeoutError::Timeout) => {
                let sentence = "the run is still within a step; it answers after it";
                Answer::json(202, &json!({ "answer": sentence }))
            }
            Err(RecvTimeoutError::Disconnected) => ended(),
        }
    }
}

/// Parses `rows=N&messages=N&show=N,N`; every part may be missing, and signals after the first [`SHOWN`] are ignored.
/// Returns `None` for other text.
fn query(text: &str) -> Option<Query> {
    let mut query = Query::default();
    for part in text.split('&').filter(|part| !part.is_empty()) {
        let (name, value) = part.split_once('=')?;
        match name {
            "rows" => query.rows_after = value.parse().ok()?,
            "messages" => query.messages_after = value.parse().ok()?,
            "show" => {
                let numbers = value.split(',').filter(|number| !number.is_empty()).take(SHOWN);
                query.shown = numbers.map(|number| number.parse().ok()).collect::<Option<_>>()?;
            }
            _ => return None,
        }
    }
    Some(query)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_is_three_lists_of_numbers() {
        let actual = query("rows=3&messages=4&show=1,2").unwrap();
        assert_eq!(actual, Query { rows_after: 3, messages_after: 4, shown: vec![1, 2] });
        assert_eq!(query(""), Some(Query::default()));
        assert_eq!(query("show=").unwrap().shown, Vec::<usize>::new());
        for wrong in [
            "rows",
            "rows=",
            "rows=-1",
            "rows=1e3",
            "show=a",
            "other=1",
            "rows=99999999999999999999",
        ] {
            assert_eq!(query(wrong), None, "{wrong}");
        }
        let many = (0..1000).map(|number| number.to_string()).collect::<Vec<_>>().join(",");
        assert_eq!(query(&format!("show={many}")).unwrap().shown.len(), SHOWN);
    }
}
