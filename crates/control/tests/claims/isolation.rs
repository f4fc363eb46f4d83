//! Residuals that isolate faults: decoupling by evaluated transfer functions, textbook examples, two case studies.

#[path = "../../examples/fault_detection/actuators.rs"]
mod actuators;
#[cfg(feature = "lmi")]
#[path = "../../examples/fault_detection/sensors.rs"]
mod sensors;

use crate::matrix;
use control::isolation::{
    DisturbedPlant, Requirements, Residual, achievable_patterns, residual_generator, structure,
};
use control::response::frequency_response;
use control::{Domain, Error, StateSpace};
use nalgebra::{Complex, DMatrix, DVector};

type ComplexMatrix = DMatrix<Complex<f64>>;

/// Numbers in -1 to 1 without a pattern, the same in every run.
fn scattered(rows: usize, cols: usize, seed: &mut u64) -> DMatrix<f64> {
    DMatrix::from_fn(rows, cols, |_, _| {
        *seed =
            seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(*seed >> 40).expect("24 bits")) / f64::from(1 << 23) - 1.0
    })
}

/// Eight states, two commands, one disturbance, three actuator and sensor faults, four measurements.
fn plant(domain: Domain) -> DisturbedPlant {
    let mut seed = 18;
    let a = scattered(8, 8, &mut seed);
    let a = if domain == Domain::Continuous { a * 3.0 } else { a * 0.4 };
    let b_u = scattered(8, 2, &mut seed);
    let d_u = scattered(4, 2, &mut seed);
    let mut d_f = d_u.clone().resize_horizontally(3, 0.0);
    d_f[(1, 2)] = 1.0;
    let b_f = b_u.clone().resize_horizontally(3, 0.0);
    DisturbedPlant {
        a,
        b_f,
        b_u,
        b_d: scattered(8, 1, &mut seed),
        c: scattered(4, 8, &mut seed),
        d_u,
        d_d: DMatrix::zeros(4, 1),
        d_f,
        domain,
    }
}

/// The transfer matrix of {a, b, c, d} at one frequency.
fn transfer([a, b, c, d]: [&DMatrix<f64>; 4], domain: Domain, frequency: f64) -> ComplexMatrix {
    if a.is_empty() {
        return d.map(|entry| Complex::new(entry, 0.0));
    }
    let (a, b, c, d) = (a.clone(), b.clone(), c.clone(), d.clone());
    let system = StateSpace { a, b, c, d, domain };
    frequency_response(&system, &[frequency]).expect("no pole").remove(0).gain
}

/// Responses of the residual to [u; d] and to f by products of transfer matrices: Q [G; I].
fn responses(plant: &DisturbedPlant, residual: &Residual, frequency: f64) -> [ComplexMatrix; 2] {
    let q = residual.generator.system();
    let q = transfer([&q.a, &q.b, &q.c, &q.d], plant.domain, frequency);
    let m = plant.b_u.ncols();
    let (q_u, q_y) = (q.columns(0, m), q.columns(m, plant.c.nrows()));
    let g = |b, d| transfer([&plant.a, b, &plant.c, d], plant.domain, frequency);
    let to_u = q_y * g(&plant.b_u, &plant.d_u) + q_u;
    let to_d = if plant.b_d.ncols() > 0 {
        q_y * g(&plant.b_d, &plant.d_d)
    } else {
        ComplexMatrix::zeros(1, 0)
    };
    let mut known = to_u.clone().resize_horizontally(m + to_d.ncols(), Complex::new(0.0, 0.0));
    known.columns_mut(m, to_d.ncols()).copy_from(&to_d);
    [known, q_y * g(&plant.b_f, &plant.d_f)]
}

fn requirements(domain: Domain) -> Requirements {
    let poles = match domain {
        Domain::Continuous => vec![-2.0, -3.0, -3.0, -4.0],
        Domain::Sampled { .. } => vec![0.5, 0.6, 0.6],
    };
    Requirements { poles, ..Requirements::with_pole(-1.0) }
}

