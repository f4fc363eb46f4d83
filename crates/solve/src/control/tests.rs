use super::*;

const BOUNDS: SizeBounds = SizeBounds { smallest: 1e-6, largest: 10.0 };

/// Returns the sizes of the accepted steps on a problem with the error `factor(t) H^q`.
fn run(control: &mut ErrorControl, q: f64, factor: impl Fn(f64) -> f64) -> Vec<f64> {
    let (mut time, mut size, mut sizes) = (0.0, 1e-3, Vec::new());
    for _ in 0..200 {
        match control.judge(size, factor(time) * f64::powf(size, q)) {
            Verdict::Accepted { next } => {
                time += size;
                sizes.push(size);
                size = next;
            }
            Verdict::Rejected { retry } => size = retry,
            Verdict::Stuck => panic!("stuck"),
        }
    }
    sizes
}

#[test]
fn a_constant_problem_settles_at_nine_tenths_of_the_step_that_meets_the_tolerance() {
    for q in [1.0, 2.0, 3.0, 4.0] {
        // e = 50 H^q is 1 at H = 50^(-1/q).
        let sizes = run(&mut ErrorControl::new(BOUNDS, q), q, |_| 50.0);
        let expected = 0.9 * f64::powf(50.0, -1.0 / q);
        assert!((sizes.last().unwrap() / expected - 1.0).abs() < 1e-6, "{q}: {sizes:?}");
    }
}

#[test]
fn the_step_follows_a_problem_that_becomes_a_thousand_times_harder() {
    let q = 2.0;
    let sizes =
        run(&mut ErrorControl::new(BOUNDS, q), q, |time| if time < 2.0 { 50.0 } else { 50e3 });
    let expected = 0.9 / f64::sqrt(50e3);
    assert!((sizes.last().unwrap() / expected - 1.0).abs() < 1e-6);
}

#[test]
fn a_rejected_step_is_at_least_halved_and_at_most_cut_to_a_fifth() {
    let judge = |error| ErrorControl::new(BOUNDS, 2.0).judge(1.0, error);
    assert_eq!(judge(1.0 + 1e-9), Verdict::Rejected { retry: 0.5 });
    // 0.9 / sqrt(9)
    let Verdict::Rejected { retry } = judge(9.0) else { panic!("accepted") };
    assert!((retry - 0.3).abs() < 1e-15);
    assert_eq!(judge(1e9), Verdict::Rejected { retry: 0.2 });
    assert_eq!(judge(f64::NAN), Verdict::Rejected { retry: 0.2 });
    assert_eq!(judge(f64::INFINITY), Verdict::Rejected { retry: 0.2 });
}

#[test]
fn the_step_after_a_rejection_does_not_grow() {
    let mut control = ErrorControl::new(BOUNDS, 2.0);
    assert_eq!(control.judge(1.0, 4.0), Verdict::Rejected { retry: 0.45 });
    assert_eq!(control.judge(0.45, 1e-6), Verdict::Accepted { next: 0.45 });
    assert_eq!(control.judge(0.45, 1e-6), Verdict::Accepted { next: 2.25 });
}

#[test]
fn the_step_stays_within_its_bounds_and_a_failure_of_the_smallest_is_reported() {
    let bounds = SizeBounds { smallest: 0.1, largest: 1.0 };
    let mut control = ErrorControl::new(bounds, 2.0);
    assert_eq!(control.judge(0.9, 0.0), Verdict::Accepted { next: 1.0 });
    assert_eq!(control.judge(0.3, 100.0), Verdict::Rejected { retry: 0.1 });
    assert_eq!(control.judge(0.1, 100.0), Verdict::Stuck);
}

#[test]
fn a_step_cut_short_by_an_event_does_not_make_the_next_one_short() {
    let mut control = ErrorControl::new(BOUNDS, 2.0);
    let settled = run(&mut control, 2.0, |_| 50.0).pop().unwrap();
    let cut = settled / 1e3;
    let Verdict::Accepted { next } = control.judge(cut, 50.0 * cut * cut) else { panic!() };
    assert!((next / settled - 1.0).abs() < 1e-6, "{next} after {settled}");
}

