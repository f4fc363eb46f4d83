//! Stop and break-away, against closed forms.

use super::*;

fn close(value: f64, exact: f64) {
    assert!((value - exact).abs() < 1e-11 * exact.abs().max(1.0), "{value} {exact}");
}

#[test]
fn a_sliding_block_stops_at_the_time_and_place_of_constant_deceleration() {
    let (mass, level, velocity) = (2.0, 5.0, -0.7_f64);
    let p = sliding_block(mass, level);
    let force = Force::constant(0.0);
    let stop = velocity.abs() * mass / level;
    let just_before = follow(&p, [0.3, 0.0, velocity, 0.0], &force, stop - 1e-9, |_| 1.0);
    assert_eq!(just_before.regime(), Regime::Backward);
    let after = follow(&p, [0.3, 0.0, velocity, 0.0], &force, stop + 1e-9, |_| 1.0);
    assert_eq!(after.regime(), Regime::Stick);
    close(after.state()[0], 0.3 - velocity * velocity * mass / (2.0 * level));
    assert_eq!(after.state()[2].to_bits(), 0);
}

#[test]
fn the_rise_of_the_friction_just_before_a_stop_is_not_stepped_over() {
    let narrow = 1e-3;
    let p =
        Parameters { static_friction: 20.0, stribeck_velocity: narrow, ..sliding_block(2.0, 5.0) };
    let motion = follow(&p, [0.0, 0.0, 0.8, 0.0], &Force::constant(0.0), 1.0, |_| 1.0);
    // Distance: the integral of M v / g(v) dv, by Simpson's rule where g varies.
    let (edge, pairs) = (10.0 * narrow, 5_000);
    let half = edge / (2.0 * f64::from(pairs));
    let part = |v: f64| 2.0 * v / (5.0 + 15.0 * (-(v / narrow) * (v / narrow)).exp());
    let simpson = |k: i32| {
        let from = 2.0 * half * f64::from(k);
        half / 3.0 * (part(from) + 4.0 * part(from + half) + part(from + 2.0 * half))
    };
    let distance = (0..pairs).map(simpson).sum::<f64>() + (0.64 - edge * edge) / 5.0;
    assert_eq!(motion.regime(), Regime::Stick);
    let moved = motion.state()[0];
    assert!((moved - distance).abs() < 1e-10, "{moved} {distance}");
}

#[test]
fn a_slide_that_nearly_stops_feels_the_rise_of_the_friction() {
    // With a constant friction of 5 N the velocity would be 3e-5 + 2 (t - 0.3)², at least 3 v_s.
    let p =
        Parameters { static_friction: 20.0, stribeck_velocity: 1e-5, ..sliding_block(2.0, 5.0) };
    let force = Force { value: 5.0, slope: 8.0, curvature: 0.0, start: 0.3 };
    let motion = follow(&p, [0.0, 0.0, 0.180_03, 0.0], &force, 0.6, |_| 1.0);
    let slope = |t: f64, v: f64| {
        let rise = 15.0 * (-(v / 1e-5) * (v / 1e-5)).exp();
        (8.0 * (t - 0.3) - rise) / 2.0
    };
    // The classical Runge-Kutta method with steps of 10 us.
    let (mut v, h) = (0.180_03, 1e-5);
    for k in 0..60_000 {
        let t = h * f64::from(k);
        let first = slope(t, v);
        let second = slope(t + h / 2.0, v + h / 2.0 * first);
        let third = slope(t + h / 2.0, v + h / 2.0 * second);
        let fourth = slope(t + h, v + h * third);
        v += h / 6.0 * (first + 2.0 * (second + third) + fourth);
    }
    assert!((v - 0.180_03).abs() > 1e-7, "the rise does not show");
    assert!((motion.state()[2] - v).abs() < 1e-9, "{} {v}", motion.state()[2]);
}

#[test]
fn a_cart_stays_exactly_at_rest_below_the_static_friction() {
    let p = Parameters::default();
    let initial = [0.1, 0.0, 0.0, 0.0];
    for level in [29.999_999, -29.999_999] {
        let motion = follow(&p, initial, &Force::constant(level), 3.0, |_| 0.4);
        assert_eq!((motion.state(), motion.regime()), (&initial, Regime::Stick));
        close(motion.response(&p, level).friction, level);
    }
}

#[test]
fn a_ramp_breaks_the_cart_away_when_it_reaches_the_static_friction() {
    let p = Parameters::default();
    for (slope, moving) in [(20.0, Regime::Forward), (-20.0, Regime::Backward)] {
        let force = Force { value: 0.0, slope, curvature: 0.0, start: 0.0 };
        let breaks = 1.5;
        let before = follow(&p, [0.0; 4], &force, breaks - 1e-10, |_| 1.0);
        assert_eq!(before.regime(), Regime::Stick);
        let after = follow(&p, [0.0; 4], &force, breaks + 1e-10, |_| 1.0);
        assert_eq!(after.regime(), moving);
    }
}

