//! Column-major arrays of Fortran, read into matrices and written from them.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use nalgebra::DMatrix;

/// A number in single or double precision; all arithmetic is in double precision.
pub(crate) trait Number: Copy + Into<f64> {
    /// Rounds to this precision.
    fn narrow(value: f64) -> Self;

    /// Converts to double precision.
    fn wide(self) -> f64 {
        self.into()
    }
}

impl Number for f64 {
    fn narrow(value: f64) -> Self {
        value
    }
}

impl Number for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "the answer in single precision")]
    fn narrow(value: f64) -> Self {
        value as Self
    }
}

/// The part of a square array that is read or written.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    All,
    Upper,
    Lower,
}

impl Part {
    /// The triangle that the argument UPLO selects.
    pub(crate) fn triangle(letter: u8) -> Option<Self> {
        match letter.to_ascii_uppercase() {
            b'U' => Some(Self::Upper),
            b'L' => Some(Self::Lower),
            _ => None,
        }
    }

    /// Whether the entry belongs to this fraction.
    fn holds(self, row: usize, col: usize) -> bool {
        match self {
            Self::All => true,
            Self::Upper => row <= col,
            Self::Lower => row >= col,
        }
    }
}

/// An array of `rows` x `cols` entries, column by column, `step` entries from one column to the next.
#[derive(Clone, Copy)]
pub(crate) struct Layout {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    step: usize,
}

impl Layout {
    /// Creates the layout; None when a size is negative, or when the leading dimension is below one or shorter than a
    /// column.
    pub(crate) fn new(rows: i32, cols: i32, leading: i32) -> Option<Self> {
        let (rows, cols) = (usize::try_from(rows).ok()?, usize::try_from(cols).ok()?);
        let step = usize::try_from(leading).ok()?;
        (step >= rows.max(1)).then_some(Self { rows, cols, step })
    }

    /// Reads the matrix; entries outside of `part` are not read and are zero.
    ///
    /// # Safety
    ///
    /// `from` is valid for reads of the entries of `part`.
    pub(crate) unsafe fn read<T: Number>(self, from: *const T, part: Part) -> DMatrix<f64> {
        DMatrix::from_fn(self.rows, self.cols, |row, col| {
            if part.holds(row, col) {
                // SAFETY: the caller guarantees that the array has this entry.
                unsafe { from.add(row + col * self.step).read() }.wide()
            } else {
                0.0
            }
        })
    }

    /// Writes the entries of `part`.
    ///
    /// # Safety
    ///
    /// `to` is valid for writes of the entries of `part`; `m` has the size of the layout.
    pub(crate) unsafe fn write<T: Number>(self, to: *mut T, m: &DMatrix<f64>, part: Part) {
        debug_assert_eq!(m.shape(), (self.rows, self.cols));
        for (at, value) in m.iter().enumerate() {
            let (row, col) = (at % self.rows, at / self.rows);
            if part.holds(row, col) {
                // SAFETY: the caller guarantees that the array has this entry.
                unsafe { to.add(row + col * self.step).write(T::narrow(*value)) }
            }
        }
    }
}

/// A vector argument with its option INC: `length` entries at distances of `increment`; a negative one runs backwards.
pub(crate) struct Vector<P> {
    data: P,
    length: usize,
    increment: i32,
}

impl<P> Vector<P> {
    /// Creates the argument; None when the length is negative or the increment zero.
    pub(crate) fn new(data: P, length: i32, increment: i32) -> Option<Self> {
        let length = usize::try_from(length).ok()?;
        (increment != 0).then_some(Self { data, length, increment })
    }

    /// The offset of entry `at`, counted from 0, from the pointer of the vector.
    fn offset(&self, at: usize) -> usize {
        let step = self.increment.unsigned_abs() as usize;
        if self.increment < 0 { (self.length - 1 - at) * step } else { at * step }
    }
}

impl<T: Number> Vector<*const T> {
    /// Reads the vector as a column.
    ///
    /// # Safety
    ///
    /// The pointer is valid for reads of the entries.
    pub(crate) unsafe fn read(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.length, 1, |at, _| {
            // SAFETY: the caller guarantees that the vector has this entry.
            unsafe { self.data.add(self.offset(at)).read() }.wide()
        })
    }
}

impl<T: Number> Vector<*mut T> {
    /// y := `product` + beta y; with beta = 0 y is not read.
    ///
    /// # Safety
    ///
    /// The pointer is valid for reads and writes of the entries; `product` is a column of the same length.
    pub(crate) unsafe fn update(&self, product: &DMatrix<f64>, beta: T) {
        for (at, &value) in product.iter().enumerate() {
            // SAFETY: the caller guarantees that the vector has this entry.
            unsafe {
                let entry = self.data.add(self.offset(at));
                let before =
                    if beta.wide() == 0.0 { 0.0 } else { beta.wide() * entry.read().wide() };
                entry.write(T::narrow(value + before));
            }
        }
    }
}
