//! Slaves that step side by side in threads, where that is faster.

use std::time::{Duration, Instant};

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::SystemError;
use slave::{Advance, CallError, Slave, StepResult};

/// Steps that are measured one way and the other.
const TRIALS: u32 = 16;
/// Part of the time in one thread that threads must not exceed to be used.
const WORTH: f64 = 0.9;

/// One slave with a step to make.
pub(crate) struct Task<'a> {
    pub(crate) slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) step: Advance<'a>,
    pub(crate) done: Result<StepResult, CallError>,
}

/// The threads, and what is known of their use for each group of slaves.
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
    /// Whether the next step is made in threads: first tried without, then with, then as was faster.
    fn in_threads(&self) -> bool {
        if self.steps < 2 * TRIALS {
            return self.steps >= TRIALS;
        }
        self.together.as_secs_f64() < WORTH * self.alone.as_secs_f64()
    }
}

impl Parallel {
    /// `jobs` threads for so many groups; none for a single one.
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

    /// Whether the group's next step is made in threads.
    pub(super) fn in_threads(&self, group: usize) -> bool {
        self.groups[group].in_threads()
    }

    /// Makes a step of a group, by `alone` or in threads, and takes its time where that is not
    /// decided yet.
    pub(super) fn measure<T>(&mut self, group: usize, step: impl FnOnce(&ThreadPool) -> T) -> T {
        let trial = self.groups[group];
        if trial.steps >= 2 * TRIALS {
            return step(&self.pool);
        }
        let begin = Instant::now();
        let done = step(&self.pool);
        let taken = begin.elapsed();
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

/// Makes all steps, in the threads of `pool`.
pub(crate) fn run(pool: &ThreadPool, tasks: &mut [Task<'_>]) {
    pool.install(|| {
        tasks.par_iter_mut().for_each(|task| task.done = task.instance.advance(&mut task.step));
    });
}
