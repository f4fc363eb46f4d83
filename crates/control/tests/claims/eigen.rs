use crate::matrix;
use control::Domain;
use control::eigen::eigenvalues;
use control::stability::instability;
use nalgebra::{Complex, DMatrix};

/// The roots of unity, for which the unshifted QR algorithm does not converge.
#[test]
fn cyclic_permutations_have_the_roots_of_unity() {
    for n in 2..=9_u8 {
        let size = usize::from(n);
        let cycle = DMatrix::from_fn(size, size, |i, j| f64::from(u8::from((i + 1) % size == j)));
        let actual = eigenvalues(&cycle).unwrap();
        for k in 0..n {
            let root =
                Complex::from_polar(1.0, std::f64::consts::TAU * f64::from(k) / f64::from(n));
            let nearest = actual.iter().map(|x| (x - root).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-13, "n = {n}, {root}: {nearest:e}");
        }
    }
}

#[test]
fn complex_pairs_are_exact_conjugates_and_ordered() {
    let actual = eigenvalues(&matrix(3, 3, &[-1., 2., 0., -3., -1., 0., 5., 1., -4.])).unwrap();
    assert!((actual[0] - Complex::new(-4.0, 0.0)).norm() < 1e-14);
    assert!((actual[1] - Complex::new(-1.0, -6.0_f64.sqrt())).norm() < 1e-14);
    assert_eq!(actual[1], actual[2].conj());
}

/// A companion matrix in units that differ by up to 1e8 between states.
#[test]
fn bad_units_cost_no_precision() {
    let companion = matrix(3, 3, &[0., 1., 0., 0., 0., 1., -6., -11., -6.]);
    let units = [1.0, 1e8, 1e-8];
    let scaled = DMatrix::from_fn(3, 3, |i, j| companion[(i, j)] * units[i] / units[j]);
    for (actual, expected) in eigenvalues(&scaled).unwrap().iter().zip([-3.0, -2.0, -1.0]) {
        assert!((actual - expected).norm() < 1e-13, "{actual}");
    }
}

/// A pendulum under three integrators in a row, in mixed order: the QR algorithm alone makes the triple zero 3e-7.
#[test]
fn integrators_behind_a_plant_have_eigenvalues_of_exactly_zero() {
    let (stiffness, damping) = (0.479_403_314_451_799, 0.011_113_670_092_665_5);
    let mut a = DMatrix::zeros(5, 5);
    for (row, column, entry) in [
        (4, 0, 1.0),
        (0, 2, 1.0),
        (2, 1, 1.534_491_392_389_36e-3),
        (2, 3, 3.557_303_544_000_62e-5),
        (1, 3, 1.0),
        (3, 1, -stiffness),
        (3, 3, -damping),
    ] {
        a[(row, column)] = entry;
    }
    let eigenvalues = eigenvalues(&a).unwrap();
    assert_eq!(eigenvalues.iter().filter(|value| value.norm() == 0.0).count(), 3);
    let frequency = (stiffness - 0.25 * damping * damping).sqrt();
    let pair = [Complex::new(-0.5 * damping, -frequency), Complex::new(-0.5 * damping, frequency)];
    for (value, expected) in eigenvalues.iter().zip(pair) {
        assert!((value - expected).norm() < 1e-15, "{value}");
    }
}

#[test]
fn the_instability_is_the_largest_real_part_or_the_spectral_radius_less_one() {
    let saddle = matrix(2, 2, &[-7.0, 0.0, 3.0, 0.5]);
    assert!((instability(&saddle, Domain::Continuous).unwrap() - 0.5).abs() < 1e-15);
    let sampled = Domain::Sampled { period: 0.1 };
    assert!((instability(&saddle, sampled).unwrap() - 6.0).abs() < 1e-14);
    let turning = matrix(2, 2, &[0.25, 100.0, -100.0, 0.25]);
    assert!((instability(&turning, Domain::Continuous).unwrap() - 0.25).abs() < 1e-13);
}

/// Three equal pairs -1.5 +- 2i and four others in many bases. Because of rounding, entries between
/// equal pairs do not vanish. The error is the rounding error times the square of the condition
/// number.
#[test]
fn repeated_pairs_are_found() {
    let mut blocks = DMatrix::from_diagonal_element(10, 10, -1.5);
    for first in [0, 2, 4] {
        blocks[(first, first + 1)] = 2.0;
        blocks[(first + 1, first)] = -2.0;
    }
    for (state, value) in [-3.0, -3.0, -3.0, -4.0].into_iter().enumerate() {
        blocks[(6 + state, 6 + state)] = value;
    }
    let fraction = |k: usize| (1000.0 * f64::from(u32::try_from(k).unwrap()).sqrt()).fract() - 0.5;
    for case in 0..50 {
        let t = DMatrix::from_fn(10, 10, |i, j| fraction(131 * case + 17 * i + j + 2));
        let inverse = t.clone().try_inverse().unwrap();
        let condition = t.norm() * inverse.norm();
        if condition > 1e4 {
            continue;
        }
        let actual = eigenvalues(&(&t * &blocks * inverse)).unwrap();
        let pair = Complex::new(-1.5, 2.0);
        for (value, times) in [(pair, 3), (pair.conj(), 3), (Complex::from(-3.0), 3)] {
            let near = actual.iter().filter(|actual| (*actual - value).norm() < 1e-6).count();
            assert_eq!(near, times, "{case}: {actual:?}");
        }
    }
}

/// Ten equal eigenvalues, coupled by 1e-9, beside lightly damped pairs, in a dense basis of order 60:
/// what an observer with ten measurements brings. The Schur form does not converge on some of these.
#[test]
fn a_large_matrix_with_a_cluster_has_the_eigenvalues_of_its_blocks() {
    let n = 60;
    let mut blocks = DMatrix::zeros(n, n);
    for k in 0..10 {
        blocks[(k, k)] = -9.745;
        if k > 0 {
            blocks[(k - 1, k)] = 1e-9;
        }
    }
    let imaginary = |pair: usize| 0.3 + 0.11 * f64::from(u32::try_from(pair).unwrap());
    for pair in 0..25 {
        let at = 10 + 2 * pair;
        (blocks[(at, at)], blocks[(at + 1, at + 1)]) = (-0.02, -0.02);
        (blocks[(at, at + 1)], blocks[(at + 1, at)]) = (imaginary(pair), -imaginary(pair));
    }
    for row in 0..n {
        for column in row + 2..n {
            let k = f64::from(u32::try_from(n * row + column).unwrap());
            blocks[(row, column)] += if row < 10 { 0.0 } else { 0.1 * (7.1 * k).sin() };
        }
    }
    let reflection = |power: f64| {
        let v = nalgebra::DVector::from_fn(n, |i, _| {
            f64::from(u32::try_from(i + 1).unwrap()).powf(power)
        });
        DMatrix::identity(n, n) - &v * v.transpose() * (2.0 / v.norm_squared())
    };
    let q = reflection(-0.3) * reflection(0.4) * reflection(-1.0);
    let actual = eigenvalues(&(&q * &blocks * q.transpose())).unwrap();
    let near = |value: Complex<f64>, width: f64| {
        actual.iter().filter(|actual| (*actual - value).norm() < width).count()
    };
    assert_eq!(near(Complex::from(-9.745), 1e-6), 10, "{actual:?}");
    for pair in 0..25 {
        let value = Complex::new(-0.02, imaginary(pair));
        assert_eq!((near(value, 1e-9), near(value.conj(), 1e-9)), (1, 1), "{value} {actual:?}");
    }
}
