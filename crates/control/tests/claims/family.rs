use crate::matrix;
use control::eigen::eigenvalues;
use control::lmi::{
    Interval, Outcome, Region, Vertex, bernstein, certify_common, certify_schedule,
    common_feedback, largest_change, largest_scaling,
};
use control::stability::instability;
use control::{Domain, Error};
use nalgebra::{DMatrix, DVector};

const SAMPLED: Domain = Domain::Sampled { period: 0.1 };

/// x'' + c x' + k x = 0.
fn oscillator(k: f64, c: f64) -> DMatrix<f64> {
    matrix(2, 2, &[0.0, 1.0, -k, -c])
}

fn stable() -> Region {
    Region::default()
}

/// By the circle criterion x'' + c x' + k(t) x = 0, k from a to b, has a quadratic Lyapunov function
/// if and only if sqrt(b) - sqrt(a) < c.
#[test]
fn a_common_p_exists_exactly_as_far_as_the_circle_criterion_says() {
    let at = |b: f64| {
        let vertices = [oscillator(1.0, 1.0), oscillator(b, 1.0)];
        certify_common(&vertices, &stable(), Domain::Continuous).unwrap()
    };
    let Outcome::Optimal(actual) = at(3.98) else { panic!("sqrt(3.98) - 1 is below 1") };
    for k in [1.0, 2.0, 3.98] {
        let a = oscillator(k, 1.0);
        let decay = -(a.transpose() * &actual.p + &actual.p * a);
        assert!(decay.symmetric_eigenvalues().min() > 0.0);
    }
    assert_eq!(at(4.02), Outcome::Infeasible { conflict: vec![0, 1] });
}

#[test]
fn a_member_outside_of_the_region_is_named() {
    let vertices = [oscillator(1.0, 1.0), oscillator(-1.0, 1.0), oscillator(2.0, 1.0)];
    let actual = certify_common(&vertices, &stable(), Domain::Continuous).unwrap();
    assert_eq!(actual, Outcome::Infeasible { conflict: vec![1] });
}

#[test]
fn a_matrix_in_the_hull_keeps_region_and_decay() {
    let vertices = [oscillator(4.0, 4.0), oscillator(5.0, 4.5)];
    let region = Region { decay: Some(1.0), sector: Some(0.8), ..stable() };
    let actual = certify_common(&vertices, &region, Domain::Continuous).unwrap();
    let p = actual.optimal().expect("a common P").p;
    let mut x = DVector::from_vec(vec![1.0, -2.0]);
    let energy = |x: &DVector<f64>| (x.transpose() * &p * x)[(0, 0)];
    let (start, step) = (energy(&x), 1e-3);
    for k in 0..3000_u32 {
        // The member changes in every step; Euler's error is far below the decay.
        let weight = f64::from(k * 37 % 11) / 10.0;
        let a = &vertices[0] * weight + &vertices[1] * (1.0 - weight);
        x += (&a + &a * &a * (0.5 * step)) * &x * step;
        let bound = start * (-2.0 * step * f64::from(k + 1)).exp();
        assert!(energy(&x) <= bound * 1.001, "{k}");
    }
}

/// Two masses and a spring, k from 0.5 to 2 (Wie and Bernstein 1992), sampled and not.
#[test]
fn one_gain_serves_all_springs_of_the_benchmark() {
    let plant = |k: f64| Vertex {
        a: matrix(4, 4, &[0., 0., 1., 0., 0., 0., 0., 1., -k, k, 0., 0., k, -k, 0., 0.]),
        b: matrix(4, 1, &[0.0, 0.0, 1.0, 0.0]),
    };
    let sampled = |k: f64| {
        let Vertex { a, b } = plant(k);
        let (a, b) = control::hold::zero_order_hold(&a, &b, 0.1).unwrap();
        Vertex { a, b }
    };
    let region = Region { decay: Some(0.1), ..stable() };
    let springs = [1.0, 0.5, 2.0];
    for (plants, domain) in
        [(springs.map(plant), Domain::Continuous), (springs.map(sampled), SAMPLED)]
    {
        let actual = common_feedback(&plants, &region, domain).unwrap().optimal().expect("a gain");
        for Vertex { a, b } in &plants {
            let worst = instability(&(a + b * &actual.gain), domain).unwrap();
            let limit = if domain == Domain::Continuous { -0.1 } else { (-0.01_f64).exp() - 1.0 };
            assert!(worst < limit, "{worst}");
        }
        let p = &actual.certificate.p;
        assert!(p.symmetric_eigenvalues().min() > 0.0);
    }
}

