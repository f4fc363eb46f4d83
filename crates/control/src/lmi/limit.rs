//! An early end of the searches of this thread.

use std::cell::RefCell;
use std::sync::Arc;

/// Whether a search shall end now.
pub type Ending = Arc<dyn Fn() -> bool + Send + Sync>;

thread_local! {
    static ENDING: RefCell<Option<Ending>> = const { RefCell::new(None) };
}

/// Restores the former condition when it is dropped, also by a panic.
struct RestoreGuard(Option<Ending>);

impl Drop for RestoreGuard {
    fn drop(&mut self) {
        ENDING.set(self.0.take());
    }
}

/// Runs `compute` and ends the programs and descents of this thread within it as soon as `ending` is true; None never
/// ends them. What is not proven by then is [`super::Outcome::Inconclusive`]. A program that is interrupted goes on in
/// a thread of its own until its present iteration ends.
///
/// ```
/// use control::lmi::{Outcome, Region, certify_region, until};
/// use control::Domain;
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_element(1, 1, -1.0);
/// let proof = || certify_region(&a, &Region::default(), Domain::Continuous);
/// assert!(matches!(until(Some(std::sync::Arc::new(|| true)), proof)?, Outcome::Inconclusive(_)));
/// assert!(matches!(proof()?, Outcome::Optimal(_)));
/// # Ok::<(), control::Error>(())
/// ```
pub fn until<T>(ending: Option<Ending>, compute: impl FnOnce() -> T) -> T {
    let _guard = RestoreGuard(ENDING.replace(ending));
    compute()
}

/// Returns the condition of this thread, to set it by [`until`] in a thread that shares its work; None if there is
/// none.
#[must_use]
pub fn ending() -> Option<Ending> {
    ENDING.with_borrow(Clone::clone)
}

/// Whether the searches of this thread shall end.
pub(super) fn is_over() -> bool {
    ENDING.with_borrow(|ending| ending.as_ref().is_some_and(|ending| ending()))
}
