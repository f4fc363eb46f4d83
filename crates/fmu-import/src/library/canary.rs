//! Canaries: copies of the arrays that an FMU gets, with a byte pattern before and after each array.
//!
//! An FMU that writes past an array, or into a constant one, changes memory of the program without an error. With
//! guards the FMU gets copies, which are checked after the call; without guards it gets the arrays themselves.
#![expect(unsafe_code, reason = "arrays as bytes")]

use std::ffi::c_int;

use slave::Failure;

/// Number of elements of the margin before and after a copy of an array.
const MARGIN: usize = 8;
/// The value of every byte in the margins around a copy.
const PATTERN: u8 = 0xa5;
/// Largest number of bytes of a state or a binary value; an FMU may state a wrong number.
const MOST_BYTES: usize = 1 << 30;
/// Largest number of states or event indicators; an FMU may state a wrong number.
const MOST_NUMBERS: usize = 1 << 20;

/// Names of arrays in messages.
pub(super) const REFERENCES: &str = "value references";
pub(super) const ORDERS: &str = "orders";
pub(super) const SEED: &str = "seed values";
pub(super) const STRING: &str = "characters of a string";
pub(super) const BYTES: &str = "bytes";
pub(super) const SIZES: &str = "sizes";
const VALUES: &str = "values";

/// A type for which every bit pattern is a valid value.
pub(super) trait Plain: Copy {}

macro_rules! plain {
    ($($type:ty)*) => { $(impl Plain for $type {})* };
}
plain! { f32 f64 i8 u8 i16 u16 i32 u32 i64 u64 usize }

// `*const c_char` and `*const u8` are one type on ARM.
impl<T> Plain for *const T {}

/// The status of a call, and a phrase for its violation of an array (a write outside it, or to a constant one).
pub(super) type Guarded = (c_int, Option<String>);

/// A copy of an array between two margins.
struct Fence<T> {
    memory: Vec<T>,
    what: &'static str,
}

impl<T: Plain> Fence<T> {
    fn new(values: &[T], what: &'static str) -> Self {
        let count = values.len() + 2 * MARGIN;
        let mut memory = Vec::with_capacity(count);
        let start: *mut T = memory.as_mut_ptr();
        // SAFETY: `count` places; the values are written between the margins; any bits are a value.
        unsafe {
            start.write_bytes(PATTERN, count);
            start.add(MARGIN).copy_from_nonoverlapping(values.as_ptr(), values.len());
            memory.set_len(count);
        }
        Self { memory, what }
    }

    /// Returns the pointer that the call gets.
    fn start(&mut self) -> *mut T {
        self.memory[MARGIN..].as_mut_ptr()
    }

    /// Returns the values after the call.
    fn values(&self) -> &[T] {
        &self.memory[MARGIN..self.memory.len() - MARGIN]
    }

    /// Returns a phrase for a write outside the array; `None` if there was none.
    fn escaped(&self) -> Option<String> {
        let is_clean = |part: &[T]| bytes(part).iter().all(|byte| *byte == PATTERN);
        let end = self.memory.len() - MARGIN;
        let place = match (is_clean(&self.memory[..MARGIN]), is_clean(&self.memory[end..])) {
            (true, true) => return None,
            (true, false) => "past the end",
            (false, _) => "before the start",
        };
        Some(format!("wrote {place} of its array of {}", self.what))
    }

    /// Returns a phrase for a write outside the array, or into it, as its values are constant; `None` without such a
    /// write.
    fn changed(&self, values: &[T]) -> Option<String> {
        let is_same = bytes(self.values()) == bytes(values);
        let changed = (!is_same).then(|| format!("changed its constant array of {}", self.what));
        changed.or_else(|| self.escaped())
    }
}

fn bytes<T: Plain>(values: &[T]) -> &[u8] {
    // SAFETY: the types have no padding.
    unsafe { std::slice::from_raw_parts(values.as_ptr().cast(), size_of_val(values)) }
}

