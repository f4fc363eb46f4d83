//! Against what scipy's `place_poles` reaches on many systems: `scripts/reference_placement.py`.

use crate::matrix;
use control::placement::{place, place_balanced, place_discrete};
use nalgebra::{Complex, DMatrix};

struct System {
    kind: &'static str,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    poles: Vec<Complex<f64>>,
    /// Of scipy.
    condition: f64,
    /// Of scipy.
    pole_error: f64,
}

fn systems() -> Vec<System> {
    let text = include_str!("../placement_reference.txt");
    let found: Vec<System> = text.lines().filter(|line| !line.starts_with('#')).map(read).collect();
    assert!(found.len() > 100, "{}", found.len());
    found
}

fn read(line: &'static str) -> System {
    let fields: Vec<&str> = line.split(';').collect();
    let numbers = |field: usize| -> Vec<f64> {
        fields[field].split(' ').map(|text| text.parse().expect("a number")).collect()
    };
    let size = |field: usize| fields[field].parse().expect("a size");
    let parts = numbers(5).into_iter().zip(numbers(6));
    System {
        kind: fields[0],
        a: matrix(size(1), size(1), &numbers(3)),
        b: matrix(size(1), size(2), &numbers(4)),
        poles: parts.map(|(re, im)| Complex::new(re, im)).collect(),
        condition: numbers(7)[0],
        pole_error: numbers(9)[0],
    }
}

#[test]
fn no_system_is_worse_conditioned_than_the_best_that_scipy_finds() {
    for System { kind, a, b, poles, condition, .. } in systems() {
        let found = place(&a, &b, &poles).unwrap().quality.condition;
        assert!(found < (1.0 + 1e-6) * condition, "{kind}, {:?}: {found}", b.shape());
    }
}

/// With as many free parameters as a choice of eigenvectors gives, the descent on the condition
/// number itself pays: scipy enlarges the determinant.
#[test]
fn systems_with_a_choice_are_better_conditioned_by_a_tenth_on_average() {
    let mut logarithms = Vec::new();
    for System { a, b, poles, condition, .. } in systems() {
        if 1 < b.ncols() && b.ncols() < a.nrows() {
            let found = place(&a, &b, &poles).unwrap().quality.condition;
            logarithms.push((found / condition).ln());
        }
    }
    let count = f64::from(u32::try_from(logarithms.len()).unwrap());
    assert!(logarithms.iter().sum::<f64>() / count < 0.9_f64.ln());
}

/// Rounding errors of either side make up a factor of ten, and those of the eigenvalues computed
/// here are in ours.
#[test]
fn the_eigenvalues_are_as_exact_as_those_of_scipy() {
    for System { kind, a, b, poles, condition, pole_error } in systems() {
        let found = place(&a, &b, &poles).unwrap().quality.pole_error;
        let rounding = 1e-15 * condition;
        assert!(found < 10.0 * pole_error.max(rounding), "{kind}, {:?}: {found}", b.shape());
    }
}

/// KNV0 and YT of scipy reach 3.24746e7 on the observer of the pendulum.
#[test]
fn the_observer_of_the_pendulum_is_better_conditioned_than_scipy_makes_it() {
    let system = systems().into_iter().find(|system| system.kind == "pendulum").unwrap();
    assert!((system.condition / 3.247_46e7 - 1.0).abs() < 1e-5, "{}", system.condition);
    let found = place(&system.a, &system.b, &system.poles).unwrap().quality;
    assert!(found.condition < 0.99 * system.condition, "{found:?}");
    assert!(found.pole_error < system.pole_error, "{found:?}");
}

#[test]
fn the_answer_is_the_same_to_the_last_bit_each_time() {
    for System { a, b, poles, .. } in systems().into_iter().step_by(9) {
        for way in [place, place_balanced, place_discrete] {
            let (first, second) = (way(&a, &b, &poles).unwrap(), way(&a, &b, &poles).unwrap());
            let bits = |m: &DMatrix<f64>| m.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&first.gain), bits(&second.gain));
            assert_eq!(first.quality, second.quality);
        }
    }
}
