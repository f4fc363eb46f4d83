//! Stop and break-away with the errors of an importer: located too early, too late, or hardly at
//! all.

use super::*;

/// The mass in kg, and the friction in N at every speed.
const MASS: f64 = 2.0;
const LEVEL: f64 = 5.0;

fn sliding_at(parameters: &Parameters, velocity: f64) -> Motion {
    let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
    let mut motion = start(parameters, [0.0, 0.0, 0.3 * direction, 0.0], &Force::constant(0.0));
    motion.state_mut()[2] = velocity;
    motion
}

fn is_due(motion: &Motion, parameters: &Parameters, force: f64) -> bool {
    motion.indicators(parameters, force).iter().any(|indicator| *indicator <= 0.0)
}

/// Where the friction is balanced, `M v' = -F_x v`: the velocity never becomes zero.
#[test]
fn a_velocity_that_dies_out_exponentially_ends_in_rest_and_stays_there() {
    let p = Parameters { cart_damping: 4.0, ..sliding_block(MASS, LEVEL) };
    for direction in [1.0, -1.0] {
        let mut motion = sliding_at(&p, 0.3 * direction);
        let (force, mut events) = (LEVEL * direction, Vec::new());
        for k in 0..4000 {
            let velocity = motion.state()[2];
            motion.state_mut()[2] = velocity / (1.0 + 0.01 * p.cart_damping / MASS);
            if is_due(&motion, &p, force) {
                events.push((0.01 * f64::from(k), motion.settle(&p, force)));
            }
        }
        let [(time, true)] = events[..] else { panic!("one event expected: {events:?}") };
        // ln(0.3 / 1e-9) / 2 = 9.76 s, up to the error of the Euler steps.
        assert!((9.7..10.0).contains(&time), "{time}");
        assert_eq!((motion.regime(), motion.state()[2].to_bits()), (Regime::Stick, 0));
    }
}

#[test]
fn a_stop_located_a_little_early_or_late_is_a_stop() {
    let p = sliding_block(MASS, LEVEL);
    for sign in [1, -1] {
        let direction = f64::from(sign);
        for velocity in [9e-9, 1e-9 + 1e-15, 1e-9, 1e-13, 0.0, -1e-13, -1e-9, -1e-4] {
            for (push, then) in [(0.0, Regime::Stick), (-9.0, Regime::Backward)] {
                let mut motion = sliding_at(&p, 0.3 * direction);
                motion.state_mut()[2] = velocity * direction;
                let force = push * direction;
                assert_eq!(is_due(&motion, &p, force), velocity <= 1e-9, "{velocity}");
                assert_eq!(motion.settle(&p, force), velocity != 0.0, "{velocity}");
                assert_eq!(motion.regime().number() * sign, then.number());
                assert!(motion.state()[2] == 0.0 && !is_due(&motion, &p, force));
            }
        }
    }
}

#[test]
fn a_break_away_located_a_little_early_happens_and_goes_on() {
    let p = sliding_block(MASS, LEVEL);
    let held = start(&p, [0.0; 4], &Force::constant(0.0));
    for direction in [1.0, -1.0] {
        for (excess, due, breaks) in [
            (1e-7, false, false),
            (0.999e-6, false, true),
            (1.001e-6, true, true),
            (1.0, true, true),
        ] {
            let mut motion = held.clone();
            let force = direction * LEVEL * (1.0 + excess);
            assert_eq!(is_due(&motion, &p, force), due, "{excess}");
            assert!(!motion.settle(&p, force));
            assert_eq!(motion.regime() != Regime::Stick, breaks, "{excess}");
            for velocity in [0.0, 1e-17, 1e-12, 0.9e-9, 1.1e-9, 1e-7] {
                motion.state_mut()[2] = if breaks { direction * velocity } else { 0.0 };
                let before = motion.clone();
                assert!(!is_due(&motion, &p, force), "{excess} {velocity}");
                assert!(!motion.settle(&p, force) && motion == before, "{excess} {velocity}");
            }
        }
    }
}

#[test]
fn a_cart_that_stopped_under_great_damping_is_held_and_does_not_chatter() {
    let p = Parameters { cart_damping: 1e4, ..sliding_block(MASS, LEVEL) };
    for velocity in [1e-9, 9e-9] {
        let mut motion = sliding_at(&p, velocity);
        let force = LEVEL + 0.9 * p.cart_damping * velocity;
        assert!(motion.settle(&p, force));
        assert_eq!(motion.regime(), Regime::Stick);
        assert!(!is_due(&motion, &p, force) && !motion.settle(&p, force));
    }
}

#[test]
fn an_event_for_another_reason_leaves_a_moving_cart_alone() {
    let p = sliding_block(MASS, LEVEL);
    for velocity in [0.3, 1e-3, 1.1e-8, -1.1e-8, -0.3] {
        for force in [-30.0, 0.0, 30.0] {
            let mut motion = sliding_at(&p, velocity);
            let before = motion.clone();
            assert!(!motion.settle(&p, force) && motion == before, "{velocity} {force}");
        }
    }
}

#[test]
fn a_stop_found_where_the_acceleration_changes_its_sign_is_a_stop_at_either_side() {
    let p = sliding_block(MASS, LEVEL);
    for (excess, due) in [(1e-9, false), (1e-14, false), (-1e-14, true), (-1e-9, true)] {
        let mut motion = sliding_at(&p, 1e-13);
        let force = LEVEL + excess;
        assert_eq!(is_due(&motion, &p, force), due, "{excess}");
        assert!(motion.settle(&p, force), "{excess}");
        assert_eq!((motion.regime(), motion.state()[2].to_bits()), (Regime::Stick, 0));
        assert!(!is_due(&motion, &p, force) && !motion.settle(&p, force));
    }
}
