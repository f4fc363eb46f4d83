//! The knowns and unknowns of the model by their names.

use super::*;
use crate::pendulum::variables::{FIXED, STATES, TUNABLE};

/// Between events: inputs and states.
pub(super) const AT_A_POINT: [&str; 6] = ["u", "f_a", "x_p", "theta", "v_p", "omega"];

/// At initialization: inputs, Real parameters and start values.
pub(super) fn at_initialization() -> Vec<String> {
    let parameters = FIXED.iter().chain(&TUNABLE).map(|(name, ..)| (*name).to_owned());
    let starts = STATES.iter().map(|(name, ..)| format!("{name}_0"));
    ["u", "f_a"].map(str::to_owned).into_iter().chain(parameters).chain(starts).collect()
}

/// The field of a Real known.
pub(super) fn field<'a>(model: &'a mut FrictionPendulum, name: &str) -> &'a mut f64 {
    let state =
        |suffix: &str| STATES.iter().position(|(state, ..)| format!("{state}{suffix}") == name);
    match name {
        "u" => &mut model.u,
        "f_a" => &mut model.f_a,
        _ => match (state(""), state("_0")) {
            (Some(k), _) => &mut model.motion.state_mut()[k],
            (_, Some(k)) => &mut model.initial[k],
            _ => {
                let mut all = FIXED.iter().chain(&TUNABLE);
                (all.find(|(parameter, ..)| *parameter == name).unwrap().3)(model)
            }
        },
    }
}

/// The unknowns, states last.
pub(super) const UNKNOWNS: [&str; 7] =
    ["f_fric", "der(v_p)", "der(omega)", "x_p", "theta", "v_p", "omega"];

/// The values of [`UNKNOWNS`], or their derivatives in a direction.
pub(super) fn unknowns(model: &FrictionPendulum) -> [f64; 7] {
    let [x, angle, velocity, rate] = *model.motion.state();
    [model.f_fric, model.slope[2], model.slope[3], x, angle, velocity, rate]
}

/// The unknowns after a known was moved by `shift`, in the same regime.
pub(super) fn moved_at_a_point(model: &FrictionPendulum, known: &str, shift: f64) -> [f64; 7] {
    let mut model = model.clone();
    *field(&mut model, known) += shift;
    model.update(0.0).unwrap();
    unknowns(&model)
}

/// The initial unknowns after a known was moved by `shift`.
pub(super) fn moved_at_initialization(
    model: &FrictionPendulum,
    known: &str,
    shift: f64,
) -> [f64; 7] {
    let mut model = model.clone();
    *field(&mut model, known) += shift;
    model.initialize(&Experiment::default()).unwrap();
    unknowns(&model)
}
