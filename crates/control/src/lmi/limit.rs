//! Early termination of the searches of a thread.

use std::cell::RefCell;
use std::sync::Arc;

/// A condition at which searches end.
pub type Ending = Arc<dyn Fn() -> bool + Send + Sync>;

thread_local! {
    static ENDING: RefCell<Option<Ending>> = const { RefCell::new(None) };
}

/// Restores the previous condition when dropped, also on a panic.
struct RestoreGuard(Option<Ending>);

impl Drop for RestoreGuard {
    fn drop(&mut self) {
        ENDING.set(self.0.take());
    }
}

/// Runs `compute`, in which all semidefinite programs and descents of this thread end as soon as `ending` is true; None
/// never ends them. What is not proven by then is [`super::Outcome::Inconclusive`]. An interrupted program continues in
/// a separate thread until its current iteration ends.
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

/// Returns the condition that [`until`] has set in this thread, to set it in a thread that shares the work; None
/// without a condition.
#[must_use]
pub fn ending() -> Option<Ending> {
    ENDING.with_borrow(Clone::clone)
}

/// Whether the searches of this thread shall end.
pub(super) fn is_over() -> bool {
    ENDING.with_borrow(|ending| ending.as_ref().is_some_and(|ending| ending()))
}
