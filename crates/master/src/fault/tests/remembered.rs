//! Faults with memory: dropout, delay; repeated steps and checkpoints.

use super::super::delay::DelayLine;
use super::{Fault, FaultChain, FaultError, LossPattern, Sample, series, single, window};
use crate::fault::{NoiseDistribution, RandomSeries};

fn dropout(lost: LossPattern, instead: Option<f64>) -> Fault {
    Fault::Dropout { lost, instead }
}

fn delay(seconds: f64) -> Fault {
    Fault::Delay { seconds, hold: false, initial: None }
}

#[test]
fn a_dropout_holds_the_last_value_that_was_not_lost() {
    let mut line = single(dropout(LossPattern::All, None), 1.0, Some(3.0));
    let actual = series(&mut line, &[(0.0, 5.0), (1.0, 6.0), (2.0, 7.0), (3.0, 8.0)]);
    assert_eq!(actual, [5.0, 5.0, 5.0, 8.0]);
}

#[test]
fn a_dropout_from_the_start_holds_the_first_value() {
    let mut line = single(dropout(LossPattern::All, None), 0.0, None);
    assert_eq!(series(&mut line, &[(0.0, 5.0), (1.0, 6.0), (2.0, 7.0)]), [5.0, 5.0, 5.0]);
}

#[test]
fn a_dropout_may_give_another_value() {
    let mut line = single(dropout(LossPattern::All, Some(0.0)), 1.0, Some(2.0));
    assert_eq!(series(&mut line, &[(0.0, 5.0), (1.0, 6.0), (2.0, 7.0)]), [5.0, 0.0, 7.0]);
}

#[test]
fn a_periodic_dropout_takes_the_first_part_of_each_period_with_any_rounding() {
    let lost = LossPattern::Periodic { period: 1.0, part: 0.3 };
    let mut line = single(dropout(lost, None), 0.1, None);
    let mut last = None;
    for step in 0..2000_u32 {
        let (time, value) = (0.1 * f64::from(step), f64::from(step) + 7.0);
        let takes = step >= 1 && (step - 1) % 10 < 3;
        let expected = if takes { last.unwrap_or(value) } else { value };
        assert_eq!(series(&mut line, &[(time, value)]), [expected], "step {step}");
        last = Some(expected);
    }
}

#[test]
fn a_delay_gives_the_value_of_that_many_seconds_ago_on_the_line_between_two_points() {
    let mut line = single(delay(0.25), 0.0, None);
    for step in 0..=10 {
        let time = 0.1 * f64::from(step);
        line.commit(time, time * time);
    }
    // 0.75 s lies between 0.49 at 0.7 s and 0.64 at 0.8 s.
    let arrived = line.apply_sample(1.0, Sample { value: 1.0, slope: 2.0 });
    assert!((arrived.value - 0.565).abs() < 1e-12, "{arrived:?}");
    assert!((arrived.slope - 1.5).abs() < 1e-12, "{arrived:?}");
}

#[test]
fn a_held_delay_gives_the_value_of_the_communication_point_before() {
    let held = Fault::Delay { seconds: 0.25, hold: true, initial: Some(-1.0) };
    let mut line = single(held, 0.0, None);
    let values: Vec<_> = (0..6).map(|step| (0.1 * f64::from(step), f64::from(step))).collect();
    assert_eq!(series(&mut line, &values), [-1.0, -1.0, -1.0, 0.0, 1.0, 2.0]);
}

#[test]
fn before_the_delay_is_over_the_first_value_arrives_or_the_one_given() {
    let mut line = single(delay(0.2), 0.0, None);
    let actual = series(&mut line, &[(0.0, 4.0), (0.1, 5.0), (0.2, 6.0)]);
    assert_eq!(actual, [4.0, 4.0, 4.0]);
    let initial = Fault::Delay { seconds: 0.2, hold: false, initial: Some(1.0) };
    let mut line = single(initial, 0.0, None);
    assert_eq!(series(&mut line, &[(0.0, 4.0), (0.1, 5.0), (0.2, 6.0)]), [1.0, 1.0, 4.0]);
}

#[test]
fn a_delay_below_the_step_interpolates_to_the_value_on_trial() {
    let mut line = single(delay(0.25), 0.0, None);
    line.commit(0.0, 0.0);
    assert_eq!(line.apply(1.0, 10.0), 7.5);
    assert_eq!(line.apply(1.0, 20.0), 15.0, "another trial of the same step");
}

