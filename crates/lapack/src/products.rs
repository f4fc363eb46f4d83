//! Products into an array: C := alpha (product) + beta C.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use crate::memory::{Layout, Number, Part, Vector};
use nalgebra::DMatrix;

/// A matrix argument with its option TRANS.
pub(crate) struct Operand<T> {
    pub(crate) data: *const T,
    pub(crate) leading: i32,
    pub(crate) transpose: u8,
}

impl<T: Number> Operand<T> {
    /// op(A), `rows` x `cols`; None for an illegal argument.
    ///
    /// # Safety
    ///
    /// The array is valid for reads.
    unsafe fn read(&self, rows: i32, cols: i32) -> Option<DMatrix<f64>> {
        match self.transpose.to_ascii_uppercase() {
            b'N' => {
                let layout = Layout::new(rows, cols, self.leading)?;
                // SAFETY: the caller guarantees it.
                Some(unsafe { layout.read(self.data, Part::All) })
            }
            b'T' | b'C' => {
                let layout = Layout::new(cols, rows, self.leading)?;
                // SAFETY: the caller guarantees it.
                Some(unsafe { layout.read(self.data, Part::All) }.transpose())
            }
            _ => None,
        }
    }
}

/// The output array C, the part of it that is written, and the two factors.
pub(crate) struct Target<T> {
    pub(crate) data: *mut T,
    pub(crate) leading: i32,
    pub(crate) part: Option<Part>,
    pub(crate) alpha: T,
    pub(crate) beta: T,
}

impl<T: Number> Target<T> {
    /// C := alpha `product` + beta C; with beta = 0 C is not read.
    ///
    /// # Safety
    ///
    /// The array is valid for reads and writes.
    unsafe fn update(&self, rows: i32, cols: i32, product: DMatrix<f64>) -> Option<()> {
        let (layout, part) = (Layout::new(rows, cols, self.leading)?, self.part?);
        let mut sum = product * self.alpha.wide();
        if self.beta.wide() != 0.0 {
            // SAFETY: the caller guarantees it.
            sum += unsafe { layout.read(self.data, part) } * self.beta.wide();
        }
        // SAFETY: the caller guarantees it.
        unsafe { layout.write(self.data, &sum, part) };
        Some(())
    }
}

/// C := alpha op(A) op(B) + beta C with C of m x n and op(A) of m x k; None, with C unchanged, if an
/// argument is illegal.
///
/// # Safety
///
/// The pointers are valid for the sizes that the arguments state.
pub(crate) unsafe fn general<T: Number>(
    (m, n, k): (i32, i32, i32),
    a: &Operand<T>,
    b: &Operand<T>,
    c: &Target<T>,
) -> Option<()> {
    // SAFETY: the caller guarantees it.
    unsafe {
        let (left, right) = (a.read(m, k)?, b.read(k, n)?);
        c.update(m, n, left * right)
    }
}

/// A triangle of C := alpha op(A) op(A)' + beta C with C of n x n and op(A) of n x k.
///
/// # Safety
///
/// The pointers are valid for the sizes that the arguments state.
pub(crate) unsafe fn rank_k<T: Number>(
    (n, k): (i32, i32),
    a: &Operand<T>,
    c: &Target<T>,
) -> Option<()> {
    // SAFETY: the caller guarantees it.
    unsafe {
        let left = a.read(n, k)?;
        c.update(n, n, &left * left.transpose())
    }
}

/// A triangle of C := alpha (op(A) op(B)' + op(B) op(A)') + beta C.
///
/// # Safety
///
/// The pointers are valid for the sizes that the arguments state.
pub(crate) unsafe fn rank_2k<T: Number>(
    (n, k): (i32, i32),
    a: &Operand<T>,
    b: &Operand<T>,
    c: &Target<T>,
) -> Option<()> {
    // SAFETY: the caller guarantees it.
    unsafe {
        let (left, right) = (a.read(n, k)?, b.read(n, k)?);
        let half = left * right.transpose();
        c.update(n, n, &half + half.transpose())
    }
}

/// y := alpha op(A) x + beta y with A of m x n.
///
/// # Safety
///
/// The pointers are valid for the sizes that the arguments state.
pub(crate) unsafe fn matrix_vector<T: Number>(
    (m, n): (i32, i32),
    a: &Operand<T>,
    x: (*const T, i32),
    (alpha, beta): (T, T),
    y: (*mut T, i32),
) -> Option<()> {
    let (rows, cols) = if a.transpose.eq_ignore_ascii_case(&b'N') { (m, n) } else { (n, m) };
    let (input, output) = (Vector::new(cols, x.1)?, Vector::new(rows, y.1)?);
    // SAFETY: the caller guarantees it.
    unsafe {
        let product = a.read(rows, cols)? * input.read(x.0);
        output.update(y.0, &(product * alpha.wide()), beta);
    }
    Some(())
}

/// y := alpha A x + beta y with A symmetric, n x n, of which one triangle is read.
///
/// # Safety
///
/// The pointers are valid for the sizes that the arguments state.
pub(crate) unsafe fn symmetric_vector<T: Number>(
    (triangle, n): (u8, i32),
    (a, leading): (*const T, i32),
    x: (*const T, i32),
    (alpha, beta): (T, T),
    y: (*mut T, i32),
) -> Option<()> {
    let (part, layout) = (Part::triangle(triangle)?, Layout::new(n, n, leading)?);
    let (input, output) = (Vector::new(n, x.1)?, Vector::new(n, y.1)?);
    // SAFETY: the caller guarantees it.
    unsafe {
        let half = layout.read(a, part);
        let mut whole = &half + half.transpose();
        whole.set_diagonal(&half.diagonal());
        output.update(y.0, &(whole * input.read(x.0) * alpha.wide()), beta);
    }
    Some(())
}
