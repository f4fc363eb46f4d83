//! Measurements that are outside of their range, against runs of the controller with other inputs or another start.

use super::*;
use crate::dependencies;

/// The small design with a filter and more entries of its measurement; `sampled` is the start of its file.
fn held(sampled: &str, entries: &str) -> AsoController {
    let text =
        small("limits = [-5.0, 5.0]").replace("t_on = 0.35", "t_on = 0.0\nfilter = [0.5]").replace(
            "[[measurements]]\nname = \"x\"",
            &format!("[[measurements]]\nname = \"x\"\n{entries}"),
        );
    // Matrices of a sampled loop that is stable.
    let text = if sampled.is_empty() {
        text
    } else {
        text.replace("[[0.0, 1.0], [0.0, -0.2]]", "[[1.0, 0.1], [0.0, 0.9]]")
            .replace("[[9.0], [24.0]]", "[[0.3], [0.2]]")
            .replace("[[-12.0]]", "[[-0.05]]")
            .replace("[[-3.0, -2.0]]", "[[-0.05, -0.1]]")
    };
    ready(with_design(&format!("{sampled}{text}")).unwrap())
}

/// A step as an importer makes it: the inputs are set, the outputs read before and after it.
fn advance(model: &mut AsoController, start: f64, size: f64, [y, slope]: [f64; 2]) {
    if let Some(check) = &mut model.measurement_check {
        (check.y[0], check.y_slopes[0]) = (y, slope);
    } else {
        (model.values.y[0], model.values.y_slopes[0]) = (y, slope);
    }
    model.update(start).unwrap();
    model.step(&Step { start, size }).unwrap();
}

/// Bits of estimates and commands, and the flags.
fn outputs(model: &AsoController) -> (Vec<u64>, [bool; 2]) {
    let values = model.values.z.iter().chain(&model.values.u);
    let flags =
        model.measurement_check.as_ref().map_or([false; 2], |check| [check.is_held, check.is_lost]);
    (values.map(|value| value.to_bits()).collect(), flags)
}

fn measured(k: u32) -> f64 {
    0.3 * (f64::from(k) * 0.7).sin()
}

const SAMPLED: &str = "sample_time = 0.125\nestimator = \"current\"\n";
const T: f64 = 0.125;

#[test]
fn one_step_far_outside_acts_like_the_last_value_inside() {
    for sampled in ["", SAMPLED] {
        let mut checked = held(sampled, "range = [-2.0, 2.0]");
        let mut plain = held(sampled, "");
        for k in 0..200_u32 {
            let start = f64::from(k) * T;
            let (mut y, mut usual) = (measured(k), measured(k));
            if k % 50 == 20 {
                (y, usual) = (if k == 20 { 1e300 } else { -2.1 }, measured(k - 1));
            }
            advance(&mut checked, start, T, [y, 0.0]);
            advance(&mut plain, start, T, [usual, 0.0]);
            let (bits, [is_held, is_lost]) = outputs(&checked);
            assert_eq!(bits, outputs(&plain).0, "{sampled:?} {k}");
            // The sample at the end of a step has the measurements of its start.
            assert_eq!((is_held, is_lost), (k % 50 == 20, false), "{sampled:?} {k}");
        }
    }
}

#[test]
fn without_a_range_the_same_step_keeps_the_command_at_its_limits() {
    let mut plain = held("", "");
    for k in 0..200_u32 {
        let y = if k == 20 { 1e300 } else { measured(k) };
        advance(&mut plain, f64::from(k) * T, T, [y, 0.0]);
        if k > 20 {
            assert!((plain.values.u[0].abs() - 5.0).abs() < 1e-9, "{k}: {}", plain.values.u[0]);
        }
    }
}

#[test]
fn a_measurement_that_is_lost_ends_at_the_operating_point_and_starts_anew_from_there() {
    for sampled in ["", SAMPLED] {
        let mut model = held(sampled, "range = [-2.0, 2.0]\nlongest_hold = 0.5");
        for k in 0..20_u32 {
            advance(&mut model, f64::from(k) * T, T, [measured(k), 0.0]);
        }
        // Sample k is taken at the end of the previous step. The longest hold contains 4 samples, or 4 steps.
        for k in 20..60_u32 {
            advance(&mut model, f64::from(k) * T, T, [1e300, 0.0]);
            let flags = outputs(&model).1;
            assert_eq!(flags, [true, k >= 24], "{sampled:?} {k}");
            let Values { z, u, .. } = &model.values;
            let is_at_rest = z.iter().chain(u).all(|value| value.to_bits() == 0);
            assert_eq!(is_at_rest, k >= 24, "{sampled:?} {k}");
        }
        if sampled.is_empty() {
            let slopes = model.with_slopes();
            assert!(slopes.z_slopes.iter().chain(&slopes.u_slopes).all(|slope| *slope == 0.0));
        }
        let mut anew = held(sampled, "range = [-2.0, 2.0]\nlongest_hold = 0.5");
        // The sample at 60 T was taken at the end of the last step; the next one is at 61 T.
        let first = if sampled.is_empty() { 60 } else { 61 };
        let start_time = f64::from(first) * T;
        anew.measurement_check.as_mut().unwrap().y[0] = measured(60);
        anew.initialize(&Experiment { start_time, ..Experiment::default() }).unwrap();
        for k in 60..100_u32 {
            advance(&mut model, f64::from(k) * T, T, [measured(k), 0.0]);
            if k >= first {
                advance(&mut anew, f64::from(k) * T, T, [measured(k), 0.0]);
            }
            assert_eq!(outputs(&model), outputs(&anew), "{sampled:?} {k}");
        }
    }
}