#[test]
fn a_delay_uses_values_from_before_its_window() {
    let mut line = single(delay(1.0), 5.0, Some(7.0));
    let values: Vec<_> = (0..9).map(|step| (f64::from(step), 10.0 * f64::from(step))).collect();
    let actual = series(&mut line, &values);
    assert_eq!(actual, [0.0, 10.0, 20.0, 30.0, 40.0, 40.0, 50.0, 70.0, 80.0]);
}

#[test]
fn a_delay_of_a_straight_line_is_exact_for_steps_of_any_size() {
    // The delay is created for steps of 0.1 s.
    let mut line = single(delay(1.0), 0.0, None);
    let (mut time, mut step) = (0.0, 1e-4);
    while time < 20.0 {
        line.commit(time, 3.0 * time);
        if time >= 1.0 {
            let arrived = line.apply(time, 3.0 * time);
            assert!((arrived - 3.0 * (time - 1.0)).abs() < 1e-9, "{arrived} at {time}");
        }
        time += step;
        step = if step > 0.3 { 1e-4 } else { step * 1.1 };
    }
}

#[test]
fn a_delay_beyond_memory_is_refused() {
    let actual = FaultChain::new(vec![(window(0.0, None), delay(1e9))], 1e-3).unwrap_err();
    assert!(matches!(actual, FaultError::Delay { steps, .. } if steps == 1e12), "{actual}");
    assert!(actual.to_string().contains("a delay of 1000000000 s is 1000000000000"), "{actual}");
}

/// A chain of one fault of each kind.
fn everything() -> FaultChain {
    let draw = |place| RandomSeries::new(5, "a.b", place, None);
    let random = LossPattern::Random { probability: 0.3, draw: draw(7) };
    let noise = Fault::Noise { spread: NoiseDistribution::Normal(0.1), draw: draw(6) };
    let faults = vec![
        (window(0.5, None), Fault::Bias(0.25)),
        (window(0.5, None), Fault::Gain(1.5)),
        (window(0.5, None), Fault::Drift(0.1)),
        (window(0.0, None), delay(0.35)),
        (window(0.0, None), noise),
        (window(0.2, None), dropout(random, None)),
        (window(0.0, None), Fault::Saturation { lowest: Some(-9.0), highest: None }),
        (window(1.5, Some(2.0)), Fault::Stuck(None)),
        (window(0.0, None), Fault::Quantisation { step: 1e-6, offset: 0.0 }),
    ];
    FaultChain::new(faults, 0.1).unwrap()
}

fn point(step: u32) -> (f64, f64) {
    let time = 0.1 * f64::from(step);
    (time, (3.0 * time).sin())
}

#[test]
fn steps_that_are_tried_and_taken_back_leave_no_trace() {
    let (mut straight, mut tried) = (everything(), everything());
    for step in 0..40 {
        let (time, value) = point(step);
        // Trials of a whole and a half step with other values, later and earlier.
        for (part, other) in [(1.0, 5.0), (0.5, -3.0), (1.0, 2.0), (0.0, 1.0)] {
            let _ = tried.apply(time + 0.1 * part, other);
        }
        assert_eq!(series(&mut straight, &[(time, value)]), series(&mut tried, &[(time, value)]));
    }
    assert_eq!(straight, tried);
}

#[test]
fn a_line_read_back_from_a_checkpoint_goes_on_identically() {
    for stop in [0, 3, 17, 19] {
        let mut line = everything();
        for step in 0..stop {
            series(&mut line, &[point(step)]);
        }
        let bytes = postcard::to_allocvec(&line).unwrap();
        let mut restored: FaultChain = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(restored, line);
        for step in stop..40 {
            let values = [point(step)];
            assert_eq!(series(&mut line, &values), series(&mut restored, &values), "{step}");
        }
    }
}

#[test]
fn a_checkpoint_that_no_delay_can_have_is_refused() {
    let read = |seconds: f64, step: f64, points: usize| {
        let points = vec![(0.0_f64, 0.0_f64); points];
        let bytes = postcard::to_allocvec(&(seconds, step, points)).unwrap();
        postcard::from_bytes::<DelayLine>(&bytes).is_ok()
    };
    assert!(read(1.0, 0.1, 3));
    assert!(!read(1.0, 0.0, 3), "no step");
    assert!(!read(f64::NAN, 0.1, 3), "no delay");
    assert!(!read(1.0, 0.1, 1000), "too many points");
}
