use super::{array, entries, int, matrix, symmetric, upper_and_lower};
use nalgebra::DMatrix;

const TRANSPOSES: [(u8, bool); 3] = [(b'N', false), (b't', true), (b'C', true)];

/// Returns A with op(A) = m.
fn stored(m: &DMatrix<f64>, turned: bool) -> DMatrix<f64> {
    if turned { m.transpose() } else { m.clone() }
}

#[test]
fn gemm_multiplies_for_all_transposes_leading_dimensions_and_factors() {
    let (m, n, k) = (3, 4, 5);
    let (a, b, c) = (entries(m, k, 1), entries(k, n, 2), entries(m, n, 3));
    for (letter_a, turned_a) in TRANSPOSES {
        for (letter_b, turned_b) in TRANSPOSES {
            for (alpha, beta) in [(1.0, 0.0), (-2.5, 1.0), (0.0, 3.0), (0.5, -0.25)] {
                let (left, right) = (stored(&a, turned_a), stored(&b, turned_b));
                let mut target = array(&c, 2);
                // SAFETY: the arrays have the sizes given.
                unsafe {
                    blas::dgemm(
                        letter_a,
                        letter_b,
                        int(m),
                        int(n),
                        int(k),
                        alpha,
                        &array(&left, 1),
                        int(left.nrows() + 1),
                        &array(&right, 3),
                        int(right.nrows() + 3),
                        beta,
                        &mut target,
                        int(m + 2),
                    );
                }
                let expected = &a * &b * alpha + &c * beta;
                assert!((matrix(m, n, 2, &target) - expected).amax() < 1e-14);
            }
        }
    }
}

#[test]
fn gemm_with_beta_zero_does_not_read_the_target_and_with_no_terms_scales_it() {
    let (a, b) = (entries(2, 3, 1), entries(3, 2, 2));
    let mut target = vec![f64::NAN; 4];
    // SAFETY: the arrays have the sizes given.
    unsafe {
        blas::dgemm(
            b'N',
            b'N',
            2,
            2,
            3,
            1.0,
            a.as_slice(),
            2,
            b.as_slice(),
            3,
            0.0,
            &mut target,
            2,
        );
    };
    assert!((DMatrix::from_column_slice(2, 2, &target) - &a * &b).amax() < 1e-14);
    let mut target = vec![1.0, 2.0, 3.0, 4.0];
    // SAFETY: the arrays are empty.
    unsafe { blas::dgemm(b'N', b'N', 2, 2, 0, 1.0, &[], 2, &[], 1, 2.0, &mut target, 2) };
    assert_eq!(target, [2.0, 4.0, 6.0, 8.0]);
}

#[test]
fn an_illegal_argument_of_a_product_leaves_the_target_alone() {
    let (a, b) = (entries(2, 2, 1), entries(2, 2, 2));
    for (letter, leading) in [(b'X', 2), (b'N', 1)] {
        let mut target = vec![7.0; 4];
        // SAFETY: the arrays have the sizes given.
        unsafe {
            blas::dgemm(
                letter,
                b'N',
                2,
                2,
                2,
                1.0,
                a.as_slice(),
                leading,
                b.as_slice(),
                2,
                0.0,
                &mut target,
                2,
            );
        }
        assert_eq!(target, [7.0; 4]);
    }
}

#[test]
fn gemv_multiplies_for_both_transposes_and_any_increments() {
    let a = entries(3, 2, 4);
    for (letter, turned) in TRANSPOSES {
        let operator = stored(&a, turned);
        let (rows, cols) = operator.shape();
        let x = [1.0, 0.0, -2.0, 0.0, 3.0];
        let mut y = [4.0, 9.0, 9.0, 5.0, 9.0, 9.0, 6.0];
        // SAFETY: the arrays have the sizes given.
        unsafe {
            blas::dgemv(letter, 3, 2, 2.0, &array(&a, 1), 4, &x, 2, -1.0, &mut y, -3);
        }
        let input = DMatrix::from_fn(cols, 1, |at, _| x[2 * at]);
        let output = operator * input * 2.0;
        for at in 0..rows {
            let before = [4.0, 5.0, 6.0][rows - 1 - at];
            assert!((y[3 * (rows - 1 - at)] - (output[at] - before)).abs() < 1e-14);
        }
        assert_eq!([y[1], y[2], y[4], y[5]].map(f64::to_bits), [9.0_f64.to_bits(); 4]);
    }
}