#[test]
fn a_cart_broken_away_by_a_ramp_moves_with_the_cube_of_time() {
    let (mass, level, slope) = (2.0, 5.0, 4.0);
    let force = Force { value: 0.0, slope, curvature: 0.0, start: 0.0 };
    let motion = follow(&sliding_block(mass, level), [0.0; 4], &force, 2.0, |_| 1.0);
    let since = 2.0_f64 - level / slope;
    close(motion.state()[2], slope * since * since / (2.0 * mass));
    close(motion.state()[0], slope * since.powi(3) / (6.0 * mass));
}

#[test]
fn a_moving_cart_pushed_back_harder_than_static_friction_turns_without_sticking() {
    let (mass, level, push) = (2.0, 5.0, -9.0);
    let p = sliding_block(mass, level);
    let turn = 0.6 * mass / (level - push);
    let motion = follow(&p, [0.0, 0.0, 0.6, 0.0], &Force::constant(push), turn + 0.5, |_| 1.0);
    assert_eq!(motion.regime(), Regime::Backward);
    close(motion.state()[2], (push + level) / mass * 0.5);
}

#[test]
fn a_jump_of_the_force_frees_a_held_cart_at_once() {
    let (mass, level) = (2.0, 5.0);
    let p = sliding_block(mass, level);
    let tolerance = Tolerance::default();
    let mut motion = start(&p, [0.0; 4], &Force::constant(0.0));
    motion.advance(&p, &Force::constant(4.9), 0.0, 0.01, &tolerance).unwrap();
    assert_eq!(motion.regime(), Regime::Stick);
    close(motion.response(&p, 8.0).friction, level);
    motion.advance(&p, &Force::constant(8.0), 0.01, 0.0, &tolerance).unwrap();
    assert_eq!(motion.regime(), Regime::Forward);
    motion.advance(&p, &Force::constant(8.0), 0.01, 0.01, &tolerance).unwrap();
    close(motion.state()[2], 0.01 * (8.0 - level) / mass);
}

#[test]
fn a_drop_of_the_friction_frees_a_held_cart_at_once() {
    let (dry, oiled) = (sliding_block(2.0, 5.0), sliding_block(2.0, 3.0));
    let force = Force::constant(-4.0);
    let mut motion = start(&dry, [0.0; 4], &force);
    motion.advance(&dry, &force, 0.0, 0.5, &Tolerance::default()).unwrap();
    assert_eq!(motion.state()[2].to_bits(), 0);
    motion.advance(&oiled, &force, 0.5, 0.5, &Tolerance::default()).unwrap();
    close(motion.state()[2], -0.5 * (4.0 - 3.0) / 2.0);
}

#[test]
fn a_peak_of_the_force_inside_one_step_frees_the_cart() {
    // u - F_s = 1e-4 - 50 s² with s = t - 0.55: positive for 2.8 ms inside a step of up to 100 ms.
    let (mass, level) = (2.0, 5.0);
    let force = Force { value: level + 1e-4, slope: 0.0, curvature: -100.0, start: 0.55 };
    let p = sliding_block(mass, level);
    let mut motion = start(&p, [0.0; 4], &force);
    motion.advance(&p, &force, 0.25, 0.5, &Tolerance::default()).unwrap();
    // From s = -half the cart gains speed; at s = 2 half it has lost it again.
    let half = (1e-4_f64 / 50.0).sqrt();
    let integral = |s: f64| 1e-4 * s * s / 2.0 - 50.0 * s.powi(4) / 12.0;
    let gained = 1e-4 * half - 50.0 * half.powi(3) / 3.0;
    let distance = (integral(2.0 * half) - integral(-half) + gained * 3.0 * half) / mass;
    assert_eq!(motion.regime(), Regime::Stick);
    let moved = motion.state()[0];
    assert!((moved - distance).abs() < 1e-7 * distance, "{moved} {distance}");
}

#[test]
fn a_short_rest_inside_one_step_is_not_missed() {
    // u - F_c = 400 s² - 2 with s = t - 0.1: if the rest were missed, the cart would go back at up to
    // 0.011 m/s, and forward again before the end.
    let p = sliding_block(1.0, 1.0);
    let force = Force { value: -1.0, slope: 0.0, curvature: 800.0, start: 0.1 };
    let motion = follow(&p, [0.0, 0.0, 0.15, 0.0], &force, 0.2, |_| 0.2);
    let free = 2.0_f64.sqrt() / 20.0;
    let gained = 400.0 * (0.001 - free.powi(3)) / 3.0 - 2.0 * (0.1 - free);
    close(motion.state()[2], gained);
}

