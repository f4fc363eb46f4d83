//! The rows, messages and interventions of a run that the server keeps.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde_json::{Value, json};

/// Largest number of rows that the server keeps.
const MOST_ROWS: usize = 4000;
/// Number of rows that are kept even if they have more than [`VALUES`] values.
const LEAST_ROWS: usize = 100;
/// Largest number of values in all rows that the server keeps.
const VALUES: usize = 1_000_000;
/// Largest number of messages that are kept, and that one answer contains.
const MESSAGES: usize = 1000;
/// Largest number of signals in one answer.
pub(crate) const SHOWN: usize = 32;
/// Time without a request after which a page counts as closed.
const PATIENCE: Duration = Duration::from_secs(3);

/// The state of a run at a communication point.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Simulated time of the sample in s.
    pub time: f64,
    /// Values of [`crate::Facts::signals`]; a sample with another number of values adds no row.
    pub values: Vec<f64>,
    /// Number of communication steps so far.
    pub steps: u64,
    /// Wall-clock time in s so far, without pauses.
    pub seconds: f64,
    /// Number of steps whose iteration failed; `None` without iteration.
    pub fallbacks: Option<u64>,
    /// Number of steps that ended later than the pacing requires; `None` if the run is not paced.
    pub late: Option<u64>,
}

/// An event that the run sends to the server.
pub(crate) enum Event {
    Sample(Sample),
    Message(Message),
    Intervention(Intervention),
    Ended { outcome: String },
}

/// A message with the name of its FMU, which is empty for a message of the run itself.
#[derive(Serialize)]
pub(crate) struct Message {
    pub(crate) fmu: String,
    pub(crate) text: String,
}

/// A change of the run at a time in s.
#[derive(Serialize)]
pub(crate) struct Intervention {
    pub(crate) time: f64,
    pub(crate) text: String,
}

/// The values of all signals at a time. Later rows have larger numbers.
struct Row {
    number: u64,
    time: f64,
    values: Vec<f64>,
}

/// The rows and messages that a page requests.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Query {
    /// Number of the last row that the page has.
    pub(crate) rows_after: u64,
    /// Number of messages that the page has.
    pub(crate) messages_after: u64,
    /// Positions of the signals whose values the page shows.
    pub(crate) shown: Vec<usize>,
}

/// The data of a run that the server keeps.
#[derive(Default)]
pub(crate) struct Store {
    signals: usize,
    rows: VecDeque<Row>,
    last: Sample,
    /// Number of the last row.
    row_number: u64,
    /// The last messages, at most [`MESSAGES`].
    messages: VecDeque<Message>,
    /// Number of all messages so far.
    message_count: u64,
    /// Number of messages by FMU.
    counts: BTreeMap<String, u64>,
    interventions: Vec<Intervention>,
    /// The outcome of the run, after its end.
    outcome: Option<String>,
    /// Time of the last request of a page.
    last_request: Option<Instant>,
    /// Whether a page has received the outcome.
    pub(crate) outcome_shown: bool,
}

impl Store {
    /// Creates the store of a run with this number of signals that starts at `start` s.
    pub(crate) fn new(signals: usize, start: f64) -> Self {
        Self { signals, last: Sample { time: start, ..Sample::default() }, ..Self::default() }
    }

    pub(crate) fn add(&mut self, event: Event) {
        match event {
            Event::Sample(sample) => self.add_sample(sample),
            Event::Message(message) => {
                self.message_count += 1;
                *self.counts.entry(message.fmu.clone()).or_default() += 1;
                if self.messages.len() == MESSAGES {
                    self.messages.pop_front();
                }
                self.messages.push_back(message);
            }
            Event::Intervention(intervention) => self.interventions.push(intervention),
            Event::Ended { outcome } => self.outcome = Some(outcome),
        }
    }

    fn add_sample(&mut self, mut sample: Sample) {
        let values = std::mem::take(&mut sample.values);
        let is_repeated = self.rows.back().is_some_and(|row| row.time >= sample.time);
        let time = sample.time;
        self.last = sample;
        if is_repeated || values.len() != self.signals {
            return;
        }
        self.row_number += 1;
        self.rows.push_back(Row { number: self.row_number, time, values });
        let most = (VALUES / self.signals.max(1)).clamp(LEAST_ROWS, MOST_ROWS);
        if self.rows.len() > most {
            // Removes every second row except the newest quarter, so that old rows become sparse.
            let mut position = 0;
            let newest = self.rows.len() - most / 4;
            self.rows.retain(|_| {
                position += 1;
                position % 2 == 1 || position > newest
            });
        }
    }

