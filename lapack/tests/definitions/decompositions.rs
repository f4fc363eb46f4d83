use super::{GUARD, array, assert_orthonormal, entries, int, matrix, symmetric};
use nalgebra::DMatrix;

/// Largest entry times the order: a bound of the norm that neither overflows nor underflows.
fn size(a: &DMatrix<f64>) -> f64 {
    a.amax() * f64::from(int(a.nrows().max(a.ncols())))
}

/// The length that a routine asks for in the first entry of its workspace.
fn asked(work: &[f64]) -> i32 {
    (1..1000).find(|&length| f64::from(length) >= work[0]).unwrap()
}

struct Spectrum {
    info: i32,
    count: i32,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

/// Asks for the workspace, then for eigenvalues and eigenvectors.
fn syevr(job: u8, triangle: u8, a: &DMatrix<f64>) -> Spectrum {
    let n = a.nrows();
    let mut found =
        Spectrum { info: 1, count: 0, values: vec![GUARD; n], vectors: vec![GUARD; (n + 1) * n] };
    let (mut stored, mut support) = (array(a, 2), vec![0; 2 * n]);
    let (mut work, mut iwork) = (vec![0.0], vec![0]);
    let mut lengths = (-1, -1);
    for _ in 0..2 {
        // SAFETY: the arrays have the sizes given.
        unsafe {
            lapack::dsyevr(
                job,
                b'A',
                triangle,
                int(n),
                &mut stored,
                int(n + 2),
                0.0,
                0.0,
                0,
                0,
                -1.0,
                &mut found.count,
                &mut found.values,
                &mut found.vectors,
                int(n + 1),
                &mut support,
                &mut work,
                lengths.0,
                &mut iwork,
                lengths.1,
                &mut found.info,
            );
        }
        assert_eq!(found.info, 0);
        lengths = (asked(&work), iwork[0]);
        assert!(lengths.0 >= 1 && lengths.1 >= 1);
        work.resize(usize::try_from(lengths.0).unwrap(), 0.0);
        iwork.resize(usize::try_from(lengths.1).unwrap(), 0);
    }
    found
}

/// Repeated, zero, tiny and huge eigenvalues, and none of these.
fn symmetric_cases() -> Vec<DMatrix<f64>> {
    let graded = symmetric(6, 21);
    let scale = |k: usize| 10.0_f64.powi(-3 * int(k));
    vec![
        symmetric(1, 20),
        symmetric(2, 20),
        symmetric(7, 22),
        symmetric(20, 23),
        DMatrix::identity(5, 5) * 3.0,
        DMatrix::zeros(4, 4),
        DMatrix::from_element(6, 6, 1.0),
        DMatrix::from_fn(6, 6, |i, j| graded[(i, j)] * scale(i) * scale(j)),
        symmetric(5, 24) * 1e200,
        symmetric(5, 25) * 1e-200,
    ]
}

#[test]
fn syevr_finds_ascending_eigenvalues_and_orthonormal_eigenvectors() {
    for a in symmetric_cases() {
        let n = a.nrows();
        for (triangle, half) in [(b'U', a.upper_triangle()), (b'L', a.lower_triangle())] {
            let found = syevr(b'V', triangle, &half);
            assert_eq!(found.count, int(n));
            assert!(found.values.is_sorted());
            let v = matrix(n, n, 1, &found.vectors);
            assert_orthonormal(&v);
            let values = DMatrix::from_fn(n, n, |i, j| if i == j { found.values[i] } else { 0.0 });
            assert!((&a * &v - &v * values).amax() <= 1e-14 * size(&a));
            let alone = syevr(b'N', triangle, &half);
            assert_eq!(alone.values, found.values);
            assert!(alone.vectors.iter().all(|&entry| entry == GUARD));
        }
    }
}

/// The eigenvalues of the matrix (2, -1 beside it) are 2 - 2 cos(k pi / (n + 1)).
#[test]
fn syevr_finds_the_eigenvalues_of_the_second_difference() {
    let n = 12;
    let a = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    });
    let step = std::f64::consts::PI / 13.0;
    let found = syevr(b'N', b'U', &a);
    for (k, value) in (1..).zip(&found.values) {
        assert!((value - (2.0 - 2.0 * (f64::from(k) * step).cos())).abs() < 1e-14);
    }
}

#[test]
fn syevr_of_entries_that_are_not_finite_ends_with_nothing_finite() {
    let mut a = symmetric(4, 26);
    a[(1, 2)] = f64::NAN;
    assert!(syevr(b'N', b'U', &a).values.iter().all(|value| value.is_nan()));
}

