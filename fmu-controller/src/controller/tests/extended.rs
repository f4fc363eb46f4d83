//! Fault model, filter, operating point and loss of effectiveness of a controller that integrates.

use nalgebra::DVector;

use super::oracle::{agree, tamed};
use super::sized::{FREE, LIMITED};
use super::*;

const SLOPE: f64 = 0.8;

/// For each command whether it is at its lower and at its upper limit.
fn sides(model: &AsoController) -> Vec<[bool; 2]> {
    let channels = 0..model.values.u.len();
    channels.map(|j| [0, 1].map(|side| model.mode.is_at(side, j))).collect()
}

#[test]
fn steps_of_any_size_follow_the_equations_of_every_design() {
    for of in [&FREE[..], &LIMITED].concat() {
        let mut commands = std::collections::BTreeSet::new();
        for milliseconds in [500, 100, 10_u32] {
            let (h, size) = (2e-3, 1e-3 * f64::from(milliseconds));
            let (model, oracle) = tamed(of);
            let (mut z, mut y) = oracle.start(&model);
            let mut model = ready(model);
            commands.insert(sides(&model));
            let slope = DVector::from_element(y.len(), SLOPE);
            for k in 0..10_u32 {
                for _ in 0..milliseconds / 2 {
                    z = oracle.runge_kutta(&z, (&y, &slope), h, true);
                    y += &slope * h;
                }
                let start = f64::from(k) * size;
                let begun = &y - &slope * size;
                step(&mut model, start, size, begun.as_slice(), slope.as_slice());
                let u = oracle.command(&z, &y, true);
                assert!(agree(&model.values.z, &z.all(), 2e-5), "{of:?} {size}");
                if of.2.contains('d') {
                    let fault = oracle.fault(&z, &y);
                    assert!(agree(&model.deviations.f_hat, fault.as_slice(), 2e-5), "{of:?}");
                }
                assert!(agree(&model.values.u, u.as_slice(), 2e-5), "{of:?} {size}");
                commands.insert(sides(&model));
            }
        }
        assert!(commands.len() > 1 || !of.1.contains('l'), "{of:?}: limits are reached and left");
    }
}

#[test]
fn at_its_operating_point_a_controller_rests() {
    for of in [&FREE[..], &LIMITED].concat().into_iter().filter(|of| of.2.contains('o')) {
        let (mut model, _) = tamed(of);
        for actuator in &mut model.design.actuators {
            actuator.limits = actuator.limits.map(|_| [-9.0, 9.0]);
        }
        let design = &model.design;
        model.x_hat_0 = design.states.iter().map(|state| state.operating.unwrap()).collect();
        model.f_hat_0.fill(0.0);
        model.x_i_0.fill(0.0);
        model.values.r =
            design.references.iter().map(|reference| reference.operating.unwrap()).collect();
        model.values.y =
            design.measurements.iter().map(|measurement| measurement.operating.unwrap()).collect();
        let required: Vec<_> =
            design.actuators.iter().map(|actuator| actuator.operating.unwrap()).collect();
        let y = model.values.y.clone();
        let mut model = ready(model);
        let before = model.values.z.clone();
        for k in 0..10_u32 {
            step(&mut model, f64::from(k), 1.0, &y, &vec![0.0; y.len()]);
            assert_eq!((&model.values.z, &model.values.u), (&before, &required));
        }
    }
}

#[test]
fn the_filter_starts_at_the_measurements_and_follows_them_with_its_time_constant() {
    let (mut model, _) = tamed(([1, 1, 1, 1], "-", "awoe"));
    model.design.filter = Some(vec![2.0]);
    model.values.y[0] = 5.0;
    let mut model = ready(model);
    assert_eq!(model.values.z[2].to_bits(), 5_f64.to_bits());
    step(&mut model, 0.0, 0.3, &[6.0], &[0.0]);
    assert!((model.values.z[2] - (6.0 - (-0.6_f64).exp())).abs() < 1e-14);
    model.design.filter = Some(vec![0.0]);
    let message = model.check().unwrap_err().to_string();
    assert!(message.contains("filter = 0, expected more than 0"), "{message}");
}

#[test]
fn the_slopes_of_all_outputs_are_the_limits_of_their_differences() {
    for of in FREE {
        let (model, _) = tamed(of);
        let mut model = ready(model);
        let zeros = vec![0.0; model.values.y.len()];
        step(&mut model, 1.0, 0.1, &zeros, &zeros);
        let (z, u) = (model.values.z.clone(), model.values.u.clone());
        let losses = model.with_slopes().losses.clone();
        let faults = model.deviations.f_hat.clone();
        let slopes = (model.z_slopes.clone(), model.u_slopes.clone(), model.f_slopes.clone());
        let h = 1e-7;
        step(&mut model, 1.1, h, &zeros, &zeros);
        let rate = |after: &[f64], before: &[f64]| -> Vec<f64> {
            after.iter().zip(before).map(|(after, before)| (after - before) / h).collect()
        };
        assert!(agree(&rate(&model.values.z, &z), &slopes.0, 1e-5), "{of:?}");
        assert!(agree(&rate(&model.values.u, &u), &slopes.1, 1e-5), "{of:?}");
        assert!(agree(&rate(&model.deviations.f_hat, &faults), &slopes.2, 1e-5), "{of:?}");
        for (after, before) in model.losses.iter().zip(&losses) {
            let actual = (after.estimate - before.estimate) / h;
            assert!((actual - before.slope).abs() < 1e-5 * before.slope.abs().max(1.0), "{of:?}");
        }
    }
}

#[test]
fn a_loss_is_the_fault_by_the_command_where_that_is_large_enough() {
    let (model, _) = tamed(([2, 2, 1, 2], "--", "e"));
    let loss = &model.losses[0];
    for (u, f_hat, required) in [
        (1e6, -0.4e6, 0.4),
        (-1e6, 0.4e6, 0.4),
        (0.7, -0.7, 0.5),
        (0.0, 3.0, 0.0),
        (1e-3, -1e-3, 1e-6 / (1e-6 + 0.49)),
        (1e200, 1.0, 0.0),
    ] {
        let actual = loss.effectiveness_lost(u, f_hat);
        assert!((actual - required).abs() < 1e-12, "{u} {f_hat}: {actual}");
    }
}

#[test]
fn steps_of_a_known_size_allocate_nothing_in_any_design() {
    for of in [&FREE[..], &LIMITED].concat() {
        let (mut model, _) = tamed(of);
        for actuator in &mut model.design.actuators {
            actuator.limits = actuator.limits.map(|_| [-1e3, 1e3]);
        }
        let mut model = ready(model);
        let y = model.values.y.clone();
        step(&mut model, 1.0, 1e-3, &y, &y);
        let allocations = allocation_counter::measure(|| {
            for k in 1..100_u32 {
                step(&mut model, 1.0 + f64::from(k) * 1e-3, 1e-3, &y, &y);
            }
        });
        assert_eq!(allocations.count_total, 0, "{of:?}");
    }
}
