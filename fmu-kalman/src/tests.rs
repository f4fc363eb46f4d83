//! The instants of samples, and the commands between them.

use crate::clock::{Clock, HeldMean};

#[test]
fn a_sample_is_due_at_each_multiple_of_the_period_within_rounding() {
    let mut clock = Clock::new(0.1);
    clock.start(5.0);
    // Steps of a third of the period, added up: the sum of three is not 0.1.
    let (mut time, mut samples) = (5.0, Vec::new());
    for _ in 0..30 {
        time += 0.1 / 3.0;
        while let Some(instant) = clock.next_until(time) {
            assert!(instant <= time);
            assert!((clock.last() - (instant - 0.1)).abs() < 1e-12);
            samples.push(instant);
            clock.tick();
        }
    }
    assert_eq!(samples.len(), 10);
    for (k, instant) in (1..).zip(samples) {
        assert!((instant - (5.0 + 0.1 * f64::from(k))).abs() < 1e-12);
    }
}

/// Seconds since 1970 are rounded by up to 0.12 us.
#[test]
fn a_sample_is_due_at_the_end_of_its_step_in_seconds_since_1970() {
    let (start, period) = (1.7e9, 1e-3);
    let mut clock = Clock::new(period);
    clock.start(start);
    for k in 0..1000_u32 {
        let end = (start + f64::from(k) * period) + period;
        assert!(clock.next_until(end).is_some(), "{k}");
        clock.tick();
        assert_eq!(clock.next_until(end), None, "{k}");
    }
}

#[test]
fn a_step_of_several_periods_has_several_samples() {
    let mut clock = Clock::new(2.0);
    clock.start(0.0);
    let mut samples = Vec::new();
    while let Some(instant) = clock.next_until(7.0) {
        samples.push(instant);
        clock.tick();
    }
    assert_eq!(samples, [2.0, 4.0, 6.0]);
}

#[test]
fn the_mean_weights_each_command_by_the_time_that_it_acts() {
    let mut mean = HeldMean::of(2);
    assert_eq!(mean.mean(&[7.0, 8.0]), [7.0, 8.0]);
    mean.add(&[1.0, 10.0], 3.0);
    mean.add(&[5.0, 30.0], 1.0);
    mean.add(&[100.0, 100.0], 0.0);
    assert_eq!(mean.mean(&[0.0, 0.0]), [2.0, 15.0]);
    mean.clear();
    mean.add(&[4.0, 4.0], 0.5);
    assert_eq!(mean.mean(&[0.0, 0.0]), [4.0, 4.0]);
}
