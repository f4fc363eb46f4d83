//! Directional derivatives against central differences, mode by mode.
//!
//! The equations are linear in each known, so the difference quotient by one known has no truncation
//! error. Along a direction in all knowns the equations are of third order.

use super::sized::{
    FREE, LIMITED, Real, SAMPLED, Shape, initial_knowns, inputs, no_direction, number, sized,
    states, unknowns, values,
};
use super::*;

/// Starts after t_on or before it, with monitor or without.
const STARTS: [(f64, bool); 4] = [(0.0, false), (0.0, true), (1.0, false), (1.0, true)];

fn begin(model: &mut AsoController, time: f64) {
    model.initialize(&Experiment { start_time: time, ..Experiment::default() }).unwrap();
}

/// All controllers of this test, initialised at each of `STARTS`; with limits, each command stands
/// at its lower limit, at its upper one, or between them, from one variant to the other.
fn each_mode(designs: &[Shape], check: impl Fn(&AsoController, f64)) {
    for &of in designs {
        for (time, monitor) in STARTS {
            for shift in if of.1.contains('l') { vec![-0.7, 0.0, 0.7] } else { vec![0.0] } {
                let mut model = sized(of);
                model.design.monitor = monitor;
                begin(&mut model, time);
                let equations = Equations::<f64>::new(&model.design, model.mode);
                let estimate = equations.estimate(&model.deviations.z);
                let inputs = [&model.deviations.y[..], &model.deviations.r];
                let free = |j: usize| {
                    let operating = model.design.actuators[j].operating.unwrap_or_default();
                    equations.free_command(j, estimate, inputs, -0.0) + operating
                };
                let middle: Vec<_> = (0..model.values.u.len()).map(free).collect();
                for (actuator, middle) in model.design.actuators.iter_mut().zip(middle) {
                    let around = [middle + shift - 0.4, middle + shift + 0.5];
                    actuator.limits = actuator.limits.map(|_| around);
                }
                begin(&mut model, time);
                check(&model, time);
            }
        }
    }
}

/// Checks the derivative of the unknowns against their difference quotient, `along` a direction in
/// `knowns`; `evaluate` computes the unknowns from the knowns.
fn is_the_quotient(
    model: &AsoController,
    (at, knowns): (&At, &[Real]),
    along: &[f64],
    (step, tolerance): (f64, f64),
    evaluate: impl Fn(&mut AsoController),
) {
    let mut direction = no_direction(model);
    for (known, along) in knowns.iter().zip(along) {
        *(known.field)(&mut direction) = *along;
    }
    model.differentiate(at, &mut direction).unwrap();
    let at_distance = |distance: f64| {
        let mut moved = model.clone();
        for (known, along) in knowns.iter().zip(along) {
            *(known.field)(&mut moved) += distance * along;
        }
        evaluate(&mut moved);
        values(&moved, &unknowns(model))
    };
    let (ahead, behind) = (at_distance(step), at_distance(-step));
    let actual = values(&direction, &unknowns(model));
    for (k, unknown) in unknowns(model).iter().enumerate() {
        let quotient = (ahead[k] - behind[k]) / (2.0 * step);
        let size = 1.0 + ahead[k].abs().max(quotient.abs());
        let name = &unknown.name;
        // A loss is not linear in its command, and a sliding-mode law not in the innovation: the
        // quotient has an error of second order.
        let nonlinear = name.starts_with("E_hat") || model.design.sliding_mode.is_some();
        let bent = if nonlinear { 1e3 * step * step } else { 0.0 };
        let allowed = (tolerance + bent) * size;
        assert!((actual[k] - quotient).abs() < allowed, "{name}: {} {quotient}", actual[k]);
    }
}

/// Checks the derivatives with respect to each known, then along a direction in all knowns.
fn is_the_quotient_everywhere(
    model: &AsoController,
    at: &At,
    knowns: &[Real],
    evaluate: impl Fn(&mut AsoController),
) {
    for column in 0..knowns.len() {
        let along: Vec<_> = (0..knowns.len()).map(|k| f64::from(u8::from(k == column))).collect();
        is_the_quotient(model, (at, knowns), &along, (1e-3, 1e-11), &evaluate);
    }
    let along: Vec<_> = (0..knowns.len()).map(number).collect();
    is_the_quotient(model, (at, knowns), &along, (1e-4, 1e-6), &evaluate);
}

#[test]
fn initial_values_have_the_derivatives_of_their_difference_quotients_by_every_known() {
    for designs in [&FREE[..], &LIMITED, &SAMPLED] {
        each_mode(designs, |model, time| {
            let knowns = initial_knowns(model);
            is_the_quotient_everywhere(model, &At::Initialization, &knowns, |moved| {
                begin(moved, time);
            });
        });
    }
}

#[test]
fn at_a_point_outputs_and_derivatives_have_those_by_every_input_and_state() {
    for designs in [&FREE[..], &LIMITED, &SAMPLED] {
        each_mode(designs, |model, time| {
            let mut event = model.clone();
            event.event(time).unwrap();
            for model in [model, &event] {
                let knowns: Vec<_> = inputs(model).into_iter().chain(states(model)).collect();
                let at = At::Point { time, delta_time: 0.0 };
                is_the_quotient_everywhere(model, &at, &knowns, |moved| {
                    moved.update(time).unwrap();
                });
            }
        });
    }
}

#[test]
fn every_channel_was_at_each_of_its_limits_in_these_tests() {
    for of in [&LIMITED[..], &SAMPLED].concat() {
        let seen = std::cell::RefCell::new(std::collections::BTreeSet::new());
        each_mode(&[of], |model, _| {
            for j in 0..model.values.u.len() {
                seen.borrow_mut().insert((j, [0, 1].map(|side| model.mode.is_at(side, j))));
            }
        });
        for (j, limited) in of.1.bytes().enumerate().map(|(j, letter)| (j, letter == b'l')) {
            let has = |sides| seen.borrow().contains(&(j, sides));
            assert!(has([false, false]));
            assert_eq!([has([true, false]), has([false, true])], [limited, limited]);
        }
    }
}

#[test]
fn time_itself_changes_nothing_between_events() {
    let mut model = sized(([3, 2, 1, 1], "l-", ""));
    begin(&mut model, 0.0);
    let mut direction = no_direction(&model);
    model.differentiate(&At::Point { time: 0.2, delta_time: 1.0 }, &mut direction).unwrap();
    assert!(values(&direction, &unknowns(&model)).iter().all(|value| *value == 0.0));
}

#[test]
fn derivatives_allocate_nothing() {
    for of in [&LIMITED[..], &SAMPLED].concat() {
        let mut model = sized(of);
        begin(&mut model, 1.0);
        let mut direction = no_direction(&model);
        let allocations = allocation_counter::measure(|| {
            for at in [At::Initialization, At::Point { time: 1.0, delta_time: 0.0 }] {
                model.differentiate(&at, &mut direction).unwrap();
            }
        });
        assert_eq!(allocations.count_total, 0, "{of:?}");
    }
}
