//! The side of the run.

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
use crate::store::{Event, Sample, Store};

/// Number of events of the run that wait for the server, and of requests that wait for the run.
const EVENTS: usize = 4096;
const REQUESTS: usize = 32;
/// Interval between two looks whether the page has seen the end.
const LOOK: Duration = Duration::from_millis(20);

/// Passes messages to the page; any thread may use it.
#[derive(Clone)]
pub struct Messages {
    events: SyncSender<Event>,
    shared: Arc<Shared>,
}

impl Messages {
    /// Passes on a message of `fmu`; an empty name is that of no FMU.
    pub fn send(&self, fmu: &str, text: String) {
        self.pass(Event::Message { fmu: fmu.to_owned(), text });
    }

    fn pass(&self, event: Event) {
        if self.events.try_send(event).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The page of a run, on the side of the run.
pub struct View {
    messages: Messages,
    shared: Arc<Shared>,
    requests: Receiver<Request>,
    port: u16,
    address: String,
}

impl View {
    /// Starts the server of the page, at a random port of 127.0.0.1.
    ///
    /// # Errors
    ///
    /// Returns an error if there is no port, no randomness or no thread.
    pub fn open(facts: &Facts, phase: Phase) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let port = listener.local_addr()?.port();
        let token = Token::random()?;
        let address = format!("http://127.0.0.1:{port}/{}/", token.text());
        let (events, received) = sync_channel(EVENTS);
        let (asked, requests) = sync_channel(REQUESTS);
        let store = Store::new(facts.signals.len(), facts.start);
        let shared = Arc::new(Shared::new(received, store, phase));
        let facts = serde_json::to_string(facts).map_err(io::Error::other)?;
        let guard = Guard::new(token, port);
        let site = Site { guard, facts, shared: shared.clone(), requests: asked };
        server::start(listener, Arc::new(site))?;
        let messages = Messages { events, shared: shared.clone() };
        Ok(Self { messages, shared, requests, port, address })
    }

    /// Returns the address of the page, with its token.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Whether a page wants something: a sample, or an answer.
    #[inline]
    #[must_use]
    pub fn is_called(&self) -> bool {
        self.shared.is_called()
    }

    /// Takes notice of the call; returns whether a sample is due. Requests are then taken by
    /// [`View::request`].
    #[must_use]
    pub fn take_calls(&self) -> bool {
        self.shared.take_calls()
    }

    /// Lets [`View::is_called`] return true at the next communication point.
    pub fn call_again(&self) {
        self.shared.call_for_request();
    }

    /// Returns the next request; waits for it at most the time `wait`.
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

    /// Publishes a sample.
    pub fn publish(&self, sample: Sample) {
        self.messages.pass(Event::Sample(sample));
    }

    /// States the time that the last sample took; samples are then due so rarely that they take at
    /// most 2 % of the time.
    pub fn set_cost(&self, cost: Duration) {
        self.shared.set_cost(cost);
    }

    /// Publishes an intervention at `time` in s.
    pub fn intervened(&self, time: f64, text: String) {
        self.messages.pass(Event::Intervention { time, text });
    }

    /// Publishes what the run does now.
    pub fn set_phase(&self, phase: Phase) {
        self.shared.set_phase(phase);
    }

    /// Returns a way to the page for messages.
    #[must_use]
    pub fn messages(&self) -> Messages {
        self.messages.clone()
    }

    /// Publishes the end of the run and closes the server; an open page gets at most the time
    /// `patience` to see it.
    pub fn end(self, outcome: &str, patience: Duration) {
        let outcome = outcome.to_owned();
        // The server takes events until it is closed.
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
