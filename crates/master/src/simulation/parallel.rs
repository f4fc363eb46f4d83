//! Parallel stepping of independent slaves in threads, if this is faster.

use std::time::{Duration, Instant};

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::SystemError;
use slave::{Advance, CallError, Slave, StepResult};

/// Number of steps measured with and without threads.
const TRIALS: u32 = 16;
/// Threads are used if their time is below this fraction of the time without threads.
const WORTH: f64 = 0.9;

/// The step of one slave.
pub(crate) struct Task<'a> {
    pub(crate) slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) step: Advance<'a>,
    pub(crate) done: Result<StepResult, CallError>,
}

/// The thread pool, and the measured times of each group of slaves.
pub(super) struct Parallel {
    pool: ThreadPool,
    groups: Vec<Trial>,
}

#[derive(Clone, Copy, Default)]
struct Trial {
    steps: u32,
    alone: Duration,
    together: Duration,
}

impl Trial {
    /// Whether the next step uses threads: the first trials do not, the following do, and then the
    /// faster way decides.
    fn in_threads(&self) -> bool {
        if self.steps < 2 * TRIALS {
            return self.steps >= TRIALS;
        }
        self.together.as_secs_f64() < WORTH * self.alone.as_secs_f64()
    }
}

impl Parallel {
    /// Creates a pool of `jobs` threads for `groups` groups of slaves; `None` for a single thread.
    pub(super) fn new(jobs: usize, groups: usize) -> Result<Option<Self>, SystemError> {
        if jobs < 2 {
            return Ok(None);
        }
        let pool = ThreadPoolBuilder::new().num_threads(jobs).build();
        let pool = pool.map_err(|error| SystemError::Algorithm {
            what: format!("{jobs} threads cannot be started: {error}"),
        })?;
        Ok(Some(Self { pool, groups: vec![Trial::default(); groups] }))
    }

    /// Whether the next step of the group uses threads.
    pub(super) fn in_threads(&self, group: usize) -> bool {
        self.groups[group].in_threads()
    }

    /// Makes a step of a group and measures its time until the choice is made.
    pub(super) fn measure<T>(&mut self, group: usize, step: impl FnOnce(&ThreadPool) -> T) -> T {
        let trial = self.groups[group];
        if trial.steps >= 2 * TRIALS {
            return step(&self.pool);
        }
        let start = Instant::now();
        let done = step(&self.pool);
        let taken = start.elapsed();
        let trial = &mut self.groups[group];
        if trial.in_threads() {
            trial.together += taken;
        } else {
            trial.alone += taken;
        }
        trial.steps += 1;
        done
    }
}

/// Makes all steps in the threads of `pool`.
pub(crate) fn run(pool: &ThreadPool, tasks: &mut [Task<'_>]) {
    pool.install(|| {
        tasks.par_iter_mut().for_each(|task| task.done = task.instance.advance(&mut task.step));
    });
}
