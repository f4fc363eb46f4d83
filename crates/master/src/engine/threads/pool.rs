//! A pool of threads.

use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

pub(super) struct Pool(ThreadPool);

impl Pool {
    /// Starts `jobs` threads. The error is the reason why they cannot start.
    pub(super) fn new(jobs: usize) -> Result<Self, String> {
        let pool = ThreadPoolBuilder::new().num_threads(jobs).build();
        pool.map(Self).map_err(|error| error.to_string())
    }

    /// Calls `work` for every item, several at the same time.
    pub(super) fn for_each<T: Send>(&self, items: &mut [T], work: impl Fn(&mut T) + Send + Sync) {
        self.0.install(|| items.par_iter_mut().for_each(work));
    }
}
