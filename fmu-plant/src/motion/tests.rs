//! Physical laws of the plant's motion: closed forms, energy, independence of the communication
//! steps.

use super::*;

mod events;
mod exchange;
mod reference;

/// A cart that does not feel its pendulum, with the friction `level` at every speed.
fn sliding_block(mass: f64, level: f64) -> Parameters {
    Parameters {
        cart_mass: mass,
        pendulum_mass: 0.0,
        cart_damping: 0.0,
        coulomb: level,
        static_friction: level,
        ..Parameters::default()
    }
}

fn start(parameters: &Parameters, initial: State, force: &Force) -> Motion {
    parameters.check().unwrap();
    Motion::start(parameters, initial, force.at(0.0)).unwrap()
}

/// Follows the motion from 0 to `end` in communication steps of the length `cut(k)`.
fn follow(
    parameters: &Parameters,
    initial: State,
    force: &Force,
    end: f64,
    cut: impl Fn(u32) -> f64,
) -> Motion {
    let mut motion = start(parameters, initial, force);
    let mut time = 0.0;
    for k in 0.. {
        let next = (time + cut(k)).min(end);
        let duration = next - time;
        motion.advance(parameters, force, time, duration, &Tolerance::default()).unwrap();
        time = next;
        if time >= end {
            break;
        }
    }
    motion
}

/// `(M+m) v²/2 + m l v omega cos theta + J omega²/2 + m g l cos theta`.
fn energy(p: &Parameters, [_, angle, v, rate]: State) -> f64 {
    let moment = p.pendulum_mass * p.length;
    let kinetic = 0.5 * (p.cart_mass + p.pendulum_mass) * v * v
        + moment * v * rate * angle.cos()
        + 0.5 * p.inertia * rate * rate;
    kinetic + moment * p.gravity * angle.cos()
}

/// Power of the force minus the power of dampers and friction.
fn power(p: &Parameters, [_, _, v, rate]: State, force: f64) -> f64 {
    let ratio: f64 = v.abs() / p.stribeck_velocity;
    let stribeck = (-ratio.powf(p.stribeck_exponent)).exp();
    let friction = p.coulomb + (p.static_friction - p.coulomb) * stribeck;
    force * v - friction * v.abs() - p.cart_damping * v * v - p.pendulum_damping * rate * rate
}

#[test]
fn the_energy_changes_by_the_work_of_force_dampers_and_friction() {
    let force = Force { value: 10.0, slope: 80.0, curvature: -90.0, start: 0.0 };
    let (half, pairs) = (1e-4, 15_000);
    for exponent in [0.5, 1.0, 2.0, 3.7] {
        let p = Parameters { stribeck_exponent: exponent, ..Parameters::default() };
        let mut motion = start(&p, [0.1, 0.6, 0.4, -0.2], &force);
        let before = energy(&p, *motion.state());
        let mut work = 0.0;
        for k in 0..pairs {
            let time = 2.0 * half * f64::from(k);
            let mut powers = [power(&p, *motion.state(), force.at(time)), 0.0, 0.0];
            for (i, from) in [(1, time), (2, time + half)] {
                motion.advance(&p, &force, from, half, &Tolerance::default()).unwrap();
                powers[i] = power(&p, *motion.state(), force.at(from + half));
            }
            work += half / 3.0 * (powers[0] + 4.0 * powers[1] + powers[2]);
        }
        let change = energy(&p, *motion.state()) - before;
        assert!(change.abs() > 1.0, "{change} J tell nothing");
        assert!((change - work).abs() < 1e-6 * change.abs(), "{exponent}: {change} {work}");
    }
}

#[test]
fn without_friction_and_dampers_the_energy_is_kept() {
    let p = Parameters {
        coulomb: 0.0,
        static_friction: 0.0,
        cart_damping: 0.0,
        pendulum_damping: 0.0,
        ..Parameters::default()
    };
    let force = Force::constant(0.0);
    let initial = [0.0, 0.5, 0.0, 0.0];
    let motion = follow(&p, initial, &force, 5.0, |_| 0.3);
    let change = energy(&p, *motion.state()) - energy(&p, initial);
    assert!(change.abs() < 1e-7 * energy(&p, initial), "{change}");
    assert!(motion.state()[2].abs() > 1e-3, "the cart is driven by the pendulum");
}

#[test]
fn friction_opposes_the_motion_with_the_magnitude_of_the_law() {
    let p = Parameters::default();
    for velocity in [1.0, 0.05, -0.05, -1.0_f64] {
        let motion = start(&p, [0.0, 0.2, velocity, 0.0], &Force::constant(0.0));
        let friction = motion.response(&p, 0.0).friction;
        let magnitude = 25.0 + 5.0 * (-(velocity / 0.15) * (velocity / 0.15)).exp();
        assert!((friction - magnitude * velocity.signum()).abs() < 1e-12);
    }
}