#[test]
fn residuals_are_decoupled_by_transfer_functions_and_have_the_prescribed_poles() {
    for domain in [Domain::Continuous, Domain::Sampled { period: 0.1 }] {
        let (plant, requirements) = (plant(domain), requirements(domain));
        let patterns = achievable_patterns(&plant, &requirements).unwrap();
        assert!(patterns.len() >= 6, "{patterns:?}");
        for actual in patterns.iter().filter(|actual| actual.strong) {
            let residual = residual_generator(&plant, &actual.pattern, &requirements).unwrap();
            assert!(residual.generator.check().is_ok() && residual.decoupling_error < 1e-9);
            assert_eq!(
                structure(std::slice::from_ref(&residual), 0.0, 1e-6).unwrap()[0],
                actual.pattern
            );
            for (at, pole) in residual.generator.a.diagonal().iter().enumerate() {
                let last = requirements.poles.len() - 1;
                assert!((pole - requirements.poles[at.min(last)]).abs() < 1e-15);
            }
            for frequency in [0.0, 0.37, 1.9, 7.3, 23.1] {
                let [known, faults] = responses(&plant, &residual, frequency);
                let form = &residual.from_faults;
                let form = transfer([&form.a, &form.b, &form.c, &form.d], domain, frequency);
                let size = faults.iter().map(|gain| gain.norm()).fold(0.0, f64::max);
                let largest =
                    |m: &ComplexMatrix| m.iter().map(|gain| gain.norm()).fold(0.0, f64::max);
                assert!(largest(&known) < 1e-9 * size, "{} {size}", largest(&known));
                assert!(largest(&(&form - &faults)) < 1e-9 * size);
                for (fault, responds) in actual.pattern.iter().enumerate() {
                    assert!(*responds || faults[fault].norm() < 1e-9 * size);
                }
            }
        }
    }
}

/// The second state acts on the first, which is measured, with a factor below the tolerance.
#[test]
fn a_coupling_below_the_tolerance_is_found_by_the_verification_of_the_decoupling() {
    let small = 1e-6;
    let plant = DisturbedPlant {
        a: matrix(3, 3, &[-1., small, 0., 0., -2., 1.0, 0., 0., -3.]),
        b_u: matrix(3, 1, &[0., 1., 1.]),
        b_d: DMatrix::zeros(3, 0),
        b_f: matrix(3, 1, &[1., 0., 0.]),
        c: matrix(1, 3, &[1., 0., 0.]),
        d_u: DMatrix::zeros(1, 1),
        d_d: DMatrix::zeros(1, 0),
        d_f: DMatrix::zeros(1, 1),
        domain: Domain::Continuous,
    };
    let requirements = Requirements { tolerance: 1e-3, ..Requirements::with_pole(-1.5) };
    let residual = residual_generator(&plant, &[true], &requirements).unwrap();
    assert!(residual.decoupling_error < 1e-9, "{}", residual.decoupling_error);
    assert_eq!(residual.generator.a.nrows(), 3);
}

/// Gu = [(s+1)/(s-2); (s+2)/(s-3)], Gd = [(s-1)/(s+2); 0], Gf = [Gu, [0; 1]]. Published (Varga 2017, example
/// 5.4): Q = [0, (s-3)/(s+3), -(s+2)/(s+3)] and Rf = [(s+2)/(s+3), (s-3)/(s+3)].
#[test]
fn example_5_4_has_the_published_filter() {
    let plant = DisturbedPlant {
        a: DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 3.0, -2.0])),
        b_u: matrix(3, 1, &[1., 1., 0.]),
        b_d: matrix(3, 1, &[0., 0., 1.]),
        b_f: matrix(3, 2, &[1., 0., 1., 0., 0., 0.]),
        c: matrix(2, 3, &[3., 0., -3., 0., 5., 0.]),
        d_u: matrix(2, 1, &[1., 1.]),
        d_d: matrix(2, 1, &[1., 0.]),
        d_f: matrix(2, 2, &[1., 0., 1., 1.]),
        domain: Domain::Continuous,
    };
    let residual =
        residual_generator(&plant, &[true, true], &Requirements::with_pole(-3.0)).unwrap();
    assert_eq!(residual.generator.a, matrix(1, 1, &[-3.0]));
    for frequency in [0.0, 0.7, 5.0] {
        let s = Complex::new(0.0, frequency);
        let q = residual.generator.system();
        let q = transfer([&q.a, &q.b, &q.c, &q.d], Domain::Continuous, frequency);
        let (zero, r_1, r_2) =
            (Complex::new(0.0, 0.0), (s + 2.0) / (s + 3.0), (s - 3.0) / (s + 3.0));
        let published = ComplexMatrix::from_row_slice(1, 3, &[-r_1, zero, r_2]);
        assert!((q - published).norm() < 1e-12);
        let f = &residual.from_faults;
        let f = transfer([&f.a, &f.b, &f.c, &f.d], Domain::Continuous, frequency);
        assert!((f - ComplexMatrix::from_row_slice(1, 2, &[r_1, r_2])).norm() < 1e-12);
    }
}