#[test]
fn symv_reads_one_triangle() {
    let (n, x) = (4, [1.0, -2.0, 3.0, 0.5]);
    let (a, rubbish) = (symmetric(n, 5), entries(n, n, 6));
    let cases = [(b'U', upper_and_lower(&a, &rubbish)), (b'l', upper_and_lower(&rubbish, &a))];
    for (letter, mut stored) in cases {
        stored.set_diagonal(&a.diagonal());
        let mut y = [1.0; 4];
        // SAFETY: the arrays have the sizes given.
        unsafe { blas::dsymv(letter, int(n), 1.5, &array(&stored, 2), 6, &x, 1, 2.0, &mut y, 1) };
        let expected = &a * DMatrix::from_column_slice(n, 1, &x) * 1.5;
        for at in 0..n {
            assert!((y[at] - expected[at] - 2.0).abs() < 1e-14);
        }
    }
}

/// The target keeps one triangle and gets the other one.
fn assert_triangle(letter: u8, target: &[f64], before: &DMatrix<f64>, expected: &DMatrix<f64>) {
    let n = before.nrows();
    let actual = matrix(n, n, 1, target);
    let strict = |m: &DMatrix<f64>| m.lower_triangle() - DMatrix::from_diagonal(&m.diagonal());
    let exact = if letter == b'U' {
        expected.upper_triangle() + strict(before)
    } else {
        expected.lower_triangle() + strict(&before.transpose()).transpose()
    };
    assert!((actual - exact).amax() < 1e-14);
}

#[test]
fn syrk_and_syr2k_write_one_triangle_for_both_transposes() {
    let (n, k) = (4, 3);
    let (a, b, c) = (entries(n, k, 7), entries(n, k, 8), symmetric(n, 9));
    for letter in [b'U', b'L'] {
        for (transpose, turned) in TRANSPOSES {
            let (left, right) = (stored(&a, turned), stored(&b, turned));
            let leading = int(left.nrows() + 2);
            let (left, right) = (array(&left, 2), array(&right, 2));
            let mut one = array(&c, 1);
            let mut two = array(&c, 1);
            // SAFETY: the arrays have the sizes given.
            unsafe {
                blas::dsyrk(letter, transpose, 4, 3, 2.0, &left, leading, -1.0, &mut one, 5);
                blas::dsyr2k(
                    letter, transpose, 4, 3, 0.5, &left, leading, &right, leading, 3.0, &mut two, 5,
                );
            }
            assert_triangle(letter, &one, &c, &(&a * a.transpose() * 2.0 - &c));
            let mixed = &a * b.transpose();
            let expected = (&mixed + mixed.transpose()) * 0.5 + &c * 3.0;
            assert_triangle(letter, &two, &c, &expected);
        }
    }
}

#[test]
fn products_in_single_precision_are_right_to_its_rounding() {
    let (a, b) = ([1.0_f32, 0.1, 0.2, 3.0], [2.0_f32, -1.0, 0.3, 0.7]);
    let (mut c, mut y, mut z) = ([0.0_f32; 4], [0.0_f32; 2], [0.0_f32; 2]);
    let (mut s, mut t) = ([0.0_f32; 4], [0.0_f32; 4]);
    // SAFETY: the arrays have the sizes given.
    unsafe {
        blas::sgemm(b'N', b'N', 2, 2, 2, 1.0, &a, 2, &b, 2, 0.0, &mut c, 2);
        blas::sgemv(b'N', 2, 2, 1.0, &a, 2, &b[..2], 1, 0.0, &mut y, 1);
        blas::ssymv(b'U', 2, 1.0, &a, 2, &b[..2], 1, 0.0, &mut z, 1);
        blas::ssyrk(b'U', b'N', 2, 2, 1.0, &a, 2, 0.0, &mut s, 2);
        blas::ssyr2k(b'U', b'N', 2, 2, 1.0, &a, 2, &b, 2, 0.0, &mut t, 2);
    }
    let near = |x: f32, y: f32| assert!((x - y).abs() < 1e-6, "{x} {y}");
    // A = [1, 0.2; 0.1, 3], B = [2, 0.3; -1, 0.7].
    for (computed, expected) in c.iter().zip([1.8, -2.8, 0.44, 2.13]) {
        near(*computed, expected);
    }
    near(y[0], 1.8);
    near(y[1], -2.8);
    near(z[0], 1.8);
    near(z[1], -2.6);
    near(s[0], 1.04);
    near(s[2], 0.7);
    near(s[3], 9.01);
    near(t[0], 4.12);
    near(t[2], 0.24);
    near(t[3], 4.0);
}
