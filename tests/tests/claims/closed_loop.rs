//! The closed loop of plant and controller, one test for each claim.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use master::{Algorithm, Extrapolation, Method, System};
use tests::{Table, closed_loop, closed_loop_of, root, simulation};

/// The signals that are compared, with the columns of the reference files.
const SIGNALS: [(&str, &str); 8] = [
    ("plant.x_p", "x_p"),
    ("plant.theta", "theta"),
    ("plant.v_p", "v_p"),
    ("plant.omega", "omega"),
    ("plant.f_fric", "f_fric"),
    ("controller.u", "u"),
    ("controller.f_hat", "f_hat"),
    ("controller.x_hat[3]", "x_hat3"),
];

/// Returns the largest difference of each signal from the reference up to `end` s, relative to the
/// signal's range, at the times of the reference.
fn differences(
    reference: &Table,
    settings: &[(&str, &str)],
    algorithm: &Algorithm,
    end: f64,
) -> Vec<f64> {
    let names: Vec<_> = SIGNALS.iter().map(|(name, _)| *name).collect();
    let (mut simulation, mut probe) = simulation(closed_loop(settings), algorithm, &names);
    let columns: Vec<_> = SIGNALS.iter().map(|(_, column)| reference.column(column)).collect();
    let mut differences = vec![0.0_f64; SIGNALS.len()];
    let mut values = vec![0.0; SIGNALS.len()];
    let times = reference.column("t");
    for (row, time) in times.iter().enumerate().filter(|(_, time)| **time <= end) {
        while simulation.time() < time - 0.5 * algorithm.step {
            simulation.step().unwrap();
        }
        probe.read(simulation.system(), *time, &mut values).unwrap();
        for ((difference, value), column) in differences.iter_mut().zip(&values).zip(&columns) {
            *difference = difference.max((value - column[row]).abs());
        }
    }
    for (difference, column) in differences.iter_mut().zip(&columns) {
        let compared = &column[..times.iter().filter(|time| **time <= end).count()];
        let high = compared.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = compared.iter().copied().fold(f64::INFINITY, f64::min);
        // The fault estimate is held at zero before the activation.
        *difference /= if high > low { high - low } else { 1.0 };
    }
    differences
}

fn largest(differences: &[f64]) -> f64 {
    differences.iter().copied().fold(0.0, f64::max)
}

/// The reference by scipy for the paper's scenario, without compensation.
fn paper() -> Table {
    Table::read(&root().join("tests/data/closed_loop_paper.csv"))
}

/// The same with compensation from 1 s on.
fn compensated() -> Table {
    Table::read(&root().join("tests/data/closed_loop_compensated.csv"))
}

#[test]
fn the_first_5_s_are_those_of_scipy_at_a_communication_step_of_20_us() {
    let actual = differences(&paper(), &[], &Algorithm::new(2e-5), 5.0);
    println!("paper: {actual:?}");
    assert!(largest(&actual) < 1e-3, "{actual:?}");
}

#[test]
fn the_first_5_s_with_compensation_are_those_of_scipy_at_a_communication_step_of_20_us() {
    let settings = [("controller.t_on", "1.0")];
    let actual = differences(&compensated(), &settings, &Algorithm::new(2e-5), 5.0);
    println!("compensated: {actual:?}");
    assert!(largest(&actual) < 1e-3, "{actual:?}");
}

/// Differences of the cart's position from the reference over the first 5 s, for steps that are
/// halved repeatedly.
fn errors(method: (Method, Extrapolation), steps: &[f64]) -> Vec<f64> {
    let reference = paper();
    let error = |step: &f64| {
        differences(&reference, &[], &Algorithm::fixed(method.0, method.1, *step), 5.0)[0]
    };
    let errors = steps.iter().map(error).collect();
    println!("{method:?}: {errors:?} at {steps:?}");
    errors
}

/// The observed order for each pair of a step and its half.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

#[test]
fn gauss_seidel_with_slopes_is_of_second_order() {
    let orders =
        orders(&errors((Method::GaussSeidel, Extrapolation::Limited), &[1e-4, 5e-5, 2.5e-5]));
    assert!(orders.iter().all(|order| (1.7..2.6).contains(order)), "{orders:?}");
}

#[test]
fn jacobi_is_of_first_order() {
    let orders = orders(&errors((Method::Jacobi, Extrapolation::Hold), &[8e-6, 4e-6, 2e-6]));
    assert!(orders.iter().all(|order| (0.7..1.4).contains(order)), "{orders:?}");
}

