//! Directional derivatives compared with difference quotients, and points without a derivative.

use super::knowns::{
    AT_A_POINT, UNKNOWNS, at_initialization, field, moved_at_a_point, moved_at_initialization,
    unknowns,
};
use super::*;

const NOW: At = At::Point { time: 0.0, delta_time: 0.0 };

/// Derivatives of the unknowns in the direction with these components.
fn along(
    model: &FrictionPendulum,
    at: &At,
    components: &[(&str, f64)],
) -> Result<[f64; 7], Failure> {
    let mut direction = model.clone();
    let knowns = at_initialization();
    for known in knowns.iter().map(String::as_str).chain(AT_A_POINT) {
        *field(&mut direction, known) = 0.0;
    }
    (direction.f_fric, direction.slope) = (0.0, [0.0; 4]);
    for (known, component) in components {
        *field(&mut direction, known) = *component;
    }
    model.differentiate(at, &mut direction)?;
    Ok(unknowns(&direction))
}

fn column(model: &FrictionPendulum, at: &At, known: &str) -> [f64; 7] {
    along(model, at, &[(known, 1.0)]).unwrap()
}

/// The difference quotient of fourth order, from four values about the present one.
fn quotient(size: f64, moved: impl Fn(f64) -> [f64; 7]) -> [f64; 7] {
    let step = 1e-4 * size.abs().max(0.1);
    let [before, back, ahead, beyond] = [-2.0, -1.0, 1.0, 2.0].map(|k| moved(k * step));
    std::array::from_fn(|k| (8.0 * (ahead[k] - back[k]) - (beyond[k] - before[k])) / (12.0 * step))
}

fn assert_close(actual: &[f64; 7], expected: &[f64; 7], known: &str) {
    for ((name, actual), expected) in UNKNOWNS.iter().zip(actual).zip(expected) {
        let bound = 1e-7 * expected.abs().max(1.0);
        assert!((actual - expected).abs() < bound, "d {name} / d {known}: {actual} {expected}");
    }
}

#[test]
fn at_a_point_they_are_the_difference_quotients_in_all_regimes() {
    for model in everywhere() {
        for known in AT_A_POINT {
            if known == "v_p" && model.motion.state()[2].abs() < 1e-3 && model.regime != 0 {
                continue; // The friction has two branches here: see the test of the right side.
            }
            let size = *field(&mut model.clone(), known);
            let expected = quotient(size, |shift| moved_at_a_point(&model, known, shift));
            assert_close(&column(&model, &NOW, known), &expected, known);
        }
    }
}

/// At rest in its equilibrium a cart without friction counts as sticking, but nothing holds it. The
/// linearised equations (20), with the determinant D = (M + m) J - (m l)^2, are
///
/// ```text
/// v'     = (J (u - F_x v) - m l (m l g theta - F_theta omega)) / D
/// omega' = (-m l (u - F_x v) + (M + m) (m l g theta - F_theta omega)) / D
/// ```
#[test]
fn without_friction_the_derivatives_at_rest_are_those_of_a_free_cart() {
    for (exponent, angle) in [(2.0, 0.0), (0.5, 0.0), (2.0, std::f64::consts::PI)] {
        let model = started(|model| {
            (model.parameters.coulomb, model.parameters.static_friction) = (0.0, 0.0);
            model.parameters.stribeck_exponent = exponent;
            model.initial = [0.0, angle, 0.0, 0.0];
        });
        let p = &model.parameters;
        let moment = p.pendulum_mass * p.length * angle.cos();
        let total = p.cart_mass + p.pendulum_mass;
        let determinant = total * p.inertia - moment * moment;
        let weight = moment * p.gravity;
        let pair = |push: f64, torque: f64| {
            let v = (p.inertia * push - moment * torque) / determinant;
            [v, (total * torque - moment * push) / determinant]
        };
        for (known, [v, omega]) in [
            ("u", pair(1.0, 0.0)),
            ("f_a", pair(1.0, 0.0)),
            ("x_p", [0.0; 2]),
            ("theta", pair(0.0, weight)),
            ("v_p", pair(-p.cart_damping, 0.0)),
            ("omega", pair(0.0, -p.pendulum_damping)),
        ] {
            let actual = column(&model, &NOW, known);
            for (name, expected) in [("der(v_p)", v), ("der(omega)", omega), ("f_fric", 0.0)] {
                let at = UNKNOWNS.iter().position(|unknown| *unknown == name).unwrap();
                let error = (actual[at] - expected).abs();
                assert!(error < 1e-12 * expected.abs().max(1.0), "d {name} / d {known}: {error}");
            }
        }
    }
}

