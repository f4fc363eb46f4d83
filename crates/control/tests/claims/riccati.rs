use crate::matrix;
use crate::paper::plant;
use crate::recorded::{Case, cases};
use control::aso::FaultyPlant;
use control::eigen::eigenvalues;
use control::riccati::{Weights, kalman, lqr};
use control::{Domain, Error};
use nalgebra::{Complex, DMatrix};

const RECORDED: &str = include_str!("../data/riccati.txt");
const SAMPLED: Domain = Domain::Sampled { period: 1.0 };

fn weights(case: &Case) -> Weights {
    let get = |name| case.get(name).clone();
    Weights { q: get("Q"), r: get("R"), n: Some(get("N")) }
}

/// Largest distance of the entries relative to sqrt(P[i,i] P[j,j]), which does not depend on units
/// of states.
pub(crate) fn distance(actual: &DMatrix<f64>, exact: &DMatrix<f64>) -> f64 {
    let size = exact.diagonal().map(|x| if x == 0.0 { 1.0 } else { x.abs().sqrt() });
    let relative = |i: usize, j: usize| (actual[(i, j)] - exact[(i, j)]).abs() / size[i] / size[j];
    DMatrix::from_fn(actual.nrows(), actual.ncols(), relative).amax()
}

/// Compared with 60 digits, entries relative to sqrt(P[i,i] P[j,j]). If the equation is
/// ill-conditioned, the tolerance is the error of `SciPy`.
fn assert_agrees_with_high_precision(kind: &str, domain: Domain) {
    let recorded = cases(RECORDED, kind);
    assert!(recorded.len() >= 28);
    for case in recorded {
        let regulator = lqr(case.get("A"), case.get("B"), &weights(&case), domain);
        let regulator = regulator.unwrap_or_else(|error| panic!("{kind}, {}: {error}", case.name));
        let error = distance(&regulator.p, case.get("P"));
        let allowed = (4.0 * case.number("scipy")).max(2e-11);
        assert!(error < allowed, "{kind}, {}: {error:e}, allowed {allowed:e}", case.name);
        let gain = (&regulator.gain - case.get("K")).norm() / case.get("K").norm().max(1e-9);
        assert!(gain < 1e-6, "{kind}, {}: gain {gain:e}", case.name);
    }
}

#[test]
fn continuous_equations_agree_with_high_precision_as_well_as_scipy() {
    assert_agrees_with_high_precision("continuous", Domain::Continuous);
}

#[test]
fn sampled_equations_agree_with_high_precision_as_well_as_scipy() {
    assert_agrees_with_high_precision("sampled", SAMPLED);
}

/// The printed equations, with other rounding errors than in the solver.
#[test]
fn solutions_satisfy_the_printed_equation_and_stabilise() {
    for case in cases(RECORDED, "continuous") {
        let (a, b, w) = (case.get("A"), case.get("B"), weights(&case));
        let computed = lqr(a, b, &w, Domain::Continuous).unwrap();
        let n = w.n.unwrap();
        let cross = &computed.p * b + &n;
        let feedback = &cross * w.r.clone().try_inverse().unwrap() * cross.transpose();
        let left = a.transpose() * &computed.p + &computed.p * a - &feedback + &w.q;
        let terms = (a.abs().transpose() * computed.p.abs()) * 2.0 + feedback.abs() + w.q.abs();
        assert!(left.norm() < 1e-9 * terms.norm(), "{}", case.name);
        assert!(computed.residual < 1e-9);
        let closed = eigenvalues(&(a + b * &computed.gain)).unwrap();
        assert!(closed.iter().all(|x| x.re < 0.0), "{}: {closed:?}", case.name);
    }
    for case in cases(RECORDED, "sampled") {
        let (a, b, w) = (case.get("A"), case.get("B"), weights(&case));
        let computed = lqr(a, b, &w, SAMPLED).unwrap();
        let cross = a.transpose() * &computed.p * b + w.n.unwrap();
        let size = &w.r + b.transpose() * &computed.p * b;
        let feedback = &cross * size.try_inverse().unwrap() * cross.transpose();
        let moved = a.transpose() * &computed.p * a;
        let left = &moved - &computed.p - &feedback + &w.q;
        let terms = moved.abs() + computed.p.abs() + feedback.abs() + w.q.abs();
        assert!(left.norm() < 1e-9 * terms.norm(), "{}", case.name);
        let closed = eigenvalues(&(a + b * &computed.gain)).unwrap();
        assert!(closed.iter().all(|x| x.norm() < 1.0), "{}: {closed:?}", case.name);
    }
}

fn identity_weights(n: usize, m: usize) -> Weights {
    Weights { q: DMatrix::identity(n, n), r: DMatrix::identity(m, m), n: None }
}

