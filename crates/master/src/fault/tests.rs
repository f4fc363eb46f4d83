//! Each fault compared with a series computed by hand.
#![expect(clippy::float_cmp, reason = "exact by construction")]

mod random;
mod remembered;

use super::*;

fn window(from: f64, until: Option<f64>) -> Window {
    Window { from, until }
}

fn single(fault: Fault, from: f64, until: Option<f64>) -> FaultChain {
    FaultChain::new(vec![(window(from, until), fault)], 0.1).unwrap()
}

/// Applies the faults to values at communication points.
fn series(line: &mut FaultChain, values: &[(f64, f64)]) -> Vec<f64> {
    values
        .iter()
        .map(|&(time, value)| {
            let arrived = line.apply(time, value);
            line.commit(time, value);
            assert_eq!(line.apply(time, value), arrived, "the same before and after the commit");
            arrived
        })
        .collect()
}

#[test]
fn a_bias_acts_from_its_start_to_before_its_end() {
    let mut line = single(Fault::Bias(0.5), 1.0, Some(3.0));
    let actual = series(&mut line, &[(0.0, 1.0), (1.0, 2.0), (2.0, 4.0), (3.0, 8.0)]);
    assert_eq!(actual, [1.0, 2.5, 4.5, 8.0]);
}

#[test]
fn a_time_reached_but_for_rounding_is_reached() {
    let line = single(Fault::Bias(1.0), 0.3, Some(0.8));
    // Times slightly above 0.3 s and slightly below 0.3 s and 0.8 s.
    assert_eq!(line.apply(0.1 + 0.1 + 0.1, 0.0), 1.0);
    assert_eq!(line.apply(0.3 - 1e-12, 0.0), 1.0);
    assert_eq!(line.apply(0.8 - 1e-12, 0.0), 0.0);
    assert_eq!(line.apply(0.3 - 1e-6, 0.0), 0.0);
}

#[test]
fn a_gain_multiplies_the_value_and_its_slope() {
    let line = single(Fault::Gain(-2.0), 0.0, None);
    let arrived = line.apply_sample(1.0, Sample { value: 3.0, slope: 5.0 });
    assert_eq!(arrived, Sample { value: -6.0, slope: -10.0 });
    assert_eq!(line.apply_derivatives(1.0, [3.0, 5.0, 7.0]), [-6.0, -10.0, -14.0]);
}

#[test]
fn added_values_keep_the_curvature_and_values_that_jump_have_none() {
    let derivatives = [1.0, 2.0, 3.0];
    let of = |fault: Fault| single(fault, 0.0, None).apply_derivatives(4.0, derivatives);
    assert_eq!(of(Fault::Bias(1.0)), [2.0, 2.0, 3.0]);
    assert_eq!(of(Fault::Drift(0.5)), [3.0, 2.5, 3.0]);
    assert_eq!(of(Fault::Stuck(Some(9.0))), [9.0, 0.0, 0.0]);
    assert_eq!(of(Fault::Quantisation { step: 2.0, offset: 0.0 }), [2.0, 0.0, 0.0]);
    assert_eq!(of(Fault::Saturation { lowest: None, highest: Some(0.5) }), [0.5, 0.0, 0.0]);
    assert_eq!(of(Fault::Saturation { lowest: None, highest: Some(5.0) }), derivatives);
}

#[test]
fn a_drift_grows_from_its_start_and_vanishes_at_its_end() {
    let mut line = single(Fault::Drift(0.25), 2.0, Some(6.0));
    let actual = series(&mut line, &[(0.0, 1.0), (2.0, 1.0), (4.0, 1.0), (5.0, 3.0), (6.0, 1.0)]);
    assert_eq!(actual, [1.0, 1.0, 1.5, 3.75, 1.0]);
    let arrived = line.apply_sample(4.0, Sample { value: 0.0, slope: 1.0 });
    assert_eq!(arrived, Sample { value: 0.5, slope: 1.25 });
}

#[test]
fn a_sensor_sticks_at_the_value_of_the_first_communication_point_of_its_window() {
    let mut line = single(Fault::Stuck(None), 12.0, Some(13.0));
    let values = [(11.9, 3.0), (12.1, 5.0), (12.5, 7.0), (12.9, -7.0), (13.1, 9.0)];
    assert_eq!(series(&mut line, &values), [3.0, 5.0, 5.0, 5.0, 9.0]);
    let arrived = line.apply_sample(12.5, Sample { value: 1.0, slope: 4.0 });
    assert_eq!(arrived, Sample::held(5.0));
}

