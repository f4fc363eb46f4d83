//! Taking turns: one side posts and waits until the other has done its part.
//!
//! Who waits looks at the turn, for a moment at full speed, then for a while giving its processor
//! away between the looks, then sleeps until a byte comes through the socket. The first is for a
//! processor to each side, the second for two sides on one processor, the third for long steps. The
//! end of the socket tells each side of the other's death.

use std::io::{self, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::yield_now;
use std::time::{Duration, Instant};

use super::layout::Shared;

/// Looks at full speed.
const LOOKS: u32 = 10;
/// How long the processor is given away between looks.
const GIVING: Duration = Duration::from_micros(60);
/// A processor that comes back this late is wanted by other programs.
const CROWDED: Duration = Duration::from_micros(500);
/// Waits in which it is not given away after that was seen.
const CAUTIOUS: u32 = 50;

/// Which side this is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Master,
    Worker,
}

/// What a wait came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// The turn is now this one.
    Turn(u64),
    /// Nothing yet; the socket's time for reading is over.
    Nothing,
    /// The other side is gone.
    Closed,
}

/// One side of the connection.
pub(super) struct Line {
    pub(super) shared: Arc<Shared>,
    socket: UnixStream,
    side: Side,
    /// Waits for which the processor is not given away.
    cautious: u32,
}

impl Line {
    pub(super) fn new(shared: Arc<Shared>, socket: UnixStream, side: Side) -> Self {
        Self { shared, socket, side, cautious: 0 }
    }

    /// Whether this side, and the other one, wait to be woken.
    fn sleeps(&self) -> (&AtomicU64, &AtomicU64) {
        let (master, worker) = (self.shared.master_sleeps(), self.shared.worker_sleeps());
        if self.side == Side::Master { (master, worker) } else { (worker, master) }
    }

    /// Makes the turn `turn`. Everything written before is seen by who sees the turn.
    #[inline]
    pub(super) fn post(&mut self, turn: u64) {
        self.shared.turn().store(turn, Ordering::SeqCst);
        let (_, other) = self.sleeps();
        if other.load(Ordering::SeqCst) != 0 {
            other.store(0, Ordering::SeqCst);
            // Who cannot be woken is gone, which the wait for its answer finds.
            let _ = self.socket.write(&[1]);
        }
    }

    /// The turn if it is no longer `old`.
    #[inline]
    fn look(&self, old: u64) -> Option<Seen> {
        let turn = self.shared.turn().load(Ordering::SeqCst);
        (turn != old).then_some(Seen::Turn(turn))
    }

    /// Waits until the turn is no longer `old`.
    #[inline]
    pub(super) fn wait(&mut self, old: u64) -> Seen {
        for _ in 0..LOOKS {
            if let Some(seen) = self.look(old) {
                return seen;
            }
            std::hint::spin_loop();
        }
        if self.cautious > 0 {
            self.cautious -= 1;
        } else if let Some(seen) = self.give_way(old) {
            return seen;
        }
        self.sleep(old)
    }

    /// Gives the processor away between looks.
    fn give_way(&mut self, old: u64) -> Option<Seen> {
        let begin = Instant::now();
        loop {
            yield_now();
            let (seen, passed) = (self.look(old), begin.elapsed());
            if passed > CROWDED {
                self.cautious = CAUTIOUS;
            }
            if seen.is_some() || passed > GIVING {
                return seen;
            }
        }
    }

    /// Sleeps until woken, for as long as the socket waits.
    #[cold]
    fn sleep(&mut self, old: u64) -> Seen {
        self.sleeps().0.store(1, Ordering::SeqCst);
        let mut bytes = [0; 64];
        let woken = loop {
            if let Some(seen) = self.look(old) {
                break seen;
            }
            match self.socket.read(&mut bytes) {
                Ok(0) => break self.look(old).unwrap_or(Seen::Closed),
                // From a wait that ended without it, or for this one.
                Ok(_) => self.sleeps().0.store(1, Ordering::SeqCst),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if is_late(&error) => break self.look(old).unwrap_or(Seen::Nothing),
                Err(_) => break self.look(old).unwrap_or(Seen::Closed),
            }
        };
        self.sleeps().0.store(0, Ordering::SeqCst);
        woken
    }
}

fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}
