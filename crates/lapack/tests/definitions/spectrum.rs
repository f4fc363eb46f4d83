use super::{GUARD, array, asked, assert_orthonormal, int, matrix, size, symmetric};
use nalgebra::DMatrix;

struct Spectrum {
    info: i32,
    count: i32,
    values: Vec<f64>,
    vectors: Vec<f64>,
}

/// Requests the size of the workspace, then eigenvalues and eigenvectors.
fn syevr(job: u8, triangle: u8, a: &DMatrix<f64>) -> Spectrum {
    let n = a.nrows();
    let mut spectrum =
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
                &mut spectrum.count,
                &mut spectrum.values,
                &mut spectrum.vectors,
                int(n + 1),
                &mut support,
                &mut work,
                lengths.0,
                &mut iwork,
                lengths.1,
                &mut spectrum.info,
            );
        }
        assert_eq!(spectrum.info, 0);
        lengths = (asked(&work), iwork[0]);
        assert!(lengths.0 >= 1 && lengths.1 >= 1);
        work.resize(usize::try_from(lengths.0).unwrap(), 0.0);
        iwork.resize(usize::try_from(lengths.1).unwrap(), 0);
    }
    spectrum
}

/// Matrices with repeated, zero, tiny and huge eigenvalues, and ordinary ones.
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
            let actual = syevr(b'V', triangle, &half);
            assert_eq!(actual.count, int(n));
            assert!(actual.values.is_sorted());
            let v = matrix(n, n, 1, &actual.vectors);
            assert_orthonormal(&v);
            let values = DMatrix::from_fn(n, n, |i, j| if i == j { actual.values[i] } else { 0.0 });
            assert!((&a * &v - &v * values).amax() <= 1e-14 * size(&a));
            let alone = syevr(b'N', triangle, &half);
            assert_eq!(alone.values, actual.values);
            assert!(alone.vectors.iter().all(|&entry| entry == GUARD));
        }
    }
}

/// The eigenvalues of the tridiagonal matrix with 2 on and -1 beside the diagonal are 2 - 2 cos(k
/// pi / (n + 1)).
#[test]
fn syevr_finds_the_eigenvalues_of_the_second_difference() {
    let n = 12;
    let a = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    });
    let step = std::f64::consts::PI / 13.0;
    let actual = syevr(b'N', b'U', &a);
    for (k, value) in (1..).zip(&actual.values) {
        assert!((value - (2.0 - 2.0 * (f64::from(k) * step).cos())).abs() < 1e-14);
    }
}

/// The eigenvalues of [[a, b], [b, a]] are a - |b| and a + |b|, those of [[15, 8], [8, -15]] are -17 and 17.
#[test]
fn syevr_finds_eigenvalues_below_the_largest_number() {
    for ([a, b, d], expected) in [
        ([1e308, 5e307, 1e308], [5e307, 1.5e308]),
        ([-1e308, 5e307, -1e308], [-1.5e308, -5e307]),
        ([5e307, -1e308, 5e307], [-5e307, 1.5e308]),
        ([1.5e308, 8e307, -1.5e308], [-1.7e308, 1.7e308]),
    ] {
        let actual = syevr(b'V', b'U', &DMatrix::from_row_slice(2, 2, &[a, b, b, d]));
        for (value, expected) in actual.values.iter().zip(expected) {
            assert!((value / expected - 1.0).abs() < 1e-14, "{value:e} {expected:e}");
        }
        assert_orthonormal(&matrix(2, 2, 1, &actual.vectors));
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

#[test]
fn syevr_in_single_precision_is_right_to_its_rounding() {
    let (mut w, mut z, mut count, mut info) = ([0.0_f32; 2], [0.0_f32; 4], 0, 1);
    let (mut a, mut work, mut iwork) = ([4.0_f32, 1.0, 1.0, 3.0], [0.0_f32; 60], [0; 20]);
    // SAFETY: the arrays have at least the sizes given.
    unsafe {
        lapack::ssyevr(
            b'V',
            b'A',
            b'U',
            2,
            &mut a,
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
            &mut iwork,
            20,
            &mut info,
        );
    }
    assert_eq!((info, count), (0, 2));
    assert!((w[0] - (3.5 - 1.25_f32.sqrt())).abs() < 1e-6);
    assert!((w[1] - (3.5 + 1.25_f32.sqrt())).abs() < 1e-6);
}
