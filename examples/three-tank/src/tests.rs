//! Physical laws of the three tanks, and their faults.

use std::iter::repeat_n;

use super::*;

fn place<'a>(model: &'a mut ThreeTank, name: &str) -> &'a mut f64 {
    let row = PARAMETERS.iter().position(|row| row.0 == name).unwrap();
    &mut model.parameters[row]
}

/// Creates the model and initialises it with these levels, commands and parameters.
fn started(h: [f64; 3], command: [f64; 2], parameters: &[(&str, f64)]) -> ThreeTank {
    let mut model = ThreeTank::new(Path::new("")).unwrap();
    (model.h, model.command) = (h, command);
    for (name, value) in parameters {
        *place(&mut model, name) = *value;
    }
    model.initialize(&Experiment::default()).unwrap();
    model
}

/// Steps the model from time zero by these step sizes.
fn follow(model: &mut ThreeTank, sizes: impl IntoIterator<Item = f64>) {
    let mut start = 0.0;
    for size in sizes {
        model.step(&Step { start, size }).unwrap();
        start += size;
    }
}

fn assert_close(actual: [f64; 3], expected: [f64; 3], bound: f64) {
    for (actual, expected) in actual.iter().zip(expected) {
        assert!((actual - expected).abs() <= bound, "{actual} {expected}");
    }
}

/// Closed pipes: each tank is a cylinder that its pump fills.
const CLOSED: [(&str, f64); 3] = [("mu_13", 0.0), ("mu_32", 0.0), ("mu_20", 0.0)];

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<ThreeTank>(Path::new("resources")), Ok(vec![]));
}

#[test]
fn the_volume_balance_of_inflow_outflow_and_content_holds() {
    let faults = [("f_1", 2e-5), ("E_2", 0.4), ("h_max", 0.5)];
    for (h, command) in [
        ([0.4, 0.2, 0.3], [3e-5, 9e-5]),
        ([0.1, 0.45, 0.2], [0.0, 5e-4]),
        ([0.5, 0.5, 0.5], [1.2e-4, 1.2e-4]),
        ([0.0, 0.0, 0.3], [-1.0, 1e-5]),
    ] {
        let model = started(h, command, &faults);
        let rise = model.slope.iter().sum::<f64>() * 0.0154;
        let [inflow, outflow] = [model.pumps.iter().sum::<f64>(), model.pipes[2] + model.spill];
        assert!((rise - (inflow - outflow)).abs() < 1e-19, "{rise} {inflow} {outflow}");
        assert!(model.pumps.iter().all(|flow| (0.0..=1.2e-4).contains(flow)));
    }
    assert!(started([0.5; 3], [1.2e-4; 2], &faults).spill > 0.0);
}

#[test]
fn without_pumps_the_potential_energy_falls_until_the_tanks_are_empty() {
    let mut model = started([0.6, 0.05, 0.3], [0.0, 0.0], &[]);
    let energy = |model: &ThreeTank| model.h.iter().map(|level| level * level).sum::<f64>();
    let mut before = energy(&model);
    for k in 0..200 {
        model.step(&Step { start: 10.0 * f64::from(k), size: 10.0 }).unwrap();
        assert!(energy(&model) < before || energy(&model) < 1e-16);
        assert!(model.h.iter().all(|level| *level > -1e-8), "{:?}", model.h);
        before = energy(&model);
    }
    assert!(energy(&model) < 1e-16);
}

#[test]
fn the_start_values_are_an_equilibrium() {
    let mut model = ThreeTank::new(Path::new("")).unwrap();
    model.initialize(&Experiment::default()).unwrap();
    assert_close(model.slope, [0.0; 3], 1e-17);
    follow(&mut model, repeat_n(100.0, 100));
    assert_close(model.h, [0.4, 0.2, 0.3], 1e-12);
}

#[test]
fn a_tank_empties_through_its_outlet_along_a_parabola_and_stays_empty() {
    for sizes in [vec![1.0; 700], vec![700.0], vec![0.3, 123.0, 70.7, 506.0]] {
        let mut model = started([0.0, 0.3, 0.0], [0.0; 2], &[("mu_13", 0.0), ("mu_32", 0.0)]);
        let rate = 0.675 * 5e-5 * (2.0 * 9.81_f64).sqrt() / (2.0 * 0.0154);
        let mut start = 0.0;
        for size in sizes {
            model.step(&Step { start, size }).unwrap();
            start += size;
            let root = (0.3_f64.sqrt() - rate * start).max(0.0);
            assert_close(model.h, [0.0, root * root, 0.0], 1e-8);
        }
    }
}

