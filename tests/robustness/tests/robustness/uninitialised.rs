//! Passes uninitialised memory to every function that fills memory of the importer.
//!
//! Under Miri, `-Zmiri-recursive-validation` rejects a `&mut [f64]` to such memory.
#![expect(unsafe_code, reason = "calls of the C interface")]

use std::ffi::{CStr, c_int};
use std::mem::MaybeUninit;

use fmu::ffi;
use fmu_description::abi::{fmi2Component, fmi2EventInfo};

use robustness::exporter::order;
use robustness::importer::{Importer, Saved};
use robustness::machine::Machine;

/// Returns the `N` values that `fill` writes.
fn filled<T: Copy, const N: usize>(fill: impl FnOnce(*mut T) -> c_int) -> [T; N] {
    let mut places = [const { MaybeUninit::<T>::uninit() }; N];
    assert_eq!(fill(places.as_mut_ptr().cast()), 0);
    // SAFETY: a function that succeeds fills all places.
    places.map(|place| unsafe { place.assume_init() })
}

fn started(kind: c_int) -> (Importer, fmi2Component) {
    let importer = Importer::new(&order(kind));
    let done = [importer.enter_initialization_mode(), importer.exit_initialization_mode()];
    assert_eq!(done, [0; 2]);
    let component = importer.component();
    (importer, component)
}

#[test]
fn values_arrive_in_memory_that_was_never_written() {
    let (importer, c) = started(1);
    let vr = [0_u32, 5, 6];
    // SAFETY: the component lives, and every pointer leads to as many places as the call says.
    unsafe {
        let reals = filled::<f64, 3>(|to| ffi::get_real::<Machine>(c, vr.as_ptr(), 3, to));
        assert_eq!(reals, [0.0, 2.0, 0.5]);
        let integers = filled::<c_int, 1>(|to| ffi::get_integer::<Machine>(c, [1].as_ptr(), 1, to));
        assert_eq!(integers, [1]);
        let booleans = filled::<c_int, 1>(|to| ffi::get_boolean::<Machine>(c, [0].as_ptr(), 1, to));
        assert_eq!(booleans, [0]);
        let [text] = filled(|to| ffi::get_string::<Machine>(c, [0].as_ptr(), 1, to));
        assert_eq!(CStr::from_ptr(text), c"100 %");
        let (y, order) = ([4_u32], [1]);
        let slopes = filled::<f64, 1>(|to| {
            ffi::get_real_output_derivatives::<Machine>(c, y.as_ptr(), 1, order.as_ptr(), to)
        });
        assert_eq!(slopes, [-1.0], "p x' = p q (u - x) with x = 1");
        let (u, seed) = ([1_u32], [3.0]);
        let directional = filled::<f64, 1>(|to| {
            let (y, u, seed) = (y.as_ptr(), u.as_ptr(), seed.as_ptr());
            ffi::get_directional_derivative::<Machine>(c, y, 1, u, 1, seed, to)
        });
        assert_eq!(directional, [3.0]);
        assert_eq!(filled::<f64, 1>(|to| ffi::get_real_status::<Machine>(c, 2, to)), [0.0]);
        assert_eq!(filled::<c_int, 1>(|to| ffi::get_boolean_status::<Machine>(c, 3, to)), [0]);
    }
    drop(importer);
}

#[test]
fn model_exchange_fills_memory_that_was_never_written() {
    let (importer, c) = started(0);
    // SAFETY: as above.
    unsafe {
        let [info] = filled::<fmi2EventInfo, 1>(|to| ffi::new_discrete_states::<Machine>(c, to));
        assert_eq!(info.next_event_time, 1.0);
        assert_eq!(importer.enter_continuous_time_mode(), 0);
        let states = filled::<f64, 1>(|to| ffi::get_continuous_states::<Machine>(c, to, 1));
        let slopes = filled::<f64, 1>(|to| ffi::get_derivatives::<Machine>(c, to, 1));
        let nominals = filled::<f64, 1>(|to| ffi::get_nominals::<Machine>(c, to, 1));
        let indicators = filled::<f64, 1>(|to| ffi::get_event_indicators::<Machine>(c, to, 1));
        assert_eq!([states, slopes, nominals, indicators], [[1.0], [-0.5], [1.0], [1.0]]);
        let mut enter = [MaybeUninit::<c_int>::uninit(); 1];
        let terminate = filled::<c_int, 1>(|to| {
            ffi::completed_integrator_step::<Machine>(c, 1, enter.as_mut_ptr().cast(), to)
        });
        assert_eq!([enter[0].assume_init(), terminate[0]], [0, 0]);
    }
    drop(importer);
}

#[test]
fn a_state_is_serialised_into_memory_that_was_never_written() {
    let (importer, c) = started(1);
    let mut state = Saved::NULL;
    assert_eq!(importer.get_fmu_state(Some(&mut state)), 0);
    // SAFETY: as above.
    unsafe {
        let [size] = filled(|to| ffi::serialized_fmu_state_size::<Machine>(c, state.raw(), to));
        let mut bytes = Vec::<u8>::with_capacity(size);
        let to = bytes.as_mut_ptr().cast();
        assert_eq!(ffi::serialize_fmu_state::<Machine>(c, state.raw(), to, size), 0);
        bytes.set_len(size);
        let from = bytes.as_ptr().cast();
        let mut again = std::ptr::null_mut();
        assert_eq!(ffi::de_serialize_fmu_state::<Machine>(c, from, size, &raw mut again), 0);
        assert_eq!(ffi::free_fmu_state::<Machine>(c, &raw mut again), 0);
    }
    importer.free_fmu_state(Some(&mut state));
}

#[test]
fn null_is_allowed_for_arrays_of_length_zero() {
    use std::ptr::{null, null_mut};
    let (importer, c) = started(1);
    // SAFETY: as above; there are no places.
    unsafe {
        let done = [
            ffi::get_real::<Machine>(c, null(), 0, null_mut()),
            ffi::set_real::<Machine>(c, null(), 0, null()),
            ffi::get_string::<Machine>(c, null(), 0, null_mut()),
            ffi::get_real_output_derivatives::<Machine>(c, null(), 0, null(), null_mut()),
            ffi::get_directional_derivative::<Machine>(c, null(), 0, null(), 0, null(), null_mut()),
        ];
        assert_eq!(done, [0; 5]);
    }
    drop(importer);
}