/// Performs `call` with an array that it fills; `call` may hold further guarded arrays.
#[inline]
pub(super) fn filled<T: Plain>(
    guards: bool,
    what: &'static str,
    values: &mut [T],
    call: impl FnOnce(*mut T) -> Guarded,
) -> Guarded {
    if !guards {
        return call(values.as_mut_ptr());
    }
    let mut array = Fence::new(values, what);
    let (status, violation) = call(array.start());
    values.copy_from_slice(array.values());
    (status, violation.or_else(|| array.escaped()))
}

/// Performs `call` with a constant array; `call` may hold further guarded arrays.
#[inline]
pub(super) fn constant<T: Plain>(
    guards: bool,
    what: &'static str,
    values: &[T],
    call: impl FnOnce(*const T) -> Guarded,
) -> Guarded {
    if !guards {
        return call(values.as_ptr());
    }
    let mut array = Fence::new(values, what);
    let (status, violation) = call(array.start());
    (status, violation.or_else(|| array.changed(values)))
}

/// Performs `call` with a constant array of pointers to constant bytes.
pub(super) fn constants(
    guards: bool,
    what: &'static str,
    values: &[&[u8]],
    call: impl FnOnce(*const *const u8) -> Guarded,
) -> Guarded {
    if !guards {
        let pointers: Vec<_> = values.iter().map(|bytes| bytes.as_ptr()).collect();
        return call(pointers.as_ptr());
    }
    let mut copies: Vec<_> = values.iter().map(|bytes| Fence::new(bytes, what)).collect();
    let pointers: Vec<_> = copies.iter_mut().map(|copy| copy.start().cast_const()).collect();
    let (status, violation) = constant(guards, "pointers", &pointers, call);
    let changed = || copies.iter().zip(values).find_map(|(copy, bytes)| copy.changed(bytes));
    (status, violation.or_else(changed))
}

/// Performs `call` with constant value references and an array of values that it fills.
#[inline]
pub(super) fn read<T: Plain>(
    guards: bool,
    references: &[u32],
    values: &mut [T],
    call: impl FnOnce(*const u32, *mut T) -> c_int,
) -> Guarded {
    constant(guards, REFERENCES, references, |list| fill(guards, values, |array| call(list, array)))
}

/// Performs `call` with constant value references and constant values.
#[inline]
pub(super) fn write<T: Plain>(
    guards: bool,
    references: &[u32],
    values: &[T],
    call: impl FnOnce(*const u32, *const T) -> c_int,
) -> Guarded {
    constant(guards, REFERENCES, references, |list| send(guards, values, |array| call(list, array)))
}

/// Performs `call` with an array of values that it fills.
#[inline]
pub(super) fn fill<T: Plain>(
    guards: bool,
    values: &mut [T],
    call: impl FnOnce(*mut T) -> c_int,
) -> Guarded {
    filled(guards, VALUES, values, |array| (call(array), None))
}

/// Performs `call` with a constant array of values.
#[inline]
pub(super) fn send<T: Plain>(
    guards: bool,
    values: &[T],
    call: impl FnOnce(*const T) -> c_int,
) -> Guarded {
    constant(guards, VALUES, values, |array| (call(array), None))
}

/// Returns a buffer of `size` zero bytes for a state whose size the FMU states; an error if this size is too large.
pub(super) fn bytes_of_state(size: usize) -> Result<Vec<u8>, Failure> {
    check_size(size, "state")?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size).map_err(|_| {
        Failure::InvalidAnswer(format!(
            "returned {size} bytes as the size of a state, but there is no memory for them"
        ))
    })?;
    bytes.resize(size, 0);
    Ok(bytes)
}

