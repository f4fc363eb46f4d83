//! The output derivative of the friction against central differences of the friction.

use super::*;

/// The model `duration` s on, under inputs that change with time.
fn after(model: &FrictionPendulum, duration: f64) -> FrictionPendulum {
    let mut model = model.clone();
    (model.u_derivatives, model.f_a_derivatives) = ([30.0, -400.0], [-7.0, 90.0]);
    model.step(&Step { start: 0.0, size: duration }).unwrap();
    model
}

fn assert_rate(model: &FrictionPendulum, duration: f64) {
    let apart = 1e-5;
    let friction = |shift: f64| {
        let moved = after(model, duration + shift);
        assert_eq!(moved.regime, model.regime, "an event in between");
        moved.f_fric
    };
    let quotient = (friction(apart) - friction(-apart)) / (2.0 * apart);
    let actual = *after(model, duration).friction_rate();
    let bound = 1e-6 * quotient.abs().max(1.0);
    assert!((actual - quotient).abs() < bound, "regime {}: {actual} {quotient}", model.regime);
}

#[test]
fn in_every_regime_the_rate_of_the_friction_is_its_difference_quotient() {
    for exponent in [1.0, 1.4, 2.0] {
        for mut model in everywhere() {
            model.parameters.stribeck_exponent = exponent;
            assert_rate(&model, 5e-3);
        }
    }
}

#[test]
fn a_held_cart_pushed_beyond_the_static_friction_has_a_friction_that_stays() {
    let mut model = started(|model| model.initial = [0.0; 4]);
    (model.u, model.u_derivatives) = (31.0, [50.0, 0.0]);
    model.update(0.0).unwrap();
    assert_eq!((model.regime, model.friction_rate().to_bits()), (0, 0));
}

#[test]
fn where_the_friction_falls_infinitely_fast_the_rate_is_zero() {
    let mut model = started(|model| {
        (model.initial, model.u) = ([0.0; 4], 40.0);
        model.parameters.stribeck_exponent = 0.5;
    });
    assert_eq!((model.regime, model.friction_rate().to_bits()), (1, 0));
}
