//! Variables of the types that FMI 2.0 does not have, by the C functions of FMI 3.0.
#![expect(clippy::float_cmp, reason = "values that are set and read back")]

use std::ffi::{CStr, CString};
use std::path::Path;
use std::ptr::{null, null_mut};

use serde::{Deserialize, Serialize};

use crate::ffi::{Callbacks, fmi3 as c};
use crate::instance::Instance;
use crate::{Failure, Model, Variables, describe, describe_3, problems};
use fmu_description::abi3::{fmi3Instance, fmi3InstanceEnvironment, fmi3String};
use fmu_description::call_order::InterfaceType;
use fmu_description::{Dimension, Elements, Kind, ModelDescription};

const OK: i32 = 0;
const DISCARD: i32 = 2;
const ERROR: i32 = 3;

/// One input of each type.
#[derive(Clone, Variables, Serialize, Deserialize)]
struct Types {
    #[fmu(input, unit = "m", min = -2, max = 2, start = 0.1)]
    a: f32,
    #[fmu(input, min = -5)]
    b: i8,
    #[fmu(input)]
    c: u8,
    #[fmu(input)]
    d: i16,
    #[fmu(input)]
    e: u16,
    #[fmu(input)]
    f: u32,
    #[fmu(input, start = -9_007_199_254_740_993)]
    g: i64,
    #[fmu(input, start = u64::MAX)]
    h: u64,
    #[fmu(input, start = [0_u8, 255])]
    bytes: Vec<u8>,
    #[fmu(input, start = [1, 2, 3])]
    row: [u16; 3],
    #[fmu(input, enumeration("Mode", off = 0, on = 1))]
    mode: i32,
    #[fmu(output)]
    sum: i64,
}

#[fmu::model(stop_time = 1)]
impl Model for Types {
    fn update(&mut self, _time: f64) -> Result<(), Failure> {
        self.sum = i64::from(self.b) + i64::from(self.f) + self.g;
        Ok(())
    }

    fn step(&mut self, _: &crate::Step) -> Result<(), Failure> {
        self.update(0.0)
    }
}

fn description() -> ModelDescription {
    describe_3::<Types>(Path::new("")).unwrap()
}

fn reference(name: &str) -> u32 {
    description().variable(name).unwrap().value_reference
}

/// Instantiates co-simulation as an importer does.
fn instance() -> fmi3Instance {
    let token = CString::new(description().guid).unwrap();
    // SAFETY: strings that end with zero; no callback; no intermediate variable.
    let instance = unsafe {
        c::instantiate_co_simulation::<Types>(
            c"types".as_ptr(),
            token.as_ptr(),
            null(),
            0,
            0,
            0,
            0,
            null(),
            0,
            null_mut(),
            None,
            None,
        )
    };
    assert!(!instance.is_null());
    instance
}

/// Appends status and text to the vector in the environment.
unsafe extern "C" fn record(
    environment: fmi3InstanceEnvironment,
    status: i32,
    _: fmi3String,
    message: fmi3String,
) {
    // SAFETY: the environment is the vector below, and the text ends with zero.
    unsafe {
        let text = CStr::from_ptr(message).to_string_lossy().into_owned();
        (*environment.cast::<Vec<(i32, String)>>()).push((status, text));
    }
}

#[test]
fn an_error_and_a_failed_instantiation_are_explained_although_logging_is_off() {
    let token = CString::new(description().guid).unwrap();
    let mut messages = Vec::<(i32, String)>::new();
    let environment = (&raw mut messages).cast();
    let make = |token: &CStr| {
        // SAFETY: strings that end with zero; a callback that fits its environment.
        unsafe {
            c::instantiate_co_simulation::<Types>(
                c"types".as_ptr(),
                token.as_ptr(),
                null(),
                0,
                0,
                0,
                0,
                null(),
                0,
                environment,
                Some(record),
                None,
            )
        }
    };
    assert!(make(c"another").is_null());
    let instance = make(&token);
    let a = reference("a");
    // SAFETY: an instance, freed once, and one value each.
    unsafe {
        let set =
            |value: f32| c::set_float32::<Types>(instance, &raw const a, 1, &raw const value, 1);
        assert_eq!(set(9.0), DISCARD, "which is no error");
        assert_eq!(c::set_uint8::<Types>(instance, &raw const a, 1, &1, 1), ERROR);
        c::free_instance::<Types>(instance);
    }
    let parts = ["another", "a of type Float32, expected a UInt8"];
    assert_eq!(messages.len(), parts.len(), "{messages:?}");
    for ((status, text), part) in messages.iter().zip(parts) {
        assert!(*status == ERROR && text.contains(part), "{text}");
    }
}

/// Sets values of one type and reads them back.
macro_rules! set_and_get {
    ($instance:expr, $set:ident, $get:ident, $name:literal, $values:expr) => {{
        let (given, reference) = ($values, [reference($name)]);
        let mut actual = given.map(|_| Default::default());
        // SAFETY: an instance, and arrays with the lengths that are passed.
        unsafe {
            let status =
                c::$set::<Types>($instance, reference.as_ptr(), 1, given.as_ptr(), given.len());
            assert_eq!(status, OK, $name);
            let status = c::$get::<Types>(
                $instance,
                reference.as_ptr(),
                1,
                actual.as_mut_ptr(),
                actual.len(),
            );
            assert_eq!(status, OK, $name);
        }
        assert_eq!(actual, given, $name);
    }};
}

