use crate::reference::{UNCOMPENSATED, UNCOMPENSATED_MILLISECOND};
use crate::{entry_error, matrix};
use control::Error;
use control::exponential::exponential;
use nalgebra::DMatrix;

/// Moler and Van Loan, Nineteen dubious ways, SIAM Review 20 (1978), section 3: eigenvalues -1,
/// -17.
#[test]
fn the_example_of_moler_and_van_loan_has_its_closed_form() {
    let e = exponential(&matrix(2, 2, &[-49.0, 24.0, -64.0, 31.0])).unwrap();
    let (slow, fast) = ((-1.0_f64).exp(), (-17.0_f64).exp());
    let expected = [
        -2.0 * slow + 3.0 * fast,
        1.5 * (slow - fast),
        4.0 * (fast - slow),
        3.0 * slow - 2.0 * fast,
    ];
    assert!(entry_error(&e, &matrix(2, 2, &expected)) < 1e-13);
}

/// Every entry is accurate, although they differ by fourteen orders of magnitude.
#[test]
fn the_observer_of_the_pendulum_agrees_with_high_precision_in_every_entry() {
    let e = exponential(&(matrix(5, 5, &UNCOMPENSATED) * 1e-3)).unwrap();
    let error = entry_error(&e, &matrix(5, 5, &UNCOMPENSATED_MILLISECOND));
    assert!(error < 1e-11, "{error:e}");
}

/// x1' = -x1 + g x2, x2' = -2 x2, of which e^A has the entry g (e^-1 - e^-2), in both orders of the states.
#[test]
fn a_cascade_of_states_with_very_different_units_keeps_its_digits() {
    let (one, two) = ((-1.0_f64).exp(), (-2.0_f64).exp());
    for g in [1e-9, 1.0, 1e5, 1e9] {
        let coupling = g * (one - two);
        let e = exponential(&matrix(2, 2, &[-1.0, g, 0.0, -2.0])).unwrap();
        let error = entry_error(&e, &matrix(2, 2, &[one, coupling, 0.0, two]));
        let e = exponential(&matrix(2, 2, &[-2.0, 0.0, g, -1.0])).unwrap();
        let other = entry_error(&e, &matrix(2, 2, &[two, 0.0, coupling, one]));
        assert!(error < 1e-13 && other < 1e-13, "{g:e}: {error:e} {other:e}");
    }
}

#[test]
fn a_nilpotent_matrix_gives_its_finite_series() {
    let e = exponential(&matrix(3, 3, &[0., 1., 0., 0., 0., 1., 0., 0., 0.])).unwrap();
    assert!((e - matrix(3, 3, &[1., 1., 0.5, 0., 1., 1., 0., 0., 1.])).amax() < 1e-15);
}

#[test]
fn the_exponential_of_the_negative_is_the_inverse() {
    let a =
        crate::integers(6, 6, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5) * 0.2;
    let product = exponential(&a).unwrap() * exponential(&-&a).unwrap();
    let error = (product - DMatrix::identity(6, 6)).amax();
    assert!(error < 1e-11, "{error:e}");
}

#[test]
fn a_result_beyond_double_precision_is_refused() {
    let overflow = Err(Error::Overflow { what: "e^A" });
    assert_eq!(exponential(&matrix(1, 1, &[1000.0])), overflow);
    // Balancing leaves the range of numbers before the exponential does.
    assert_eq!(exponential(&matrix(2, 2, &[1e308, 1e306, 1e300, 0.0])), overflow);
}
