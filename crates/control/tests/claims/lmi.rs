use crate::matrix;
use crate::paper::{CONTROLLER_POLES, OBSERVER_POLES, plant};
use crate::recorded::{Case, cases};
use control::eigen::eigenvalues;
use control::lmi::{
    Affine, Disc, Norm, Outcome, Performance, Problem, Region, certify_gain, certify_region,
    feedback_norm_lower_bound, observer_gain, state_feedback,
};
use control::placement::real_poles;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;
use std::f64::consts::FRAC_PI_4;

const DATA: &str = include_str!("../data/lmi.txt");
const SAMPLED: Domain = Domain::Sampled { period: 0.1 };

fn one(value: f64) -> DMatrix<f64> {
    matrix(1, 1, &[value])
}

fn decay(alpha: f64) -> Region {
    Region { decay: Some(alpha), ..Region::default() }
}

fn disc(center: f64, radius: f64) -> Region {
    Region { disc: Some(Disc { center, radius }), ..Region::default() }
}

/// Names of the requirements in conflict.
fn conflict<T: std::fmt::Debug>(outcome: Result<Outcome<T>, Error>) -> Vec<&'static str> {
    match outcome.expect("good arguments") {
        Outcome::Infeasible { conflict } => conflict,
        other => panic!("{other:?}"),
    }
}

fn optimal<T: std::fmt::Debug>(outcome: Result<Outcome<T>, Error>) -> T {
    match outcome.expect("good arguments") {
        Outcome::Optimal(answer) => answer,
        other => panic!("{other:?}"),
    }
}

/// Smallest eigenvalue of S scaled to a diagonal of ones.
fn smallest(s: &DMatrix<f64>) -> f64 {
    let root = s.diagonal().map(f64::sqrt);
    let scaled = DMatrix::from_fn(s.nrows(), s.ncols(), |i, j| s[(i, j)] / (root[i] * root[j]));
    scaled.symmetric_eigenvalues().min()
}

fn assert_inside(a: &DMatrix<f64>, Disc { center, radius }: Disc) {
    for value in eigenvalues(a).expect("eigenvalues") {
        assert!((value - center).norm() < radius, "{value}");
    }
}

#[test]
fn a_conflict_is_named_without_the_requirements_that_take_no_part() {
    let mut problem = Problem::new();
    let (x, y) = (problem.scalar(), problem.scalar());
    problem.require("x is small", &(&Affine::identity(1, 1.0) - &x), 1e-7);
    problem.require("y is above two", &(&y - &Affine::identity(1, 2.0)), 1e-7);
    problem.require("x exceeds y", &(&x - &y), 1e-7);
    problem.require("y is below nine", &(&Affine::identity(1, 9.0) - &y), 1e-7);
    problem.minimise(&x);
    let expected = ["x is small", "y is above two", "x exceeds y"];
    assert_eq!(conflict(problem.solve()), expected);
}

#[test]
fn a_matrix_that_is_zero_does_not_meet_a_margin() {
    let mut problem = Problem::new();
    problem.require("zero", &Affine::zeros(1, 1), 1.0);
    assert_eq!(conflict(problem.solve()), ["zero"]);
}

/// The smallest trace of X with [X, M; M', I] semidefinite belongs to X = M M'.
#[test]
fn the_smallest_matrix_above_a_square_is_the_square() {
    let m = crate::integers(3, 2, |i, j| (3 * i + 5 * j + i * j) % 7 - 3);
    let mut problem = Problem::new();
    let x = problem.symmetric(3);
    let known = Affine::constant(&m);
    let whole = Affine::blocks(&[&[&x, &known], &[&known.transpose(), &Affine::identity(2, 1.0)]]);
    problem.require("above", &whole, 1e-7);
    let entry = |k: usize| {
        let row = DMatrix::from_fn(1, 3, |_, col| if col == k { 1.0 } else { 0.0 });
        &row * &(&x * &row.transpose())
    };
    problem.minimise(&(&(&entry(0) + &entry(1)) + &entry(2)));
    let solution = optimal(problem.solve());
    assert!((solution.value(&x) - &m * m.transpose()).amax() < 1e-5);
    assert!(solution.margins[0].1 >= 0.5e-7);
}

