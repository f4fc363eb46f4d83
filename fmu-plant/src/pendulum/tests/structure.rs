//! The stated dependencies, by perturbation of every known at every point.

use std::collections::BTreeSet;

use super::knowns::{
    AT_A_POINT, UNKNOWNS, at_initialization, field, moved_at_a_point, moved_at_initialization,
    unknowns,
};
use super::*;
use crate::pendulum::variables::{CART, DEPENDS, FRICTION_INITIALLY};

type Found = [BTreeSet<String>; 7];

/// Records which unknowns the change of `known` has changed.
fn record(actual: &mut Found, known: &str, before: &[f64; 7], after: &[f64; 7]) {
    for (k, names) in actual.iter_mut().enumerate() {
        if before[k].to_bits() != after[k].to_bits() {
            names.insert(known.to_owned());
        }
    }
}

fn assert_stated(actual: &Found, stated: [&[&str]; 7]) {
    for ((unknown, actual), stated) in UNKNOWNS.iter().zip(actual).zip(stated) {
        let stated: BTreeSet<String> = stated.iter().map(|name| (*name).to_owned()).collect();
        assert_eq!(*actual, stated, "{unknown}");
    }
}

/// Small and large, to both sides.
const SHIFTS: [f64; 4] = [-0.4, -1e-3, 1e-3, 0.4];

#[test]
fn no_rule_of_the_description_is_broken() {
    assert_eq!(fmu::problems::<FrictionPendulum>(Path::new("")).unwrap(), []);
}

#[test]
fn between_events_each_unknown_depends_on_what_is_stated_and_on_nothing_else() {
    let mut actual = Found::default();
    for model in everywhere() {
        for known in AT_A_POINT {
            for shift in SHIFTS {
                let after = moved_at_a_point(&model, known, shift);
                record(&mut actual, known, &unknowns(&model), &after);
            }
        }
    }
    let position = ["x_p"; 1];
    let states: [&[&str]; 4] = [&position, &["theta"], &["v_p"], &["omega"]];
    let [x, angle, velocity, rate] = states;
    assert_stated(&actual, [&DEPENDS, &DEPENDS, &DEPENDS, x, angle, velocity, rate]);
}

#[test]
fn at_initialization_each_unknown_depends_on_what_is_stated_and_on_nothing_else() {
    let mut actual = Found::default();
    for model in everywhere() {
        for known in at_initialization() {
            for shift in SHIFTS {
                let size = field(&mut model.clone(), &known).abs().max(0.01);
                let mut moved = model.clone();
                *field(&mut moved, &known) += shift * size;
                if moved.check().is_ok() {
                    let after = moved_at_initialization(&model, &known, shift * size);
                    record(&mut actual, &known, &unknowns(&model), &after);
                }
            }
        }
        let mut other = model.clone();
        other.parameters.linearised = !model.parameters.linearised;
        other.initialize(&Experiment::default()).unwrap();
        record(&mut actual, "linearised", &unknowns(&model), &unknowns(&other));
    }
    let accelerations = &[&FRICTION_INITIALLY[..], &CART].concat();
    assert_stated(
        &actual,
        [
            &FRICTION_INITIALLY,
            accelerations,
            accelerations,
            &["x_p_0"],
            &["theta_0"],
            &["v_p_0"],
            &["omega_0"],
        ],
    );
}