/// x' = b u with b = 1 and b = -1 has no common gain; b = 2 takes no part in the contradiction.
#[test]
fn members_in_conflict_and_the_largest_scaling_are_found() {
    let plant = |b: f64| Vertex { a: matrix(1, 1, &[0.0]), b: matrix(1, 1, &[b]) };
    let region = Region { decay: Some(1.0), ..stable() };
    let plants = [1.0, 2.0, -1.0].map(plant);
    let actual = common_feedback(&plants, &region, Domain::Continuous).unwrap();
    let Outcome::Infeasible { conflict } = actual else { panic!("{actual:?}") };
    assert_eq!(conflict.len(), 2);
    assert_eq!(conflict[1], 2);
    // b = 1 - 2 s is above 0 below s = 1/2.
    let scaling = largest_scaling(&plants, &region, Domain::Continuous).unwrap().unwrap();
    assert!(scaling < 0.5 && scaling > 0.48, "{scaling}");
}

#[test]
fn members_of_different_orders_are_refused() {
    let plants = [1, 2].map(|n| Vertex { a: DMatrix::zeros(n, n), b: DMatrix::zeros(n, 1) });
    let refused = largest_scaling(&plants, &stable(), Domain::Continuous);
    assert!(matches!(refused, Err(Error::Shape { matrix: "A", expected: (1, 1), .. })));
}

#[test]
fn bernstein_coefficients_bound_a_polynomial() {
    // (1 - 2 t)^2 = 1, -1, 1 in Bernstein form.
    let value = |t: f64| matrix(1, 1, &[(1.0 - 2.0 * t).powi(2)]);
    let actual = bernstein(&[0.0, 0.5, 1.0].map(value)).unwrap();
    for (actual, expected) in actual.iter().zip([1.0, -1.0, 1.0]) {
        assert!((actual[(0, 0)] - expected).abs() < 1e-14);
    }
}

/// A quarter of a turn on an ellipse whose axes change places between the ends of the interval.
fn rotation(t: f64) -> DMatrix<f64> {
    let stretch = 2.0_f64.powf(1.0 - 2.0 * t);
    matrix(2, 2, &[0.0, stretch, -1.0 / stretch, 0.0]) * 0.7
}

fn rotations() -> Interval {
    let values: Vec<_> = (0..=4).map(|k| rotation(f64::from(k) / 4.0)).collect();
    Interval { length: 2.0, coefficients: bernstein(&values).expect("values of one shape") }
}

#[test]
fn a_loop_that_a_jump_destabilises_is_stable_while_its_variable_changes_slowly() {
    let interval = rotations();
    let jumps = certify_common(&[rotation(0.0), rotation(1.0)], &stable(), SAMPLED).unwrap();
    assert_eq!(jumps, Outcome::Infeasible { conflict: vec![0, 1] });
    let actual =
        largest_change(std::slice::from_ref(&interval), SAMPLED).unwrap().expect("a certificate");
    assert!(actual.change > 0.01 && actual.change < 2.0, "{}", actual.change);
    let again = certify_schedule(std::slice::from_ref(&interval), actual.change, SAMPLED);
    assert!(again.unwrap().is_some());
    let p = |theta: f64| &actual.p[0] * (1.0 - theta / 2.0) + &actual.p[1] * (theta / 2.0);
    let a = |theta: f64| {
        let t = theta / 2.0;
        let c = &interval.coefficients;
        let b = [1.0, 4.0, 6.0, 4.0, 1.0];
        (0..5).fold(DMatrix::zeros(2, 2), |sum, j| {
            let power = i32::try_from(j).unwrap();
            sum + &c[j] * (b[j] * t.powi(power) * (1.0 - t).powi(4 - power))
        })
    };
    let mut x = DVector::from_vec(vec![1.0, 1.0]);
    let (mut theta, mut seed) = (0.0_f64, 1_u64);
    for _ in 0..2000 {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let part = f64::from(u32::try_from(seed >> 33).unwrap()) / f64::from(1_u32 << 31);
        let next = (theta + actual.change * (2.0 * part - 1.0)).clamp(0.0, 2.0);
        let energy = |x: &DVector<f64>, at: f64| (x.transpose() * p(at) * x)[(0, 0)];
        let before = energy(&x, theta);
        x = a(theta) * x;
        assert!(energy(&x, next) < before);
        theta = next;
        x /= x.norm();
    }
}

