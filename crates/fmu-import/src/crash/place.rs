//! The current function and time of each FMU instance, for crash reports.
#![expect(unsafe_code, reason = "names of functions are stored by address")]

use std::cell::Cell;
use std::fmt;
use std::ops::Deref;
use std::ptr;
use std::sync::atomic::{
    AtomicBool, AtomicI32, AtomicPtr, AtomicU8, AtomicU64, AtomicUsize, Ordering,
};
use std::sync::{Arc, OnceLock};

use fmu_description::abi::Status;
use slave::{CallError, Failure};

use super::Call;

/// Number of instances that can have a separate slot in the record.
const SLOT_COUNT: usize = 4096;
/// Bytes of an instance's name that reports show.
const NAME_LENGTH: usize = 96;

/// The record of this process for a report of its end. The record is static because an FMU may overwrite the heap
/// before it crashes.
pub(crate) static RECORD: Record = Record {
    slots: [const { Slot::new() }; SLOT_COUNT],
    used: AtomicUsize::new(0),
    started: AtomicBool::new(false),
    done: AtomicI32::new(0),
    copies: AtomicUsize::new(0),
};

/// The calls of all instances, and the progress of the program. The record fills whole pages, of at most 64 KiB each,
/// which a supervisor shares with this process.
#[repr(C, align(65536))]
pub(crate) struct Record {
    /// The slots of the instances. Instances beyond [`SLOT_COUNT`] share the last slot.
    slots: [Slot; SLOT_COUNT],
    /// The number of slots, counted from the first one, that were ever taken.
    used: AtomicUsize,
    /// Whether the first step has started.
    pub(super) started: AtomicBool,
    /// The exit status with which the program ends, plus 1; 0 while the program works.
    pub(crate) done: AtomicI32,
    /// The number of copies of this process that FMUs made by `fork` and that continued as the program.
    pub(super) copies: AtomicUsize,
}

impl Record {
    /// The slots that were ever taken.
    fn used(&self) -> &[Slot] {
        &self.slots[..self.used.load(Ordering::Acquire).min(SLOT_COUNT)]
    }
}

type Observer = dyn Fn(&str) + Send + Sync;

/// Receives the name of each function that an instance enters, and an empty name when the instance leaves it. Set
/// only in the worker processes of isolation.
static OBSERVER: OnceLock<Box<Observer>> = OnceLock::new();

/// Passes the functions of all instances of this process to `observer`: their names, and an empty name when an instance
/// leaves its function. Only the first call of `observe` has an effect.
#[cfg(target_os = "linux")]
pub(crate) fn observe(observer: impl Fn(&str) + Send + Sync + 'static) {
    let _ = OBSERVER.set(Box::new(observer));
}

thread_local! {
    /// Address of the slot that this thread entered last; a signal handler reads it.
    static LAST: Cell<usize> = const { Cell::new(0) };
}

/// The name of an instance, cut after 96 bytes and stored without heap allocation.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Name {
    bytes: [u8; NAME_LENGTH],
    length: usize,
}

impl Deref for Name {
    type Target = str;

    fn deref(&self) -> &str {
        let bytes = &self.bytes[..self.length];
        let whole = str::from_utf8(bytes).map_or_else(|error| error.valid_up_to(), str::len);
        str::from_utf8(&bytes[..whole]).unwrap_or_default()
    }
}

impl fmt::Display for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self)
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(formatter)
    }
}

/// The current function and time of one instance. Entering and leaving a function cost a few stores.
pub(crate) struct Slot {
    /// Whether an instance has the slot.
    is_used: AtomicBool,
    /// The function that the instance executes; null between calls.
    function: AtomicPtr<&'static str>,
    /// Number of calls that the instance has made.
    calls: AtomicU64,
    /// Bits of the time of the instance, in s.
    time: AtomicU64,
    /// Name of the instance, the first `length` bytes.
    name: [AtomicU8; NAME_LENGTH],
    length: AtomicUsize,
}

/// A claimed [`Slot`], released when the instance is dropped.
pub(crate) struct Place {
    slot: &'static Slot,
    instance: String,
}

impl Place {
    /// Claims a slot for a new instance. If no slot is free, instances share the last one.
    pub(crate) fn new(instance: &str) -> Arc<Self> {
        let mut slots = RECORD.slots.iter();
        let free = slots.position(|slot| !slot.is_used.swap(true, Ordering::AcqRel));
        let index = free.unwrap_or(SLOT_COUNT - 1);
        let slot = &RECORD.slots[index];
        RECORD.used.fetch_max(index + 1, Ordering::AcqRel);
        let bytes = instance.as_bytes();
        for (place, byte) in slot.name.iter().zip(bytes) {
            place.store(*byte, Ordering::Relaxed);
        }
        slot.length.store(bytes.len().min(NAME_LENGTH), Ordering::Relaxed);
        slot.time.store(0, Ordering::Relaxed);
        Arc::new(Self { slot, instance: instance.to_owned() })
    }

    /// Returns the slot, which is never freed.
    pub(crate) fn slot(&self) -> &'static Slot {
        self.slot
    }

    pub(crate) fn instance(&self) -> &str {
        &self.instance
    }

    /// Returns `error`, after noting it for a crash report unless its status is `fmi2Discard` or `fmi2Pending`.
    pub(crate) fn note_failure(&self, error: CallError) -> CallError {
        if !matches!(error.failure, Failure::Status(Status::Discard | Status::Pending)) {
            super::note(format!("{}: {error}", self.instance));
        }
        error
    }
}

