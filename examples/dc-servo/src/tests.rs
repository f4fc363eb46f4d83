//! Laws of the servo, its friction and its faults.

use super::*;

fn place<'a>(model: &'a mut DcServo, name: &str) -> &'a mut f64 {
    match name {
        "u" => &mut model.u,
        "theta" => &mut model.state[0],
        "omega" => &mut model.state[1],
        _ => &mut model.parameters[PARAMETERS.iter().position(|row| row.0 == name).unwrap()],
    }
}

fn parameter(name: &str) -> f64 {
    *place(&mut DcServo::new(Path::new("")).unwrap(), name)
}

/// Creates the model and initialises it with these values.
fn started(friction: bool, values: &[(&str, f64)]) -> DcServo {
    let mut model = DcServo::new(Path::new("")).unwrap();
    model.friction = friction;
    for (name, value) in values {
        *place(&mut model, name) = *value;
    }
    model.check().unwrap();
    model.initialize(&Experiment::default()).unwrap();
    model
}

/// The voltage that balances a torque at rest.
fn voltage(torque: f64) -> f64 {
    torque * parameter("R") / parameter("k")
}

/// The rate of the free motion in 1/s.
fn decay() -> f64 {
    let k = parameter("k");
    (parameter("F_v") + k * k / parameter("R")) / parameter("J")
}

fn close(actual: f64, expected: f64, bound: f64) {
    assert!((actual - expected).abs() <= bound * expected.abs().max(1.0), "{actual} {expected}");
}

#[test]
fn the_variables_keep_the_rules_of_the_standard() {
    assert_eq!(fmu::problems::<DcServo>(Path::new("resources")), Ok(vec![]));
}

#[test]
fn a_load_at_rest_is_held_up_to_the_static_friction_and_no_further() {
    for sign in [-1.0, 1.0] {
        let mut model = started(true, &[("u", sign * voltage(0.008) * (1.0 - 1e-12))]);
        model.step(&Step { start: 0.0, size: 5.0 }).unwrap();
        assert_eq!(model.state.map(f64::to_bits), [0, 0]);
        close(model.dry_friction, sign * 0.008, 1e-12);
        model.u *= 1.0 + 1e-11;
        model.step(&Step { start: 5.0, size: 0.1 }).unwrap();
        assert!(sign * model.state[1] > 1.0, "{}", model.state[1]);
        close(model.dry_friction, sign * 0.006, 1e-15);
    }
}

#[test]
fn a_rising_voltage_breaks_the_load_away_when_it_reaches_the_static_friction() {
    let (rise, a) = (3.0, decay());
    let breaks = voltage(0.008) / rise;
    for sizes in [vec![1.0], vec![0.01; 100], vec![0.3, breaks - 0.3, 1.0 - breaks]] {
        let mut model = started(true, &[]);
        let mut start = 0.0;
        for size in sizes {
            (model.u, model.u_slope) = (rise * start, rise);
            model.step(&Step { start, size }).unwrap();
            start += size;
        }
        let gone = start - breaks;
        let [b_0, b_1] = [0.002, rise / voltage(1.0)].map(|torque| torque / parameter("J"));
        let shape = (-a * gone).exp_m1() / a;
        close(model.state[1], -b_0 * shape + b_1 / a * (gone + shape), 1e-11);
        let turned = (b_0 - b_1 / a) * (gone + shape) / a + 0.5 * b_1 / a * gone * gone;
        close(model.state[0], turned, 1e-10);
    }
}

#[test]
fn a_coasting_load_stops_at_the_time_and_angle_of_the_closed_form() {
    let (a, slowing) = (decay(), 0.006 / parameter("J"));
    for omega in [-200.0, -3.0, 50.0] {
        let speed = f64::abs(omega);
        let time = (1.0 + a * speed / slowing).ln() / a;
        let angle = (speed - slowing * time) / a;
        let mut model = started(true, &[("omega", omega)]);
        model.step(&Step { start: 0.0, size: time * (1.0 - 1e-9) }).unwrap();
        assert!(model.regime != 0 && model.state[1] * omega > 0.0);
        model.step(&Step { start: time, size: 0.1 }).unwrap();
        close(model.state[0], angle * f64::signum(omega), 1e-12);
        assert_eq!((model.state[1].to_bits(), model.regime), (0, 0));
    }
}

