//! The routines of LAPACK on arrays; each answers with its INFO.
//!
//! 0: done; -i: argument i, from 1, is illegal; above 0: as said at the routine.
#![expect(unsafe_code, reason = "the boundary to callers in C and Fortran")]

use crate::factor::{Elimination, backward, cholesky, forward};
use crate::memory::{Layout, Number, Part};
use crate::singular::Decomposition;
use crate::spectrum::eigen;
use nalgebra::DMatrix;

const NOT_CONVERGED: i32 = 1;

/// An array and its leading dimension.
#[derive(Clone, Copy)]
pub(crate) struct Array<T> {
    pub(crate) at: *mut T,
    pub(crate) leading: i32,
}

impl<T> Array<T> {
    /// INFO is -`argument` when sizes and leading dimension do not fit.
    fn layout(self, rows: i32, cols: i32, argument: i32) -> Result<Layout, i32> {
        Layout::new(rows, cols, self.leading).ok_or(-argument)
    }
}

/// INFO is -`argument` for a negative size.
fn size(value: i32, argument: i32) -> Result<i32, i32> {
    if value < 0 { Err(-argument) } else { Ok(value) }
}

/// An index, from 1, as INFO or pivot.
fn from_one(index: usize) -> i32 {
    i32::try_from(index).unwrap_or(i32::MAX)
}

/// A := its factor L or U, A = L L' or U' U; INFO k: the leading minor of order k is not positive.
///
/// # Safety
///
/// The array is valid for what the arguments say.
pub(crate) unsafe fn potrf<T: Number>(triangle: u8, n: i32, a: Array<T>) -> Result<(), i32> {
    let part = Part::triangle(triangle).ok_or(-1)?;
    let layout = a.layout(size(n, 2)?, n, 4)?;
    // SAFETY: as the caller promises.
    let half = unsafe { layout.read(a.at, part) };
    let lower = if part == Part::Lower { half } else { half.transpose() };
    let l = cholesky(&lower).map_err(from_one)?;
    let factor = if part == Part::Lower { l } else { l.transpose() };
    // SAFETY: as the caller promises.
    unsafe { layout.write(a.at, &factor, part) };
    Ok(())
}

/// B := X of A X = B with the factor of A that [`potrf`] found.
///
/// # Safety
///
/// The arrays are valid for what the arguments say.
pub(crate) unsafe fn potrs<T: Number>(
    triangle: u8,
    (n, right_sides): (i32, i32),
    a: Array<T>,
    b: Array<T>,
) -> Result<(), i32> {
    let part = Part::triangle(triangle).ok_or(-1)?;
    let layout = a.layout(size(n, 2)?, n, 5)?;
    let right = b.layout(n, size(right_sides, 3)?, 7)?;
    // SAFETY: as the caller promises.
    let (factor, given) = unsafe { (layout.read(a.at, part), right.read(b.at, Part::All)) };
    let l = if part == Part::Lower { factor } else { factor.transpose() };
    let x = backward(&l.transpose(), &forward(&l, &given));
    // SAFETY: as the caller promises.
    unsafe { right.write(b.at, &x, Part::All) };
    Ok(())
}

/// B := X of A X = B, A := L and U; INFO k: pivot k is zero.
///
/// # Safety
///
/// The arrays are valid for what the arguments say.
pub(crate) unsafe fn gesv<T: Number>(
    (n, right_sides): (i32, i32),
    a: Array<T>,
    pivots: *mut i32,
    b: Array<T>,
) -> Result<(), i32> {
    let layout = a.layout(size(n, 1)?, n, 4)?;
    let right = b.layout(n, size(right_sides, 2)?, 7)?;
    // SAFETY: as the caller promises.
    let (matrix, given) = unsafe { (layout.read(a.at, Part::All), right.read(b.at, Part::All)) };
    let elimination = Elimination::of(&matrix);
    // SAFETY: as the caller promises; there are n pivots.
    unsafe {
        layout.write(a.at, &elimination.factors, Part::All);
        for (step, &pivot) in elimination.swaps.iter().enumerate() {
            pivots.add(step).write(from_one(pivot + 1));
        }
    }
    if let Some(pivot) = elimination.singular {
        return Err(from_one(pivot));
    }
    // SAFETY: as the caller promises.
    unsafe { right.write(b.at, &elimination.solve(&given), Part::All) };
    Ok(())
}