#[test]
fn of_two_break_aways_inside_one_step_the_earlier_one_happens() {
    // u = -6 + 15000 w² with w = t - 1.02: breaks the cart away backward, lets it stop, and frees
    // it forward, all in less than the longest integration step.
    let (mass, level) = (2.0, 5.0);
    let p = sliding_block(mass, level);
    let force = Force { value: -6.0, slope: 0.0, curvature: 30_000.0, start: 1.02 };
    let tolerance = Tolerance::default();
    let mut motion = start(&p, [0.0; 4], &Force::constant(0.0));
    motion.advance(&p, &Force::constant(0.0), 0.0, 1.0, &tolerance).unwrap();
    motion.advance(&p, &force, 1.0, 0.1, &tolerance).unwrap();
    // Distance of a slide from `from` to `to` under a net force of 15000 w² - deficit.
    let slide = |deficit: f64, from: f64, to: f64| {
        let integral = |w: f64| 1250.0 * w.powi(4) - deficit * w * w / 2.0;
        let rate = 5000.0 * from.powi(3) - deficit * from;
        (integral(to) - integral(from) - rate * (to - from)) / mass
    };
    let (back, forth) = ((1.0_f64 / 15e3).sqrt(), (11.0_f64 / 15e3).sqrt());
    close(motion.state()[0], slide(1.0, -back, 2.0 * back) + slide(11.0, forth, 0.08));
    assert!(slide(1.0, -back, 2.0 * back) < -1e-6);
}

#[test]
fn a_force_that_only_touches_the_static_friction_does_not_move_the_cart() {
    let p = sliding_block(2.0, 5.0);
    let force = Force { value: 5.0, slope: 0.0, curvature: -100.0, start: 0.55 };
    let mut motion = start(&p, [0.0; 4], &Force::constant(0.0));
    motion.advance(&p, &force, 0.25, 0.6, &Tolerance::default()).unwrap();
    assert!(motion.state()[0].abs() < 1e-15, "{motion:?}");
    assert_eq!(motion.regime(), Regime::Stick);
}

#[test]
fn a_force_that_equals_the_static_friction_to_rounding_does_not_stall_the_integration() {
    let parameters = Parameters::default();
    let mut angle = 3.6e-17;
    for k in 0..2000_u32 {
        let below = f64::from(k % 7) * 3.6e-15;
        let slope = (f64::from(k % 11) - 3.0) * 1e-11;
        let force = Force { value: 30.0 - below, slope, curvature: 0.0, start: 0.0 };
        let mut motion = start(&parameters, [0.0, -angle, 0.0, 0.7 * angle], &force);
        motion.advance(&parameters, &force, 0.0, 2e-4, &Tolerance::default()).unwrap();
        assert!(motion.state()[2].abs() < 1e-12, "{:?}", motion.state());
        angle = 1e-18 + (angle * 1.37) % 9e-17;
    }
}

/// Follows the motion in `steps` steps of `size` under a force that is constant in each of them, and that
/// pushes the cart to and fro. Returns the motion and the times of the events at which it `stops`.
fn follow_pushed(
    p: &Parameters,
    initial: State,
    size: f64,
    steps: u32,
    stops: bool,
) -> (Motion, Vec<f64>) {
    let tolerance = Tolerance::default();
    let mut motion = start(p, initial, &Force::constant(0.0));
    let mut events = Vec::new();
    for k in 0..steps {
        let (mut time, end) = (f64::from(k) * size, f64::from(k + 1) * size);
        let force = Force::constant(40.0 * (time * 9.0).sin());
        if !stops {
            motion.advance(p, &force, time, size, &tolerance).unwrap();
            continue;
        }
        while let Some(event) =
            motion.advance_to_event(p, &force, time, end - time, &tolerance).unwrap()
        {
            assert!(event > time && event <= end);
            events.push(event);
            time = event;
        }
    }
    (motion, events)
}

#[test]
fn a_step_to_an_event_ends_where_a_block_stops() {
    let (mass, level, velocity) = (2.0, 5.0, 0.7);
    let p = sliding_block(mass, level);
    let force = Force::constant(0.0);
    let mut motion = start(&p, [0.0, 0.0, velocity, 0.0], &force);
    let mut to = |from: f64, to: f64| {
        motion.advance_to_event(&p, &force, from, to - from, &Tolerance::default()).unwrap()
    };
    let stop = to(0.0, 0.25).or_else(|| to(0.25, 0.5)).unwrap();
    close(stop, velocity * mass / level);
    assert_eq!(to(stop, 0.5), None);
    assert_eq!((motion.regime(), motion.state()[2].to_bits()), (Regime::Stick, 0));
}

#[test]
fn a_motion_that_stops_at_its_events_has_the_bits_of_one_that_does_not() {
    let p = Parameters::default();
    let initial = [0.0, 0.02, 0.3, 0.0];
    let (stopping, events) = follow_pushed(&p, initial, 1.0 / 128.0, 400, true);
    assert!(events.len() > 5, "{events:?}");
    let (whole, _) = follow_pushed(&p, initial, 1.0 / 128.0, 400, false);
    assert_eq!(stopping.state().map(f64::to_bits), whole.state().map(f64::to_bits));
    assert_eq!(stopping.regime(), whole.regime());
}
