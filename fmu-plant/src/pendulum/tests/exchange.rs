//! The model as an importer integrates it: regimes, indicators and events.

use super::*;

/// The velocity in m/s at which a cart that slows down counts as stopped, and the nominal velocity.
const REST: f64 = 1e-9;
const NOMINAL: f64 = 0.1;

fn indicators(model: &mut FrictionPendulum) -> [f64; INDICATORS] {
    let mut actual = [f64::NAN; INDICATORS];
    model.update(0.0).unwrap();
    model.event_indicators(0.0, &mut actual);
    actual
}

/// A time step of the classical Runge-Kutta method, as an importer takes it.
fn runge_kutta(model: &FrictionPendulum, length: f64) -> FrictionPendulum {
    let start = *model.motion.state();
    let slope_after = |time: f64, slope: &[f64; 4]| {
        let mut inner = model.clone();
        *inner.motion.state_mut() = std::array::from_fn(|k| start[k] + time * slope[k]);
        inner.update(0.0).unwrap();
        // As der(x_p) and der(theta) are named: aliases of v_p and omega.
        let [.., velocity, rate] = *inner.motion.state();
        [velocity, rate, inner.slope[2], inner.slope[3]]
    };
    let k1 = slope_after(0.0, &[0.0; 4]);
    let k2 = slope_after(length / 2.0, &k1);
    let k3 = slope_after(length / 2.0, &k2);
    let k4 = slope_after(length, &k3);
    let mut end = model.clone();
    *end.motion.state_mut() =
        std::array::from_fn(|k| start[k] + length / 6.0 * (k1[k] + 2.0 * (k2[k] + k3[k]) + k4[k]));
    end
}

/// Integrates for `duration` and handles the events; returns the regimes before and after each.
fn integrate(model: &mut FrictionPendulum, duration: f64, step: f64) -> Vec<(i32, i32)> {
    let (mut time, mut events) = (0.0, Vec::new());
    while time < duration {
        let length = step.min(duration - time);
        let crossed =
            |length| indicators(&mut runge_kutta(model, length)).iter().any(|z| *z <= 0.0);
        if !crossed(length) {
            *model = runge_kutta(model, length);
            time += length;
            continue;
        }
        let (mut before, mut after) = (0.0, length);
        for _ in 0..60 {
            let middle = 0.5 * (before + after);
            if crossed(middle) { after = middle } else { before = middle }
        }
        *model = runge_kutta(model, after);
        time += after;
        let regime = model.regime;
        let event = model.event(0.0).unwrap();
        assert!(!event.new_discrete_states_needed);
        assert!(indicators(model).iter().all(|z| *z > 0.0));
        events.push((regime, model.regime));
        assert!(events.len() < 100, "events without end");
    }
    events
}

/// Compares the motion of an importer with that of the model's own steps, each force held 0.1 s; returns the events.
fn compare(linearised: bool, initial: [f64; 4], forces: &[f64]) -> Vec<(i32, i32)> {
    let fresh = || {
        started(|model| {
            (model.parameters.linearised, model.initial) = (linearised, initial);
        })
    };
    let (mut imported, mut stepped, mut time) = (fresh(), fresh(), 0.0);
    let mut events = Vec::new();
    for &u in forces {
        (imported.u, stepped.u) = (u, u);
        assert!(!imported.event(time).unwrap().values_of_continuous_states_changed);
        events.extend(integrate(&mut imported, 0.1, 2e-4));
        stepped.step(&Step { start: time, size: 0.1 }).unwrap();
        time += 0.1;
        imported.update(time).unwrap();
        assert_eq!(imported.regime, stepped.regime, "after {u} N");
        for (one, other) in imported.motion.state().iter().zip(stepped.motion.state()) {
            let bound = 1e-8 * other.abs().max(1.0);
            assert!((one - other).abs() < bound, "after {u} N: {one} {other}");
        }
    }
    events
}

#[test]
fn an_importer_that_integrates_comes_to_where_the_own_integration_comes() {
    for linearised in [false, true] {
        let moving = [0.1, 0.2, 0.3, 0.0];
        let events = compare(linearised, moving, &[0.0, 60.0, -70.0, 20.0]);
        assert_eq!(events[..3], [(1, 0), (1, -1), (-1, 0)]);
        let leaning = [0.0, -0.06, 0.0, 0.0];
        assert_eq!(compare(linearised, leaning, &[29.5, 29.5, 0.0]), [(0, 1), (1, 0)]);
    }
}