#[test]
fn a_sensor_sticks_at_the_value_given() {
    let mut line = single(Fault::Stuck(Some(-1.0)), 1.0, None);
    assert_eq!(series(&mut line, &[(0.0, 3.0), (1.0, 5.0), (2.0, 7.0)]), [3.0, -1.0, -1.0]);
}

#[test]
fn the_nearest_level_arrives_and_halves_go_away_from_zero() {
    let line = single(Fault::Quantisation { step: 0.5, offset: 0.0 }, 0.0, None);
    for (value, expected) in
        [(0.74, 0.5), (0.75, 1.0), (0.2, 0.0), (-0.25, -0.5), (-0.2, 0.0), (7.0, 7.0)]
    {
        assert_eq!(line.apply(0.0, value), expected, "{value}");
    }
    let line = single(Fault::Quantisation { step: 2.0, offset: 0.5 }, 0.0, None);
    for (value, expected) in [(0.0, 0.5), (1.4, 0.5), (1.6, 2.5), (-0.6, -1.5)] {
        assert_eq!(line.apply(0.0, value), expected, "{value}");
    }
    let finest = single(Fault::Quantisation { step: 1e-308, offset: 0.0 }, 0.0, None);
    assert_eq!(finest.apply(0.0, 1e10), 1e10);
    let arrived = line.apply_sample(0.0, Sample { value: 0.0, slope: 3.0 });
    assert_eq!(arrived, Sample::held(0.5));
}

#[test]
fn a_saturated_value_stays_at_its_bound_and_has_no_slope() {
    let line = single(Fault::Saturation { lowest: Some(-1.0), highest: Some(2.0) }, 0.0, None);
    let moving = |value| Sample { value, slope: 3.0 };
    assert_eq!(line.apply_sample(0.0, moving(1.5)), moving(1.5));
    assert_eq!(line.apply_sample(0.0, moving(2.5)), Sample::held(2.0));
    assert_eq!(line.apply_sample(0.0, moving(-1.5)), Sample::held(-1.0));
    let open = single(Fault::Saturation { lowest: None, highest: Some(2.0) }, 0.0, None);
    assert_eq!(open.apply(0.0, -1e9), -1e9);
}

#[test]
fn faults_act_in_the_order_stated() {
    let (bias, gain) = (Fault::Bias(1.0), Fault::Gain(10.0));
    let always = window(0.0, None);
    let of = |first: &Fault, second: &Fault| {
        FaultChain::new(vec![(always, first.clone()), (always, second.clone())], 0.1).unwrap()
    };
    assert_eq!(of(&bias, &gain).apply(0.0, 2.0), 30.0);
    assert_eq!(of(&gain, &bias).apply(0.0, 2.0), 21.0);
    // The value that sticks is the output of the fault before.
    let mut line = of(&bias, &Fault::Stuck(None));
    assert_eq!(series(&mut line, &[(0.0, 2.0), (1.0, 5.0)]), [3.0, 3.0]);
}

#[test]
fn integers_and_booleans_have_faults_too() {
    let mut stuck = single(Fault::Stuck(None), 1.0, None);
    stuck.commit(0.0, 1.0);
    stuck.commit(1.0, 4.0);
    assert_eq!(stuck.apply_integer(2.0, -7), 4);
    let bias = single(Fault::Bias(3.0), 0.0, None);
    assert_eq!(bias.apply_integer(0.0, -7), -4);
    let largest = i64::from(i32::MAX);
    assert_eq!(bias.apply_integer(0.0, largest), largest);
    assert_eq!(bias.apply_integer(0.0, largest + 2), largest + 5);
    let inversion = single(Fault::Inversion, 1.0, Some(2.0));
    let actual: Vec<_> = [(0.0, 1), (1.0, 1), (1.5, 0), (1.5, 7), (2.0, 0)]
        .map(|(time, value)| inversion.apply_boolean(time, value))
        .into();
    assert_eq!(actual, [1, 0, 1, 0, 0]);
}

#[test]
fn breaks_are_start_end_and_the_edges_of_a_periodic_dropout() {
    let lost = LossPattern::Periodic { period: 2.0, part: 0.5 };
    let dropout = Fault::Dropout { lost, instead: None };
    let faults = vec![(window(1.0, Some(5.2)), dropout), (window(3.2, None), Fault::Bias(1.0))];
    let line = FaultChain::new(faults, 0.1).unwrap();
    let mut actual = vec![0.0];
    while let Some(next) = line.next_break(actual[actual.len() - 1]) {
        actual.push(next);
    }
    assert_eq!(actual, [0.0, 1.0, 1.5, 3.0, 3.2, 3.5, 5.0, 5.2]);
    // A time that differs by rounding counts as past.
    assert_eq!(line.next_break(1.0 - 1e-12), Some(1.5));
}
