//! Bumpless transfer: commands when the compensation starts, in steps, model exchange and samples.

use super::*;

/// w in 1/s, and the instant at which the compensation starts.
const DECAY: f64 = 4.0;
const START: f64 = 0.35;

/// The small design with a transfer.
fn transferred(limits: &str) -> AsoController {
    let text = format!("monitor = true\ntransfer = {DECAY:?}\n{}", small(limits));
    ready(with_design(&text).unwrap())
}

/// [z; u] at `end` by classic Runge-Kutta steps of 10 us from zero with y(t) = 0.4 + 0.5 t. From 0.35 s on the command is that
/// of the law plus d exp(-w (t - 0.35)), d the step that the law alone would make.
fn reference(end: f64, [low, high]: [f64; 2]) -> [f64; 4] {
    let law = |z: [f64; 3], on: bool| -3.0 * z[0] - 2.0 * z[1] + if on { z[2] } else { 0.0 };
    let h = 1e-5;
    let (mut z, mut step) = ([0.0; 3], None);
    let command = |z: [f64; 3], t: f64, step: Option<f64>| {
        let left = step.map_or(0.0, |step| step * (-DECAY * (t - START)).exp());
        (law(z, step.is_some()) + left).clamp(low, high)
    };
    let rates = |z: [f64; 3], t: f64, step: Option<f64>| {
        let innovation = 0.4 + 0.5 * t - z[0];
        [
            z[1] + 9.0 * innovation,
            -0.2 * z[1] + 2.0 * command(z, t, step) - 2.0 * z[2] + 24.0 * innovation,
            -12.0 * innovation,
        ]
    };
    for k in 0.. {
        let t = f64::from(k) * h;
        if step.is_none() && t > START - 0.5 * h {
            step = Some(command(z, t, None) - law(z, true));
        }
        if t > end - 0.5 * h {
            break;
        }
        let along = |k: [f64; 3], f: f64| std::array::from_fn(|i| z[i] + f * h * k[i]);
        let k1 = rates(z, t, step);
        let k2 = rates(along(k1, 0.5), t + 0.5 * h, step);
        let k3 = rates(along(k2, 0.5), t + 0.5 * h, step);
        let k4 = rates(along(k3, 1.0), t + h, step);
        z = std::array::from_fn(|i| z[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
    }
    [z[0], z[1], z[2], command(z, end, step)]
}

/// The estimates and the command.
fn reached(controller: &AsoController) -> [f64; 4] {
    let z = &controller.values.z;
    [z[0], z[1], z[2], controller.values.u[0]]
}

fn assert_close(actual: [f64; 4], expected: [f64; 4], what: &str) {
    for (actual, expected) in actual.into_iter().zip(expected) {
        assert!((actual - expected).abs() < 2e-5, "{what}: {actual} {expected}");
    }
}

const CASES: [(&str, [f64; 2]); 2] =
    [("", [f64::NEG_INFINITY, f64::INFINITY]), ("limits = [-1.5, 0.3]", [-1.5, 0.3])];

#[test]
fn a_command_stays_where_it_is_when_its_law_changes_and_approaches_the_new_one() {
    for (text, limits) in CASES {
        // A step that ends at the change, one that contains it, one that starts at it.
        for size in [0.35, 0.5, 0.1, 0.07, 0.001] {
            let mut controller = transferred(text);
            let mut start = 0.0;
            while start < 0.7 - 1e-9 {
                step(&mut controller, start, size, &[0.4 + 0.5 * start], &[0.5]);
                start += size;
                let case = format!("{text} {size} {start}");
                assert_close(reached(&controller), reference(start, limits), &case);
            }
        }
    }
    let [_, _, f_hat, _] = reference(START, CASES[0].1);
    assert!(f_hat.abs() > 0.1, "without the transfer the command would jump by {f_hat}");
}

#[test]
fn compensation_that_an_input_switches_off_and_on_moves_no_command_at_once() {
    let mut controller = transferred("");
    let mut last = controller.values.u[0];
    for k in 0..200_u32 {
        controller.compensate = !(80..120).contains(&k);
        let start = 0.01 * f64::from(k);
        step(&mut controller, start, 0.01, &[0.4 + 0.5 * start], &[0.5]);
        let slope = controller.with_slopes().u_slopes[0].abs();
        let moved = (controller.values.u[0] - last).abs();
        assert!(moved < 0.02 * slope.max(1.0), "{k}: {moved} {slope}");
        last = controller.values.u[0];
    }
}

#[test]
fn in_model_exchange_the_change_is_a_new_value_of_a_state() {
    let mut controller = transferred("");
    controller.event(0.0).unwrap();
    controller.values.z.copy_from_slice(&[0.1, -0.2, 0.7, 0.0]);
    controller.update(0.35).unwrap();
    let before = controller.values.u[0];
    let event = controller.event(0.35).unwrap();
    assert!(event.values_of_continuous_states_changed);
    controller.update(0.35).unwrap();
    assert!((controller.values.u[0] - before).abs() < 1e-15);
    assert!((controller.values.z[3] + 0.7).abs() < 1e-15, "less K_f f_hat = 0.7");
    assert!((controller.with_slopes().z_slopes[3] - DECAY * 0.7).abs() < 1e-14);
    assert!(!controller.event(0.36).unwrap().values_of_continuous_states_changed);
}

#[test]
fn a_command_at_a_limit_stays_there_without_a_change_of_sign_of_its_indicators() {
    let mut controller = transferred("limits = [-1.5, 0.3]");
    controller.event(0.0).unwrap();
    // The free command is 0.6 without f_hat and -2.4 with it.
    controller.values.z.copy_from_slice(&[-0.2, 0.0, -3.0, 0.0]);
    controller.update(0.2).unwrap();
    controller.event(0.2).unwrap();
    controller.update(0.35).unwrap();
    let signs = |controller: &AsoController| {
        let mut values = [f64::NAN; 2];
        controller.event_indicators(0.0, &mut values);
        values.map(|value| value > 0.0)
    };
    let before = signs(&controller);
    assert_eq!((before, controller.values.u[0]), ([true, false], 0.3));
    assert!(controller.event(0.35).unwrap().values_of_continuous_states_changed);
    controller.update(0.35).unwrap();
    assert_eq!((signs(&controller), controller.values.u[0]), (before, 0.3));
    assert!((controller.values.z[3] - 2.7).abs() < 1e-8);
}

#[test]
fn a_decay_that_is_no_rate_is_refused() {
    for (value, sampled, rule) in [
        (0.0, "", "more than 0 1/s"),
        (-1.0, "", "more than 0 1/s"),
        (1.5, "sample_time = 0.1\nestimator = \"current\"\n", "more than 0 and at most 1"),
    ] {
        let text = format!("transfer = {value:?}\n{sampled}{}", small(""));
        let message = with_design(&text).err().unwrap().to_string();
        assert!(message.contains(&format!("transfer = {value}")), "{message}");
        assert!(message.contains(rule), "{message}");
    }
}

#[test]
fn events_of_co_simulation_change_no_course() {
    for transfer in ["", "monitor = true\ntransfer = 4.0\n"] {
        let text = format!("{transfer}{}", small("limits = [-1.5, 0.3]"));
        let [mut with, mut without] = [(); 2].map(|()| ready(with_design(&text).unwrap()));
        for k in 0..100_u32 {
            let start = 0.01 * f64::from(k);
            with.event(start).unwrap();
            with.update(start).unwrap();
            for controller in [&mut with, &mut without] {
                step(controller, start, 0.01, &[0.4 + 0.5 * start], &[0.5]);
            }
            assert!((-1.5..=0.3).contains(&with.values.u[0]), "{k}: {}", with.values.u[0]);
            let difference = (with.values.u[0] - without.values.u[0]).abs();
            assert!(difference < 1e-6, "{transfer} {k}: {difference}");
        }
    }
}