#[test]
fn levels_of_connected_tanks_become_equal_in_finite_time_and_stay_equal() {
    let mut model = started([0.5, 0.1, 0.3], [0.0; 2], &[("mu_32", 0.0), ("mu_20", 0.0)]);
    let rate = 0.5 * 5e-5 * (2.0 * 9.81_f64).sqrt() / 0.0154;
    for k in 0..100 {
        let start = f64::from(k);
        model.step(&Step { start, size: 1.0 }).unwrap();
        let half = 0.5 * (0.2_f64.sqrt() - rate * (start + 1.0)).max(0.0).powi(2);
        assert_close(model.h, [0.4 + half, 0.1, 0.4 - half], 1e-8);
    }
}

#[test]
fn a_full_tank_spills_its_surplus_inflow_and_its_level_falls_when_there_is_none() {
    let mut model = started([0.61, 0.1, 0.3], [1e-4, 0.0], &CLOSED);
    let until_full = 0.01 * 0.0154 / 1e-4;
    model.step(&Step { start: 0.0, size: 1.0 }).unwrap();
    assert_close(model.h, [0.62 - (until_full - 1.0) * 1e-4 / 0.0154, 0.1, 0.3], 1e-13);
    assert_eq!(model.spill.to_bits(), 0);
    model.step(&Step { start: 1.0, size: 9.0 }).unwrap();
    assert_eq!(model.h.map(f64::to_bits), [0.62, 0.1, 0.3].map(f64::to_bits));
    assert_eq!((model.spill.to_bits(), model.slope[0].to_bits()), (1e-4_f64.to_bits(), 0));
    let open = [("mu_13", 0.0), ("mu_32", 0.0)];
    let mut model = started([0.3, 0.62, 0.3], [0.0, 1.2e-4], &open);
    let outflow = 0.675 * 5e-5 * (2.0 * 9.81 * 0.62_f64).sqrt();
    assert!((model.spill - (1.2e-4 - outflow)).abs() < 1e-18);
    model.command[1] = 0.0;
    model.step(&Step { start: 0.0, size: 10.0 }).unwrap();
    assert!(model.h[1] < 0.62 - 0.9 * outflow * 10.0 / 0.0154);
}

#[test]
fn a_fault_starts_at_its_time_for_every_step_size() {
    let faults = [("f_1", 3e-5), ("t_fault_1", 0.333), ("E_2", 0.25), ("t_fault_2", 1.77)];
    for sizes in [vec![4.0], vec![0.1; 40], vec![0.333, 1.437, 2.23]] {
        let mut model = started([0.1; 3], [2e-5, 6e-5], &[&CLOSED[..], &faults].concat());
        follow(&mut model, sizes);
        let first = 2e-5 * 4.0 + 3e-5 * (4.0 - 0.333);
        let second = 6e-5 * 4.0 - 0.25 * 6e-5 * (4.0 - 1.77);
        assert_close(model.h, [0.1 + first / 0.0154, 0.1 + second / 0.0154, 0.1], 1e-13);
    }
}

#[test]
fn from_its_time_on_a_bias_shifts_the_measurement_and_nothing_else() {
    let mut biased = started([0.4, 0.2, 0.3], [0.0; 2], &[("b_2", 0.05), ("t_bias", 3.0)]);
    let mut sound = started([0.4, 0.2, 0.3], [0.0; 2], &[]);
    for k in 0..6 {
        let step = Step { start: f64::from(k), size: 1.0 };
        biased.step(&step).unwrap();
        sound.step(&step).unwrap();
        assert_close(biased.h, sound.h, 1e-11);
        let shift = if k < 2 { 0.0 } else { 0.05 };
        assert_close(biased.measured, from_fn(|i| biased.h[i] + [0.0, shift, 0.0][i]), 1e-15);
    }
}

/// Derivatives of slopes and measurements along the named direction.
fn along(model: &ThreeTank, name: &str) -> Result<[f64; 6], Failure> {
    let mut direction = model.clone();
    (direction.h, direction.command, direction.parameters) = ([0.0; 3], [0.0; 2], [0.0; COUNT]);
    *known(&mut direction, name) = 1.0;
    model.differentiate(&At::Initialization, &mut direction)?;
    let (slope, measured) = (direction.slope, direction.measured);
    Ok(from_fn(|k| if k < 3 { slope[k] } else { measured[k - 3] }))
}