#[test]
fn the_velocity_settles_where_the_torques_balance() {
    let mut model = started(true, &[("u", 12.0)]);
    model.step(&Step { start: 0.0, size: 2.0 }).unwrap();
    let damping = decay() * parameter("J");
    close(model.state[1], (12.0 / voltage(1.0) - 0.006) / damping, 1e-12);
    close(model.acceleration, 0.0, 1e-7);
}

/// Parameters of a run with faults, and its input.
const FAULTS: [(&str, f64); 5] =
    [("E", 0.3), ("f_u", -0.9), ("r_u", 7.0), ("t_fault", 0.2347), ("omega", 30.0)];

fn input(time: f64) -> f64 {
    3.0 * (25.0 * time).sin()
}

#[test]
fn friction_dissipates_energy_and_the_energy_balance_holds() {
    let mut model = started(true, &FAULTS);
    let size = 1e-5;
    let power = |model: &DcServo| {
        let [_, omega] = model.state;
        assert!(model.dry_friction * omega >= 0.0 && model.dry_friction.abs() <= 0.008);
        let viscous = parameter("F_v") * omega;
        (parameter("k") * model.current - viscous - model.dry_friction) * omega
    };
    let kinetic = |model: &DcServo| 0.5 * parameter("J") * model.state[1].powi(2);
    let (begin, mut work, mut regimes) = (kinetic(&model), 0.0, [false; 3]);
    for k in 0..60_000 {
        let start = f64::from(k) * size;
        model.u = input(start);
        model.update(start).unwrap();
        work += 0.5 * size * power(&model);
        model.step(&Step { start, size }).unwrap();
        work += 0.5 * size * power(&model);
        regimes[usize::try_from(model.regime + 1).unwrap()] = true;
    }
    assert_eq!(regimes, [true; 3]);
    let gained = kinetic(&model) - begin;
    // The quadrature notices the start of the fault up to a step late.
    assert!((gained - work).abs() < 2e-4 * gained, "{gained} {work}");
}

#[test]
fn the_result_does_not_depend_on_how_an_interval_with_held_input_is_divided_into_steps() {
    let follow = |cuts: u32| {
        let mut model = started(true, &FAULTS);
        for k in 0..60 {
            model.u = input(0.01 * f64::from(k));
            for part in 0..cuts {
                let size = 0.01 / f64::from(cuts);
                let start = 0.01 * f64::from(k) + f64::from(part) * size;
                model.step(&Step { start, size }).unwrap();
            }
        }
        model.state
    };
    let whole = follow(1);
    for cuts in [2, 3, 17] {
        let actual = follow(cuts);
        close(actual[0], whole[0], 1e-10);
        close(actual[1], whole[1], 1e-9);
    }
}

#[test]
fn a_fault_of_the_drive_acts_like_the_equal_change_of_voltage() {
    let faulty = started(true, &FAULTS);
    let sound = started(true, &[("omega", 30.0)]);
    let [mut faulty, mut sound] = [faulty, sound];
    (faulty.u, faulty.u_slope) = (2.0, 1.0);
    faulty.step(&Step { start: 0.0, size: 0.7 }).unwrap();
    (sound.u, sound.u_slope) = (2.0, 1.0);
    sound.step(&Step { start: 0.0, size: 0.2347 }).unwrap();
    (sound.u, sound.u_slope) = (0.7 * 2.2347 - 0.9, 0.7 + 7.0);
    sound.step(&Step { start: 0.2347, size: 0.7 - 0.2347 }).unwrap();
    close(faulty.state[0], sound.state[0], 1e-13);
    close(faulty.state[1], sound.state[1], 1e-13);
}

#[test]
fn from_its_time_on_a_bias_shifts_the_measurement_and_nothing_else() {
    let mut model = started(true, &[("omega", 9.0), ("b_theta", 0.1), ("t_bias", 0.02)]);
    let mut sound = started(true, &[("omega", 9.0)]);
    for k in 0..4 {
        let step = Step { start: 0.01 * f64::from(k), size: 0.01 };
        model.step(&step).unwrap();
        sound.step(&step).unwrap();
        close(model.state[0], sound.state[0], 1e-15);
        let bias = if k < 1 { 0.0 } else { 0.1 };
        close(model.measured, model.state[0] + bias, 1e-15);
    }
}