/// Where eigenvalues and eigenvectors go.
pub(crate) struct Spectrum<T> {
    pub(crate) count: *mut i32,
    pub(crate) values: *mut T,
    pub(crate) vectors: Array<T>,
    pub(crate) support: *mut i32,
}

/// All eigenvalues, ascending, and with JOBZ = V the eigenvectors; INFO 1: not converged.
///
/// # Safety
///
/// The arrays are valid for what the arguments say.
pub(crate) unsafe fn syevr<T: Number>(
    (job, range, triangle): (u8, u8, u8),
    n: i32,
    a: Array<T>,
    to: &Spectrum<T>,
) -> Result<(), i32> {
    let wants_vectors = match job.to_ascii_uppercase() {
        b'N' => false,
        b'V' => true,
        _ => return Err(-1),
    };
    if !range.eq_ignore_ascii_case(&b'A') {
        return Err(-2);
    }
    let part = Part::triangle(triangle).ok_or(-3)?;
    let layout = a.layout(size(n, 4)?, n, 6)?;
    // SAFETY: as the caller promises.
    let half = unsafe { layout.read(a.at, part) };
    let upper = if part == Part::Upper { half } else { half.transpose() };
    let vectors = wants_vectors.then(|| to.vectors.layout(n, n, 15)).transpose()?;
    let (values, directions) = eigen(&upper).ok_or(NOT_CONVERGED)?;
    // SAFETY: as the caller promises.
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

/// Which singular vectors are wanted.
#[derive(Clone, Copy)]
enum Vectors {
    None,
    Thin,
    All,
}

impl Vectors {
    fn of(letter: u8, argument: i32) -> Result<Self, i32> {
        match letter.to_ascii_uppercase() {
            b'N' => Ok(Self::None),
            b'S' => Ok(Self::Thin),
            b'A' => Ok(Self::All),
            _ => Err(-argument),
        }
    }

    /// Number of vectors out of `all`, of which `thin` have a singular value.
    fn count(self, thin: i32, all: i32) -> i32 {
        match self {
            Self::None => 0,
            Self::Thin => thin,
            Self::All => all,
        }
    }
}

/// Where singular values and vectors go; the letters are JOBU and JOBVT.
pub(crate) struct Factors<T> {
    pub(crate) values: *mut T,
    pub(crate) left: (u8, Array<T>),
    pub(crate) right: (u8, Array<T>),
}

/// The singular value decomposition; INFO 1: not converged. `first` is the number of the argument
/// M, before which the options stand.
///
/// # Safety
///
/// The arrays are valid for what the arguments say.
pub(crate) unsafe fn singular_values<T: Number>(
    (m, n): (i32, i32),
    a: Array<T>,
    to: &Factors<T>,
    first: i32,
) -> Result<(), i32> {
    let (left, right) = (Vectors::of(to.left.0, 1)?, Vectors::of(to.right.0, first - 1)?);
    let layout = a.layout(size(m, first)?, size(n, first + 1)?, first + 3)?;
    let thin = m.min(n);
    let count = (left.count(thin, m), right.count(thin, n));
    let u_rows = if count.0 == 0 { 0 } else { m };
    let vt_cols = if count.1 == 0 { 0 } else { n };
    let u_layout = to.left.1.layout(u_rows, count.0, first + 6)?;
    let vt_layout = to.right.1.layout(count.1, vt_cols, first + 8)?;
    // SAFETY: as the caller promises.
    let matrix = unsafe { layout.read(a.at, Part::All) };
    if matrix.iter().any(|entry| entry.is_nan()) {
        return Err(-(first + 2));
    }
    let found = Decomposition::of(&matrix).ok_or(NOT_CONVERGED)?;
    // SAFETY: as the caller promises.
    unsafe {
        for (at, &value) in found.values.iter().enumerate() {
            to.values.add(at).write(T::narrow(value));
        }
        u_layout.write(to.left.1.at, &corner(&found.u, u_layout), Part::All);
        vt_layout.write(to.right.1.at, &corner(&found.v.transpose(), vt_layout), Part::All);
    }
    Ok(())
}

/// The first rows and columns, as many as the layout has.
fn corner(m: &DMatrix<f64>, layout: Layout) -> DMatrix<f64> {
    m.view((0, 0), (layout.rows, layout.cols)).into_owned()
}