#[test]
fn illegal_arguments_of_syevr_are_named_by_their_place() {
    let illegal = [
        (b'X', b'A', b'U', 2, 2, 2, -1),
        (b'V', b'X', b'U', 2, 2, 2, -2),
        (b'V', b'A', b'X', 2, 2, 2, -3),
        (b'V', b'A', b'U', -1, 2, 2, -4),
        (b'V', b'A', b'U', 2, 1, 2, -6),
        (b'V', b'A', b'U', 2, 2, 1, -15),
    ];
    for (job, range, triangle, n, lda, ldz, expected) in illegal {
        let (mut a, mut w, mut z) = ([1.0; 4], [GUARD; 2], [GUARD; 4]);
        let (mut count, mut info) = (0, 0);
        // SAFETY: the arrays have at least the sizes given.
        unsafe {
            lapack::dsyevr(
                job,
                range,
                triangle,
                n,
                &mut a,
                lda,
                0.0,
                0.0,
                0,
                0,
                0.0,
                &mut count,
                &mut w,
                &mut z,
                ldz,
                &mut [0; 4],
                &mut [0.0; 60],
                60,
                &mut [0; 20],
                20,
                &mut info,
            );
        }
        assert_eq!((info, w, z), (expected, [GUARD; 2], [GUARD; 4]));
    }
}

struct Factors {
    info: i32,
    u: DMatrix<f64>,
    values: Vec<f64>,
    vt: DMatrix<f64>,
}

/// The decomposition by either routine, workspace first, with guards around the vectors.
fn svd(divide: bool, job: u8, a: &DMatrix<f64>) -> Factors {
    let (m, n) = a.shape();
    let k = m.min(n);
    let (u_cols, vt_rows) = if job == b'A' { (m, n) } else { (k, k) };
    let (mut u, mut vt) = (vec![GUARD; (m + 2) * u_cols], vec![GUARD; (vt_rows + 1) * n]);
    let (mut values, mut stored, mut info) = (vec![GUARD; k], array(a, 3), 1);
    let (mut work, mut length) = (vec![0.0], -1);
    for _ in 0..2 {
        // SAFETY: the arrays have the sizes given.
        unsafe {
            if divide {
                lapack::dgesdd(
                    job,
                    int(m),
                    int(n),
                    &mut stored,
                    int(m + 3),
                    &mut values,
                    &mut u,
                    int(m + 2),
                    &mut vt,
                    int(vt_rows + 1),
                    &mut work,
                    length,
                    &mut vec![0; 8 * k],
                    &mut info,
                );
            } else {
                lapack::dgesvd(
                    job,
                    job,
                    int(m),
                    int(n),
                    &mut stored,
                    int(m + 3),
                    &mut values,
                    &mut u,
                    int(m + 2),
                    &mut vt,
                    int(vt_rows + 1),
                    &mut work,
                    length,
                    &mut info,
                );
            }
        }
        length = asked(&work);
        work.resize(usize::try_from(length).unwrap(), 0.0);
    }
    let (u, vt) = (matrix(m, u_cols, 2, &u), matrix(vt_rows, n, 1, &vt));
    Factors { info, u, values, vt }
}

/// Square, tall, wide; full and deficient rank; graded, huge, tiny, zero.
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
                let found = svd(divide, job, &a);
                assert_eq!(found.info, 0);
                assert!(
                    found.values.iter().rev().is_sorted() && found.values.iter().all(|&s| s >= 0.0)
                );
                assert_orthonormal(&found.u);
                assert_orthonormal(&found.vt.transpose());
                let s = DMatrix::from_fn(found.u.ncols(), found.vt.nrows(), |i, j| {
                    if i == j { found.values[i] } else { 0.0 }
                });
                let rebuilt = &found.u * s * &found.vt;
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
    let mut a = [4.0_f32, 1.0, 1.0, 3.0];
    let (mut w, mut z, mut count, mut info) = ([0.0_f32; 2], [0.0_f32; 4], 0, [1; 3]);
    let (mut s, mut t) = ([0.0_f32; 2], [0.0_f32; 2]);
    let (mut u, mut v, mut work) = ([0.0_f32; 4], [0.0_f32; 4], [0.0_f32; 60]);
    // SAFETY: the arrays have at least the sizes given.
    unsafe {
        lapack::ssyevr(
            b'V',
            b'A',
            b'U',
            2,
            &mut a.clone(),
            2,
            0.0,
            0.0,
            0,
            0,
            0.0,
            &mut count,
            &mut w,
            &mut z,
            2,
            &mut [0; 4],
            &mut work,
            60,
            &mut [0; 20],
            20,
            &mut info[0],
        );
        lapack::sgesdd(
            b'S',
            2,
            2,
            &mut a.clone(),
            2,
            &mut s,
            &mut u,
            2,
            &mut v,
            2,
            &mut work,
            60,
            &mut [0; 16],
            &mut info[1],
        );
        lapack::sgesvd(
            b'S',
            b'S',
            2,
            2,
            &mut a,
            2,
            &mut t,
            &mut u,
            2,
            &mut v,
            2,
            &mut work,
            60,
            &mut info[2],
        );
    }
    assert_eq!((info, count), ([0; 3], 2));
    let (small, large) = (3.5 - 1.25_f32.sqrt(), 3.5 + 1.25_f32.sqrt());
    for (value, expected) in
        w.iter().chain(&s).chain(&t).zip([small, large, large, small, large, small])
    {
        assert!((value - expected).abs() < 1e-6);
    }
}