#[test]
fn gauss_seidel_with_held_inputs_is_of_first_order() {
    let orders = orders(&errors((Method::GaussSeidel, Extrapolation::Hold), &[8e-6, 4e-6, 2e-6]));
    assert!(orders.iter().all(|order| (0.7..1.4).contains(order)), "{orders:?}");
}

/// Half of the peak-to-peak values of `x_p` and theta, and the rms of `f_fric` - `f_hat`, from 60
/// to 100 s.
fn residual(system: System, step: f64) -> [f64; 3] {
    let names = ["plant.x_p", "plant.theta", "plant.f_fric", "controller.f_hat"];
    let (mut simulation, mut probe) = simulation(system, &Algorithm::new(step), &names);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let (mut squares, mut count) = (0.0, 0.0);
    let mut values = [0.0; 4];
    while simulation.time() < 100.0 - 0.5 * step {
        simulation.step().unwrap();
        if simulation.time() < 60.0 {
            continue;
        }
        let time = simulation.time();
        probe.read(simulation.system(), time, &mut values).unwrap();
        for k in 0..2 {
            low[k] = low[k].min(values[k]);
            high[k] = high[k].max(values[k]);
        }
        squares += (values[2] - values[3]).powi(2);
        count += 1.0;
    }
    [0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), (squares / count).sqrt()]
}

#[test]
fn the_residual_at_1_ms_equals_that_at_10_us_to_1_percent() {
    let (coarse, fine) = (residual(closed_loop(&[]), 1e-3), residual(closed_loop(&[]), 1e-5));
    println!("1 ms {coarse:?}, 10 us {fine:?}");
    for (coarse, fine) in coarse[..2].iter().zip(&fine) {
        assert!((coarse / fine - 1.0).abs() < 0.01, "{coarse} {fine}");
    }
}

/// The loop of these versions of FMI.
fn mixed(plant: &str, controller: &str) -> System {
    let plant = format!("FrictionPendulum{plant}.fmu");
    closed_loop_of(&plant, &format!("AsoController{controller}.fmu"), &[])
}

#[test]
fn the_residual_at_1_ms_is_the_same_with_fmi_3_where_intermediate_update_replaces_derivatives() {
    let known = residual(closed_loop(&[]), 1e-3);
    for (plant, controller) in [(".fmi3", ".fmi3"), ("", ".fmi3"), (".fmi3", "")] {
        let actual = residual(mixed(plant, controller), 1e-3);
        println!("plant {plant}, controller {controller}: {actual:?}, FMI 2.0 {known:?}");
        // Cart, pendulum, error of the estimate.
        for ((actual, known), bound) in actual.iter().zip(&known).zip([1e-4, 1e-4, 0.02]) {
            assert!((actual / known - 1.0).abs() < bound, "{actual} {known}");
        }
    }
}

#[test]
fn held_inputs_give_the_same_bits_with_fmi_2_and_fmi_3() {
    let names: Vec<_> = SIGNALS.iter().map(|(name, _)| *name).collect();
    let algorithm = Algorithm::fixed(Method::Jacobi, Extrapolation::Hold, 1e-3);
    let end = |system| {
        let (mut simulation, mut probe) = simulation(system, &algorithm, &names);
        while simulation.time() < 5.0 {
            simulation.step().unwrap();
        }
        let mut values = vec![0.0; names.len()];
        let time = simulation.time();
        probe.read(simulation.system(), time, &mut values).unwrap();
        values.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(end(mixed(".fmi3", ".fmi3")), end(mixed("", "")));
}

#[test]
fn a_communication_step_allocates_nothing_in_fmi_2_and_fmi_3() {
    for version in ["", ".fmi3"] {
        let (mut simulation, _) = simulation(mixed(version, version), &Algorithm::new(1e-3), &[]);
        for _ in 0..10 {
            simulation.step().unwrap();
        }
        let allocations = allocation_counter::measure(|| {
            for _ in 0..100 {
                simulation.step().unwrap();
            }
        });
        assert_eq!(allocations.count_total, 0, "{version}");
    }
}

#[test]
fn the_plant_is_stepped_before_the_controller_and_there_is_no_loop() {
    let (simulation, _) = simulation(closed_loop(&[]), &Algorithm::new(1e-3), &[]);
    assert_eq!(simulation.order().sequence, [0, 1]);
    assert!(simulation.order().looped.is_empty());
}
