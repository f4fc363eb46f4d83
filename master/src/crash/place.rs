//! Where the FMUs are: for each instance the function that it is in, and the time.
#![expect(unsafe_code, reason = "names of functions are kept by address")]

use std::cell::Cell;
use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock, TryLockError, Weak};

use super::Call;

/// The places of all instances of this process.
static PLACES: RwLock<Vec<Weak<Place>>> = RwLock::new(Vec::new());

thread_local! {
    /// Address of the place that this thread entered last; a signal handler reads it.
    static LAST: Cell<usize> = const { Cell::new(0) };
}

/// Where one instance is. Entering and leaving a function are a few stores.
pub(crate) struct Place {
    /// The function that the instance is in; null between the calls.
    function: AtomicPtr<&'static str>,
    /// Bits of the time at which the instance is, in s.
    time: AtomicU64,
    instance: String,
}

impl Place {
    /// The place of a new instance.
    pub(crate) fn new(instance: &str) -> Arc<Self> {
        let place = Arc::new(Self {
            function: AtomicPtr::new(ptr::null_mut()),
            time: AtomicU64::new(0),
            instance: instance.to_owned(),
        });
        let mut places = PLACES.write().unwrap_or_else(PoisonError::into_inner);
        places.push(Arc::downgrade(&place));
        place
    }

    /// The name of the instance.
    pub(crate) fn instance(&self) -> &str {
        &self.instance
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
        Some(Call { instance: self.instance.clone(), function, time: self.time() })
    }

    /// Whether that is the address of this place.
    pub(crate) fn is_at(&self, address: usize) -> bool {
        ptr::from_ref(self).addr() == address
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut places = PLACES.write().unwrap_or_else(PoisonError::into_inner);
        places.retain(|place| place.strong_count() > 0);
    }
}

/// The address of the place that this thread entered last; 0 where it never did.
#[inline]
pub(crate) fn last_of_this_thread() -> usize {
    LAST.try_with(Cell::get).unwrap_or(0)
}

/// The call that the instance at that place is in; where there is no such place or call, the calls
/// that all instances are in.
pub(super) fn calls(address: usize) -> Vec<Call> {
    let places: Vec<Arc<Place>> = match PLACES.try_read() {
        Ok(places) => places.iter().filter_map(Weak::upgrade).collect(),
        Err(TryLockError::Poisoned(poisoned)) => {
            poisoned.into_inner().iter().filter_map(Weak::upgrade).collect()
        }
        Err(TryLockError::WouldBlock) => return Vec::new(),
    };
    let own = places.iter().find(|place| place.is_at(address)).and_then(|place| place.call());
    own.map_or_else(|| places.iter().filter_map(|place| place.call()).collect(), |call| vec![call])
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
        let call = Call { instance: "one".to_owned(), function: "fmi2DoStep", time: 0.5 };
        assert_eq!(calls(address), std::slice::from_ref(&call));
        assert!(calls(1).contains(&call));
        one.leave();
        assert!(!calls(address).iter().any(|call| call.instance == "one"));
        one.enter(&"fmi2GetReal");
        drop(one);
        assert!(!calls(1).iter().any(|call| call.instance == "one"));
    }
}
