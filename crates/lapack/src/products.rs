//! Products into an array: C := alpha (product) + beta C.
//!
//! The pointers of all functions are valid for the sizes that the arguments state.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use crate::memory::{Layout, Number, Part, Vector};
use nalgebra::DMatrix;

/// A matrix argument A with its option TRANS, and the size of op(A).
pub(crate) struct Operand<T> {
    pub(crate) data: *const T,
    pub(crate) leading: i32,
    pub(crate) transpose: u8,
    /// Rows of op(A).
    pub(crate) rows: i32,
    /// Columns of op(A).
    pub(crate) cols: i32,
}

impl<T: Number> Operand<T> {
    /// The operand of an array with `m` rows and `n` columns.
    pub(crate) fn of_array(data: *const T, leading: i32, transpose: u8, m: i32, n: i32) -> Self {
        let (rows, cols) = if transpose.eq_ignore_ascii_case(&b'N') { (m, n) } else { (n, m) };
        Self { data, leading, transpose, rows, cols }
    }

    /// op(A); None for an illegal argument.
    ///
    /// # Safety
    ///
    /// The array is valid for reads.
    unsafe fn read(&self) -> Option<DMatrix<f64>> {
        let array = |rows, cols| {
            let layout = Layout::new(rows, cols, self.leading)?;
            // SAFETY: the caller guarantees valid pointers.
            Some(unsafe { layout.read(self.data, Part::All) })
        };
        match self.transpose.to_ascii_uppercase() {
            b'N' => array(self.rows, self.cols),
            b'T' | b'C' => Some(array(self.cols, self.rows)?.transpose()),
            _ => None,
        }
    }
}

/// The output array C, the part of C that is written, and the factors alpha and beta.
pub(crate) struct Target<T> {
    pub(crate) data: *mut T,
    pub(crate) leading: i32,
    /// The part that is written; None for an illegal UPLO.
    pub(crate) part: Option<Part>,
    pub(crate) alpha: T,
    pub(crate) beta: T,
}

impl<T: Number> Target<T> {
    /// C := alpha `product` + beta C; with beta = 0 C is not read. None, with C unchanged, if an argument is illegal.
    ///
    /// # Safety
    ///
    /// The array is valid for reads and writes.
    unsafe fn update(&self, rows: i32, cols: i32, product: DMatrix<f64>) -> Option<()> {
        let (layout, part) = (Layout::new(rows, cols, self.leading)?, self.part?);
        let mut sum = product * self.alpha.wide();
        if self.beta.wide() != 0.0 {
            // SAFETY: the caller guarantees valid pointers.
            sum += unsafe { layout.read(self.data, part) } * self.beta.wide();
        }
        // SAFETY: the caller guarantees valid pointers.
        unsafe { layout.write(self.data, &sum, part) };
        Some(())
    }
}

/// C := alpha op(A) op(B) + beta C with C of m x n and op(A) of m x k; None, with C unchanged, if an
/// argument is illegal.
pub(crate) unsafe fn general<T: Number>(
    a: &Operand<T>,
    b: &Operand<T>,
    c: &Target<T>,
) -> Option<()> {
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        let (left, right) = (a.read()?, b.read()?);
        c.update(a.rows, b.cols, left * right)
    }
}

/// A triangle of C := alpha op(A) op(A)' + beta C with C of n x n and op(A) of n x k; None, with C unchanged,
/// if an argument is illegal.
pub(crate) unsafe fn rank_k<T: Number>(a: &Operand<T>, c: &Target<T>) -> Option<()> {
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        let left = a.read()?;
        c.update(a.rows, a.rows, &left * left.transpose())
    }
}

/// A triangle of C := alpha (op(A) op(B)' + op(B) op(A)') + beta C; None, with C unchanged, if an argument is
/// illegal.
pub(crate) unsafe fn rank_2k<T: Number>(
    a: &Operand<T>,
    b: &Operand<T>,
    c: &Target<T>,
) -> Option<()> {
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        let (left, right) = (a.read()?, b.read()?);
        let half = left * right.transpose();
        c.update(a.rows, a.rows, &half + half.transpose())
    }
}

/// A symmetric matrix argument, n x n, of which one triangle is read.
pub(crate) struct Symmetric<T> {
    pub(crate) data: *const T,
    pub(crate) leading: i32,
    pub(crate) triangle: u8,
    pub(crate) n: i32,
}

/// y := alpha op(A) x + beta y; None, with y unchanged, if an argument is illegal.
pub(crate) unsafe fn matrix_vector<T: Number>(
    a: &Operand<T>,
    x: Option<Vector<*const T>>,
    y: Option<Vector<*mut T>>,
    [alpha, beta]: [T; 2],
) -> Option<()> {
    let (x, y) = x.zip(y)?;
    // SAFETY: the caller guarantees valid pointers.
    unsafe { y.update(&(a.read()? * x.read() * alpha.wide()), beta) };
    Some(())
}

/// y := alpha A x + beta y with A symmetric, n x n, of which one triangle is read; None, with y unchanged, if
/// an argument is illegal.
pub(crate) unsafe fn symmetric_vector<T: Number>(
    a: &Symmetric<T>,
    x: Option<Vector<*const T>>,
    y: Option<Vector<*mut T>>,
    [alpha, beta]: [T; 2],
) -> Option<()> {
    let (part, layout) = (Part::triangle(a.triangle)?, Layout::new(a.n, a.n, a.leading)?);
    let (x, y) = x.zip(y)?;
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        let half = layout.read(a.data, part);
        let mut whole = &half + half.transpose();
        whole.set_diagonal(&half.diagonal());
        y.update(&(whole * x.read() * alpha.wide()), beta);
    }
    Some(())
}