#[test]
fn every_matrix_between_the_grid_points_is_stable_by_the_certificate() {
    let actual =
        largest_change(&[rotations(), rotations_back()], SAMPLED).unwrap().expect("a certificate");
    assert_eq!(actual.p.len(), 3);
    assert!(actual.margin > 0.0);
    for value in eigenvalues(&rotation(0.37)).unwrap() {
        assert!(value.norm() < 1.0);
    }
}

fn rotations_back() -> Interval {
    let values: Vec<_> = (0..=4).map(|k| rotation(1.0 - f64::from(k) / 4.0)).collect();
    Interval { length: 1.0, coefficients: bernstein(&values).expect("values of one shape") }
}

/// x'' + x' + k x = 0 with k from 1 to 9 on one interval of length 8.
fn spring() -> Interval {
    Interval { length: 8.0, coefficients: vec![oscillator(1.0, 1.0), oscillator(9.0, 1.0)] }
}

/// By the circle criterion no quadratic Lyapunov function serves any rate, as sqrt(9) - sqrt(1) > 1.
#[test]
fn a_spring_that_no_common_p_serves_is_stable_while_it_changes_slowly() {
    let interval = spring();
    let jumps = certify_common(&interval.coefficients, &stable(), Domain::Continuous).unwrap();
    assert_eq!(jumps, Outcome::Infeasible { conflict: vec![0, 1] });
    let actual = largest_change(std::slice::from_ref(&interval), Domain::Continuous);
    let actual = actual.unwrap().expect("a certificate");
    // V = x' P(k) x with rates up to this one decreases at each k: the residual at a grid of its own.
    assert!(actual.change > 0.1, "{}", actual.change);
    let slope = (&actual.p[1] - &actual.p[0]) / 8.0;
    for step in 0..=400 {
        let t = f64::from(step) / 400.0;
        let p = &actual.p[0] * (1.0 - t) + &actual.p[1] * t;
        assert!(p.clone().symmetric_eigenvalues().min() > 0.0);
        let a = oscillator(1.0 + 8.0 * t, 1.0);
        for rate in [-actual.change, 0.0, actual.change] {
            let change = a.transpose() * &p + &p * &a + &slope * rate;
            assert!(change.symmetric_eigenvalues().max() < 0.0, "{t} {rate}");
        }
    }
}

/// A spring that is soft while the mass moves outwards and stiff while it comes back pumps energy into the
/// oscillation: the state grows, though every constant k is stable. So no certificate may exist for a
/// rate at which k follows this law.
#[test]
fn no_certificate_exists_for_a_rate_at_which_the_spring_can_be_pumped() {
    let (rate, step) = (500.0, 1e-4);
    let (mut x, mut v, mut k) = (1.0_f64, 0.0_f64, 1.0_f64);
    for _ in 0..200_000 {
        let aim = if x * v > 0.0 { 1.0 } else { 25.0 };
        k += (aim - k).clamp(-rate * step, rate * step);
        v -= step * (v + k * x);
        x += step * v;
    }
    let grown = x.hypot(v);
    assert!(grown > 1e3, "{grown}");
    let coefficients = vec![oscillator(1.0, 1.0), oscillator(25.0, 1.0)];
    let interval = Interval { length: 24.0, coefficients };
    assert!(certify_schedule(&[interval], rate, Domain::Continuous).unwrap().is_none());
}