#[test]
fn steps_after_one_cut_short_are_as_they_were() {
    let (mut error, mut forward) =
        (ErrorControl::new(BOUNDS, 2.0), ForwardControl::new(BOUNDS, 1.0));
    let settled = run(&mut error, 2.0, |_| 50.0).pop().unwrap();
    let moved = (0..500).fold(1e-3, |size, _| forward.next(size, 4.0 * size));
    assert!((moved - 0.225).abs() < 1e-6, "nine tenths of a quarter: {moved}");
    let (mut first, mut second) = (settled / 1e3, moved / 1e3);
    for _ in 0..3 {
        let Verdict::Accepted { next } = error.judge(first, 50.0 * first * first) else { panic!() };
        first = next;
        second = forward.next(second, 4.0 * second);
        assert!((first / settled - 1.0).abs() < 1e-3, "{first} after {settled}");
        assert!((second / moved - 1.0).abs() < 1e-3, "{second} after {moved}");
    }
}

#[test]
fn without_repetition_the_increment_settles_at_nine_tenths_of_the_target() {
    let mut control = ForwardControl::new(BOUNDS, 1.0);
    let mut size = 1e-3;
    for _ in 0..100 {
        size = control.next(size, 20.0 * size);
    }
    assert!((size / (0.9 / 20.0) - 1.0).abs() < 1e-6, "{size}");
    assert!((control.next(size, f64::NAN) / size - 0.2).abs() < 1e-15);
    assert!((control.next(1e-6, f64::INFINITY) - 1e-6).abs() < 1e-20);
}

#[test]
fn a_resting_system_reaches_the_largest_step_and_an_error_of_zero_is_no_obstacle() {
    let mut control = ForwardControl::new(BOUNDS, 1.0);
    let size = (0..20).fold(1e-6, |size, _| control.next(size, 0.0));
    assert_eq!(size.to_bits(), BOUNDS.largest.to_bits());
}

#[test]
fn the_residual_of_a_bond_is_the_power_given_less_the_power_got() {
    // One FMU received the force 10 N and computed 2 m/s; the other computed 11 N and received 1.5 m/s.
    let bond = Bond { first: (10.0, 11.0), second: (1.5, 2.0) };
    assert!((bond.residual() - (10.0 * 2.0 - 11.0 * 1.5)).abs() < 1e-15);
    assert!((bond.power() - 22.0).abs() < 1e-15);
    let right = Bond { first: (11.0, 11.0), second: (2.0, 2.0) };
    assert!(right.residual().abs() < 1e-15);
}

#[test]
fn energy_control_measures_the_residuals_by_the_largest_power_so_far() {
    let mut control = EnergyControl::new(BOUNDS, 1.0, 0.01, 0.0, &[1.0, 1.0]);
    let strong = Bond { first: (100.0, 100.0), second: (1.0, 1.0) };
    assert!(control.measure(&[strong, strong]).abs() < 1e-15);
    // Both bonds have a residual of 0.5 W and a largest power of 100 W: 0.5 / (0.01 * 100) each.
    let loses = Bond { first: (1.0, 0.5), second: (0.0, 0.5) };
    assert!((control.measure(&[loses, loses]) - 0.5).abs() < 1e-12);
    // One of two bonds has no residual: the measure is the root of the mean square.
    assert!((control.measure(&[loses, strong]) - f64::sqrt(0.125)).abs() < 1e-12);
}

#[test]
fn bonds_at_rest_are_measured_by_the_absolute_tolerance() {
    let mut control = EnergyControl::new(BOUNDS, 1.0, 0.01, 1e-3, &[4.0]);
    let bond = Bond { first: (1.0, 0.0), second: (0.0, 8e-3) };
    assert!((control.measure(&[bond]) - 2.0).abs() < 1e-12);
    let mut none = EnergyControl::new(BOUNDS, 1.0, 0.01, 0.0, &[1.0]);
    let rest = Bond { first: (0.0, 0.0), second: (0.0, 0.0) };
    assert!(none.next(1e-3, &[rest]) > 1e-3, "0/0 is no step");
}