fn known<'a>(model: &'a mut ThreeTank, name: &str) -> &'a mut f64 {
    match name {
        "h_1" => &mut model.h[0],
        "h_2" => &mut model.h[1],
        "h_3" => &mut model.h[2],
        "Q_1" => &mut model.command[0],
        "Q_2" => &mut model.command[1],
        _ => place(model, name),
    }
}

#[test]
fn directional_derivatives_by_every_known_are_difference_quotients() {
    let faults = [("f_1", 1e-5), ("E_1", 0.3), ("E_2", 0.1), ("b_1", 0.01), ("b_3", -0.02)];
    let names = ["h_1", "h_2", "h_3", "Q_1", "Q_2"];
    for h in [[0.4, 0.2, 0.3], [0.1, 0.5, 0.3], [0.62, 0.1, 0.2]] {
        let model = started(h, [7e-5, 5e-5], &faults);
        let times = ["t_fault_1", "t_fault_2", "t_bias"];
        for name in names.into_iter().chain(PARAMETERS.map(|row| row.0)) {
            let size = known(&mut model.clone(), name).abs().max(1e-5) * 1e-4;
            let moved = |shift: f64| -> [f64; 6] {
                let mut model = model.clone();
                *known(&mut model, name) += shift;
                model.update(0.0).unwrap();
                from_fn(|k| if k < 3 { model.slope[k] } else { model.measured[k - 3] })
            };
            let (ahead, back) = (moved(size), moved(-size));
            for (k, actual) in along(&model, name).unwrap().into_iter().enumerate() {
                let expected = (ahead[k] - back[k]) / (2.0 * size);
                let bound = 1e-6 * expected.abs().max(1e-3);
                assert!((actual - expected).abs() < bound, "{name} {k}: {actual} {expected}");
                assert!(!times.contains(&name) || actual == 0.0);
            }
        }
    }
}

#[test]
fn at_equal_levels_derivatives_by_levels_are_refused_and_by_commands_exist() {
    let model = started([0.3, 0.2, 0.3], [7e-5, 5e-5], &[]);
    for name in ["h_1", "h_3"] {
        assert!(matches!(along(&model, name), Err(Failure::Error(_))), "{name}");
    }
    assert!((along(&model, "Q_1").unwrap()[0] - 1.0 / 0.0154).abs() < 1e-12);
    assert!(along(&model, "h_2").unwrap()[2].is_finite());
}

#[test]
fn the_sampled_linear_model_is_the_published_one() {
    // x[k+1] = A x + B u at levels 0.4, 0.2, 0.3 m and a sample time of 1 s, as printed.
    let published = [
        [0.9888, 0.0001, 0.0112, 64.5687, 0.0014],
        [0.0001, 0.9781, 0.0111, 0.0014, 64.2202],
        [0.0112, 0.0111, 0.9776, 0.3650, 0.3637],
    ];
    let mut model = ThreeTank::new(Path::new("")).unwrap();
    model.initialize(&Experiment::default()).unwrap();
    let columns = ["h_1", "h_2", "h_3", "Q_1", "Q_2"].map(|name| along(&model, name).unwrap());
    for (column, start) in (0..5).map(|k| (k, from_fn(|i| if i == k { 1.0 } else { 0.0 }))) {
        let sampled = held(&columns, start);
        for (row, actual) in published.iter().zip(sampled) {
            assert!((actual - row[column]).abs() < 5e-5, "{actual} {}", row[column]);
        }
    }
}

/// The state after 1 s of `x' = A x + B u`, both in one vector; power series of the exponential.
fn held(columns: &[[f64; 6]; 5], start: [f64; 5]) -> [f64; 3] {
    let (mut term, mut sum) = (start, start);
    for order in 1..20 {
        let slope = |i: usize| (0..5).map(|k| columns[k][i] * term[k]).sum::<f64>();
        term = from_fn(|i| if i < 3 { slope(i) / f64::from(order) } else { 0.0 });
        sum = from_fn(|i| sum[i] + term[i]);
    }
    [sum[0], sum[1], sum[2]]
}

#[test]
fn initial_levels_outside_of_the_tanks_are_refused() {
    for h in [[-1e-3, 0.2, 0.3], [0.4, 0.63, 0.3], [0.4, 0.2, f64::NAN]] {
        let mut model = ThreeTank::new(Path::new("")).unwrap();
        model.h = h;
        let refusal = model.initialize(&Experiment::default()).unwrap_err();
        assert!(refusal.to_string().contains("expected 0 to h_max = 0.62 m"), "{refusal}");
    }
}