#[test]
fn at_initialization_they_are_the_difference_quotients_in_every_known() {
    for exponent in [2.0, 1.4] {
        for mut model in everywhere() {
            model.parameters.stribeck_exponent = exponent;
            model.initialize(&Experiment::default()).unwrap();
            for known in at_initialization() {
                if known == "v_p_0" && model.initial[2] == 0.0 {
                    continue; // The start is at rest or not: the regime would change.
                }
                let size = *field(&mut model.clone(), &known);
                let moved = |shift| moved_at_initialization(&model, &known, shift);
                let actual = column(&model, &At::Initialization, &known);
                assert_close(&actual, &quotient(size, moved), &known);
            }
        }
    }
}

#[test]
fn a_direction_of_several_knowns_gives_the_sum_of_their_columns() {
    let direction = [("u", 0.3), ("theta", -1.2), ("v_p", 0.7), ("omega", 2.0)];
    for model in everywhere() {
        let mut sum = [0.0; 7];
        for (known, component) in direction {
            let of_known = column(&model, &NOW, known);
            sum = std::array::from_fn(|k| sum[k] + component * of_known[k]);
        }
        let actual = along(&model, &NOW, &direction).unwrap();
        for (actual, sum) in actual.iter().zip(sum) {
            assert!((actual - sum).abs() < 1e-13 * sum.abs().max(1.0), "{actual} {sum}");
        }
    }
}

#[test]
fn with_respect_to_time_all_are_zero() {
    for model in everywhere() {
        let actual = along(&model, &At::Point { time: 0.0, delta_time: 1.0 }, &[]).unwrap();
        assert!(actual.iter().all(|part| *part == 0.0), "{actual:?}");
    }
}

#[test]
fn a_held_cart_hands_the_force_to_the_friction_up_to_the_static_one_and_no_further() {
    let mut model = started(|model| model.initial = [0.0; 4]);
    for (u, slope) in [(29.0, 1.0), (30.0, 1.0), (30.5, 0.0), (-30.0, 1.0), (-31.0, 0.0)] {
        model.u = u;
        model.update(0.0).unwrap();
        assert_eq!(model.motion.regime(), Regime::Stick);
        let [friction, others @ ..] = column(&model, &NOW, "u");
        assert!((friction - slope).abs() < f64::EPSILON, "{u} N: {friction}");
        assert!(others.iter().all(|part| *part == 0.0), "{u} N: {others:?}");
    }
}

#[test]
fn after_a_step_they_belong_to_the_force_at_its_end() {
    // The force falls from 40 N, more than F_s, to zero; the cart slides and stops again.
    let mut model = started(|model| model.initial = [0.0; 4]);
    (model.u, model.u_derivatives) = (40.0, [-400.0, 0.0]);
    model.step(&Step { start: 0.0, size: 0.1 }).unwrap();
    assert_eq!(model.motion.regime(), Regime::Stick);
    assert!(model.motion.state()[0] > 0.0 && model.f_fric.abs() < 1.0);
    assert_eq!(column(&model, &NOW, "u")[0].to_bits(), 1.0_f64.to_bits());
}

#[test]
fn of_a_cart_that_breaks_away_they_are_those_of_the_side_it_slides_to() {
    for (u, exponent, slope) in
        [(40.0, 1.0, -5.0 / 0.15), (-40.0, 1.0, -5.0 / 0.15), (40.0, 1.5, 0.0)]
    {
        let model = started(|model| {
            (model.initial, model.u) = ([0.0; 4], u);
            model.parameters.stribeck_exponent = exponent;
        });
        assert_eq!(model.motion.regime().sign().to_bits(), u.signum().to_bits());
        let actual = column(&model, &NOW, "v_p")[0];
        assert!((actual - slope).abs() < 1e-12, "{actual} {slope}");
        let step = 1e-9 * u.signum();
        let ahead = (moved_at_a_point(&model, "v_p", step)[0] - model.f_fric) / step;
        assert!((ahead - slope).abs() < 0.02, "{ahead} {slope}");
    }
}

#[test]
fn where_the_friction_is_infinitely_steep_there_is_none() {
    let model = started(|model| {
        (model.initial, model.u) = ([0.0; 4], 40.0);
        model.parameters.stribeck_exponent = 0.5;
    });
    let refused = along(&model, &NOW, &[("v_p", 1.0)]).unwrap_err();
    assert!(matches!(&refused, Failure::Error(text) if text.contains("delta = 0.5")), "{refused}");
    assert_eq!(column(&model, &NOW, "u")[0].to_bits(), 0);
    for known in ["delta", "v_s", "F_s"] {
        assert!(along(&model, &At::Initialization, &[(known, 1.0)]).is_ok(), "{known}");
    }
}
