use crate::data::reference;
use crate::matrix;
use crate::paper::plant;
use control::distance::{from_uncontrollable, from_unobservable};
use nalgebra::{DMatrix, DVector};

/// The expected values are from a grid and Nelder-Mead in the script.
#[test]
fn the_bounds_enclose_the_distance_that_a_search_in_scipy_finds() {
    for case in 0..5 {
        let of = |part: &str| reference(&format!("distance_{case}{part}"));
        let actual = from_uncontrollable(&of("_a"), &of("_b")).unwrap();
        let expected = of("");
        assert!((actual.upper / expected[0] - 1.0).abs() < 1e-2, "{actual:?} {expected}");
        assert!(actual.lower <= expected[0] && actual.lower > 0.85 * expected[0], "{actual:?}");
        assert!((actual.at.re - expected[1]).hypot(actual.at.im - expected[2]) < 0.1, "{actual:?}");
    }
}

/// Removing the small entry of B makes one mode uncontrollable. No much smaller change can do so,
/// because the other entries are one.
#[test]
fn a_nearly_uncontrollable_mode_is_found_with_its_eigenvalue() {
    let a = DMatrix::from_diagonal(&DVector::from_vec(vec![-1.0, -0.5, 0.25]));
    for weak in [1e-3, 1e-8] {
        let actual = from_uncontrollable(&a, &matrix(3, 1, &[1.0, weak, 1.0])).unwrap();
        assert!(actual.upper < weak && actual.upper > 0.3 * weak, "{actual:?}");
        assert!((actual.at + 0.5).norm() < 2.0 * weak.max(1e-9), "{actual:?}");
        assert!(actual.lower <= actual.upper);
    }
}

#[test]
fn a_lost_mode_has_the_distance_zero() {
    let a = DMatrix::from_diagonal(&DVector::from_vec(vec![-3.0, -1.0]));
    let actual = from_uncontrollable(&a, &matrix(2, 1, &[1.0, 0.0])).unwrap();
    assert!(actual.upper < 1e-15 && (actual.at + 1.0).norm() < 1e-12, "{actual:?}");
}

/// With other units of states, time (ms) and measurements the result changes by a few per cent,
/// because of balancing.
#[test]
fn units_hardly_change_the_distance() {
    let plant = plant();
    let before = from_unobservable(&plant.a, &plant.c).unwrap();
    let units = [1.0, 1024.0, 0.125, 4096.0];
    let a = DMatrix::from_fn(4, 4, |i, j| plant.a[(i, j)] * units[i] / units[j] / 1000.0);
    let c = DMatrix::from_fn(2, 4, |i, j| plant.c[(i, j)] / units[j] * 17.0);
    let after = from_unobservable(&a, &c).unwrap();
    assert!((after.upper / before.upper - 1.0).abs() < 0.1, "{before:?} {after:?}");
    assert!((after.at * 1000.0 - before.at).norm() < 1e-2 * plant.a.norm(), "{before:?} {after:?}");
}
