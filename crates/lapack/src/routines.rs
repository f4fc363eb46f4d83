//! The routines of LAPACK on arrays. Their error is the code INFO.
//!
//! INFO -i: argument i, counted from 1, is illegal. Each routine states the meaning of INFO above 0. The callers
//! guarantee that the pointers are valid for the sizes that the arguments state.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use crate::factor::{Elimination, backward, cholesky, forward};
use crate::memory::{Layout, Number, Part};
use crate::spectrum::symmetric_eigen;
use crate::svd::Svd;
use nalgebra::DMatrix;

/// INFO of an iteration that does not converge.
const NOT_CONVERGED: i32 = 1;

/// An array and its leading dimension.
#[derive(Clone, Copy)]
pub(crate) struct Array<T> {
    pub(crate) at: *mut T,
    pub(crate) leading: i32,
}

impl<T> Array<T> {
    /// The layout of the array; INFO -`argument` if sizes and leading dimension do not fit.
    fn layout(self, rows: i32, cols: i32, argument: i32) -> Result<Layout, i32> {
        Layout::new(rows, cols, self.leading).ok_or(-argument)
    }
}

/// Checks a size; INFO -`argument` if it is negative.
fn size(value: i32, argument: i32) -> Result<i32, i32> {
    if value < 0 { Err(-argument) } else { Ok(value) }
}

/// Converts an index, from 1, to the integers of LAPACK.
fn from_one(index: usize) -> i32 {
    i32::try_from(index).unwrap_or(i32::MAX)
}

/// Replaces A by its Cholesky factor L or U, A = L L' or U' U; INFO k: the leading minor of order k is
/// not positive.
pub(crate) unsafe fn potrf<T: Number>(triangle: u8, n: i32, a: Array<T>) -> Result<(), i32> {
    let part = Part::triangle(triangle).ok_or(-1)?;
    let layout = a.layout(size(n, 2)?, n, 4)?;
    // SAFETY: the caller guarantees valid pointers.
    let half = unsafe { layout.read(a.at, part) };
    let lower = if part == Part::Lower { half } else { half.transpose() };
    let l = cholesky(&lower).map_err(from_one)?;
    let factor = if part == Part::Lower { l } else { l.transpose() };
    // SAFETY: the caller guarantees valid pointers.
    unsafe { layout.write(a.at, &factor, part) };
    Ok(())
}

/// Replaces B by the solution X of A X = B, with the factor of A from [`potrf`].
pub(crate) unsafe fn potrs<T: Number>(
    triangle: u8,
    n: i32,
    right_sides: i32,
    a: Array<T>,
    b: Array<T>,
) -> Result<(), i32> {
    let part = Part::triangle(triangle).ok_or(-1)?;
    let layout = a.layout(size(n, 2)?, n, 5)?;
    let right = b.layout(n, size(right_sides, 3)?, 7)?;
    // SAFETY: the caller guarantees valid pointers.
    let (factor, right_side) = unsafe { (layout.read(a.at, part), right.read(b.at, Part::All)) };
    let l = if part == Part::Lower { factor } else { factor.transpose() };
    let x = backward(&l.transpose(), &forward(&l, &right_side));
    // SAFETY: the caller guarantees valid pointers.
    unsafe { right.write(b.at, &x, Part::All) };
    Ok(())
}

/// Replaces B by the solution X of A X = B and A by its factors L and U; INFO k: pivot k is zero, B is unchanged.
pub(crate) unsafe fn gesv<T: Number>(
    n: i32,
    right_sides: i32,
    a: Array<T>,
    pivots: *mut i32,
    b: Array<T>,
) -> Result<(), i32> {
    let layout = a.layout(size(n, 1)?, n, 4)?;
    let right = b.layout(n, size(right_sides, 2)?, 7)?;
    // SAFETY: the caller guarantees valid pointers.
    let (matrix, right_side) =
        unsafe { (layout.read(a.at, Part::All), right.read(b.at, Part::All)) };
    let elimination = Elimination::new(&matrix);
    // SAFETY: the caller guarantees valid pointers; there are n pivots.
    unsafe {
        layout.write(a.at, &elimination.factors, Part::All);
        for (step, &pivot) in elimination.swaps.iter().enumerate() {
            pivots.add(step).write(from_one(pivot + 1));
        }
    }
    if let Some(pivot) = elimination.singular {
        return Err(from_one(pivot));
    }
    // SAFETY: the caller guarantees valid pointers.
    unsafe { right.write(b.at, &elimination.solve(&right_side), Part::All) };
    Ok(())
}

