//! The model as an importer uses it.

use super::*;
use crate::friction::Regime;

mod derivatives;
mod exchange;
mod knowns;
mod rates;
mod structure;

/// The model initialised after a change of parameters, start values and inputs.
fn started(change: impl Fn(&mut FrictionPendulum)) -> FrictionPendulum {
    let mut model = FrictionPendulum::new(Path::new("")).unwrap();
    change(&mut model);
    model.check().unwrap();
    model.initialize(&Experiment::default()).unwrap();
    model
}

/// Points in all regimes, linearised and not: `[x_p, theta, v_p, omega]` and `u`.
const POINTS: [(Regime, [f64; 4], f64); 8] = [
    (Regime::Forward, [0.1, 0.4, 0.3, -1.3], 12.0),
    (Regime::Forward, [-0.2, -1.1, 0.06, 2.0], 0.0),
    (Regime::Forward, [0.0, 0.2, 0.0, 0.4], 45.0),
    (Regime::Backward, [0.3, 2.6, -0.2, 0.7], -20.0),
    (Regime::Backward, [0.0, -0.3, -0.9, -3.0], 35.0),
    (Regime::Stick, [0.1, 0.3, 0.0, 1.5], 7.0),
    (Regime::Stick, [0.0, -0.6, 0.0, -0.8], -9.0),
    (Regime::Stick, [0.2, 0.05, 0.0, 0.0], 0.0),
];

/// The model at each of the points, in the regime named there.
fn everywhere() -> Vec<FrictionPendulum> {
    let mut models = Vec::new();
    for linearised in [false, true] {
        for (regime, state, u) in POINTS {
            let model = started(|model| {
                model.parameters.linearised = linearised;
                (model.initial, model.u, model.f_a) = (state, u, 1.5);
            });
            assert_eq!(model.motion.regime(), regime, "{state:?}");
            models.push(model);
        }
    }
    models
}

#[test]
fn u_and_f_a_act_alike_derivatives_included() {
    let mut states = [[0; 4]; 2];
    for (which, state) in states.iter_mut().enumerate() {
        let mut model = FrictionPendulum::new(Path::new("")).unwrap();
        model.initialize(&Experiment::default()).unwrap();
        if which == 0 {
            (model.u, model.u_derivatives) = (40.0, [100.0, -3000.0]);
        } else {
            (model.f_a, model.f_a_derivatives) = (40.0, [100.0, -3000.0]);
        }
        model.step(&Step { start: 0.0, size: 0.1 }).unwrap();
        assert!(model.motion.state()[2] > 0.0, "the cart moves");
        *state = model.motion.state().map(f64::to_bits);
    }
    assert_eq!(states[0], states[1]);
}

#[test]
fn a_step_allocates_nothing_events_included() {
    let mut model = FrictionPendulum::new(Path::new("")).unwrap();
    model.initialize(&Experiment::default()).unwrap();
    let mut regimes = [false; 3];
    let allocations = allocation_counter::measure(|| {
        for k in 0..2000_u32 {
            let start = f64::from(k) * 1e-3;
            model.u = 45.0 * (9.0 * start).sin();
            model.update(start).unwrap();
            model.step(&Step { start, size: 1e-3 }).unwrap();
            regimes[usize::try_from(model.regime + 1).unwrap()] = true;
        }
    });
    assert_eq!(regimes, [true; 3]);
    assert_eq!(allocations.count_total, 0);
}
