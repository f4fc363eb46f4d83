//! Comparison with scipy's `place_poles` on many systems: `scripts/reference_placement.py`.

use crate::matrix;
use control::placement::{Quality, place, place_balanced, place_discrete};
use nalgebra::{Complex, DMatrix};
use std::sync::LazyLock;

struct System {
    kind: &'static str,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    poles: Vec<Complex<f64>>,
    /// Condition number by scipy.
    condition: f64,
    /// Pole error by scipy.
    pole_error: f64,
}

/// The systems, each with the quality reached by this crate.
static SYSTEMS: LazyLock<Vec<(System, Quality)>> = LazyLock::new(|| {
    let text = include_str!("../placement_reference.txt");
    let systems = text.lines().filter(|line| !line.starts_with('#')).map(read);
    let placed = |system: System| {
        let placement = place(&system.a, &system.b, &system.poles).expect(system.kind);
        (system, placement.quality)
    };
    systems.map(placed).collect()
});

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
    assert!(SYSTEMS.len() > 60, "{}", SYSTEMS.len());
    for (System { kind, b, condition, .. }, found) in SYSTEMS.iter() {
        assert!(found.condition < (1.0 + 1e-6) * condition, "{kind}, {:?}: {found:?}", b.shape());
    }
}

/// scipy maximises the determinant of the eigenvectors; this crate minimises their condition
/// number.
#[test]
fn systems_with_a_choice_are_better_conditioned_by_a_tenth_on_average() {
    let with_a_choice = SYSTEMS.iter().filter(|(system, _)| {
        let (states, inputs) = system.b.shape();
        1 < inputs && inputs < states
    });
    let (mut sum, mut count) = (0.0, 0.0);
    for (System { condition, .. }, found) in with_a_choice {
        sum += (found.condition / condition).ln();
        count += 1.0;
    }
    assert!(sum / count < 0.9_f64.ln(), "{}", (sum / count).exp());
}

/// A factor of ten allows for rounding errors of both sides and of the eigenvalues computed here.
#[test]
fn the_eigenvalues_are_as_exact_as_those_of_scipy() {
    for (System { kind, b, condition, pole_error, .. }, found) in SYSTEMS.iter() {
        let allowed = 10.0 * pole_error.max(1e-15 * condition);
        assert!(found.pole_error < allowed, "{kind}, {:?}: {found:?}", b.shape());
    }
}

/// KNV0 and YT of scipy reach 3.24746e7 on the observer of the pendulum.
#[test]
fn the_observer_of_the_pendulum_is_better_conditioned_than_scipy_makes_it() {
    let (scipy, found) = SYSTEMS.iter().find(|(system, _)| system.kind == "pendulum").unwrap();
    assert!((scipy.condition / 3.247_46e7 - 1.0).abs() < 1e-5, "{}", scipy.condition);
    assert!(found.condition < 0.99 * scipy.condition, "{found:?}");
    assert!(found.pole_error < scipy.pole_error, "{found:?}");
}

#[test]
fn the_answer_is_the_same_to_the_last_bit_each_time() {
    for (System { a, b, poles, .. }, _) in SYSTEMS.iter().step_by(10) {
        for way in [place, place_balanced, place_discrete] {
            let (first, second) = (way(a, b, poles).unwrap(), way(a, b, poles).unwrap());
            let bits = |m: &DMatrix<f64>| m.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&first.gain), bits(&second.gain));
            assert_eq!(first.quality, second.quality);
        }
    }
}