#[test]
fn a_cart_that_turned_round_stands_still_at_the_event_and_only_there() {
    let mut model = started(|model| model.initial = [0.1, 0.0, 0.2, 0.0]);
    model.motion.state_mut()[2] = -1e-9;
    model.update(0.0).unwrap();
    assert_eq!((model.regime, indicators(&mut model)), (1, [(-1e-9 - REST) / NOMINAL, 1.0, 1.0]));
    assert!(model.event(0.0).unwrap().values_of_continuous_states_changed);
    assert_eq!((model.regime, model.motion.state()[2].to_bits()), (0, 0));
    let before = model.motion.clone();
    assert_eq!(model.event(0.0).unwrap(), Event::default());
    assert_eq!(model.motion, before);
}

#[test]
fn a_cart_that_stops_under_a_great_force_goes_the_other_way_at_once() {
    let mut model = started(|model| (model.initial, model.u) = ([0.0, 0.0, 0.2, 0.0], -40.0));
    model.motion.state_mut()[2] = -1e-9;
    assert!(model.event(0.0).unwrap().values_of_continuous_states_changed);
    assert_eq!((model.regime, indicators(&mut model)), (-1, [REST / NOMINAL, 1.0, 1.0]));
    assert!(model.slope[2] < -1.0, "it accelerates backward: {}", model.slope[2]);
}

#[test]
fn a_jump_of_the_force_frees_the_cart_at_the_event_without_a_jump_of_the_state() {
    for (u, regime) in [(30.1, 1), (-30.1, -1), (29.9, 0)] {
        let mut model = started(|model| model.initial = [0.0; 4]);
        model.u = u;
        model.update(0.0).unwrap();
        assert_eq!((model.regime, model.slope), (0, [0.0; 4]), "the regime is frozen");
        assert_eq!(indicators(&mut model).iter().any(|z| *z <= 0.0), regime != 0);
        assert!(!model.event(0.0).unwrap().values_of_continuous_states_changed);
        assert_eq!(model.regime, regime);
        assert_eq!(model.slope[2] != 0.0, regime != 0);
    }
}

#[test]
fn less_static_friction_frees_the_cart_at_the_event() {
    let mut model = started(|model| (model.initial, model.u) = ([0.0; 4], 20.0));
    (model.parameters.coulomb, model.parameters.static_friction) = (10.0, 15.0);
    assert_eq!(model.event(0.0).unwrap(), Event::default());
    assert_eq!(model.regime, 1);
}

/// States and forces on and about the edges of the regimes.
fn edges(visit: impl Fn(FrictionPendulum)) {
    for (coulomb, limit) in [(25.0, 30.0), (0.1, 0.3), (0.0, 0.0)] {
        for started_with in [-0.2, 0.0, 0.2] {
            for velocity in [-0.3, -1e-12, -0.0, 0.0, 1e-12, 0.3] {
                for u in [-2.0, -1.0 - 1e-15, -1.0, -0.5, 0.0, 0.5, 1.0, 1.0 + 1e-15, 2.0] {
                    for angle in [0.0, 0.3] {
                        let mut model = started(|model| {
                            model.initial = [0.0, 0.0, started_with, 0.0];
                            model.parameters.coulomb = coulomb;
                            model.parameters.static_friction = limit;
                        });
                        model.u = u * f64::max(limit, 1e-3);
                        *model.motion.state_mut() = [0.0, angle, velocity, 0.0];
                        visit(model);
                    }
                }
            }
        }
    }
}

#[test]
fn after_an_event_every_indicator_is_positive_and_a_further_event_changes_nothing() {
    edges(|mut model| {
        model.event(0.0).unwrap();
        assert!(indicators(&mut model).iter().all(|z| *z > 0.0));
        let before = (model.motion.clone(), model.slope.map(f64::to_bits));
        assert_eq!(model.event(0.0).unwrap(), Event::default());
        assert_eq!((model.motion.clone(), model.slope.map(f64::to_bits)), before);
    });
}

#[test]
fn an_indicator_that_is_not_positive_means_that_the_event_changes_regime_or_state() {
    edges(|mut model| {
        if indicators(&mut model).iter().all(|z| *z > 0.0) {
            return;
        }
        let before = model.motion.clone();
        let event = model.event(0.0).unwrap();
        assert_ne!(model.motion, before);
        let changed = model.motion.state().map(f64::to_bits) != before.state().map(f64::to_bits);
        assert_eq!(event.values_of_continuous_states_changed, changed);
    });
}
