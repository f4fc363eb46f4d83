//! Arrays and texts as C passes them.

use std::ffi::CString;
use std::ptr::{null, null_mut};

use fmu_description::abi::fmi2String;

/// How the pointer to an array is passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Right,
    Null,
    Misaligned,
    /// With a count that no memory can hold.
    Huge,
}

/// An array as an argument.
#[derive(Debug)]
pub(crate) struct Array<T> {
    pub(crate) items: Vec<T>,
    pub(crate) shape: Shape,
}

impl<T> Array<T> {
    pub(crate) fn right(items: Vec<T>) -> Self {
        Self { items, shape: Shape::Right }
    }

    pub(crate) fn pointer(&self) -> *const T {
        match self.shape {
            Shape::Right | Shape::Huge => self.items.as_ptr(),
            Shape::Null => null(),
            Shape::Misaligned => self.items.as_ptr().wrapping_byte_add(1),
        }
    }

    pub(crate) fn pointer_mut(&mut self) -> *mut T {
        match self.shape {
            Shape::Right | Shape::Huge => self.items.as_mut_ptr(),
            Shape::Null => null_mut(),
            Shape::Misaligned => self.items.as_mut_ptr().wrapping_byte_add(1),
        }
    }

    /// The length to state.
    pub(crate) fn count(&self) -> usize {
        if self.shape == Shape::Huge { usize::MAX } else { self.items.len() }
    }
}

/// The count of two arrays that share it.
pub(crate) fn shared<A, B>(one: &Array<A>, other: &Array<B>) -> usize {
    let huge = [one.shape, other.shape].contains(&Shape::Huge);
    assert_eq!(one.items.len(), other.items.len());
    if huge { usize::MAX } else { one.items.len() }
}

/// A C string as an argument; `None` is null.
pub(crate) type Text = Option<CString>;

pub(crate) fn pointer(text: &Text) -> fmi2String {
    text.as_ref().map_or(null(), |text| text.as_ptr())
}

pub(crate) fn pointers(texts: &Array<Text>) -> Array<fmi2String> {
    Array { items: texts.items.iter().map(pointer).collect(), shape: texts.shape }
}
