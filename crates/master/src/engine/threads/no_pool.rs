//! The pool of threads on WebAssembly, which has no threads.

/// A pool of threads; no value of this type exists.
pub(super) enum Pool {}

impl Pool {
    /// Fails with the reason.
    pub(super) fn new(_jobs: usize) -> Result<Self, String> {
        Err("WebAssembly has none".to_owned())
    }

    /// Calls `work` for every item.
    pub(super) fn for_each<T: Send>(&self, _: &mut [T], _: impl Fn(&mut T) + Send + Sync) {
        match *self {}
    }
}