#[test]
fn the_upright_rest_is_an_equilibrium() {
    for linearised in [false, true] {
        let p = Parameters { linearised, ..Parameters::default() };
        let motion = follow(&p, [0.3, 0.0, 0.0, 0.0], &Force::constant(0.0), 5.0, |_| 1.0);
        assert_eq!(motion.state().map(f64::to_bits), [0.3, 0.0, 0.0, 0.0].map(f64::to_bits));
        assert_eq!(motion.regime(), Regime::Stick);
    }
}

#[test]
fn the_linearised_pendulum_on_a_held_cart_falls_like_a_hyperbolic_cosine() {
    let p = Parameters { linearised: true, pendulum_damping: 0.0, ..Parameters::default() };
    let motion = follow(&p, [0.0, 1e-3, 0.0, 0.0], &Force::constant(0.0), 0.8, |_| 0.17);
    let rate = (p.pendulum_mass * p.length * p.gravity / p.inertia).sqrt();
    let exact = [0.0, 1e-3 * (rate * 0.8).cosh(), 0.0, 1e-3 * rate * (rate * 0.8).sinh()];
    for (value, exact) in motion.state().iter().zip(exact) {
        assert!((value - exact).abs() <= 1e-9 * exact, "{value} {exact}");
    }
}

#[test]
fn the_result_does_not_depend_on_how_the_interval_is_cut() {
    let force = Force { value: 0.0, slope: 60.0, curvature: -90.0, start: 0.0 };
    let initial = [0.1, -0.1, 0.2, 0.0];
    for linearised in [false, true] {
        let p = Parameters { linearised, ..Parameters::default() };
        let by = |cut: &dyn Fn(u32) -> f64| *follow(&p, initial, &force, 2.0, cut).state();
        let milli = by(&|_| 1e-3);
        let uneven = by(&|k| 7e-3 * (1.0 + 0.9 * f64::from(k).sin()));
        let whole = by(&|_| 1.0);
        // The first stop, at 25 ms, is in one of the microsecond steps.
        let micro = by(&|k| if k < 50_000 { 1e-6 } else { 1e-3 });
        for other in [uneven, whole, micro] {
            for (one, other) in milli.iter().zip(other) {
                let difference = (one - other).abs();
                assert!(difference < 1e-8 * one.abs().max(1.0), "{one} {other}");
            }
        }
    }
}

#[test]
fn a_copy_continues_with_the_same_bits() {
    let p = Parameters::default();
    let force = |k: u32| Force::constant(45.0 * (0.05 * f64::from(k)).sin());
    let tolerance = Tolerance::default();
    let mut motion = start(&p, [0.1, 0.5, 0.0, 0.0], &force(0));
    let mut copy = motion.clone();
    for k in 0..400 {
        if k % 7 == 0 {
            copy = motion.clone();
        }
        let time = 0.01 * f64::from(k);
        motion.advance(&p, &force(k), time, 0.01, &tolerance).unwrap();
        copy.advance(&p, &force(k), time, 0.01, &tolerance).unwrap();
        assert_eq!(motion.state().map(f64::to_bits), copy.state().map(f64::to_bits));
        assert_eq!(motion, copy);
    }
}

#[test]
fn bad_input_is_refused_and_leaves_the_motion_as_it_was() {
    let p = Parameters::default();
    let tolerance = Tolerance::default();
    let mut motion = start(&p, [0.1, 0.5, 0.2, 0.0], &Force::constant(0.0));
    let before = motion.clone();
    let failure = motion.advance(&p, &Force::constant(f64::NAN), 3.0, 0.1, &tolerance);
    assert_eq!(failure, Err(Failure::NotFinite { time: 3.0 }));
    let failure = motion.advance(&p, &Force::constant(1e308), 3.0, 0.1, &tolerance);
    assert_eq!(failure, Err(Failure::NotFinite { time: 3.0 }));
    let failure = motion.advance(&p, &Force::constant(0.0), 3.0, -0.1, &tolerance);
    assert_eq!(failure, Err(Failure::Interval { start: 3.0, duration: -0.1 }));
    assert_eq!(motion.state().map(f64::to_bits), before.state().map(f64::to_bits));
    let mut wild = start(&p, [0.0, 0.0, 0.0, 1e160], &Force::constant(0.0));
    let failure = wild.advance(&p, &Force::constant(0.0), 3.0, 0.1, &tolerance);
    assert_eq!(failure, Err(Failure::NotFinite { time: 3.0 }));
    let refusal = Motion::start(&p, [0.0, f64::NAN, 0.0, 0.0], 0.0).unwrap_err();
    assert_eq!(refusal.name, "theta_0");
    assert_eq!(Tolerance::new(0.0).unwrap_err().name, "tolerance");
}