#[test]
fn an_unstable_mode_without_an_input_is_named() {
    let a = matrix(2, 2, &[-1.0, 3.0, 0.0, 2.0]);
    let b = matrix(2, 1, &[1.0, 0.0]);
    let refused = lqr(&a, &b, &identity_weights(2, 1), Domain::Continuous).unwrap_err();
    let Error::NotStabilisable { eigenvalue } = refused else { panic!("{refused}") };
    assert!((eigenvalue - Complex::new(2.0, 0.0)).norm() < 1e-14);
    assert!(refused.to_string().contains("2.000000+0.000000i"), "{refused}");
    let refused = lqr(&a, &b, &identity_weights(2, 1), SAMPLED).unwrap_err();
    assert!(matches!(refused, Error::NotStabilisable { .. }), "{refused}");
    let stable = matrix(2, 2, &[0.5, 3.0, 0.0, -0.25]);
    assert!(lqr(&stable, &b, &identity_weights(2, 1), SAMPLED).is_ok());
}

#[test]
fn a_mode_on_the_limit_of_stability_that_the_weight_does_not_see_is_named() {
    let turning = matrix(3, 3, &[0.0, 2.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
    let b = matrix(3, 1, &[1.0, 1.0, 1.0]);
    let mut weights = identity_weights(3, 1);
    weights.q = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![0.0, 0.0, 1.0]));
    let refused = lqr(&turning, &b, &weights, Domain::Continuous).unwrap_err();
    let Error::Unweighted { weight: "Q", eigenvalue } = refused else { panic!("{refused}") };
    assert!((eigenvalue.im.abs() - 2.0).abs() < 1e-14 && eigenvalue.re == 0.0);
    let (one, none) = (DMatrix::identity(1, 1), DMatrix::zeros(1, 1));
    let weights = Weights { q: none, r: one.clone(), n: None };
    let refused = lqr(&one, &one, &weights, SAMPLED);
    assert!(matches!(refused, Err(Error::Unweighted { .. })), "{refused:?}");
}

/// x'' = u with a weight of the speed alone, in turned coordinates: rounding splits the double eigenvalue 0, and the
/// best gain leaves the position at rest, with the eigenvalue 0.
#[test]
fn a_double_mode_on_the_limit_of_stability_is_never_taken_for_a_stable_one() {
    for step in 1..150_u32 {
        let (s, c) = (0.02 * f64::from(step)).sin_cos();
        let turn = matrix(2, 2, &[c, -s, s, c]);
        let turned = |m: DMatrix<f64>| &turn * m * turn.transpose();
        let a = turned(matrix(2, 2, &[0.0, 1.0, 0.0, 0.0]));
        let b = &turn * matrix(2, 1, &[0.0, 1.0]);
        let mut weights = identity_weights(2, 1);
        weights.q = turned(matrix(2, 2, &[0.0, 0.0, 0.0, 1.0]));
        weights.q[(1, 0)] = weights.q[(0, 1)];
        let refused = lqr(&a, &b, &weights, Domain::Continuous);
        assert!(refused.is_err(), "{step}: {refused:?}");
    }
}

#[test]
fn weights_that_are_not_definite_are_refused_by_name() {
    let (a, b) = (-DMatrix::identity(2, 2), DMatrix::identity(2, 2));
    let mut weights = identity_weights(2, 2);
    weights.r[(1, 1)] = 0.0;
    let refused = lqr(&a, &b, &weights, Domain::Continuous);
    assert_eq!(refused, Err(Error::NotPositiveDefinite { matrix: "R" }));
    let mut weights = identity_weights(2, 2);
    weights.q = matrix(2, 2, &[1.0, 2.0, 2.0, 1.0]);
    let refused = lqr(&a, &b, &weights, Domain::Continuous);
    assert_eq!(refused, Err(Error::NotPositiveSemidefinite { matrix: "Q - N R^-1 N'" }));
    let mut weights = identity_weights(2, 2);
    weights.n = Some(DMatrix::from_diagonal_element(2, 2, 1.1));
    let refused = lqr(&a, &b, &weights, Domain::Continuous);
    assert_eq!(refused, Err(Error::NotPositiveSemidefinite { matrix: "Q - N R^-1 N'" }));
    weights.n = Some(DMatrix::from_diagonal_element(2, 2, 1.0));
    assert!(lqr(&a, &b, &weights, Domain::Continuous).is_ok());
    let mut weights = identity_weights(2, 2);
    weights.q[(0, 1)] = 1e-3;
    let refused = lqr(&a, &b, &weights, Domain::Continuous);
    assert_eq!(refused, Err(Error::NotSymmetric { matrix: "Q", row: 1, col: 2 }));
}

