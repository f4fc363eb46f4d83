//! The live view of a campaign.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use live::{Action, Facts, Phase, Sample, Subject, Variable, View};
use pyo3::prelude::*;

/// Time for which the page remains after the end of the campaign, so that an open page can show the end.
const CLOSE_DELAY: Duration = Duration::from_secs(2);

/// A page on this machine that shows the runs of a campaign.
#[pyclass(frozen)]
pub(crate) struct LiveView {
    /// `None` after [`LiveView::end`].
    view: Mutex<Option<View>>,
    address: String,
}

impl LiveView {
    /// Calls `act` with the view, unless the view has ended.
    fn with(&self, act: impl FnOnce(&View)) {
        if let Some(view) = &*self.view.lock().unwrap_or_else(PoisonError::into_inner) {
            act(view);
        }
    }
}

#[pymethods]
impl LiveView {
    /// Serves the page of the campaign `name` with `total` runs, of which `done` are done already.
    #[new]
    fn new(name: String, total: f64, done: f64, measures: Vec<String>) -> PyResult<Self> {
        let signal = |name| Variable { name, kind: "Real".to_owned(), ..Variable::default() };
        let facts = Facts {
            subject: Subject::Campaign,
            system: name,
            start: done,
            stop: total,
            signals: measures.into_iter().map(signal).collect(),
            ..Facts::default()
        };
        let view = View::open(&facts, Phase::Running)?;
        let address = view.address().to_owned();
        Ok(Self { view: Mutex::new(Some(view)), address })
    }

    /// The address of the page, with its token.
    #[getter]
    fn address(&self) -> &str {
        &self.address
    }

    /// Publishes a finished run: the number of finished runs including this one, the time of the campaign so far in s,
    /// the measures, and a line of text with its status.
    fn publish(&self, finished: f64, seconds: f64, measures: Vec<f64>, status: &str, line: String) {
        self.with(|view| {
            let values = measures;
            view.publish(Sample { time: finished, seconds, values, ..Sample::default() });
            view.messages().send(status, line);
        });
    }

    /// Answers the requests of the page. `held` is whether the campaign is paused; returns whether it should be paused
    /// from now on, and whether it should stop.
    fn attend(&self, mut held: bool) -> (bool, bool) {
        let mut stopped = false;
        self.with(|view| {
            if !view.is_called() {
                return;
            }
            let _ = view.take_calls();
            while let Some(request) = view.request(None) {
                let answer = match &request.action {
                    Action::Pause => {
                        held = true;
                        Ok("No further run starts.")
                    }
                    Action::Continue => {
                        held = false;
                        Ok("The campaign goes on.")
                    }
                    Action::Stop => {
                        stopped = true;
                        Ok("The campaign is stopped; the same command goes on with it.")
                    }
                    Action::Step | Action::Intervene(_) => {
                        Err("a campaign can be paused and stopped only")
                    }
                };
                view.set_phase(if held { Phase::Paused } else { Phase::Running });
                request.answer(answer.map(str::to_owned).map_err(str::to_owned));
            }
        });
        (held, stopped)
    }

    /// Tells the page how the campaign ended, and closes it.
    fn end(&self, py: Python<'_>, outcome: &str) {
        let view = self.view.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(view) = view {
            py.detach(|| view.end(outcome, CLOSE_DELAY));
        }
    }
}
