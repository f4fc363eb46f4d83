//! The turn-taking of master and worker: one side posts a turn and waits for the next one.
//!
//! The waiter spins, then yields, then blocks until a byte arrives at the socket. Spinning is fastest if each side has
//! a processor, yielding if both sides share a processor; blocking serves long steps. A closed socket shows that the
//! other side has ended.

use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::yield_now;
use std::time::{Duration, Instant};

use super::layout::Shared;

/// Number of reads of the turn counter before the first yield.
const SPINS: u32 = 10;
/// Time for which a wait yields the processor before the thread blocks.
const YIELD_TIME: Duration = Duration::from_micros(60);
/// Duration of a yield that shows that other programs use the processor.
const CONTENDED: Duration = Duration::from_micros(500);
/// Number of waits without yields after a yield of [`CONTENDED`].
const WAITS_WITHOUT_YIELD: u32 = 50;

/// A side of the channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Master,
    Worker,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WaitResult {
    /// The turn has changed to this value.
    Turn(u64),
    /// The turn has not changed within the read timeout of the socket.
    TimedOut,
    /// The process at the other end of the channel has ended.
    Closed,
}

/// One side of the channel between master and worker.
pub(super) struct Channel {
    pub(super) shared: Arc<Shared>,
    socket: UnixStream,
    side: Side,
    /// Number of the next waits that block without yielding.
    waits_without_yield: u32,
}

impl Channel {
    pub(super) fn new(shared: Arc<Shared>, socket: UnixStream, side: Side) -> Self {
        Self { shared, socket, side, waits_without_yield: 0 }
    }

    /// Returns the flags "this side sleeps" and "the other side sleeps".
    fn sleeps(&self) -> (&AtomicU64, &AtomicU64) {
        let (master, worker) = (self.shared.master_sleeps(), self.shared.worker_sleeps());
        if self.side == Side::Master { (master, worker) } else { (worker, master) }
    }

    /// Sets the turn, and wakes the other side if it sleeps. A side that reads the turn also sees all earlier writes.
    #[inline]
    pub(super) fn post(&mut self, turn: u64) {
        self.shared.turn().store(turn, Ordering::SeqCst);
        let (_, other) = self.sleeps();
        if other.load(Ordering::SeqCst) != 0 {
            other.store(0, Ordering::SeqCst);
            // Fails if the other side has ended, which the next wait detects.
            let _ = self.socket.write(&[1]);
        }
    }

    /// Returns the turn if it differs from `old`, otherwise `None`.
    #[inline]
    fn poll(&self, old: u64) -> Option<WaitResult> {
        let turn = self.shared.turn().load(Ordering::SeqCst);
        (turn != old).then_some(WaitResult::Turn(turn))
    }

    /// Waits until the turn differs from `old`, the other side has ended, or the read timeout of the socket has passed.
    #[inline]
    pub(super) fn wait(&mut self, old: u64) -> WaitResult {
        for _ in 0..SPINS {
            if let Some(result) = self.poll(old) {
                return result;
            }
            std::hint::spin_loop();
        }
        if self.waits_without_yield > 0 {
            self.waits_without_yield -= 1;
        } else if let Some(result) = self.wait_yielding(old) {
            return result;
        }
        self.wait_blocking(old)
    }

    /// Polls the turn and yields the processor in between, up to [`YIELD_TIME`].
    fn wait_yielding(&mut self, old: u64) -> Option<WaitResult> {
        let start = Instant::now();
        loop {
            yield_now();
            let (result, passed) = (self.poll(old), start.elapsed());
            if passed > CONTENDED {
                self.waits_without_yield = WAITS_WITHOUT_YIELD;
            }
            if result.is_some() || passed > YIELD_TIME {
                return result;
            }
        }
    }

    /// Blocks until the other side wakes this one, up to the read timeout of the socket.
    #[cold]
    fn wait_blocking(&mut self, old: u64) -> WaitResult {
        self.sleeps().0.store(1, Ordering::SeqCst);
        let mut bytes = [0; 64];
        let woken = loop {
            if let Some(result) = self.poll(old) {
                break result;
            }
            match self.socket.read(&mut bytes) {
                Ok(0) => break self.poll(old).unwrap_or(WaitResult::Closed),
                // The byte is for this wait, or left over from an earlier one.
                Ok(_) => self.sleeps().0.store(1, Ordering::SeqCst),
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                        break self.poll(old).unwrap_or(WaitResult::TimedOut);
                    }
                    _ => break self.poll(old).unwrap_or(WaitResult::Closed),
                },
            }
        };
        self.sleeps().0.store(0, Ordering::SeqCst);
        woken
    }
}