/// For each kind of region, the eigenvalues of the inequality with the certificate P.
#[test]
fn certificates_of_regions_satisfy_their_inequalities() {
    let a = matrix(3, 3, &[-2., 3., 0., -3., -2., 1., 0., 0., -5.]);
    let scaled = |p: &DMatrix<f64>| p * &a;
    let p = optimal(certify_region(&a, &decay(1.9), Domain::Continuous)).p;
    let left = scaled(&p) + scaled(&p).transpose() + &p * 3.8;
    assert!(smallest(&p) > 0.0 && smallest(&-left) > 0.0);

    let p = optimal(certify_region(&a, &disc(-4.0, 4.0), Domain::Continuous)).p;
    let moved = scaled(&p) + &p * 4.0;
    let mut whole = DMatrix::zeros(6, 6);
    whole.view_mut((0, 0), (3, 3)).copy_from(&(&p * 4.0));
    whole.view_mut((3, 3), (3, 3)).copy_from(&(&p * 4.0));
    whole.view_mut((0, 3), (3, 3)).copy_from(&moved);
    whole.view_mut((3, 0), (3, 3)).copy_from(&moved.transpose());
    assert!(smallest(&whole) > 0.0);
}

/// -3 +- 4i: decay 3, modulus 5, angle atan(4/3).
#[test]
fn regions_are_certified_up_to_the_eigenvalues_and_not_beyond() {
    let a = matrix(2, 2, &[0., 1., -25., -6.]);
    let angle = (4.0_f64 / 3.0).atan();
    let sector = |angle| Region { sector: Some(angle), ..Region::default() };
    let cases = [
        (decay(2.999), decay(3.001), "decay"),
        (disc(0.0, 5.001), disc(0.0, 4.999), "disc"),
        (sector(angle + 1e-4), sector(angle - 1e-4), "sector"),
    ];
    for (inside, outside, name) in cases {
        assert!(optimal(certify_region(&a, &inside, Domain::Continuous)).margin > 0.0);
        assert_eq!(conflict(certify_region(&a, &outside, Domain::Continuous)), [name]);
    }
    let all = Region { decay: Some(3.5), disc: disc(0.0, 6.0).disc, sector: Some(FRAC_PI_4) };
    assert_eq!(conflict(certify_region(&a, &all, Domain::Continuous)), ["decay", "sector"]);
}

/// 0.6 +- 0.3i has the modulus 0.6708, a decay rate of 3.99 at a period of 0.1.
#[test]
fn regions_of_sampled_systems_are_discs_and_decay_per_period() {
    let a = matrix(2, 2, &[0.6, 0.3, -0.3, 0.6]);
    let limit = -0.45_f64.sqrt().ln() / 0.1;
    assert!(optimal(certify_region(&a, &decay(limit - 1e-3), SAMPLED)).margin > 0.0);
    assert_eq!(conflict(certify_region(&a, &decay(limit + 1e-3), SAMPLED)), ["decay"]);
    assert!(optimal(certify_region(&a, &disc(0.6, 0.301), SAMPLED)).margin > 0.0);
    let nothing = Region::default();
    assert_eq!(conflict(certify_region(&(a * 2.0), &nothing, SAMPLED)), ["stability"]);
    let sector = Region { sector: Some(1.0), ..Region::default() };
    let refused = certify_region(&one(0.5), &sector, SAMPLED);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "sector", .. })));
}

fn system(case: &Case, domain: Domain) -> StateSpace {
    let get = |name| case.get(name).clone();
    StateSpace { a: get("A"), b: get("B"), c: get("C"), d: get("D"), domain }
}

/// The bound is above the norm that another method finds, and close to it.
fn assert_bounds(case: &Case, domain: Domain) {
    let names = [
        ("infinity", Norm::HInfinity),
        ("peak", Norm::EnergyToPeak),
        ("impulse", Norm::ImpulseToEnergy),
    ];
    for (name, norm) in names {
        let bound = optimal(certify_gain(&system(case, domain), norm));
        let ratio = bound.gamma / case.number(name);
        assert!(ratio > 1.0 - 1e-9 && ratio < 1.002, "{} {name}: {ratio}", case.name);
        assert!(bound.margin > 0.0 && smallest(&bound.p) > 0.0);
    }
}

#[test]
fn bounds_of_gains_are_just_above_those_of_hamiltonians_and_lyapunov_equations() {
    for case in cases(DATA, "norms") {
        assert_bounds(&case, Domain::Continuous);
    }
}

