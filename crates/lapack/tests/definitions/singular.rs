use super::{GUARD, array, asked, assert_orthonormal, entries, int, matrix, size};
use nalgebra::DMatrix;

struct Factors {
    info: i32,
    u: DMatrix<f64>,
    values: Vec<f64>,
    vt: DMatrix<f64>,
}

/// The arrays of a decomposition (values, U and V'), with two guards after the columns of U and one
/// after those of V'.
type Arrays = (Vec<f64>, Vec<f64>, Vec<f64>);

/// Calls one of the routines and returns INFO; a workspace of one entry requests its size.
fn call(divide: bool, job: u8, a: &DMatrix<f64>, to: &mut Arrays, work: &mut [f64]) -> i32 {
    let (m, n) = (int(a.nrows()), int(a.ncols()));
    let ldvt = int(to.2.len()) / n;
    let length = if work.len() == 1 { -1 } else { int(work.len()) };
    let (mut stored, mut iwork, mut info) = (array(a, 3), vec![0; 8 * to.0.len()], 1);
    let (s, u, vt) = (&mut to.0, &mut to.1, &mut to.2);
    // SAFETY: the arrays have the sizes given.
    unsafe {
        if divide {
            lapack::dgesdd(
                job,
                m,
                n,
                &mut stored,
                m + 3,
                s,
                u,
                m + 2,
                vt,
                ldvt,
                work,
                length,
                &mut iwork,
                &mut info,
            );
        } else {
            lapack::dgesvd(
                job,
                job,
                m,
                n,
                &mut stored,
                m + 3,
                s,
                u,
                m + 2,
                vt,
                ldvt,
                work,
                length,
                &mut info,
            );
        }
    }
    info
}

fn svd(divide: bool, job: u8, a: &DMatrix<f64>) -> Factors {
    let (m, n) = a.shape();
    let k = m.min(n);
    let (cols, rows) = if job == b'A' { (m, n) } else { (k, k) };
    let mut to = (vec![GUARD; k], vec![GUARD; (m + 2) * cols], vec![GUARD; (rows + 1) * n]);
    let mut work = vec![0.0];
    assert_eq!(call(divide, job, a, &mut to, &mut work), 0);
    work.resize(usize::try_from(asked(&work).max(2)).unwrap(), 0.0);
    let info = call(divide, job, a, &mut to, &mut work);
    let (values, u, vt) = to;
    Factors { info, u: matrix(m, cols, 2, &u), values, vt: matrix(rows, n, 1, &vt) }
}

/// Matrices that are square, tall and wide; with full and deficient rank; graded, huge, tiny, zero.
fn general_cases() -> Vec<DMatrix<f64>> {
    let (tall, wide) = (entries(7, 2, 31), entries(2, 5, 32));
    let integers = DMatrix::from_row_slice(4, 3, &[1., 2., 3., 2., 4., 6., 1., 0., 1., 0., 2., 2.]);
    let nilpotent = DMatrix::from_fn(5, 5, |i, j| if j == i + 1 { 1.0 } else { 0.0 });
    let grade = |j: usize| 10.0_f64.powi(-5 * int(j));
    let graded = entries(6, 6, 33);
    vec![
        entries(1, 1, 30),
        entries(5, 5, 30),
        entries(20, 20, 34),
        tall.clone(),
        wide.clone(),
        &tall * &wide,
        integers.clone(),
        integers.transpose(),
        nilpotent,
        DMatrix::zeros(3, 4),
        DMatrix::from_element(4, 4, 2.0),
        DMatrix::from_fn(6, 6, |i, j| graded[(i, j)] * grade(j)),
        DMatrix::from_fn(6, 6, |i, j| graded[(i, j)] * grade(i)),
        entries(4, 4, 35) * 1e250,
        entries(4, 4, 36) * 1e-250,
    ]
}

#[test]
fn the_singular_value_decomposition_is_one_for_any_shape_and_rank() {
    for a in general_cases() {
        for divide in [true, false] {
            for job in [b'S', b'A'] {
                let actual = svd(divide, job, &a);
                assert_eq!(actual.info, 0);
                assert!(
                    actual.values.iter().rev().is_sorted()
                        && actual.values.iter().all(|&s| s >= 0.0)
                );
                assert_orthonormal(&actual.u);
                assert_orthonormal(&actual.vt.transpose());
                let s = DMatrix::from_fn(actual.u.ncols(), actual.vt.nrows(), |i, j| {
                    if i == j { actual.values[i] } else { 0.0 }
                });
                let rebuilt = &actual.u * s * &actual.vt;
                assert!((rebuilt - &a).amax() <= 1e-14 * size(&a));
            }
        }
    }
}

