//! The state that the run and the server share: flags, and a queue from the run to the server.

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;

use crate::store::{Event, Store};

/// The flag by which the server asks the run for a sample.
const SAMPLE: u8 = 1;
/// The flag by which the server asks the run to answer a request.
const REQUEST: u8 = 2;

/// The state of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// The run steps.
    Running = 0,
    /// The run waits at a communication point for a request to resume.
    Paused = 1,
    /// The run has ended.
    Ended = 2,
}

/// The state that the run and the server share.
pub(crate) struct Shared {
    flags: AtomicU8,
    phase: AtomicU8,
    /// Time in ns that the last sample took.
    sample_duration: AtomicU64,
    /// Number of events that were dropped because the queue was full.
    pub(crate) dropped: AtomicU64,
    /// Whether the view is closed, so that the threads of the server end.
    pub(crate) closed: AtomicBool,
    events: Mutex<Receiver<Event>>,
    store: Mutex<Store>,
}

impl Shared {
    pub(crate) fn new(events: Receiver<Event>, store: Store, phase: Phase) -> Self {
        Self {
            flags: AtomicU8::new(REQUEST),
            phase: AtomicU8::new(phase as u8),
            sample_duration: AtomicU64::new(0),
            dropped: AtomicU64::new(0),
            closed: AtomicBool::new(false),
            events: Mutex::new(events),
            store: Mutex::new(store),
        }
    }

    #[inline]
    pub(crate) fn is_called(&self) -> bool {
        self.flags.load(Ordering::Relaxed) != 0
    }

    /// Clears the flags; returns whether a sample is due.
    pub(crate) fn take_calls(&self) -> bool {
        self.flags.swap(0, Ordering::Acquire) & SAMPLE != 0
    }

    pub(crate) fn call_for_sample(&self) {
        self.flags.fetch_or(SAMPLE, Ordering::Release);
    }

    pub(crate) fn call_for_request(&self) {
        self.flags.fetch_or(REQUEST, Ordering::Release);
    }

    pub(crate) fn phase(&self) -> Phase {
        match self.phase.load(Ordering::Acquire) {
            0 => Phase::Running,
            1 => Phase::Paused,
            _ => Phase::Ended,
        }
    }

    pub(crate) fn set_phase(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::Release);
    }

    pub(crate) fn sample_duration(&self) -> Duration {
        Duration::from_nanos(self.sample_duration.load(Ordering::Relaxed))
    }

    pub(crate) fn set_sample_duration(&self, duration: Duration) {
        let nanoseconds = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        self.sample_duration.store(nanoseconds, Ordering::Relaxed);
    }

    /// Moves all events of the run into the store and returns the locked store. During the run only threads of the
    /// server call this, so that the run does not wait for the lock.
    pub(crate) fn store(&self) -> MutexGuard<'_, Store> {
        let events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        for event in events.try_iter() {
            store.add(event);
        }
        store
    }
}