#[test]
fn bounds_of_gains_of_sampled_systems_lie_just_above_the_norms() {
    for case in cases(DATA, "sampled norms") {
        assert_bounds(&case, SAMPLED);
    }
}

/// 1 / (s^2 + 2 d s + 1) has the largest gain 1 / (2 d sqrt(1 - d^2)).
#[test]
fn the_resonance_of_an_oscillator_is_bounded_tightly() {
    for damping in [0.5, 0.1, 0.01] {
        let a = matrix(2, 2, &[0., 1., -1., -2.0 * damping]);
        let (b, c) = (matrix(2, 1, &[0., 1.]), matrix(1, 2, &[1., 0.]));
        let system = StateSpace { a, b, c, d: one(0.0), domain: Domain::Continuous };
        let bound = optimal(certify_gain(&system, Norm::HInfinity));
        let exact = 0.5 / (damping * (1.0 - damping * damping).sqrt());
        assert!(bound.gamma > exact && bound.gamma < 1.001 * exact, "{} {exact}", bound.gamma);
    }
}

/// 1 / z^2, whose eigenvalues are all zero, has the norm 1.
#[test]
fn a_delay_of_two_samples_is_proven() {
    let a = matrix(2, 2, &[0., 1., 0., 0.]);
    let (b, c) = (matrix(2, 1, &[0., 1.]), matrix(1, 2, &[1., 0.]));
    assert!(optimal(certify_region(&a, &Region::default(), SAMPLED)).margin > 0.0);
    let system = StateSpace { a, b, c, d: one(0.0), domain: SAMPLED };
    let bound = optimal(certify_gain(&system, Norm::HInfinity)).gamma;
    assert!(bound > 1.0 && bound < 1.001, "{bound}");
}

/// e / ((s + 1) (s + 2)) has the H-infinity norm e / 2. Its energy to peak is the root of the integral of
/// e^2 (exp(-t) - exp(-2 t))^2, e / sqrt(12).
#[test]
fn weak_gains_between_states_are_bounded_tightly() {
    for e in [1e-4, 1e-6, 1e-8] {
        let a = matrix(2, 2, &[-1., 0., e, -2.]);
        let (b, c) = (matrix(2, 1, &[1., 0.]), matrix(1, 2, &[0., 1.]));
        let system = StateSpace { a, b, c, d: one(0.0), domain: Domain::Continuous };
        for (norm, exact) in [(Norm::HInfinity, 0.5 * e), (Norm::EnergyToPeak, e / 12.0_f64.sqrt())]
        {
            let ratio = optimal(certify_gain(&system, norm)).gamma / exact;
            assert!(ratio > 1.0 && ratio < 1.001, "{e:e} {norm:?}: {ratio}");
        }
    }
}

#[test]
fn an_unstable_system_has_no_bound() {
    let system = StateSpace {
        a: one(0.1),
        b: one(1.0),
        c: one(1.0),
        d: one(0.0),
        domain: Domain::Continuous,
    };
    let actual = certify_gain(&system, Norm::HInfinity);
    assert_eq!(conflict(actual), ["stability"]);
}

fn wish(case: &Case, norm: Norm, gamma: Option<f64>) -> Performance {
    let get = |name| case.get(name).clone();
    Performance {
        disturbance: get("disturbance"),
        output: get("output"),
        feedthrough: get("feed"),
        norm,
        gamma,
    }
}

/// Tolerance: the 5 % that the design allows, and the error of the reference.
#[test]
fn state_feedback_is_close_to_the_best_bound_of_other_methods() {
    let nothing = Region::default();
    for case in cases(DATA, "feedback") {
        let (a, b) = (case.get("A"), case.get("B"));
        let kinds = [
            ("infinity", Norm::HInfinity, nothing, Domain::Continuous),
            ("peak", Norm::EnergyToPeak, nothing, Domain::Continuous),
            ("sampled", Norm::HInfinity, nothing, SAMPLED),
            ("disc", Norm::HInfinity, disc(-3.0, 2.0), Domain::Continuous),
        ];
        for (name, norm, region, domain) in kinds {
            let actual =
                optimal(state_feedback(a, b, &region, Some(&wish(&case, norm, None)), domain));
            let gamma = actual.bound.unwrap().gamma;
            assert!(gamma < 1.06 * case.number(name), "{} {name}: {gamma}", case.name);
            // The reference uses one P for region and bound, which is conservative for the disc.
            let least = if name == "disc" { "infinity" } else { name };
            assert!(gamma > 0.999 * case.number(least), "{} {name}: {gamma}", case.name);
            if let Some(disc) = region.disc {
                assert_inside(&(a + b * actual.gain), disc);
            }
        }
    }
}

