//! The panic fence: turns a panic of the model into [`Failure::Fatal`], with the file and line of the panic.
//!
//! `catch_unwind` does not return the location of a panic. Only the panic hook receives it, and the
//! hook is global: to the process, or, in an FMU, to the library, which has its own standard library.
//! Therefore:
//!
//! * The first instance replaces the hook; freeing the last instance restores it.
//! * Our hook handles only a panic inside a fence of the same thread, and prints nothing. It passes
//!   every other panic to the previous hook.
//! * If other code has replaced our hook in the meantime, its hook stays.
//!
//! This module has the only global state of the crate, because a hook receives nothing but the panic:
//! the number of guards and, for each thread, the depth of nested fences and the last panic. No result
//! of a model depends on it.

use std::any::Any;
use std::cell::Cell;
use std::mem::ManuallyDrop;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::model::Failure;

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Send + Sync>;

/// The state that the hook and the fences of one thread share.
struct Fence {
    /// Number of nested fences on this thread.
    depth: Cell<u32>,
    /// The last panic inside a fence. This value is never dropped with the thread: a destructor in thread-local storage
    /// would keep the library loaded until the thread ends.
    last: Cell<ManuallyDrop<Option<Panic>>>,
}

struct Panic {
    /// File, line and column of the panic.
    place: String,
    text: String,
}

thread_local! {
    static FENCE: Fence = const {
        Fence { depth: Cell::new(0), last: Cell::new(ManuallyDrop::new(None)) }
    };
}

impl Fence {
    /// Sets the last panic, and returns the previous one.
    fn replace(&self, panic: Option<Panic>) -> Option<Panic> {
        ManuallyDrop::into_inner(self.last.replace(ManuallyDrop::new(panic)))
    }

    #[cold]
    fn failure(&self, payload: &dyn Any) -> Failure {
        let text = text(payload);
        // A panic by `resume_unwind` does not call the hook; then `last` may be a panic that the model caught before.
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

/// Runs `body`, code of the model, and turns a panic into [`Failure::Fatal`].
///
/// The message contains the location of the panic while a [`HookGuard`] exists.
pub(crate) fn guarded<T, E: From<Failure>>(body: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    // Where panics abort the process, there is nothing to catch.
    if !cfg!(panic = "unwind") {
        return body();
    }
    FENCE.with(|fence| {
        fence.depth.set(fence.depth.get() + 1);
        let result = catch_unwind(AssertUnwindSafe(body));
        fence.depth.set(fence.depth.get() - 1);
        result.unwrap_or_else(|payload| Err(fence.failure(&*payload).into()))
    })
}

/// Runs `callback`, code of the importer, outside of all fences.
pub(crate) fn outside<T>(callback: impl FnOnce() -> T) -> T {
    FENCE.with(|fence| {
        let depth = fence.depth.replace(0);
        let result = callback();
        fence.depth.set(depth);
        result
    })
}

/// A guard that keeps the hook installed while it exists.
pub(crate) struct HookGuard(());

/// Our installed hook and the previous one.
struct Installed {
    /// Address of the hook that this crate installed, to recognise whether other code has replaced it.
    address: usize,
    previous: Arc<Hook>,
}

struct Guards {
    count: usize,
    installed: Option<Installed>,
}

static GUARDS: Mutex<Guards> = Mutex::new(Guards { count: 0, installed: None });

impl HookGuard {
    pub(crate) fn new() -> Self {
        let mut guards = GUARDS.lock().unwrap_or_else(PoisonError::into_inner);
        guards.count += 1;
        // A panicking thread cannot change the hook. If panics abort, the previous hook must print
        // the message.
        if guards.installed.is_none() && !thread::panicking() && cfg!(panic = "unwind") {
            guards.installed = Some(install());
        }
        Self(())
    }
}

impl Drop for HookGuard {
    fn drop(&mut self) {
        let mut guards = GUARDS.lock().unwrap_or_else(PoisonError::into_inner);
        guards.count -= 1;
        if cfg!(panic = "unwind")
            && guards.count == 0
            && !thread::panicking()
            && let Some(installed) = guards.installed.take()
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
    let previous_hook = Arc::clone(&previous);
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
            previous_hook(panic);
        }
    });
    let address = address(&hook);
    panic::set_hook(hook);
    Installed { address, previous }
}

fn uninstall(installed: Installed) {
    let current = panic::take_hook();
    if address(&current) != installed.address {
        // Other code replaced our hook; its hook may still call ours.
        panic::set_hook(current);
        return;
    }
    drop(current);
    panic::set_hook(
        Arc::try_unwrap(installed.previous)
            .unwrap_or_else(|previous| Box::new(move |panic| previous(panic))),
    );
}
