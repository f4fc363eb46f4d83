//! Where the FMUs are: for each instance the function that it is in, and the time.
#![expect(unsafe_code, reason = "names of functions are kept by address")]

use std::cell::Cell;
use std::fmt;
use std::ops::Deref;
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU8, AtomicU64, AtomicUsize, Ordering};

use super::Call;

/// Most instances that are told apart in reports.
const MOST: usize = 4096;
/// Bytes of an instance's name that reports show.
const NAME: usize = 96;

/// Where the instances are. No part of the heap, which an FMU may write over before it crashes; the
/// last one is shared by the instances for which there is no other.
static SLOTS: [Slot; MOST] = [const { Slot::new() }; MOST];

thread_local! {
    /// Address of the place that this thread entered last; a signal handler reads it.
    static LAST: Cell<usize> = const { Cell::new(0) };
}

/// The name of an instance, cut after 96 bytes. No part of the heap, as all that is told of a crash.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Name {
    bytes: [u8; NAME],
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

/// Where one instance is. Entering and leaving a function are a few stores.
pub(crate) struct Slot {
    taken: AtomicBool,
    /// The function that the instance is in; null between the calls.
    function: AtomicPtr<&'static str>,
    /// Bits of the time at which the instance is, in s.
    time: AtomicU64,
    /// Name of the instance, and how many bytes it has.
    name: [AtomicU8; NAME],
    length: AtomicUsize,
}

/// The slot of an instance, for as long as it lives.
pub(crate) struct Place {
    slot: &'static Slot,
    instance: String,
}

impl Place {
    /// The place of a new instance.
    pub(crate) fn new(instance: &str) -> Arc<Self> {
        let free = SLOTS.iter().find(|slot| !slot.taken.swap(true, Ordering::AcqRel));
        let slot = free.unwrap_or(&SLOTS[MOST - 1]);
        let bytes = instance.as_bytes();
        for (place, byte) in slot.name.iter().zip(bytes) {
            place.store(*byte, Ordering::Relaxed);
        }
        slot.length.store(bytes.len().min(NAME), Ordering::Relaxed);
        slot.time.store(0, Ordering::Relaxed);
        Arc::new(Self { slot, instance: instance.to_owned() })
    }

    /// What outlives the instance.
    pub(crate) fn slot(&self) -> &'static Slot {
        self.slot
    }

    /// The name of the instance.
    pub(crate) fn instance(&self) -> &str {
        &self.instance
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
            taken: AtomicBool::new(false),
            function: AtomicPtr::new(ptr::null_mut()),
            time: AtomicU64::new(0),
            name: [const { AtomicU8::new(0) }; NAME],
            length: AtomicUsize::new(0),
        }
    }

    /// The calling thread is about to call this function of the instance.
    #[inline]
    pub(crate) fn enter(&self, function: &'static &'static str) {
        self.function.store(ptr::from_ref(function).cast_mut(), Ordering::Relaxed);
        LAST.set(ptr::from_ref(self).addr());
    }

    /// The call has returned.
    #[inline]
    pub(crate) fn leave(&self) {
        self.function.store(ptr::null_mut(), Ordering::Relaxed);
    }

    /// The time at which the instance is from now on, in s.
    #[inline]
    pub(crate) fn set_time(&self, time: f64) {
        self.time.store(time.to_bits(), Ordering::Relaxed);
    }

    /// The time at which the instance is, in s.
    pub(crate) fn time(&self) -> f64 {
        f64::from_bits(self.time.load(Ordering::Relaxed))
    }

    /// The call that the instance is in.
    fn call(&self) -> Option<Call> {
        let function = self.function.load(Ordering::Relaxed);
        // SAFETY: null, or the address of a static reference that `enter` was given.
        let function = *unsafe { function.as_ref() }?;
        let bytes = self.name.each_ref().map(|byte| byte.load(Ordering::Relaxed));
        let instance = Name { bytes, length: self.length.load(Ordering::Relaxed).min(NAME) };
        Some(Call { instance, function, time: self.time() })
    }

    /// Whether that is the address of this slot.
    pub(crate) fn is_at(&self, address: usize) -> bool {
        ptr::from_ref(self).addr() == address
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.slot.leave();
        self.slot.taken.store(false, Ordering::Release);
    }
}

/// The address of the place that this thread entered last; 0 where it never did.
#[inline]
pub(crate) fn last_of_this_thread() -> usize {
    LAST.try_with(Cell::get).unwrap_or(0)
}

/// The call that the instance at that place is in; where there is no such place or call, the calls
/// that all instances are in. Nothing here allocates.
pub(super) fn calls(address: usize) -> impl Iterator<Item = Call> {
    let own = SLOTS.iter().find(|slot| slot.is_at(address) && slot.call().is_some());
    SLOTS
        .iter()
        .filter(move |slot| own.is_none_or(|own| ptr::eq(own, *slot)))
        .filter_map(Slot::call)
}

#[cfg(test)]
mod tests {
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
        assert!(calls(1).any(|found| found == call));
        one.leave();
        assert!(calls(address).all(|call| &*call.instance != "one"));
        one.enter(&"fmi2GetReal");
        drop(one);
        assert!(calls(1).all(|call| &*call.instance != "one"));
    }
}