/// The output arrays of [`syevr`].
pub(crate) struct Spectrum<T> {
    /// M, the number of eigenvalues.
    pub(crate) count: *mut i32,
    /// W, the eigenvalues.
    pub(crate) values: *mut T,
    /// Z, the eigenvectors.
    pub(crate) vectors: Array<T>,
    /// ISUPPZ, the first and the last row of each eigenvector.
    pub(crate) support: *mut i32,
}

/// Computes all eigenvalues, ascending, and with JOBZ = V the eigenvectors; INFO 1: not converged. The options are
/// JOBZ, RANGE and UPLO.
pub(crate) unsafe fn syevr<T: Number>(
    [job, range, triangle]: [u8; 3],
    n: i32,
    a: Array<T>,
    to: &Spectrum<T>,
) -> Result<(), i32> {
    let compute_vectors = match job.to_ascii_uppercase() {
        b'N' => false,
        b'V' => true,
        _ => return Err(-1),
    };
    if !range.eq_ignore_ascii_case(&b'A') {
        return Err(-2);
    }
    let part = Part::triangle(triangle).ok_or(-3)?;
    let layout = a.layout(size(n, 4)?, n, 6)?;
    // SAFETY: the caller guarantees valid pointers.
    let half = unsafe { layout.read(a.at, part) };
    let upper = if part == Part::Upper { half } else { half.transpose() };
    let vectors = compute_vectors.then(|| to.vectors.layout(n, n, 15)).transpose()?;
    let (values, directions) = symmetric_eigen(&upper).ok_or(NOT_CONVERGED)?;
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        to.count.write(n);
        for (at, &value) in values.iter().enumerate() {
            to.values.add(at).write(T::narrow(value));
        }
        if let Some(layout) = vectors {
            layout.write(to.vectors.at, &directions, Part::All);
            for at in 0..layout.cols {
                to.support.add(2 * at).write(1);
                to.support.add(2 * at + 1).write(n);
            }
        }
    }
    Ok(())
}

/// The number of singular vectors to compute: none, the `thin` ones that have a singular value, or `all`; INFO
/// -`argument` for another option.
fn vectors(letter: u8, argument: i32, thin: i32, all: i32) -> Result<i32, i32> {
    match letter.to_ascii_uppercase() {
        b'N' => Ok(0),
        b'S' => Ok(thin),
        b'A' => Ok(all),
        _ => Err(-argument),
    }
}

/// The output array of the singular vectors of one side, and its option JOBU or JOBVT.
pub(crate) struct Vectors<T> {
    pub(crate) option: u8,
    pub(crate) array: Array<T>,
}

/// The output arrays of [`singular_values`].
pub(crate) struct Factors<T> {
    /// S, the singular values.
    pub(crate) values: *mut T,
    /// U, the left singular vectors.
    pub(crate) left: Vectors<T>,
    /// VT, the right singular vectors.
    pub(crate) right: Vectors<T>,
}

/// Computes the singular value decomposition; INFO 1: not converged, or A has an infinite entry. `first` is
/// the number of the argument M, which follows the options.
pub(crate) unsafe fn singular_values<T: Number>(
    m: i32,
    n: i32,
    a: Array<T>,
    to: &Factors<T>,
    first: i32,
) -> Result<(), i32> {
    let thin = m.min(n);
    let left = vectors(to.left.option, 1, thin, m)?;
    let right = vectors(to.right.option, first - 1, thin, n)?;
    let layout = a.layout(size(m, first)?, size(n, first + 1)?, first + 3)?;
    let u_layout = to.left.array.layout(if left == 0 { 0 } else { m }, left, first + 6)?;
    let vt_layout = to.right.array.layout(right, if right == 0 { 0 } else { n }, first + 8)?;
    // SAFETY: the caller guarantees valid pointers.
    let matrix = unsafe { layout.read(a.at, Part::All) };
    if matrix.iter().any(|entry| entry.is_nan()) {
        return Err(-(first + 2));
    }
    let svd = Svd::new(&matrix).ok_or(NOT_CONVERGED)?;
    // SAFETY: the caller guarantees valid pointers.
    unsafe {
        for (at, &value) in svd.values.iter().enumerate() {
            to.values.add(at).write(T::narrow(value));
        }
        u_layout.write(to.left.array.at, &corner(&svd.u, u_layout), Part::All);
        vt_layout.write(to.right.array.at, &corner(&svd.v.transpose(), vt_layout), Part::All);
    }
    Ok(())
}

/// The leading block of `m` with the size of `layout`.
fn corner(m: &DMatrix<f64>, layout: Layout) -> DMatrix<f64> {
    m.view((0, 0), (layout.rows, layout.cols)).into_owned()
}
