//! Threads that step the slaves of a group at the same time, where measurements show that this is
//! faster: handing a step to another thread costs some microseconds, more than many FMUs need.

#[cfg_attr(target_family = "wasm", path = "threads/no_pool.rs")]
mod pool;

use std::time::{Duration, Instant};

use crate::error::{SystemError, contradiction};
use crate::exchange::Task;
use pool::Pool;

/// Number of steps of a group whose time is measured without threads, and again in threads.
const TRIALS: u32 = 16;
/// Time of a step in threads, relative to the time without threads, below which threads are used.
const WORTH: f64 = 0.9;

/// The thread pool, and the measured times of each group of slaves.
pub(super) struct Threads {
    pool: Pool,
    groups: Vec<Measured>,
}

/// The measured steps of a group.
#[derive(Clone, Copy, Default)]
struct Measured {
    /// Number of measured steps.
    steps: u32,
    /// Total time of the steps without threads.
    sequential: Duration,
    /// Total time of the steps in threads.
    parallel: Duration,
}

/// How a group makes one step.
pub(super) struct Trial {
    pub(super) in_threads: bool,
    /// Start of the step if its time is measured.
    start: Option<Instant>,
}

impl Threads {
    /// Creates a pool of `jobs` threads for `groups` groups of slaves; `None` for a single thread.
    pub(super) fn new(jobs: usize, groups: usize) -> Result<Option<Self>, SystemError> {
        if jobs < 2 {
            return Ok(None);
        }
        let pool = Pool::new(jobs).map_err(|reason| {
            contradiction(format!("{jobs} threads cannot be started: {reason}"))
        })?;
        Ok(Some(Self { pool, groups: vec![Measured::default(); groups] }))
    }

    /// Decides how the group makes its next step: the first trials without threads, the next trials in threads, later
    /// steps in threads if these were clearly faster.
    pub(super) fn begin(&self, group: usize) -> Trial {
        let Measured { steps, sequential, parallel } = self.groups[group];
        if steps < 2 * TRIALS {
            return Trial { in_threads: steps >= TRIALS, start: Some(Instant::now()) };
        }
        let in_threads = parallel.as_secs_f64() < WORTH * sequential.as_secs_f64();
        Trial { in_threads, start: None }
    }

    /// Records the time of a step if it is measured.
    pub(super) fn end(&mut self, group: usize, trial: &Trial) {
        let Some(start) = trial.start else { return };
        let measured = &mut self.groups[group];
        let total =
            if trial.in_threads { &mut measured.parallel } else { &mut measured.sequential };
        *total += start.elapsed();
        measured.steps += 1;
    }
}

/// Makes all steps: in the threads of the pool, or one after the other without `threads`.
pub(super) fn run(threads: Option<&Threads>, tasks: &mut [Task<'_>]) {
    let step = |task: &mut Task<'_>| task.done = task.instance.advance(&mut task.request);
    match threads {
        Some(threads) => threads.pool.for_each(tasks, step),
        None => tasks.iter_mut().for_each(step),
    }
}