/// The singular values of the 3 x 3 Hilbert matrix, and those of a matrix of rank one.
#[test]
fn known_singular_values_are_found() {
    let hilbert = DMatrix::from_fn(3, 3, |i, j| 1.0 / (f64::from(int(i + j)) + 1.0));
    let expected = [1.408_318_927_123_65, 0.122_327_065_853_906, 0.002_687_340_355_773_53];
    for (value, expected) in svd(true, b'S', &hilbert).values.iter().zip(expected) {
        assert!((value - expected).abs() < 2e-14);
    }
    let rank_one = svd(false, b'A', &DMatrix::from_element(3, 3, 1.0)).values;
    assert!((rank_one[0] - 3.0).abs() < 1e-14 && rank_one[1] < 1e-15);
}

#[test]
fn singular_values_alone_leave_the_vectors_alone() {
    let a = entries(3, 2, 37);
    let (mut s, mut u, mut info) = ([0.0; 2], [GUARD], 1);
    let mut stored = array(&a, 0);
    // SAFETY: the arrays have the sizes given.
    unsafe {
        lapack::dgesdd(
            b'N',
            3,
            2,
            &mut stored,
            3,
            &mut s,
            &mut u,
            1,
            &mut [GUARD],
            1,
            &mut [0.0; 50],
            50,
            &mut [0; 16],
            &mut info,
        );
    }
    assert_eq!((info, u), (0, [GUARD]));
    assert!((s[0] * s[1]).powi(2) - (a.transpose() * &a).determinant() < 1e-14);
}

#[test]
fn illegal_arguments_of_the_decompositions_are_named_by_their_place() {
    let mut infos = [0; 7];
    let (mut a, mut s, mut u, mut v) = ([1.0; 4], [GUARD; 2], [GUARD; 4], [GUARD; 4]);
    let mut not_a_number = [1.0, f64::NAN, 0.0, 1.0];
    let (mut work, mut iwork) = ([0.0; 80], [0; 16]);
    // SAFETY: the arrays have at least the sizes given.
    unsafe {
        let [first, second, third, fourth, fifth, sixth, seventh] = &mut infos;
        lapack::dgesdd(
            b'X', 2, 2, &mut a, 2, &mut s, &mut u, 2, &mut v, 2, &mut work, 80, &mut iwork, first,
        );
        lapack::dgesdd(
            b'S', 2, 2, &mut a, 1, &mut s, &mut u, 2, &mut v, 2, &mut work, 80, &mut iwork, second,
        );
        lapack::dgesdd(
            b'S', 2, 2, &mut a, 2, &mut s, &mut u, 1, &mut v, 2, &mut work, 80, &mut iwork, third,
        );
        lapack::dgesdd(
            b'S', 2, 2, &mut a, 2, &mut s, &mut u, 2, &mut v, 1, &mut work, 80, &mut iwork, fourth,
        );
        lapack::dgesdd(
            b'S',
            2,
            2,
            &mut not_a_number,
            2,
            &mut s,
            &mut u,
            2,
            &mut v,
            2,
            &mut work,
            80,
            &mut iwork,
            fifth,
        );
        lapack::dgesvd(
            b'S', b'X', 2, 2, &mut a, 2, &mut s, &mut u, 2, &mut v, 2, &mut work, 80, sixth,
        );
        lapack::dgesvd(
            b'S', b'S', 2, 2, &mut a, 2, &mut s, &mut u, 2, &mut v, 1, &mut work, 80, seventh,
        );
    }
    assert_eq!(infos, [-1, -5, -8, -10, -4, -2, -11]);
    assert_eq!((s, u, v), ([GUARD; 2], [GUARD; 4], [GUARD; 4]));
}

#[test]
fn decompositions_in_single_precision_are_right_to_its_rounding() {
    let (mut a, mut b) = ([4.0_f32, 1.0, 1.0, 3.0], [4.0_f32, 1.0, 1.0, 3.0]);
    let (mut s, mut t, mut info) = ([0.0_f32; 2], [0.0_f32; 2], [1; 2]);
    let (mut u, mut v, mut work) = ([0.0_f32; 4], [0.0_f32; 4], [0.0_f32; 60]);
    let (mut iwork, [first, second]) = ([0; 16], &mut info);
    // SAFETY: the arrays have at least the sizes given.
    unsafe {
        lapack::sgesdd(
            b'S', 2, 2, &mut a, 2, &mut s, &mut u, 2, &mut v, 2, &mut work, 60, &mut iwork, first,
        );
        lapack::sgesvd(
            b'S', b'S', 2, 2, &mut b, 2, &mut t, &mut u, 2, &mut v, 2, &mut work, 60, second,
        );
    }
    assert_eq!(info, [0; 2]);
    let expected = [3.5 + 1.25_f32.sqrt(), 3.5 - 1.25_f32.sqrt()];
    for (value, expected) in s.iter().chain(&t).zip(expected.iter().chain(&expected)) {
        assert!((value - expected).abs() < 1e-6);
    }
}