#[test]
fn a_bound_below_the_best_is_a_conflict_and_one_above_it_is_kept() {
    let case = &cases(DATA, "feedback")[0];
    let (a, b) = (case.get("A"), case.get("B"));
    let best = case.number("infinity");
    let design = |part: f64, region: &Region| {
        let required = wish(case, Norm::HInfinity, Some(best * part));
        state_feedback(a, b, region, Some(&required), Domain::Continuous)
    };
    let actual = optimal(design(1.2, &Region::default()));
    assert!(actual.bound.unwrap().gamma <= 1.2 * best);
    assert_eq!(conflict(design(0.9, &Region::default())), ["gain"]);
    assert_eq!(conflict(design(1.1, &disc(-3.0, 2.0))), ["disc", "gain"]);
}

#[test]
fn regions_without_a_common_point_are_a_conflict() {
    let a = matrix(2, 2, &[0., 1., 0., 0.]);
    let c = matrix(1, 2, &[1., 0.]);
    let region = Region { decay: Some(3.0), disc: disc(-1.0, 1.0).disc, sector: Some(FRAC_PI_4) };
    let actual = observer_gain(&a, &c, &region, None, Domain::Continuous);
    assert_eq!(conflict(actual), ["decay", "disc"]);
    let region = Region { decay: Some(10.0), disc: disc(0.9, 0.05).disc, sector: None };
    assert_eq!(conflict(observer_gain(&a, &c, &region, None, SAMPLED)), ["decay", "disc"]);
}

/// The second state, with the eigenvalue -1, is not measured.
#[test]
fn an_uncontrollable_eigenvalue_outside_of_the_region_is_a_conflict() {
    let a = matrix(2, 2, &[1., 0., 0., -1.]);
    let c = matrix(1, 2, &[1., 0.]);
    assert_eq!(conflict(observer_gain(&a, &c, &decay(2.0), None, Domain::Continuous)), ["decay"]);
    let actual = optimal(observer_gain(&a, &c, &decay(0.9), None, Domain::Continuous));
    assert!(eigenvalues(&(a - actual.gain * c)).unwrap().iter().all(|value| value.re < -0.9));
}

#[test]
fn intersections_of_regions_are_reached_by_feedback_and_by_observer() {
    let a = matrix(3, 3, &[0., 1., 0., 0., 0., 1., 2., -1., 1.]);
    let b = matrix(3, 2, &[0., 1., 0., 0., 1., 1.]);
    let region = Region { decay: Some(1.0), disc: disc(-3.0, 3.0).disc, sector: Some(FRAC_PI_4) };
    let k = optimal(state_feedback(&a, &b, &region, None, Domain::Continuous)).gain;
    let l = optimal(observer_gain(&a, &b.transpose(), &region, None, Domain::Continuous)).gain;
    for closed in [&a + &b * k, &a - l * b.transpose()] {
        for value in eigenvalues(&closed).unwrap() {
            let inside = value.re < -1.0 && (value + 3.0).norm() < 3.0;
            assert!(inside && value.im.abs() < -value.re, "{value}");
        }
    }
}

/// Sampled double integrator with a constant disturbance, its position measured.
#[test]
fn the_eigenvalues_of_a_sampled_observer_are_in_its_disc() {
    let (t, half) = (0.1, 0.005);
    let a = matrix(3, 3, &[1., t, half, 0., 1., t, 0., 0., 1.]);
    let c = matrix(1, 3, &[1., 0., 0.]);
    let region = disc(0.5, 0.3);
    let l = optimal(observer_gain(&a, &c, &region, None, SAMPLED)).gain;
    assert_inside(&(a - l * c), Disc { center: 0.5, radius: 0.3 });
}

/// From the fault rate to [e; eps].
fn fault_rate(norm: Norm, gamma: Option<f64>) -> Performance {
    let mut disturbance = DMatrix::zeros(5, 1);
    disturbance[4] = -1.0;
    let (output, feedthrough) = (DMatrix::identity(5, 5), DMatrix::zeros(2, 1));
    Performance { disturbance, output, feedthrough, norm, gamma }
}

