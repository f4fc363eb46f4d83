//! Arrays and strings as C passes them.

use std::ffi::CString;
use std::ptr::{null, null_mut};

use fmu_description::abi::fmi2String;

/// How the pointer to an array is passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Right,
    Null,
    Misaligned,
    /// With a count that exceeds all memory.
    Huge,
}

/// An array as an argument.
#[derive(Debug)]
pub struct Array<T> {
    pub items: Vec<T>,
    pub shape: Shape,
}

impl<T> Array<T> {
    pub fn right(items: Vec<T>) -> Self {
        Self { items, shape: Shape::Right }
    }

    pub fn pointer(&self) -> *const T {
        match self.shape {
            Shape::Right | Shape::Huge => self.items.as_ptr(),
            Shape::Null => null(),
            Shape::Misaligned => self.items.as_ptr().wrapping_byte_add(1),
        }
    }

    pub fn pointer_mut(&mut self) -> *mut T {
        match self.shape {
            Shape::Right | Shape::Huge => self.items.as_mut_ptr(),
            Shape::Null => null_mut(),
            Shape::Misaligned => self.items.as_mut_ptr().wrapping_byte_add(1),
        }
    }

    /// The length to pass.
    pub fn count(&self) -> usize {
        if self.shape == Shape::Huge { usize::MAX } else { self.items.len() }
    }
}

/// The common count of two arrays.
pub fn shared<A, B>(one: &Array<A>, other: &Array<B>) -> usize {
    let huge = [one.shape, other.shape].contains(&Shape::Huge);
    assert_eq!(one.items.len(), other.items.len());
    if huge { usize::MAX } else { one.items.len() }
}

/// A C string as an argument; `None` is null.
pub type Text = Option<CString>;

pub fn pointer(text: &Text) -> fmi2String {
    text.as_ref().map_or(null(), |text| text.as_ptr())
}

pub fn pointers(texts: &Array<Text>) -> Array<fmi2String> {
    Array { items: texts.items.iter().map(pointer).collect(), shape: texts.shape }
}
