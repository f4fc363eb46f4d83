//! The interface of the run to its page.

use std::io;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use crate::action::Request;
use crate::facts::Facts;
use crate::guard::{Guard, Token};
use crate::routes::Site;
use crate::server;
use crate::shared::{Phase, Shared};
use crate::store::{Event, Intervention, Message, Sample, Store};

/// Largest number of events of the run that wait for the server.
const EVENTS: usize = 4096;
/// Largest number of requests that wait for the run.
const REQUESTS: usize = 32;
/// Interval between two checks whether the page has received the outcome.
const LOOK: Duration = Duration::from_millis(20);

/// Sends messages to the page, from any thread. Messages that the server cannot take at once are dropped and counted.
#[derive(Clone)]
pub struct Messages {
    events: SyncSender<Event>,
    shared: Arc<Shared>,
}

impl Messages {
    /// Sends a message of the FMU `fmu`; the name is empty for a message that comes from no FMU.
    pub fn send(&self, fmu: &str, text: String) {
        self.publish(Event::Message(Message { fmu: fmu.to_owned(), text }));
    }

    fn publish(&self, event: Event) {
        if self.events.try_send(event).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The page of a run. Dropping it ends the server.
pub struct View {
    messages: Messages,
    shared: Arc<Shared>,
    requests: Receiver<Request>,
    port: u16,
    address: String,
}

impl View {
    /// Starts the server of the page at a random port of 127.0.0.1. `phase` is the phase in which the run starts.
    ///
    /// # Errors
    ///
    /// Returns an error if the system provides no port, no random numbers or no thread.
    pub fn open(facts: &Facts, phase: Phase) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let port = listener.local_addr()?.port();
        let token = Token::random()?;
        let address = format!("http://127.0.0.1:{port}/{}/", token.text());
        let (events, event_queue) = sync_channel(EVENTS);
        let (request_sender, requests) = sync_channel(REQUESTS);
        let store = Store::new(facts.signals.len(), facts.start);
        let shared = Arc::new(Shared::new(event_queue, store, phase));
        let facts = serde_json::to_string(facts).map_err(io::Error::other)?;
        let guard = Guard::new(token, port);
        let site = Site { guard, facts, shared: shared.clone(), requests: request_sender };
        server::start(listener, Arc::new(site))?;
        let messages = Messages { events, shared: shared.clone() };
        Ok(Self { messages, shared, requests, port, address })
    }

    /// Returns the address of the page, with its token.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns whether the server asks for a sample or for the answer to a request.
    #[inline]
    #[must_use]
    pub fn is_called(&self) -> bool {
        self.shared.is_called()
    }

    /// Makes [`View::is_called`] return false until the server asks again; returns whether a sample is due. The
    /// requests are then available by [`View::request`].
    #[must_use]
    pub fn take_calls(&self) -> bool {
        self.shared.take_calls()
    }

    /// Makes [`View::is_called`] return true, for example at the next communication point.
    pub fn call_again(&self) {
        self.shared.call_for_request();
    }

    /// Returns the next request, if there is one; waits for it up to the time `wait`, or not at all if `wait`
    /// is `None`.
    #[must_use]
    pub fn request(&self, wait: Option<Duration>) -> Option<Request> {
        match wait {
            None => self.requests.try_recv().ok(),
            Some(wait) => match self.requests.recv_timeout(wait) {
                Ok(request) => Some(request),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => {
                    std::thread::sleep(wait);
                    None
                }
            },
        }
    }

    /// Publishes a sample. The sample is dropped and counted if the server cannot take it at once.
    pub fn publish(&self, sample: Sample) {
        self.messages.publish(Event::Sample(sample));
    }

    /// Sets the wall-clock time that the last sample took. The server then asks for samples so rarely that samples of
    /// up to a second take at most 2 % of the time, not counting samples that a page requests.
    pub fn set_cost(&self, cost: Duration) {
        self.shared.set_sample_duration(cost);
    }

    /// Publishes an intervention at `time` in s, which is dropped and counted if the server cannot take it at once.
    pub fn intervened(&self, time: f64, text: String) {
        self.messages.publish(Event::Intervention(Intervention { time, text }));
    }

    /// Publishes the phase of the run.
    pub fn set_phase(&self, phase: Phase) {
        self.shared.set_phase(phase);
    }

    /// Returns a sender of messages to the page.
    #[must_use]
    pub fn messages(&self) -> Messages {
        self.messages.clone()
    }

    /// Publishes the end of the run and closes the server. If a page is open, waits up to the time `patience` until the
    /// page has received the end.
    pub fn end(self, outcome: &str, patience: Duration) {
        let outcome = outcome.to_owned();
        // Empties the queue: the server may sleep until the next sample is due.
        drop(self.shared.store());
        let _ = self.messages.events.send(Event::Ended { outcome });
        self.shared.set_phase(Phase::Ended);
        let start = Instant::now();
        while start.elapsed() < patience {
            let store = self.shared.store();
            if store.outcome_shown || !store.is_watched() {
                break;
            }
            drop(store);
            std::thread::sleep(LOOK);
        }
    }
}

impl Drop for View {
    fn drop(&mut self) {
        self.shared.closed.store(true, Ordering::Release);
        // Wakes the thread that accepts connections.
        let _ = TcpStream::connect_timeout(&(Ipv4Addr::LOCALHOST, self.port).into(), LOOK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_run_does_not_wait_for_the_next_sample_if_the_queue_is_full() {
        let view = View::open(&Facts::default(), Phase::Running).unwrap();
        view.set_cost(Duration::from_secs(1));
        view.shared.store().record_request();
        // After the first check, the server sleeps for 50 s: 50 times the cost of a sample.
        std::thread::sleep(Duration::from_millis(300));
        let messages = view.messages();
        (0..=EVENTS).for_each(|_| messages.send("", String::new()));
        let start = Instant::now();
        view.end("done", Duration::ZERO);
        assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
    }
}
