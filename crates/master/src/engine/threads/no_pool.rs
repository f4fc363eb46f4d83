//! The pool of threads on WebAssembly, which has no threads.

/// A pool of threads; no value of this type exists.
pub(super) enum Pool {}

impl Pool {
    /// Returns the reason why there is no pool, as an error.
    pub(super) fn new(_jobs: usize) -> Result<Self, String> {
        Err("WebAssembly has none".to_owned())
    }

    /// Calls `work` for every item.
    pub(super) fn for_each<T: Send>(&self, _: &mut [T], _: impl Fn(&mut T) + Send + Sync) {
        match *self {}
    }
}
