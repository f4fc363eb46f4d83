//! Proven fractions of tolerances against closed forms, exact limits of single parameters, and random plants.

use crate::matrix;
use crate::recorded::cases;
use control::hold::zero_order_hold;
use control::riccati::{Weights, lqr};
use control::robustness::{
    Block, EntryFamily, Loop, PlantEntry, PlantFamily, ProvenTolerance, Tolerances,
    proven_tolerance, random_deviations, structured_bound, tolerance_test,
};
use control::stability::instability;
use control::{Domain, Error, StateSpace};
use nalgebra::DMatrix;

const RECORDED: &str = include_str!("../data/structured.txt");
const CONTINUOUS: Domain = Domain::Continuous;

/// The proven fraction, with the tolerances `relative` of the entries that are not structural.
fn proven(plant: &StateSpace, controller: &StateSpace, tolerances: &Tolerances) -> ProvenTolerance {
    let family = EntryFamily::new(plant, tolerances).expect("fits");
    let proof = proven_tolerance(&family, controller, 16.0, &|| false);
    proof.expect("no error").expect("a proof")
}

/// An observer with a state feedback, in continuous time.
fn compensator(plant: &StateSpace, k: &DMatrix<f64>, l: &DMatrix<f64>) -> StateSpace {
    let (m, p) = (plant.b.ncols(), plant.c.nrows());
    StateSpace {
        a: &plant.a + &plant.b * k - l * &plant.c,
        b: l.clone(),
        c: k.clone(),
        d: DMatrix::zeros(m, p),
        domain: plant.domain,
    }
}

/// A controller that does nothing.
fn idle(inputs: usize, outputs: usize) -> StateSpace {
    StateSpace {
        a: matrix(1, 1, &[-1.0]),
        b: DMatrix::zeros(1, outputs),
        c: DMatrix::zeros(inputs, 1),
        d: DMatrix::zeros(inputs, outputs),
        domain: CONTINUOUS,
    }
}

/// Whether the loop is stable with these deviations, by its eigenvalues.
fn is_stable(family: &EntryFamily<'_>, controller: &StateSpace, deviations: &[f64]) -> bool {
    let mut plant = family.plant(deviations).expect("a plant");
    if let Domain::Sampled { period } = controller.domain {
        (plant.a, plant.b) = zero_order_hold(&plant.a, &plant.b, period).expect("a plant");
        plant.domain = controller.domain;
    }
    let closed = Loop::new(plant, controller.clone()).expect("a loop");
    instability(&closed.dynamics(), controller.domain).expect("a number") < 0.0
}

/// The least size of the only deviation for which the loop is not stable, by bisection on a fine grid.
fn limit(family: &EntryFamily<'_>, controller: &StateSpace) -> f64 {
    let unstable = |size: f64| {
        !(is_stable(family, controller, &[size]) && is_stable(family, controller, &[-size]))
    };
    let first = (1..16_000).map(|k| 1e-3 * f64::from(k)).find(|size| unstable(*size));
    let (mut low, mut high) = (first.expect("a limit") - 1e-3, first.expect("a limit"));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if unstable(middle) { high = middle } else { low = middle }
    }
    low
}

/// mu of a constant real matrix of rank one is the sum of the moduli of its diagonal, for real numbers too.
#[test]
fn a_constant_matrix_of_rank_one_has_its_closed_form() {
    let (l, r) = ([1.0, -200.0, 0.03, 4.0], [5.0, 0.002, 7.0, -0.3]);
    let exact: f64 = l.iter().zip(&r).map(|(l, r)| f64::abs(l * r)).sum();
    let system = StateSpace {
        a: matrix(1, 1, &[-1.0]),
        b: DMatrix::zeros(1, 4),
        c: DMatrix::zeros(4, 1),
        d: DMatrix::from_fn(4, 4, |i, j| l[i] * r[j]),
        domain: CONTINUOUS,
    };
    for block in [Block::Real(1), Block::Full(1)] {
        for domain in [CONTINUOUS, Domain::Sampled { period: 0.1 }] {
            let mut system = StateSpace { domain, ..system.clone() };
            system.a *= 0.5;
            let actual = structured_bound(&system, &[block; 4], 1e-3, &|| false).expect("a bound");
            let part = actual.expect("in time").upper / exact;
            assert!((1.0..1.02).contains(&part), "{block:?} {domain:?}: {part}");
        }
    }
}

