use crate::recorded::cases;
use crate::reference::{LYAPUNOV, LYAPUNOV_RANGE, UNCOMPENSATED};
use crate::riccati::distance;
use crate::{entry_error, integers, matrix};
use control::Error;
use control::lyapunov::{definite_range, discrete_lyapunov, lyapunov};
use nalgebra::DMatrix;

#[test]
fn the_observer_of_the_pendulum_agrees_with_high_precision_in_every_entry() {
    let solution = lyapunov(&matrix(5, 5, &UNCOMPENSATED), &DMatrix::identity(5, 5)).unwrap();
    let error = entry_error(&solution.p, &matrix(5, 5, &LYAPUNOV));
    assert!(error < 1e-10, "{error:e}");
    assert!(solution.residual < 1e-14 && solution.defect < 1e-2, "{solution:?}");
}

/// Computes Q for a known P by the definition, with other rounding errors.
#[test]
fn a_known_solution_with_complex_eigenvalues_is_found() {
    let a = integers(6, 6, |i, j| (7 * i * i + 3 * i * j + 5 * j + i * j * j) % 11 - 5)
        - DMatrix::from_diagonal_element(6, 6, 15.0);
    let root = integers(6, 6, |i, j| (i * j + 2 * i + j) % 5 - 2);
    let p = root.transpose() * &root;
    let q = -(a.transpose() * &p + &p * &a);
    let error = (lyapunov(&a, &q).unwrap().p - &p).amax() / p.amax();
    assert!(error < 1e-13, "{error:e}");
}

#[test]
fn an_unstable_matrix_is_refused() {
    let a = matrix(2, 2, &[-1.0, 0.0, 0.0, 0.5]);
    let refused = lyapunov(&a, &DMatrix::identity(2, 2));
    assert!(
        matches!(refused, Err(Error::NotHurwitz { matrix: "A", abscissa: 0.5 })),
        "{refused:?}"
    );
}

#[test]
fn an_unsymmetric_right_side_is_refused() {
    let q = matrix(2, 2, &[1.0, 2.0, 3.0, 1.0]);
    let refused = lyapunov(&-DMatrix::identity(2, 2), &q);
    assert_eq!(refused, Err(Error::NotSymmetric { matrix: "Q", row: 1, col: 2 }));
}

#[test]
fn the_smallest_eigenvalue_is_right_far_below_the_rounding_of_the_largest_entry() {
    let (least, largest) = definite_range(&matrix(5, 5, &LYAPUNOV)).unwrap();
    assert!((least / LYAPUNOV_RANGE.0 - 1.0).abs() < 1e-3, "{least:e}");
    assert!((largest / LYAPUNOV_RANGE.1 - 1.0).abs() < 1e-13, "{largest:e}");
}

#[test]
fn an_indefinite_matrix_is_refused() {
    let refused = definite_range(&matrix(2, 2, &[1.0, 2.0, 2.0, 1.0]));
    assert_eq!(refused, Err(Error::NotPositiveDefinite { matrix: "P" }));
}

/// y(k) = u(k - n): each state is kept for as many samples as it still passes.
#[test]
fn the_solution_of_a_delay_counts_its_samples() {
    for (n, samples) in (1..8).zip(1..) {
        let delay = integers(n, n, |i, j| i32::from(i == j + 1));
        let p = discrete_lyapunov(&delay, &DMatrix::identity(n, n)).expect("a solution").p;
        let expected = integers(n, n, |i, j| if i == j { samples - i } else { 0 });
        assert!((&p - &expected).amax() < 1e-13, "{p}");
    }
}

#[test]
fn discrete_equations_agree_with_high_precision_as_well_as_scipy() {
    for case in cases(include_str!("../data/riccati.txt"), "lyapunov") {
        let actual = discrete_lyapunov(case.get("A"), case.get("Q")).unwrap();
        let error = distance(&actual.p, case.get("P"));
        let allowed = (2.0 * case.number("scipy")).max(1e-12);
        assert!(error < allowed, "{}: {error:e}", case.name);
        assert!(actual.residual < 1e-13, "{}: {:e}", case.name, actual.residual);
    }
}

/// P is the sum of A'^k Q A^k.
#[test]
fn the_discrete_solution_is_the_sum_of_its_series() {
    let a = matrix(3, 3, &[0.5, -0.6, 0.1, 0.7, 0.2, 0.0, 3.0, 1.0, -0.4]);
    let q = matrix(3, 3, &[2.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 5.0]);
    let (mut sum, mut term) = (q.clone(), q.clone());
    for _ in 0..400 {
        term = a.transpose() * term * &a;
        sum += &term;
    }
    let error = (discrete_lyapunov(&a, &q).unwrap().p - &sum).amax() / sum.amax();
    assert!(error < 1e-14, "{error:e}");
}

#[test]
fn a_matrix_with_an_eigenvalue_on_the_unit_circle_is_refused() {
    let turn = matrix(2, 2, &[0.0, 1.0, -1.0, 0.0]);
    let refused = discrete_lyapunov(&turn, &DMatrix::identity(2, 2));
    assert!(matches!(refused, Err(Error::NotSchur { matrix: "A", .. })), "{refused:?}");
}
