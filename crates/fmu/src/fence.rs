//! The panic fence: a panic of the model becomes [`Failure::Fatal`], with the file and line of the panic.
//!
//! What `catch_unwind` returns does not say where the panic happened; only the panic hook is told, and
//! the hook belongs to the process (in an FMU, whose library has a standard library of its own, to that
//! library). Therefore:
//!
//! * The hook is replaced when the first instance is made, and put back when the last one is freed.
//! * The hook acts only on a panic inside a fence of the same thread. It prints nothing there; every
//!   other panic goes to the hook that was there before.
//! * A hook that someone else installed meanwhile is left alone.
//!
//! This is the one place with state outside of instances, because the hook gets no other argument
//! than the panic: how many watches there are, and for each thread how deep it is inside fences and
//! what its last panic was. No result of a model depends on it.

use std::any::Any;
use std::cell::Cell;
use std::mem::ManuallyDrop;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::model::Failure;

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Send + Sync>;

/// What the hook and the fences of one thread tell each other.
struct Fence {
    /// How many fences the thread is inside of.
    depth: Cell<u32>,
    /// The last panic inside a fence. Without a destructor: one in thread-local storage would keep
    /// the library loaded until the thread ends.
    last: Cell<ManuallyDrop<Option<Panic>>>,
}

struct Panic {
    /// File, line and column.
    place: String,
    text: String,
}

thread_local! {
    static FENCE: Fence = const {
        Fence { depth: Cell::new(0), last: Cell::new(ManuallyDrop::new(None)) }
    };
}

impl Fence {
    /// Replaces the last panic.
    fn replace(&self, panic: Option<Panic>) -> Option<Panic> {
        ManuallyDrop::into_inner(self.last.replace(ManuallyDrop::new(panic)))
    }

    #[cold]
    fn failure(&self, payload: &dyn Any) -> Failure {
        let text = text(payload);
        // Of `resume_unwind` the hook hears nothing; the last panic may be one that the model caught.
        Failure::Fatal(match self.replace(None).filter(|last| last.text == text) {
            Some(Panic { place, .. }) => format!("the model panicked at {place}: {text}"),
            None => format!("the model panicked: {text}"),
        })
    }
}

fn text(payload: &dyn Any) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

/// Runs `body`, which is the model's code; a panic becomes [`Failure::Fatal`].
///
/// The message has the place of the panic while there is a [`Watch`].
pub(crate) fn guarded<T>(body: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    FENCE.with(|fence| {
        fence.depth.set(fence.depth.get() + 1);
        let done = catch_unwind(AssertUnwindSafe(body));
        fence.depth.set(fence.depth.get() - 1);
        done.unwrap_or_else(|payload| Err(fence.failure(&*payload)))
    })
}

/// Runs `callback`, which is the importer's code, outside of all fences.
pub(crate) fn outside<T>(callback: impl FnOnce() -> T) -> T {
    FENCE.with(|fence| {
        let depth = fence.depth.replace(0);
        let done = callback();
        fence.depth.set(depth);
        done
    })
}

/// Keeps the hook installed.
pub(crate) struct Watch(());

/// The hook, while it is installed.
struct Installed {
    /// Tells the hook from those of others.
    address: usize,
    previous: Arc<Hook>,
}

struct Watches {
    count: usize,
    installed: Option<Installed>,
}

static WATCHES: Mutex<Watches> = Mutex::new(Watches { count: 0, installed: None });

impl Watch {
    pub(crate) fn new() -> Self {
        let mut watches = WATCHES.lock().unwrap_or_else(PoisonError::into_inner);
        watches.count += 1;
        // From a thread that panics the hook cannot be changed. Where a panic aborts, the message of
        // the previous hook is the only one.
        if watches.installed.is_none() && !thread::panicking() && cfg!(panic = "unwind") {
            watches.installed = Some(install());
        }
        Self(())
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let mut watches = WATCHES.lock().unwrap_or_else(PoisonError::into_inner);
        watches.count -= 1;
        if watches.count == 0
            && !thread::panicking()
            && let Some(installed) = watches.installed.take()
        {
            uninstall(installed);
        }
    }
}

fn address(hook: &Hook) -> usize {
    std::ptr::from_ref(&**hook).cast::<()>().addr()
}

fn install() -> Installed {
    let previous = Arc::new(panic::take_hook());
    let others = Arc::clone(&previous);
    let hook: Hook = Box::new(move |panic| {
        let inside = FENCE.with(|fence| {
            let inside = fence.depth.get() > 0;
            if inside {
                let place = panic.location().map(ToString::to_string).unwrap_or_default();
                drop(fence.replace(Some(Panic { place, text: text(panic.payload()).to_owned() })));
            }
            inside
        });
        if !inside {
            others(panic);
        }
    });
    let address = address(&hook);
    panic::set_hook(hook);
    Installed { address, previous }
}

fn uninstall(installed: Installed) {
    let current = panic::take_hook();
    if address(&current) != installed.address {
        // Somebody else's, which may lead to ours.
        panic::set_hook(current);
        return;
    }
    drop(current);
    panic::set_hook(
        Arc::try_unwrap(installed.previous)
            .unwrap_or_else(|previous| Box::new(move |panic| previous(panic))),
    );
}