/// x'' + d x' + k x = 0 is stable for d > 0 and k > 0 (Routh, Hurwitz), however little d damps: with relative
/// tolerances t the limit is at the fraction 1 / t of the larger one.
#[test]
fn a_damped_oscillator_is_proven_up_to_the_limit_of_routh_and_hurwitz() {
    for (k, d) in [(1.0, 1.0), (25.0, 0.1), (1e4, 2.0), (1e-3, 3.0)] {
        for [of_k, of_d] in [[0.1, 0.5], [0.5, 0.1], [0.2, 0.2]] {
            let plant = StateSpace {
                a: matrix(2, 2, &[0.0, 1.0, -k, -d]),
                b: matrix(2, 1, &[0.0, 1.0]),
                c: matrix(1, 2, &[1.0, 0.0]),
                d: matrix(1, 1, &[0.0]),
                domain: CONTINUOUS,
            };
            let mut tolerances = Tolerances::unless_structural(&plant, [0.0; 4]);
            (tolerances.of[0][(1, 0)], tolerances.of[0][(1, 1)]) = (of_k, of_d);
            let actual = proven(&plant, &idle(1, 1), &tolerances);
            let part = actual.fraction * f64::max(of_k, of_d);
            // Where both vanish together, the best scales are beyond all bounds.
            let least = if of_k.to_bits() == of_d.to_bits() { 0.75 } else { 0.97 };
            assert!((least..1.0).contains(&part), "{k} {d} {of_k} {of_d}: {part} {actual:?}");
            assert_eq!((actual.deviations, actual.channels), (2, 2));
        }
    }
}