    /// Records that a page has sent a request now.
    pub(crate) fn record_request(&mut self) {
        self.last_request = Some(Instant::now());
    }

    /// Returns whether a page is open: one has sent a request within [`PATIENCE`].
    pub(crate) fn is_watched(&self) -> bool {
        self.last_request.is_some_and(|time| time.elapsed() < PATIENCE)
    }

    /// Returns the state of the run as JSON, with the rows and messages of `query`. Values that are not finite, and
    /// values of unknown signals, are null.
    pub(crate) fn state(&mut self, query: &Query, phase: &impl Serialize, dropped: u64) -> Value {
        self.outcome_shown |= self.outcome.is_some();
        let rows: Vec<&Row> =
            self.rows.iter().filter(|row| row.number > query.rows_after).collect();
        let column = |signal: &usize| -> Vec<Option<f64>> {
            rows.iter().map(|row| row.values.get(*signal).copied()).collect()
        };
        let first = self.message_count - self.messages.len() as u64;
        let skipped = usize::try_from(query.messages_after.saturating_sub(first)).unwrap_or(0);
        let messages: Vec<&Message> = self.messages.iter().skip(skipped).collect();
        let Sample { time, steps, seconds, fallbacks, late, .. } = &self.last;
        json!({
            "phase": phase,
            "time": time,
            "steps": steps,
            "seconds": seconds,
            "fallbacks": fallbacks,
            "late": late,
            "row": self.row_number,
            "times": rows.iter().map(|row| row.time).collect::<Vec<_>>(),
            "values": query.shown.iter().take(SHOWN).map(column).collect::<Vec<_>>(),
            "message": self.message_count,
            "messages": messages,
            "counts": self.counts,
            "dropped": dropped,
            "interventions": self.interventions,
            "outcome": self.outcome,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(time: f64) -> Event {
        Event::Sample(Sample { time, values: vec![time, f64::NAN], ..Sample::default() })
    }

    #[test]
    fn a_long_run_keeps_few_rows_from_its_whole_length() {
        let mut store = Store::new(2, 0.0);
        for step in 0..100_000 {
            store.add(sample(f64::from(step)));
        }
        assert!(store.rows.len() <= MOST_ROWS);
        let times: Vec<f64> = store.rows.iter().map(|row| row.time).collect();
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(times[0] < 1.0 && *times.last().unwrap() >= 99_999.0);
    }

    #[test]
    fn a_page_gets_the_rows_after_its_last_one_and_null_for_what_is_no_number() {
        let mut store = Store::new(2, 0.0);
        (0..5).for_each(|step| store.add(sample(f64::from(step))));
        // A sample of a paused run repeats the time.
        store.add(sample(4.0));
        let query = Query { rows_after: 3, shown: vec![1, 0, 7], ..Query::default() };
        let state = store.state(&query, &"running", 0);
        assert_eq!(state["times"], json!([3.0, 4.0]));
        assert_eq!(state["values"], json!([[null, null], [3.0, 4.0], [null, null]]));
        assert_eq!(state["row"], 5);
    }

    #[test]
    fn messages_are_counted_by_fmu_and_the_last_ones_kept() {
        let mut store = Store::new(0, 0.0);
        for number in 0..1500 {
            let fmu = if number % 3 == 0 { "plant" } else { "" }.to_owned();
            store.add(Event::Message(Message { fmu, text: number.to_string() }));
        }
        let state = store.state(&Query { messages_after: 1499, ..Query::default() }, &"running", 0);
        assert_eq!(state["counts"], json!({ "": 1000, "plant": 500 }));
        assert_eq!(state["messages"], json!([{ "fmu": "", "text": "1499" }]));
        let all = store.state(&Query::default(), &"running", 0);
        assert_eq!(all["messages"].as_array().unwrap().len(), MESSAGES);
        let none =
            store.state(&Query { messages_after: u64::MAX, ..Query::default() }, &"running", 0);
        assert_eq!(none["messages"], json!([]));
    }
}