/// Checks the size in bytes that an FMU states for `what`.
pub(super) fn check_size(size: usize, what: &str) -> Result<(), Failure> {
    if size <= MOST_BYTES {
        return Ok(());
    }
    Err(Failure::InvalidAnswer(format!(
        "returned {size} bytes as the size of a {what}, expected at most {MOST_BYTES}, a protection \
         against wrong numbers"
    )))
}

/// Checks a number of states or event indicators that an FMU states.
pub(crate) fn check_number(count: usize) -> Result<usize, Failure> {
    if count <= MOST_NUMBERS {
        return Ok(count);
    }
    Err(Failure::InvalidAnswer(format!(
        "returned the number {count}, expected at most {MOST_NUMBERS}, a protection against wrong numbers"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_violations_the_values_pass_in_both_directions() {
        let mut values = [1.0, 2.0];
        for guards in [false, true] {
            let done = read(guards, &[7, 8], &mut values, |list, array| {
                // SAFETY: as many as stated.
                unsafe { array.add(1).write(f64::from(*list.add(1))) };
                3
            });
            assert_eq!((done, values), ((3, None), [1.0, 8.0]));
        }
    }

    #[test]
    fn each_write_beside_or_into_a_constant_array_is_named() {
        let actual = |list_at: Option<isize>, array_at: Option<isize>, constant: bool| {
            let call = |list: *mut u32, array: *mut f64| {
                // SAFETY: within the margins.
                unsafe {
                    list_at.inspect(|at| list.offset(*at).write(9));
                    array_at.inspect(|at| array.offset(*at).write(9.0));
                }
                0
            };
            let mut values = [1.0, f64::NAN];
            let done = if constant {
                write(true, &[7, 8], &values, |list, array| call(list.cast_mut(), array.cast_mut()))
            } else {
                read(true, &[7, 8], &mut values, |list, array| call(list.cast_mut(), array))
            };
            done.1.unwrap_or_default()
        };
        assert_eq!(actual(None, None, true), "");
        assert_eq!(actual(None, Some(1), false), "");
        assert_eq!(actual(None, Some(2), false), "wrote past the end of its array of values");
        assert_eq!(actual(None, Some(-1), false), "wrote before the start of its array of values");
        assert_eq!(actual(None, Some(1), true), "changed its constant array of values");
        let references = "changed its constant array of value references";
        assert_eq!(actual(Some(0), None, true), references);
        assert_eq!(actual(Some(1), None, false), references);
    }

    #[test]
    fn each_of_several_arrays_has_its_name() {
        let actual = |orders_at: Option<isize>, text_at: Option<isize>| {
            let done = constant(true, ORDERS, &[1_i32, 2], |orders| {
                constants(true, STRING, &[b"one\0", b"three\0"], |texts| {
                    // SAFETY: within the margins.
                    unsafe {
                        orders_at.inspect(|at| orders.cast_mut().offset(*at).write(9));
                        text_at
                            .inspect(|at| texts.add(1).read().cast_mut().offset(*at).write(b'x'));
                    }
                    (0, None)
                })
            });
            done.1.unwrap_or_default()
        };
        assert_eq!(actual(None, None), "");
        assert_eq!(actual(Some(1), None), "changed its constant array of orders");
        assert_eq!(actual(Some(2), None), "wrote past the end of its array of orders");
        assert_eq!(actual(None, Some(0)), "changed its constant array of characters of a string");
        assert_eq!(
            actual(None, Some(6)),
            "wrote past the end of its array of characters of a string"
        );
    }

    #[test]
    fn impossible_sizes_are_refused() {
        assert_eq!(bytes_of_state(3).unwrap(), [0; 3]);
        for size in [MOST_BYTES + 1, 3 << 30, usize::MAX] {
            let Err(Failure::InvalidAnswer(what)) = bytes_of_state(size) else { panic!("{size}") };
            assert!(what.contains(&size.to_string()), "{what}");
        }
        assert!(check_number(10).is_ok() && check_number(usize::MAX).is_err());
    }
}