/// Gu = [(s+1)/(s+2); (s+2)/(s+3)], Gd = [1/(s+2); 0], Gf = [(s+1)/(s+2), 0; 0, 1] (Varga 2017, example 5.2):
/// the first fault acts as the disturbance does.
#[test]
fn example_5_2_has_no_residual_for_both_faults_and_the_fault_is_named() {
    let plant = DisturbedPlant {
        a: DMatrix::from_diagonal(&DVector::from_vec(vec![-2.0, -3.0, -2.0, -2.0])),
        b_u: matrix(4, 1, &[1., 1., 0., 0.]),
        b_d: matrix(4, 1, &[0., 0., 1., 0.]),
        b_f: matrix(4, 2, &[0., 0., 0., 0., 0., 0., 1., 0.]),
        c: matrix(2, 4, &[-1., 0., 1., -1., 0., -1., 0., 0.]),
        d_u: matrix(2, 1, &[1., 1.]),
        d_d: DMatrix::zeros(2, 1),
        d_f: matrix(2, 2, &[1., 0., 0., 1.]),
        domain: Domain::Continuous,
    };
    let requirements = Requirements::with_pole(-3.0);
    let refused = residual_generator(&plant, &[true, true], &requirements);
    assert_eq!(refused, Err(Error::FaultNotIsolable { fault: 1, decoupled: vec![] }));
    let patterns = achievable_patterns(&plant, &requirements).unwrap();
    assert_eq!(patterns.len(), 1);
    assert_eq!(patterns[0].pattern, [false, true]);
}

/// Three sensors of one signal (Varga 2017, example 5.10): the differences of two sensors each.
#[test]
fn three_sensors_of_one_signal_are_isolated_by_static_differences() {
    let mut seed = 5;
    let one = scattered(1, 4, &mut seed);
    let plant = DisturbedPlant {
        a: scattered(4, 4, &mut seed),
        b_u: scattered(4, 1, &mut seed),
        b_d: scattered(4, 2, &mut seed),
        b_f: DMatrix::zeros(4, 3),
        c: DMatrix::from_fn(3, 4, |_, j| one[j]),
        d_u: DMatrix::from_element(3, 1, 0.3),
        d_d: DMatrix::from_element(3, 2, -0.7),
        d_f: DMatrix::identity(3, 3),
        domain: Domain::Continuous,
    };
    let requirements = Requirements::with_pole(-1.0);
    for (pattern, expected) in [
        ([false, true, true], [0., 1., -1.]),
        ([true, false, true], [1., 0., -1.]),
        ([true, true, false], [1., -1., 0.]),
    ] {
        let generator = residual_generator(&plant, &pattern, &requirements).unwrap().generator;
        assert!(generator.a.is_empty() && generator.d_u.norm() < 1e-12);
        assert!((generator.d_y - matrix(1, 3, &expected)).norm() < 1e-12);
    }
    let count = achievable_patterns(&plant, &requirements).unwrap().len();
    assert_eq!(count, 4);
}

/// Of two sensors of a state that a disturbance moves, `y_1` - `y_2` is `f_1` - `f_2`. Of a tank x' = u + f with
/// y = x, (s y - u) / (s + 1) is f / (s + 1).
#[test]
fn constant_faults_are_visible_in_a_difference_of_sensors_and_at_an_integrator() {
    let sensors = DisturbedPlant {
        a: matrix(1, 1, &[-1.0]),
        b_u: matrix(1, 1, &[1.0]),
        b_d: matrix(1, 1, &[1.0]),
        b_f: DMatrix::zeros(1, 2),
        c: DMatrix::from_element(2, 1, 1.0),
        d_u: DMatrix::zeros(2, 1),
        d_d: DMatrix::zeros(2, 1),
        d_f: DMatrix::identity(2, 2),
        domain: Domain::Continuous,
    };
    let tank = DisturbedPlant {
        a: DMatrix::zeros(1, 1),
        b_d: DMatrix::zeros(1, 0),
        b_f: matrix(1, 1, &[1.0]),
        c: matrix(1, 1, &[1.0]),
        d_u: DMatrix::zeros(1, 1),
        d_d: DMatrix::zeros(1, 0),
        d_f: DMatrix::zeros(1, 1),
        ..sensors.clone()
    };
    for plant in [sensors, tank] {
        let requirements = Requirements::with_pole(-1.0);
        let patterns = achievable_patterns(&plant, &requirements).unwrap();
        assert!(patterns.len() == 1 && patterns[0].strong, "{patterns:?}");
        let residual = residual_generator(&plant, &patterns[0].pattern, &requirements).unwrap();
        assert!(residual.gains.iter().all(|gain| gain.norm() > 0.5), "{:?}", residual.gains);
    }
}

