//! Intermediate update: the FMU asks for its inputs within a step, and they follow polynomials (FMI 3.0.2,
//! section 4.2.2). This replaces the input derivatives of FMI 2.0.
#![expect(unsafe_code, reason = "the boundary to C")]

use std::cell::Cell;
use std::collections::HashMap;
use std::ffi::{c_int, c_void};
use std::ptr;

use super::functions::Instance;

/// Largest supported order of an input derivative.
pub(crate) const ORDERS: usize = 3;

type SetFloat64 = unsafe extern "C" fn(Instance, *const u32, usize, *const f64, usize) -> c_int;

thread_local! {
    /// The inputs of the instance that steps on this thread. The callback does not use
    /// `instanceEnvironment`, which some FMUs pass back changed.
    static CURRENT: Cell<*mut Inputs> = const { Cell::new(ptr::null_mut()) };
}

/// An element of an input for which the FMU asks within a step; a scalar is its own element.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InputElement {
    /// Value reference of the whole input, in the FMU.
    pub(crate) reference: u32,
    /// Number of elements of the input.
    pub(crate) size: usize,
    /// Position of the element among all elements of the input.
    pub(crate) element: usize,
}

/// The inputs of the present step.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    /// Whether derivatives are set for the step.
    pub(super) is_set: bool,
    /// Start of the step in s.
    pub(super) start: f64,
    /// The last time for which the FMU asked for inputs, in s.
    asked_time: Option<f64>,
    /// The whole inputs that have had derivatives in this or an earlier step.
    pub(super) references: Vec<u32>,
    /// The values of the elements of these inputs at the start of the step.
    pub(super) values: Vec<f64>,
    /// The derivatives of order 1 to [`ORDERS`] of the elements for this step.
    derivatives: Vec<[f64; ORDERS]>,
    /// Position of the first element of each input, by value reference.
    index: HashMap<u32, usize>,
    /// Buffer for the values of the inputs at a time within the step.
    present: Vec<f64>,
    /// The instance that steps, and its function to set inputs; `None` outside a step.
    target: Option<(Instance, SetFloat64)>,
}

impl Inputs {
    /// Stores the derivatives of the inputs for which `locate` returns an element; all others become 0. On failure
    /// returns an order that is not supported.
    pub(super) fn derive(
        &mut self,
        list: &[u32],
        orders: &[i32],
        values: &[f64],
        locate: impl Fn(u32) -> Option<InputElement>,
    ) -> Result<(), i32> {
        self.derivatives.fill([0.0; ORDERS]);
        for ((&input, &order), &value) in list.iter().zip(orders).zip(values) {
            let Some(InputElement { reference, size, element }) = locate(input) else { continue };
            let place = usize::try_from(order).ok().and_then(|order| order.checked_sub(1));
            let place = place.filter(|place| *place < ORDERS).ok_or(order)?;
            let first = *self.index.entry(reference).or_insert_with(|| {
                let (first, count) = (self.values.len(), self.values.len() + size);
                self.references.push(reference);
                self.values.resize(count, 0.0);
                self.derivatives.resize(count, [0.0; ORDERS]);
                self.present.resize(count, 0.0);
                first
            });
            self.derivatives[first + element][place] = value;
        }
        Ok(())
    }

    /// Runs `step`, a part of the step of the instance `target`, which may ask for its inputs; returns the status.
    pub(super) fn during(
        &mut self,
        target: (Instance, SetFloat64),
        step: impl FnOnce() -> c_int,
    ) -> c_int {
        (self.asked_time, self.target) = (None, Some(target));
        let before = CURRENT.replace(self);
        let status = step();
        CURRENT.set(before);
        status
    }

    /// Sets the inputs to their values at `time`, in s, unless the FMU asked for the values at this time last.
    /// Returns the status of the FMU, or 0 (OK).
    pub(super) fn settle(&mut self, time: f64) -> c_int {
        if self.asked_time == Some(time) { 0 } else { self.apply(time) }
    }

    /// Sets the inputs to their values at `time`, in s; returns the status of the FMU.
    fn apply(&mut self, time: f64) -> c_int {
        let elapsed = time - self.start;
        let all = self.present.iter_mut().zip(&self.values).zip(&self.derivatives);
        for ((present, value), derivatives) in all {
            *present = value_at(*value, derivatives, elapsed);
        }
        let Some((instance, set)) = self.target else { return 0 };
        let (references, values) = (&self.references, &self.present);
        let (count, length) = (references.len(), values.len());
        // SAFETY: the instance is alive, as it asks or has just stepped; both lists have their lengths.
        unsafe { set(instance, references.as_ptr(), count, values.as_ptr(), length) }
    }
}

/// Returns `value + first s + second s^2 / 2 + third s^3 / 6`, where `s` is the time since the start of the step.
fn value_at(value: f64, [first, second, third]: &[f64; ORDERS], s: f64) -> f64 {
    value + s * (first + s / 2.0 * (second + s / 3.0 * third))
}

/// `fmi3IntermediateUpdateCallback`: sets the inputs if the FMU asks for them; no early return.
///
/// A failure of the FMU shows in the status of its step.
pub(super) unsafe extern "C" fn update(
    _environment: *mut c_void,
    time: f64,
    set_requested: u8,
    _get_allowed: u8,
    _finished: u8,
    _can_return_early: u8,
    return_requested: *mut u8,
    _return_time: *mut f64,
) {
    if !return_requested.is_null() {
        // SAFETY: a place for the answer by the standard.
        unsafe { return_requested.write(0) };
    }
    // SAFETY: null, or the inputs of the step that runs on this thread and waits for this callback.
    let inputs = unsafe { CURRENT.get().as_mut() };
    if let Some(inputs) = inputs.filter(|_| set_requested != 0) {
        inputs.asked_time = Some(time);
        inputs.apply(time);
    }
}

#[cfg(test)]
mod tests {
    use super::value_at;

    #[test]
    fn a_polynomial_of_order_3_is_that_of_taylor() {
        let taylor = |s: f64| 2.0 + 0.5 * s - 3.0 * s * s / 2.0 + 7.0 * s * s * s / 6.0;
        for s in [0.0, 0.25, 1.0, 3.0] {
            assert!((value_at(2.0, &[0.5, -3.0, 7.0], s) - taylor(s)).abs() < 1e-12);
        }
    }
}