#[test]
fn every_type_keeps_the_extremes_of_its_values() {
    let instance = instance();
    set_and_get!(instance, set_float32, get_float32, "a", [1.1_f32]);
    set_and_get!(instance, set_int8, get_int8, "b", [i8::MAX]);
    set_and_get!(instance, set_uint8, get_uint8, "c", [u8::MAX]);
    set_and_get!(instance, set_int16, get_int16, "d", [i16::MIN]);
    set_and_get!(instance, set_uint16, get_uint16, "e", [u16::MAX]);
    set_and_get!(instance, set_uint32, get_uint32, "f", [u32::MAX]);
    set_and_get!(instance, set_int64, get_int64, "g", [i64::MIN]);
    set_and_get!(instance, set_uint64, get_uint64, "h", [u64::MAX]);
    set_and_get!(instance, set_uint16, get_uint16, "row", [7_u16, 8, 9]);
    // SAFETY: an instance, freed once.
    unsafe { c::free_instance::<Types>(instance) };
}

#[test]
fn a_binary_is_copied_with_its_zeros_and_may_be_empty() {
    let instance = instance();
    let reference = reference("bytes");
    let get = || {
        let (mut size, mut bytes) = (usize::MAX, null());
        // SAFETY: an instance, and places for one value.
        let status = unsafe {
            c::get_binary::<Types>(
                instance,
                &raw const reference,
                1,
                &raw mut size,
                &raw mut bytes,
                1,
            )
        };
        assert_eq!(status, OK);
        // SAFETY: the bytes are valid until the next call.
        if size == 0 {
            Vec::new()
        } else {
            // SAFETY: the bytes are valid until the next call.
            unsafe { std::slice::from_raw_parts(bytes, size) }.to_vec()
        }
    };
    assert_eq!(get(), [0, 255]);
    for value in [&[1, 0, 0, 2][..], &[]] {
        let (size, bytes) = (value.len(), if value.is_empty() { null() } else { value.as_ptr() });
        // SAFETY: an instance, and one value.
        let status = unsafe {
            c::set_binary::<Types>(
                instance,
                &raw const reference,
                1,
                &raw const size,
                &raw const bytes,
                1,
            )
        };
        assert_eq!(status, OK);
        assert_eq!(get(), value);
    }
    // SAFETY: an instance, freed once.
    unsafe { c::free_instance::<Types>(instance) };
}

#[test]
fn enumerations_and_64_bit_integers_are_set_together_or_not_at_all() {
    let instance = instance();
    let references = [reference("mode"), reference("g")];
    let set = |values: [i64; 2]| {
        // SAFETY: an instance, and two values.
        unsafe { c::set_int64::<Types>(instance, references.as_ptr(), 2, values.as_ptr(), 2) }
    };
    let get = || {
        let mut values = [0; 2];
        // SAFETY: an instance, and two places.
        let status = unsafe {
            c::get_int64::<Types>(instance, references.as_ptr(), 2, values.as_mut_ptr(), 2)
        };
        assert_eq!(status, OK);
        values
    };
    assert_eq!(get(), [0, -9_007_199_254_740_993]);
    assert_eq!((set([1, i64::MAX]), get()), (OK, [1, i64::MAX]));
    assert_eq!((set([5, 3]), get()), (DISCARD, [1, i64::MAX]));
    // SAFETY: an instance, freed once.
    unsafe { c::free_instance::<Types>(instance) };
}

#[test]
fn a_value_outside_the_limits_is_discarded_and_another_type_is_an_error() {
    let instance = instance();
    let (a, b) = (reference("a"), reference("b"));
    // SAFETY: an instance, and one value each.
    unsafe {
        for value in [2.1_f32, f32::NAN, f32::INFINITY] {
            let set = c::set_float32::<Types>(instance, &raw const a, 1, &raw const value, 1);
            assert_eq!(set, DISCARD, "{value}");
        }
        assert_eq!(c::set_int8::<Types>(instance, &raw const b, 1, &-6, 1), DISCARD);
        assert_eq!(c::set_uint8::<Types>(instance, &raw const b, 1, &1, 1), ERROR);
        c::free_instance::<Types>(instance);
    }
}

#[test]
fn the_description_of_every_type_breaks_no_rule_and_reads_back_equal() {
    assert_eq!(problems::<Types>(Path::new("")).unwrap(), vec![]);
    let instance = description();
    let (read, warnings) = ModelDescription::read(instance.to_xml().as_bytes()).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(read.variables, instance.variables);
    let row = instance.variable("row").unwrap();
    assert_eq!(row.dimensions, [Dimension::Fixed(3)]);
    assert_eq!(row.start_elements, Some(Elements::Integer(vec![1, 2, 3])));
    let Kind::UInt64(h) = &instance.variable("h").unwrap().kind else { panic!() };
    assert_eq!(h.start, Some(u64::MAX.into()));
}

#[test]
fn fmi_2_refuses_a_type_that_it_does_not_have_by_name() {
    let message = describe::<Types>(Path::new("")).unwrap_err().to_string();
    assert!(
        message.contains("variable a is a Float32") && message.contains("--fmi 3"),
        "{message}"
    );
    let token = description().guid;
    let (kind, callbacks) = (InterfaceType::CoSimulation, Callbacks::silent());
    let refused = Instance::<Types>::new(kind, Path::new(""), &token, callbacks).err();
    assert_eq!(refused.map(|failure| failure.to_string()), Some(message));
}