impl Deref for Place {
    type Target = Slot;

    fn deref(&self) -> &Slot {
        self.slot
    }
}

impl Slot {
    const fn new() -> Self {
        Self {
            is_used: AtomicBool::new(false),
            function: AtomicPtr::new(ptr::null_mut()),
            calls: AtomicU64::new(0),
            time: AtomicU64::new(0),
            name: [const { AtomicU8::new(0) }; NAME_LENGTH],
            length: AtomicUsize::new(0),
        }
    }

    /// Records that the calling thread is about to call `function` of the instance.
    #[inline]
    pub(crate) fn enter(&self, function: &'static &'static str) {
        // One thread at a time calls an instance.
        self.calls.store(self.calls.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        self.function.store(ptr::from_ref(function).cast_mut(), Ordering::Relaxed);
        LAST.set(ptr::from_ref(self).addr());
        if let Some(observer) = OBSERVER.get() {
            observer(function);
        }
    }

    /// Records that the call has returned.
    #[inline]
    pub(crate) fn leave(&self) {
        self.function.store(ptr::null_mut(), Ordering::Relaxed);
        if let Some(observer) = OBSERVER.get() {
            observer("");
        }
    }

    /// Sets the time of the instance, in s.
    #[inline]
    pub(crate) fn set_time(&self, time: f64) {
        self.time.store(time.to_bits(), Ordering::Relaxed);
    }

    pub(crate) fn time(&self) -> f64 {
        f64::from_bits(self.time.load(Ordering::Relaxed))
    }

    /// Returns whether a call of the instance has not returned.
    pub(crate) fn is_entered(&self) -> bool {
        !self.function.load(Ordering::Relaxed).is_null()
    }

    fn name(&self) -> Name {
        let bytes = self.name.each_ref().map(|byte| byte.load(Ordering::Relaxed));
        Name { bytes, length: self.length.load(Ordering::Relaxed).min(NAME_LENGTH) }
    }

    /// Returns the call that the instance executes; `None` between calls.
    fn call(&self) -> Option<Call> {
        let function = self.function.load(Ordering::Relaxed);
        // SAFETY: null, or the address of the static reference passed to `enter`.
        let function = *unsafe { function.as_ref() }?;
        let number = self.calls.load(Ordering::Relaxed);
        Some(Call { instance: self.name(), function, time: self.time(), number })
    }

    /// Returns whether `address` is the address of this slot.
    pub(crate) fn is_at(&self, address: usize) -> bool {
        ptr::from_ref(self).addr() == address
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.slot.leave();
        self.slot.is_used.store(false, Ordering::Release);
    }
}

/// Returns the address of the slot that this thread entered last; 0 if the thread entered no slot.
#[inline]
pub(crate) fn last_of_this_thread() -> usize {
    LAST.try_with(Cell::get).unwrap_or(0)
}

/// Returns the names of the instances so far, except instances whose slot a later instance has taken.
#[cfg(unix)]
pub(super) fn instances() -> impl Iterator<Item = Name> {
    RECORD.used().iter().map(Slot::name)
}

/// Returns the name of the instance with the slot at `address`; `None` if no instance has had such a slot.
#[cfg(unix)]
pub(super) fn instance(address: usize) -> Option<Name> {
    RECORD.used().iter().find(|slot| slot.is_at(address)).map(Slot::name)
}

/// Returns the call that the slot at `address` executes. Without such a slot or call, returns the
/// current calls of all instances. Does not allocate.
pub(super) fn calls(address: usize) -> impl Iterator<Item = Call> {
    let slots = RECORD.used();
    let executing = slots.iter().find(|slot| slot.is_at(address) && slot.call().is_some());
    slots
        .iter()
        .filter(move |slot| executing.is_none_or(|executing| ptr::eq(executing, *slot)))
        .filter_map(Slot::call)
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn a_call_is_known_from_entering_to_leaving_and_gone_with_its_instance() {
        let (one, other) = (Place::new("one"), Place::new("other"));
        one.set_time(0.5);
        one.enter(&"fmi2DoStep");
        let address = last_of_this_thread();
        assert!(one.is_at(address) && !other.is_at(address));
        let call = calls(address).next().unwrap();
        assert_eq!((&*call.instance, call.function, call.time), ("one", "fmi2DoStep", 0.5));
        assert_eq!(calls(address).count(), 1);
        assert!(calls(1).any(|actual| actual == call));
        one.leave();
        assert!(calls(address).all(|call| &*call.instance != "one"));
        // A repeated step: the same function at the same time, but another call.
        one.enter(&"fmi2DoStep");
        let again = calls(address).next().unwrap();
        assert_eq!((again.function, again.time), (call.function, call.time));
        assert_ne!(again, call);
        one.leave();
        one.enter(&"fmi2GetReal");
        drop(one);
        assert!(calls(1).all(|call| &*call.instance != "one"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_observer_receives_the_name_of_each_function_and_its_return() {
        static NAMES: Mutex<Vec<String>> = Mutex::new(Vec::new());
        observe(|name| NAMES.lock().unwrap().push(name.to_owned()));
        let place = Place::new("observed");
        place.enter(&"fmi2GetDerivatives");
        place.leave();
        // Other tests run at the same time.
        let names = NAMES.lock().unwrap();
        let call = names.iter().position(|name| name == "fmi2GetDerivatives").unwrap();
        assert!(names[call..].iter().any(String::is_empty), "{names:?}");
    }
}