/// The benchmark of two masses and a spring: force on the first, position of the second (B. Wie and D. S. Bernstein,
/// Benchmark problems for robust control design, J. Guidance, Control, and Dynamics 15 (1992)), with the spring k as
/// nominal value.
fn two_masses(k: f64) -> StateSpace {
    StateSpace {
        a: matrix(
            4,
            4,
            &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -k, k, 0.0, 0.0, k, -k, 0.0, 0.0],
        ),
        b: matrix(4, 1, &[0.0, 0.0, 1.0, 0.0]),
        c: matrix(1, 4, &[0.0, 1.0, 0.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain: CONTINUOUS,
    }
}

/// The four entries of the spring: one parameter of rank one.
fn spring(plant: &StateSpace, relative: f64) -> Tolerances {
    let entry = |row, column| PlantEntry { matrix: 0, row, column };
    let mut tolerances = Tolerances::unless_structural(plant, [0.0; 4]);
    let entries = vec![entry(2, 0), entry(2, 1), entry(3, 0), entry(3, 1)];
    for PlantEntry { row, column, .. } in &entries {
        tolerances.of[0][(*row, *column)] = relative;
    }
    tolerances.common.push(entries);
    tolerances
}

/// The controller of the linear-quadratic regulator and the Kalman filter with unit weights, in the domain of `plant`.
fn quadratic(plant: &StateSpace, price: f64) -> StateSpace {
    let (n, m) = plant.b.shape();
    let unit = |size: usize| DMatrix::identity(size, size);
    let weights = |size| Weights { q: unit(n), r: unit(size) * price, n: None };
    let k = lqr(&plant.a, &plant.b, &weights(m), plant.domain).expect("a regulator").gain;
    let dual = (plant.a.transpose(), plant.c.transpose());
    let filter = lqr(&dual.0, &dual.1, &weights(plant.c.nrows()), plant.domain);
    compensator(plant, &k, &-filter.expect("a filter").gain.transpose())
}

/// For one parameter the bound by D and G is exact; the limit of the spring is found by eigenvalues on a fine grid.
#[test]
fn the_spring_of_the_two_mass_benchmark_is_proven_up_to_its_limit() {
    for price in [0.1, 1.0, 10.0] {
        let plant = two_masses(1.25);
        let controller = quadratic(&plant, price);
        let tolerances = spring(&plant, 0.1);
        let actual = proven(&plant, &controller, &tolerances);
        let exact = limit(&EntryFamily::new(&plant, &tolerances).expect("fits"), &controller);
        assert_eq!((actual.deviations, actual.channels), (1, 1), "four entries of rank one");
        let part = actual.fraction / exact.min(16.0);
        assert!((0.97..1.0).contains(&part), "{price}: {actual:?} {exact}");
    }
}

/// With one or two varying entries of a plant under a sampled controller, whose exponential is nonlinear in them.
#[test]
fn a_sampled_loop_is_proven_up_to_its_limit() {
    for period in [0.05, 0.3, 0.8] {
        let plant = two_masses(1.25);
        let (a, b) = zero_order_hold(&plant.a, &plant.b, period).expect("a plant");
        let domain = Domain::Sampled { period };
        let controller = quadratic(&StateSpace { a, b, domain, ..plant.clone() }, 1.0);
        let tolerances = spring(&plant, 0.1);
        let actual = proven(&plant, &controller, &tolerances);
        let exact = limit(&EntryFamily::new(&plant, &tolerances).expect("fits"), &controller);
        let part = actual.fraction / exact.min(16.0);
        assert!((0.9..1.0).contains(&part), "{period}: {actual:?} {exact}");
    }
}

/// Numbers in -1 to 1, the same in every run.
fn numbers(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let count = u32::try_from(rows * columns).expect("few");
    let values = random_deviations(1, count, seed).concat();
    DMatrix::from_vec(rows, columns, values)
}

/// What is proven is less than what is found unstable, and no random plant within it, its vertices included, is
/// unstable, in 50 loops of random plants.
#[test]
fn no_plant_within_the_proven_fraction_is_unstable() {
    let mut parts = Vec::new();
    for seed in 0..50 {
        // A sampled loop has two channels for each entry.
        let n = if seed % 2 == 0 { 2 + seed % 3 } else { 2 + seed / 2 % 2 };
        let (m, p) = (1 + seed / 4 % 2, 1 + seed / 8 % 2);
        let at = |k: u64| 10 * u64::try_from(seed).expect("small") + k;
        let plant = StateSpace {
            a: numbers(n, n, at(1)) * 2.0,
            b: numbers(n, m, at(2)),
            c: numbers(p, n, at(3)),
            d: DMatrix::zeros(p, m),
            domain: CONTINUOUS,
        };
        let domain = if seed % 2 == 0 { CONTINUOUS } else { Domain::Sampled { period: 0.1 } };
        let model = match domain {
            Domain::Continuous => plant.clone(),
            Domain::Sampled { period } => {
                let (a, b) = zero_order_hold(&plant.a, &plant.b, period).expect("a plant");
                StateSpace { a, b, domain, ..plant.clone() }
            }
        };
        let controller = quadratic(&model, 1.0);
        let tolerances = Tolerances::unless_structural(&plant, [0.05; 4]);
        let actual = proven(&plant, &controller, &tolerances);
        let family = EntryFamily::new(&plant, &tolerances).expect("fits");
        let tested = tolerance_test(&family, &controller, 50, 3).expect("a test");
        let first = tested.first_unstable.unwrap_or(16.0);
        assert!(actual.fraction <= first, "{seed}: {actual:?} {first}");
        parts.push(actual.fraction / first);
        for case in random_deviations(family.count(), 100, at(4)) {
            let vertex: Vec<f64> = case.iter().map(|part| part.signum()).collect();
            for deviations in [case, vertex] {
                let inside: Vec<f64> = deviations.iter().map(|d| d * actual.fraction).collect();
                assert!(is_stable(&family, &controller, &inside), "{seed} {actual:?}");
            }
        }
    }
    parts.sort_by(f64::total_cmp);
    // The proof is worth having: in half of the loops it reaches this part of the least instability found.
    assert!(parts[25] > 0.6, "{parts:?}");
}

/// Entries of a stable state that nothing measures do not act on the loop: their channels have scales of another size.
#[test]
fn a_state_that_nothing_measures_leaves_the_proof_true() {
    for (price, coupling) in [(1.0, 300.0), (0.1, 300.0), (1e-3, 20.0), (1e-4, 1.0)] {
        let plant = StateSpace {
            a: matrix(3, 3, &[-30.0, 0.0, 0.0, 1.0, 6.0, 0.0, 0.0, coupling, -20.0]),
            b: matrix(3, 1, &[30.0, 0.0, 0.0]),
            c: matrix(1, 3, &[0.0, 1.0, 0.0]),
            d: DMatrix::zeros(1, 1),
            domain: CONTINUOUS,
        };
        let controller = quadratic(&plant, price);
        let tolerances = Tolerances::unless_structural(&plant, [0.1; 4]);
        let actual = proven(&plant, &controller, &tolerances);
        let family = EntryFamily::new(&plant, &tolerances).expect("fits");
        let vertex = |size: f64| [size, -size, size, -size, -size, -size];
        let is_stable = |size| is_stable(&family, &controller, &vertex(size));
        assert!(is_stable(actual.fraction), "{actual:?}");
        assert!(!is_stable(1.01 * actual.fraction), "{actual:?}");
    }
}

#[test]
fn an_unstable_loop_and_blocks_that_do_not_fit_are_refused() {
    let system = |pole: f64| StateSpace {
        a: matrix(1, 1, &[pole]),
        b: matrix(1, 1, &[1.0]),
        c: matrix(1, 1, &[1.0]),
        d: matrix(1, 1, &[0.0]),
        domain: CONTINUOUS,
    };
    let bound = |pole, blocks: &[Block]| structured_bound(&system(pole), blocks, 1e-3, &|| false);
    assert!(matches!(bound(0.5, &[Block::Real(1)]), Err(Error::NotHurwitz { .. })));
    assert!(matches!(bound(-0.5, &[Block::Real(2)]), Err(Error::Shape { .. })));
    let ended = structured_bound(&system(-0.5), &[Block::Real(1)], 1e-3, &|| true);
    assert_eq!(ended.expect("no error"), None);
    let bound = bound(-0.5, &[Block::Real(1)]).expect("a bound").expect("in time");
    assert!((1.0..1.02).contains(&(bound.upper / 2.0)), "{bound:?}");
}

/// Between a grid that SLICOT refined about its maximum and the whole axis there is no difference but the widths of both.
#[test]
fn the_bound_over_all_frequencies_is_the_peak_of_slicot() {
    for case in cases(RECORDED, "system") {
        let [a, b, c] = ["A", "B", "C"].map(|name| case.get(name).clone());
        let d = DMatrix::zeros(c.nrows(), b.ncols());
        let system = StateSpace { a, b, c, d, domain: CONTINUOUS };
        let blocks: Vec<Block> = case
            .get("kinds")
            .iter()
            .map(|kind| if *kind < 1.5 { Block::Real(1) } else { Block::Full(1) })
            .collect();
        let actual = structured_bound(&system, &blocks, 1e-3, &|| false).expect("a bound");
        let part = actual.expect("in time").upper / case.number("peak");
        assert!((0.995..1.02).contains(&part), "{}: {actual:?} {part}", case.name);
    }
}

/// Two inertias and an elastic shaft, with entries and frequencies of very different sizes: examples/plants/two-mass-drive.toml.
#[test]
#[expect(clippy::unreadable_literal, reason = "the digits of the design")]
fn a_stiff_drive_is_proven_to_near_the_instability_that_is_found() {
    let (motor, load, (k, c)) = (0.0019, 0.003, (50.0, 0.02));
    let plant = StateSpace {
        a: matrix(
            5,
            5,
            &[
                0.0,
                1.0,
                0.0,
                0.0,
                0.0,
                -k / motor,
                -c / motor,
                k / motor,
                c / motor,
                1.0 / motor,
                0.0,
                0.0,
                0.0,
                1.0,
                0.0,
                k / load,
                c / load,
                -k / load,
                -c / load,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                -1000.0,
            ],
        ),
        b: matrix(5, 1, &[0.0, 0.0, 0.0, 0.0, 1000.0]),
        c: matrix(1, 5, &[1.0, 0.0, 0.0, 0.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        domain: CONTINUOUS,
    };
    // The observer has one more state, a constant torque that is compensated.
    let k_x = matrix(
        1,
        6,
        &[
            21.097402283415235,
            -0.4027483040935672,
            -27.379258283415226,
            0.1416839264935668,
            -0.07280701754385985,
            -1.0,
        ],
    );
    let l = matrix(
        6,
        1,
        &[
            2982.8070175438606,
            3143234.1951369694,
            -44883.33522992294,
            14038063.128558446,
            5106635.643564357,
            5078700.0,
        ],
    );
    let mut extended = plant.a.clone().resize(6, 6, 0.0);
    extended[(4, 5)] = 1000.0;
    let (b, c) =
        (plant.b.clone().resize_vertically(6, 0.0), plant.c.clone().resize_horizontally(6, 0.0));
    let controller = StateSpace {
        a: extended + b * &k_x - &l * c,
        b: l,
        c: k_x,
        d: matrix(1, 1, &[0.0]),
        domain: CONTINUOUS,
    };
    let tolerances = Tolerances::unless_structural(&plant, [0.1; 4]);
    let family = EntryFamily::new(&plant, &tolerances).expect("fits");
    for most in [16.0, 0.922_669_4] {
        let actual = proven_tolerance(&family, &controller, most, &|| false);
        let actual = actual.expect("no error").expect("a proof");
        assert!((0.8..0.923).contains(&actual.fraction), "{most}: {actual:?}");
    }
}

/// For a sampled loop the fraction is halved until a bound exists, which never ends from infinity.
#[test]
fn a_largest_fraction_that_is_not_finite_and_above_zero_is_refused() {
    let one = |value| matrix(1, 1, &[value]);
    let plant =
        StateSpace { a: one(-1.0), b: one(1.0), c: one(1.0), d: one(0.0), domain: CONTINUOUS };
    let tolerances = Tolerances { of: [0.1, 0.0, 0.0, 0.0].map(one), common: Vec::new() };
    let family = EntryFamily::new(&plant, &tolerances).expect("fits");
    for domain in [CONTINUOUS, Domain::Sampled { period: 0.1 }] {
        let controller = StateSpace { domain, a: one(-0.5), ..idle(1, 1) };
        for most in [f64::INFINITY, f64::NAN, 0.0] {
            let refused = proven_tolerance(&family, &controller, most, &|| false);
            assert!(matches!(refused, Err(Error::OutOfRange { name: "most", .. })), "{refused:?}");
        }
    }
}