/// Derivatives of acceleration, friction and measurement along the named direction.
fn along(model: &DcServo, name: &str, delta_time: f64) -> [f64; 3] {
    let mut direction = model.clone();
    (direction.state, direction.u, direction.parameters) = ([0.0; 2], 0.0, [0.0; COUNT]);
    if !name.is_empty() {
        *place(&mut direction, name) = 1.0;
    }
    model.differentiate(&At::Point { time: 0.5, delta_time }, &mut direction).unwrap();
    [direction.acceleration, direction.dry_friction, direction.measured]
}

#[test]
fn directional_derivatives_are_difference_quotients_in_every_regime() {
    let names = ["u", "theta", "omega"].into_iter().chain(PARAMETERS.map(|row| row.0));
    let names: Vec<_> = names.filter(|name| *name != "t_bias").chain([""]).collect();
    for (friction, omega, u) in [
        (true, 20.0, 5.0),
        (true, -7.0, 1.0),
        (true, 0.0, 0.4),
        (false, 0.0, 0.4),
        (false, -3.0, 1.0),
    ] {
        let faults = [("E", 0.3), ("f_u", 0.1), ("r_u", 0.7), ("t_fault", 0.1), ("b_theta", 0.2)];
        let mut model = started(friction, &[&faults[..], &[("u", u), ("omega", omega)]].concat());
        model.event(0.5).unwrap();
        for name in &names {
            let size = if name.is_empty() { 0.5 } else { *place(&mut model.clone(), name) };
            let size = 1e-5 * if size.abs() > 0.0 { size.abs() } else { 0.1 };
            let moved = |shift: f64| {
                let mut model = model.clone();
                let time = if name.is_empty() { 0.5 + shift } else { 0.5 };
                if !name.is_empty() {
                    *place(&mut model, name) += shift;
                }
                model.update(time).unwrap();
                [model.acceleration, model.dry_friction, model.measured]
            };
            let actual = along(&model, name, if name.is_empty() { 1.0 } else { 0.0 });
            for ((actual, ahead), back) in actual.iter().zip(moved(size)).zip(moved(-size)) {
                let expected = (ahead - back) / (2.0 * size);
                let bound = 1e-8 * (expected.abs() + (ahead.abs() + 1e-3) * 1e-3 / size);
                assert!((actual - expected).abs() <= bound, "{name}: {actual} {expected}");
            }
        }
    }
}

#[test]
fn without_friction_the_model_is_the_linear_motor_also_at_rest() {
    let model = started(false, &[]);
    let gain = parameter("k") / (parameter("R") * parameter("J"));
    close(along(&model, "omega", 0.0)[0], -decay(), 1e-14);
    close(along(&model, "u", 0.0)[0], gain, 1e-14);
    assert_eq!(along(&model, "theta", 0.0).map(f64::to_bits), [0.0, 0.0, 1.0].map(f64::to_bits));
    let mut model = started(false, &[("u", 2.0), ("omega", -4.0)]);
    model.step(&Step { start: 0.0, size: 0.03 }).unwrap();
    let settled = 2.0 * gain / decay();
    close(model.state[1], settled + (-4.0 - settled) * (-0.03 * decay()).exp(), 1e-13);
    let held = started(true, &[]);
    assert_eq!(along(&held, "u", 0.0)[0].to_bits(), 0);
}

#[test]
fn a_static_friction_below_the_coulomb_friction_is_refused() {
    let mut model = DcServo::new(Path::new("")).unwrap();
    *place(&mut model, "T_s") = 0.005;
    let refusal = model.check().unwrap_err().to_string();
    assert_eq!(refusal, "T_s = 0.005: must be at least T_c = 0.006 N m");
}

#[test]
fn a_voltage_that_overflows_the_motion_is_refused_and_leaves_the_state() {
    let mut model = started(true, &[("omega", 1.0)]);
    model.u = 1e308;
    let refusal = model.step(&Step { start: 0.0, size: 1e9 }).unwrap_err();
    assert!(matches!(refusal, Failure::Discard(_)), "{refusal}");
    assert_eq!(model.state.map(f64::to_bits), [0.0, 1.0].map(f64::to_bits));
}