/// The observer of the paper in its own units: eigenvalues around -2100, entries from 1 to 1e9. The
/// gain from the fault rate is smaller than with the paper's eigenvalues.
#[test]
fn the_observer_of_the_paper_is_designed_by_inequalities() {
    let plant = plant();
    let (a_0, c_0) = (plant.augmented_dynamics(), plant.augmented_output());
    let region = disc(-2100.0, 1000.0);
    let placed = control::aso::design(
        &plant,
        &real_poles(&CONTROLLER_POLES),
        &real_poles(&OBSERVER_POLES),
        None,
    )
    .unwrap();
    let placed = placed.gains.error_dynamics(&plant);
    assert!(optimal(certify_region(&placed, &region, Domain::Continuous)).margin > 0.0);
    for norm in [Norm::HInfinity, Norm::EnergyToPeak] {
        let required = fault_rate(norm, None);
        let actual = observer_gain(&a_0, &c_0, &region, Some(&required), Domain::Continuous);
        let actual = optimal(actual);
        assert_inside(&(&a_0 - &actual.gain * &c_0), region.disc.unwrap());
        let (b, c) = (required.disturbance, required.output);
        let system = StateSpace {
            a: placed.clone(),
            b,
            c,
            d: DMatrix::zeros(5, 1),
            domain: Domain::Continuous,
        };
        let before = optimal(certify_gain(&system, norm));
        assert!(actual.bound.unwrap().gamma < before.gamma);
    }
    let impossible = fault_rate(Norm::HInfinity, Some(1e-4));
    let actual = observer_gain(&a_0, &c_0, &region, Some(&impossible), Domain::Continuous);
    assert_eq!(conflict(actual), ["disc", "gain"]);
}

#[test]
fn bad_arguments_are_refused_by_name() {
    let (a, c) = (matrix(2, 2, &[0., 1., 0., 0.]), matrix(1, 2, &[1., 0.]));
    let region = decay(1.0);
    let refused = observer_gain(&a, &a.columns(0, 1).into(), &region, None, Domain::Continuous);
    assert!(matches!(refused, Err(Error::Shape { matrix: "C", expected: (2, 2), .. })));
    for (wrong, name) in [
        (decay(-1.0), "decay"),
        (disc(f64::NAN, 1.0), "disc center"),
        (disc(0.0, 0.0), "disc radius"),
    ] {
        let refused = observer_gain(&a, &c, &wrong, None, Domain::Continuous);
        assert!(matches!(refused, Err(Error::OutOfRange { name: actual, .. }) if actual == name));
    }
    let required = Performance {
        disturbance: DMatrix::zeros(2, 1),
        output: DMatrix::zeros(1, 3),
        feedthrough: DMatrix::zeros(1, 1),
        norm: Norm::HInfinity,
        gamma: None,
    };
    let refused = observer_gain(&a, &c, &region, Some(&required), Domain::Continuous);
    assert!(matches!(refused, Err(Error::Shape { matrix: "output", .. })));
    let refused = feedback_norm_lower_bound(&a, &c, &required, Domain::Continuous);
    assert!(matches!(refused, Err(Error::Shape { matrix: "B", expected: (2, 2), .. })));
    let system =
        StateSpace { a: a.clone(), b: c.transpose(), c, d: one(1.0), domain: Domain::Continuous };
    let refused = certify_gain(&system, Norm::EnergyToPeak);
    assert!(matches!(refused, Err(Error::OutOfRange { name: "D", .. })));
}

/// One output, five states coupled at random, eigenvalues a thousand times faster than the plant's: the
/// observer exists, but rounding its gain moves the eigenvalues out of the disc.
#[test]
fn rounding_errors_do_not_give_a_conflict() {
    let a = crate::integers(5, 5, |i, j| (7 * i * i + 3 * j + 5 * i * j) % 11 - 5);
    let c = crate::integers(1, 5, |_, j| (3 * j) % 5 - 1);
    let actual = observer_gain(&a, &c, &disc(-20000.0, 2000.0), None, Domain::Continuous).unwrap();
    assert!(matches!(actual, Outcome::Inconclusive(_)), "{actual:?}");
}