#[test]
fn bad_shapes_entries_and_periods_are_named() {
    let (a, b) = (-DMatrix::identity(2, 2), DMatrix::identity(2, 1));
    let refused = lqr(&a, &b, &identity_weights(2, 2), Domain::Continuous);
    assert_eq!(refused, Err(Error::Shape { matrix: "R", expected: (1, 1), actual: (2, 2) }));
    let mut weights = identity_weights(2, 1);
    weights.n = Some(DMatrix::zeros(1, 2));
    let refused = lqr(&a, &b, &weights, Domain::Continuous);
    assert_eq!(refused, Err(Error::Shape { matrix: "N", expected: (2, 1), actual: (1, 2) }));
    let refused = lqr(&a, &b, &identity_weights(2, 1), Domain::Sampled { period: 0.0 });
    assert!(matches!(refused, Err(Error::OutOfRange { name: "period", .. })), "{refused:?}");
    let bad = DMatrix::from_element(2, 2, f64::NAN);
    let one = DMatrix::identity(2, 2);
    let refused = kalman(&a, &one, &bad, &one, Domain::Continuous);
    assert!(matches!(refused, Err(Error::NotFinite { matrix: "W", .. })), "{refused:?}");
    let refused = kalman(&a, &one, &one, &DMatrix::zeros(2, 2), Domain::Continuous);
    assert_eq!(refused, Err(Error::NotPositiveDefinite { matrix: "V" }));
    let blind = DMatrix::zeros(1, 2);
    let unit = DMatrix::identity(1, 1);
    let refused = kalman(&one, &blind, &one, &unit, Domain::Continuous);
    assert!(matches!(refused, Err(Error::NotDetectable { .. })), "{refused:?}");
    let still = DMatrix::zeros(2, 2);
    let refused = kalman(&still, &one, &still, &one, Domain::Continuous);
    assert!(matches!(refused, Err(Error::Unweighted { weight: "W", .. })), "{refused:?}");
}

/// Noise of the paper's plant with a randomly changing friction force.
fn augmented(plant: &FaultyPlant) -> [DMatrix<f64>; 4] {
    let noise = [1e-8, 1e-8, 1e-2, 1e-2, 1e10];
    let process = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&noise));
    let measurement = DMatrix::from_diagonal_element(2, 2, 1e-8);
    [plant.augmented_dynamics(), plant.augmented_output(), process, measurement]
}

/// The covariance equation itself: its right side must vanish for the computed covariance.
#[test]
fn the_filter_of_the_augmented_pendulum_keeps_its_covariance() {
    let [a, c, w, v] = augmented(&plant());
    let filter = kalman(&a, &c, &w, &v, Domain::Continuous).unwrap();
    let (p, l) = (&filter.covariance, &filter.gain);
    let closed = &a - l * &c;
    let rate = &closed * p + p * closed.transpose() + &w + l * &v * l.transpose();
    let size = |m: &DMatrix<f64>| m.diagonal().map(f64::sqrt);
    let terms = size(&(l * &v * l.transpose() + &w));
    let relative = DMatrix::from_fn(5, 5, |i, j| rate[(i, j)].abs() / terms[i] / terms[j]);
    assert!(relative.amax() < 1e-6, "{relative}");
    assert!(filter.eigenvalues.iter().all(|x| x.re < 0.0));
    assert!(filter.current_gain.is_none());
}

/// Prediction and correction alternate 20000 times, up to the steady state of the recursion.
#[test]
fn the_sampled_gains_are_the_limit_of_the_filter_recursion() {
    let a = matrix(2, 2, &[1.0, 0.1, 0.0, 1.0]);
    let c = matrix(1, 2, &[1.0, 0.0]);
    let w = matrix(2, 2, &[1e-4, 2e-4, 2e-4, 5e-3]);
    let v = matrix(1, 1, &[0.04]);
    let filter = kalman(&a, &c, &w, &v, SAMPLED).unwrap();
    let mut p = DMatrix::identity(2, 2);
    let mut current = DMatrix::zeros(2, 1);
    for _ in 0..20_000 {
        current = &p * c.transpose() / (&v + &c * &p * c.transpose())[0];
        let corrected = &p - &current * &c * &p;
        p = &a * corrected * a.transpose() + &w;
    }
    assert!(distance(&filter.covariance, &p) < 1e-12);
    assert!((filter.current_gain.clone().unwrap() - &current).norm() < 1e-12);
    assert!((&filter.gain - &a * current).norm() < 1e-12);
}

/// The cost of a simulated trajectory is x' P x, and any other gain costs more.
#[test]
fn the_cost_is_the_quadratic_form_of_the_solution() {
    let a = matrix(2, 2, &[1.1, 0.3, -0.2, 0.9]);
    let b = matrix(2, 1, &[0.1, 1.0]);
    let n = matrix(2, 1, &[0.2, -0.1]);
    let w = Weights { n: Some(n.clone()), ..identity_weights(2, 1) };
    let computed = lqr(&a, &b, &w, SAMPLED).unwrap();
    let start = matrix(2, 1, &[1.0, -2.0]);
    let cost = |gain: &DMatrix<f64>| {
        let (mut x, mut sum) = (start.clone(), 0.0);
        for _ in 0..2000 {
            let u = gain * &x;
            sum += (x.transpose() * (&w.q * &x + &n * &u * 2.0) + u.transpose() * &w.r * &u)[0];
            x = &a * x + &b * u;
        }
        sum
    };
    let best = cost(&computed.gain);
    let form = (start.transpose() * &computed.p * &start)[0];
    assert!((best / form - 1.0).abs() < 1e-13, "{best} {form}");
    for change in [[0.01, 0.0], [-0.01, 0.0], [0.0, 0.01], [0.0, -0.01]] {
        assert!(cost(&(&computed.gain + matrix(1, 2, &change))) > best);
    }
}
