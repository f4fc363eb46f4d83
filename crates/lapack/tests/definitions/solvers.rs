use super::{GUARD, array, entries, int, matrix};
use nalgebra::DMatrix;

/// Symmetric positive definite.
fn definite(n: usize) -> DMatrix<f64> {
    let root = entries(n, n, 11);
    &root * root.transpose() + DMatrix::identity(n, n) * 0.1
}

#[test]
fn potrf_factors_either_triangle_and_leaves_the_other() {
    for n in 1..8 {
        let a = definite(n);
        for letter in [b'U', b'L'] {
            let mut stored = array(&a, 2);
            let mut info = 1;
            // SAFETY: the array has the size given.
            unsafe { lapack::dpotrf(letter, int(n), &mut stored, int(n + 2), &mut info) };
            assert_eq!(info, 0);
            let actual = matrix(n, n, 2, &stored);
            let (factor, kept, before) = if letter == b'U' {
                (actual.upper_triangle().transpose(), actual.lower_triangle(), a.lower_triangle())
            } else {
                (actual.lower_triangle(), actual.upper_triangle(), a.upper_triangle())
            };
            assert!((&factor * factor.transpose() - &a).amax() < 1e-14);
            let without = |m: &DMatrix<f64>| m - DMatrix::from_diagonal(&m.diagonal());
            assert_eq!(without(&kept), without(&before));
        }
    }
}

#[test]
fn potrf_names_the_first_leading_minor_that_is_not_positive() {
    let mut a = definite(5);
    a[(2, 2)] = -1.0;
    let not_a_number = DMatrix::from_element(2, 2, f64::NAN);
    let singular = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]);
    for (m, expected) in [(a, 3), (not_a_number, 1), (singular, 2)] {
        for letter in [b'U', b'L'] {
            let mut info = 0;
            let n = int(m.nrows());
            // SAFETY: the array has the size given.
            unsafe { lapack::dpotrf(letter, n, &mut array(&m, 0), n, &mut info) };
            assert_eq!(info, expected);
        }
    }
}

#[test]
fn potrs_solves_with_either_factor() {
    let (n, sides) = (5, 3);
    let (a, x) = (definite(n), entries(n, sides, 12));
    for letter in [b'U', b'L'] {
        let (mut factor, mut b, mut info) = (array(&a, 1), array(&(&a * &x), 4), 1);
        // SAFETY: the arrays have the sizes given.
        unsafe {
            lapack::dpotrf(letter, 5, &mut factor, 6, &mut info);
            lapack::dpotrs(letter, 5, 3, &factor, 6, &mut b, 9, &mut info);
        }
        assert_eq!(info, 0);
        assert!((matrix(n, sides, 4, &b) - &x).amax() < 1e-12);
    }
}

#[test]
fn gesv_solves_and_leaves_the_factors_with_their_pivots() {
    let (n, sides) = (6, 2);
    let (a, x) = (entries(n, n, 13), entries(n, sides, 14));
    let (mut lu, mut b) = (array(&a, 2), array(&(&a * &x), 1));
    let (mut pivots, mut info) = (vec![0; n], 1);
    // SAFETY: the arrays have the sizes given.
    unsafe { lapack::dgesv(6, 2, &mut lu, 8, &mut pivots, &mut b, 7, &mut info) };
    assert_eq!(info, 0);
    assert!((matrix(n, sides, 1, &b) - x).amax() < 1e-12);
    let factors = matrix(n, n, 2, &lu);
    let mut l = factors.lower_triangle();
    l.fill_diagonal(1.0);
    let mut swapped = a.clone();
    for (row, &pivot) in pivots.iter().enumerate() {
        swapped.swap_rows(row, usize::try_from(pivot - 1).unwrap());
    }
    assert!((&l * factors.upper_triangle() - swapped).amax() < 1e-14);
    assert!(l.amax() <= 1.0);
}

#[test]
fn gesv_names_the_pivot_that_is_zero() {
    let singular = DMatrix::from_row_slice(3, 3, &[1., 2., 3., 2., 4., 6., 1., 0., 1.]);
    let (mut b, mut info) = (vec![1.0; 3], 0);
    // SAFETY: the arrays have the sizes given.
    unsafe { lapack::dgesv(3, 1, &mut array(&singular, 0), 3, &mut [0; 3], &mut b, 3, &mut info) };
    assert_eq!(info, 3);
    assert_eq!(b, [1.0; 3]);
}

#[test]
fn illegal_arguments_are_named_by_their_place() {
    let mut a = [GUARD; 4];
    let mut b = [GUARD; 2];
    let mut info = [0; 8];
    // SAFETY: the arrays have at least the sizes given.
    unsafe {
        lapack::dpotrf(b'X', 2, &mut a, 2, &mut info[0]);
        lapack::dpotrf(b'U', -1, &mut a, 2, &mut info[1]);
        lapack::dpotrf(b'U', 2, &mut a, 1, &mut info[2]);
        lapack::dpotrs(b'U', 2, -1, &a, 2, &mut b, 2, &mut info[3]);
        lapack::dpotrs(b'U', 2, 1, &a, 1, &mut b, 2, &mut info[4]);
        lapack::dpotrs(b'U', 2, 1, &a, 2, &mut b, 1, &mut info[5]);
        lapack::dgesv(2, 1, &mut a, 1, &mut [0; 2], &mut b, 2, &mut info[6]);
        lapack::dgesv(2, 1, &mut a, 2, &mut [0; 2], &mut b, 1, &mut info[7]);
    }
    assert_eq!(info, [-1, -2, -4, -3, -5, -7, -4, -7]);
    assert_eq!((a, b), ([GUARD; 4], [GUARD; 2]));
}

#[test]
fn factors_in_single_precision_are_right_to_its_rounding() {
    let x = [1.0_f32, -2.0, 0.5, 3.0];
    let single = DMatrix::from_fn(4, 4, |i, j| if i == j { 3.0 } else { 0.7_f32 });
    let right = &single * DMatrix::from_column_slice(4, 1, &x);
    let (mut first, mut second) = (right.as_slice().to_vec(), right.as_slice().to_vec());
    let (mut factor, mut lu) = (single.as_slice().to_vec(), single.as_slice().to_vec());
    let mut info = [1; 3];
    // SAFETY: the arrays have the sizes given.
    unsafe {
        lapack::spotrf(b'L', 4, &mut factor, 4, &mut info[0]);
        lapack::spotrs(b'L', 4, 1, &factor, 4, &mut first, 4, &mut info[1]);
        lapack::sgesv(4, 1, &mut lu, 4, &mut [0; 4], &mut second, 4, &mut info[2]);
    }
    assert_eq!(info, [0; 3]);
    for at in 0..4 {
        assert!((first[at] - x[at]).abs() < 1e-4 && (second[at] - x[at]).abs() < 1e-4);
    }
}
