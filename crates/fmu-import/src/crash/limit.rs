//! A time limit for code that runs under the lock of the dynamic linker.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::{OVERDUE, REPORTER, start_report};

/// A time limit that ends the process as a crash does, unless it is dropped in time.
pub(crate) struct Limit {
    /// Whether the limit has been dropped, so that the process goes on.
    ended: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Limit {
    /// Starts the time limit; `None` if the program does not watch for crashes, or if no thread can start.
    pub(crate) fn new(time: Duration) -> Option<Self> {
        REPORTER.get()?;
        let [ready, ended] = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
        let shared = (ready.clone(), ended.clone());
        let wait = move || {
            let (ready, ended) = shared;
            let start = Instant::now();
            ready.store(true, Ordering::Release);
            while !ended.load(Ordering::Acquire) {
                let left = time.saturating_sub(start.elapsed());
                if left.is_zero() {
                    start_report(OVERDUE, 0);
                    return;
                }
                thread::park_timeout(left);
            }
        };
        let thread = thread::Builder::new().name("limit".to_owned()).spawn(wait).ok()?;
        // A starting thread needs the lock of the dynamic linker, which the caller takes later.
        while !ready.load(Ordering::Acquire) {
            thread::yield_now();
        }
        Some(Self { ended, thread })
    }
}

impl Drop for Limit {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        self.thread.thread().unpark();
    }
}