#[test]
fn bad_requirements_and_patterns_are_refused_and_a_plant_without_disturbances_is_accepted() {
    let mut plant = plant(Domain::Continuous);
    let good = requirements(Domain::Continuous);
    let design = |plant: &DisturbedPlant, pattern: &[bool], requirements: &Requirements| {
        residual_generator(plant, pattern, requirements)
    };
    let short = design(&plant, &[true], &good);
    assert!(matches!(short, Err(Error::Shape { matrix: "pattern", .. })));
    let none = design(&plant, &[false; 3], &good);
    assert!(matches!(none, Err(Error::Empty { matrix: "pattern", .. })));
    for poles in [vec![], vec![1.0], vec![-1.0, f64::NAN]] {
        let bad = Requirements { poles, ..good.clone() };
        let refused = design(&plant, &[true; 3], &bad);
        assert!(matches!(refused, Err(Error::OutOfRange { name: "poles", .. })));
    }
    let noise = Some(vec![1.0, 2.0]);
    let refused = design(&plant, &[true; 3], &Requirements { noise, ..good.clone() });
    assert!(matches!(refused, Err(Error::Shape { matrix: "noise", .. })));
    plant.d_d = DMatrix::zeros(4, 0);
    plant.b_d = DMatrix::zeros(0, 0);
    let expected = Error::Shape { matrix: "B_d", expected: (8, 0), actual: (0, 0) };
    assert_eq!(plant.check(), Err(expected));
    plant.b_d = DMatrix::zeros(8, 0);
    let residual = design(&plant, &[true, false, false], &good).unwrap();
    let [known, faults] = responses(&plant, &residual, 1.3);
    assert!(known.norm() < 1e-9 * faults.norm());
    assert!((residual.gains[0] - 1.0).norm() < 1e-9);
}

/// Published: `CS1_1` of Varga 2017, section 8.1: this structure matrix, errors of the nominal closed loop below
/// 1e-6.
#[test]
fn the_flight_actuator_case_study_has_the_published_structure_and_errors() {
    let nominal = actuators::plant(actuators::NOMINAL).unwrap();
    let residuals = actuators::residuals(&nominal).unwrap();
    let actual = structure(&residuals, 0.0, 1e-3).unwrap();
    let expected = actuators::PATTERNS.map(|row| row.map(|entry| entry == 1));
    assert!(actual.iter().zip(&expected).all(|(row, expected)| row == expected), "{actual:?}");
    let norms = actuators::norms(&nominal, &residuals).unwrap();
    assert!(norms.iter().all(|norm| *norm < 1e-6), "{norms:?}");
    let orders: Vec<usize> = residuals.iter().map(|one| one.generator.a.nrows()).collect();
    assert_eq!(orders, [6, 6, 6, 5, 4, 4]);
    let other = actuators::plant(actuators::MODELS - 1).unwrap();
    assert!(actuators::norms(&other, &residuals).unwrap()[0] > 1.0);
    let patterns = achievable_patterns(&nominal, &actuators::requirements()).unwrap();
    for row in &expected {
        assert!(patterns.iter().any(|actual| actual.strong && actual.pattern == row));
    }
}

/// Published: `CS2_1` of Varga 2017, section 8.2. The errors of the nominal gain and of the mean gain are those of
/// `scripts/reference/reference_isolation.py` (null spaces by scipy, norms by SLICOT).
#[cfg(feature = "lmi")]
#[test]
fn the_air_data_sensor_case_study_has_the_published_errors() {
    let plants: Vec<_> = (0..sensors::MODELS).map(|at| sensors::plant(at).unwrap()).collect();
    let exact: Vec<_> = plants.iter().map(|plant| sensors::exact_gain(plant).unwrap()).collect();
    for (plant, gain) in plants.iter().zip(&exact) {
        assert!(sensors::error(plant, gain).unwrap() < 1e-7);
    }
    let error = |plant: usize, gain| sensors::error(&plants[plant], gain).unwrap();
    let near = |actual: f64, expected: f64| (actual / expected - 1.0).abs() < 1e-6;
    let nominal = &exact[sensors::NOMINAL];
    assert!(near(error(0, nominal), 643.560_281) && near(error(10, nominal), 365.504_564));
    let mean = exact.iter().skip(1).fold(exact[0].clone(), |sum, gain| sum + gain) / 11.0;
    assert!(near(error(0, &mean), 504.820_573) && near(error(10, &mean), 545.680_057));
    let best = sensors::best_gain(&plants).unwrap();
    assert!(best.worst < 0.77 && best.lower_bound > 0.76, "{} {}", best.worst, best.lower_bound);
    for (at, norm) in best.norms.iter().enumerate() {
        assert!(error(at, &best.gain) <= *norm);
    }
}