/// The longest hold is 10 steps; in seconds since 1970 these last 0.099999905 s.
#[test]
fn a_hold_lasts_as_many_steps_in_seconds_since_1970() {
    for start_time in [0.0, 1.7e9] {
        let mut model = held("", "range = [-2.0, 2.0]\nlongest_hold = 0.1");
        model.initialize(&Experiment { start_time, ..Experiment::default() }).unwrap();
        for k in 0..20_u32 {
            advance(&mut model, start_time + 0.01 * f64::from(k), 0.01, [1e300, 0.0]);
            assert_eq!(outputs(&model).1, [true, k >= 10], "{start_time} {k}");
        }
    }
}

#[test]
fn an_input_derivative_that_leads_out_of_the_range_is_not_used() {
    let mut checked = held("", "range = [-2.0, 2.0]");
    let mut plain = held("", "");
    for k in 0..40_u32 {
        let start = f64::from(k) * T;
        let slope = if k == 20 { -1e303 } else { 0.4 };
        advance(&mut checked, start, T, [measured(k), slope]);
        advance(&mut plain, start, T, [measured(k), if k == 20 { 0.0 } else { 0.4 }]);
        assert_eq!(outputs(&checked), outputs(&plain), "{k}");
    }
}

#[test]
fn nothing_depends_on_a_measurement_that_is_not_used() {
    let text = "range = [-2.0, 2.0]\nlongest_hold = 0.5";
    for (y, is_used) in [(0.4, true), (1e300, false)] {
        let mut model = held("", text);
        advance(&mut model, 0.0, T, [0.1, 0.0]);
        model.measurement_check.as_mut().unwrap().y[0] = y;
        model.update(T).unwrap();
        model.with_slopes();
        let slope = |y: f64| {
            let mut direction = model.clone();
            direction.measurement_check.as_mut().unwrap().y[0] = y;
            let at = At::Point { time: T, delta_time: 0.0 };
            model.differentiate(&at, &mut direction).unwrap();
            direction.z_slopes[3]
        };
        // y_f' = 0.5 (y - y_f); the other components of the direction are the same.
        let expected = if is_used { 0.5 } else { 0.0 };
        assert!((slope(1.0) - slope(0.0) - expected).abs() < 1e-12, "{y}");
    }
}

#[test]
fn a_filter_starts_at_the_operating_point_where_its_measurement_is_not_used() {
    for sampled in ["", SAMPLED] {
        for (y, start, by_operating_point) in [(0.4_f64, 0.4_f64, 0.0), (1e300, 0.5, 1.0)] {
            let mut model = held(sampled, "range = [-2.0, 2.0]");
            model.design.actuators[0].operating = Some(0.0);
            model.design.measurements[0].operating = Some(0.5);
            model.measurement_check.as_mut().unwrap().y[0] = y;
            let model = ready(model);
            assert_eq!(model.values.z[3].to_bits(), start.to_bits(), "{sampled:?} {y}");
            assert_eq!(dependencies::of_initial_estimate(&model.design, 3), ["x", "y_op"]);
            let derivative = |operating: f64| {
                let mut direction = model.clone();
                direction.design.measurements[0].operating = Some(operating);
                model.differentiate(&At::Initialization, &mut direction).unwrap();
                direction.values.z[3]
            };
            let actual = derivative(1.0) - derivative(0.0);
            assert!((actual - by_operating_point).abs() < 1e-12, "{sampled:?} {y}: {actual}");
        }
    }
}

#[test]
fn a_controller_that_may_rest_at_sample_0_depends_on_its_measurement_and_operating_point() {
    let with_prediction = SAMPLED.replace("current", "prediction");
    let mut model = held(&with_prediction, "range = [-2.0, 2.0]\nlongest_hold = 0.1");
    model.design.actuators[0].operating = Some(0.0);
    model.design.states[0].operating = Some(0.5);
    model.x_hat_0[0] = 0.25;
    for (y, is_lost) in [(0.4, false), (1e300, true)] {
        model.measurement_check.as_mut().unwrap().y[0] = y;
        model.initialize(&Experiment::default()).unwrap();
        let start: f64 = if is_lost { 0.5 } else { 0.25 };
        assert_eq!(model.values.z[0].to_bits(), start.to_bits(), "{y}");
    }
    let listed = dependencies::of_initial_estimate(&model.design, 0);
    assert_eq!(listed, ["x", "x_hat_0[1]", "x_op[1]"]);
    assert!(dependencies::of_initial_command(&model.design, 0).contains(&"x".to_owned()));
}

#[test]
fn a_continuous_controller_with_a_range_is_for_co_simulation_only() {
    assert!(held("", "").model_exchange().is_some());
    assert!(held("", "range = [-2.0, 2.0]").model_exchange().is_none());
    assert!(held(SAMPLED, "range = [-2.0, 2.0]").model_exchange().is_some());
}

#[test]
fn a_lost_measurement_survives_a_copy_through_bytes() {
    let mut model = held("", "range = [-2.0, 2.0]\nlongest_hold = 0.5");
    for k in 0..10_u32 {
        advance(&mut model, f64::from(k) * T, T, [1e300, 0.0]);
    }
    let bytes = postcard::to_stdvec(&model).unwrap();
    let mut copy: AsoController = postcard::from_bytes(&bytes).unwrap();
    assert!(copy.with_slopes().z_slopes.iter().all(|slope| *slope == 0.0));
    for k in 10..20_u32 {
        for model in [&mut model, &mut copy] {
            advance(model, f64::from(k) * T, T, [0.5, 0.0]);
        }
        assert_eq!(outputs(&model), outputs(&copy));
    }
}
