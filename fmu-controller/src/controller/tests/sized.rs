//! Designs of any size, and every number of a controller by the name of its variable.

use crate::controller::AsoController;
use crate::names;
use aso_controller::Matrix;
use aso_controller::design::{Actuator, Design};
use aso_controller::{channel, channels};

/// Numbers of states, actuators, measurements and faults.
pub(super) type Sizes = [usize; 4];

/// Sizes; an `l` for each actuator with limits; what else the design has: `a` a fault model A_f, `w`
/// a filter, `o` an operating point, `e` losses of effectiveness, `i` references with integral action,
/// `n` references with a feedforward, `c` or `p` samples, with a current or a prediction estimator, `d` a
/// direct term, `s` a sliding-mode law, `u` a feedthrough D, `t` a transfer.
pub(super) type Shape = (Sizes, &'static str, &'static str);

pub(super) const LIMITED: [Shape; 13] = [
    ([1, 1, 1, 1], "l", ""),
    ([2, 2, 2, 2], "ll", ""),
    ([3, 2, 1, 1], "l-", ""),
    ([4, 3, 2, 3], "-l-", ""),
    ([2, 2, 2, 2], "ll", "o"),
    ([3, 2, 2, 3], "-l", "awoe"),
    ([2, 2, 2, 2], "ll", "i"),
    ([3, 2, 2, 3], "-l", "awoein"),
    ([2, 2, 2, 2], "ll", "d"),
    ([3, 2, 2, 2], "-l", "dawoe"),
    ([2, 2, 2, 1], "l-", "din"),
    ([3, 2, 2, 2], "-l", "wuo"),
    ([2, 2, 2, 1], "l-", "teoi"),
];
pub(super) const FREE: [Shape; 20] = [
    ([1, 1, 1, 1], "-", ""),
    ([2, 2, 2, 2], "--", ""),
    ([3, 1, 1, 2], "-", ""),
    ([4, 2, 3, 1], "--", ""),
    ([2, 1, 2, 2], "-", "a"),
    ([2, 2, 2, 1], "--", "w"),
    ([3, 1, 1, 2], "-", "o"),
    ([2, 2, 1, 2], "--", "e"),
    ([1, 1, 1, 1], "-", "awoe"),
    ([2, 2, 2, 1], "--", "wi"),
    ([2, 2, 1, 1], "--", "n"),
    ([3, 1, 2, 1], "-", "oin"),
    ([2, 1, 2, 1], "-", "d"),
    ([3, 2, 2, 2], "--", "dao"),
    ([2, 2, 2, 2], "--", "dwe"),
    ([2, 1, 2, 2], "-", "dwi"),
    ([2, 2, 2, 1], "--", "wu"),
    ([3, 1, 2, 2], "-", "dwuae"),
    ([2, 2, 1, 1], "--", "te"),
    ([2, 1, 2, 1], "-", "tdwuin"),
];
pub(super) const SAMPLED: [Shape; 21] = [
    ([1, 1, 1, 1], "l", "c"),
    ([2, 2, 2, 2], "--", "c"),
    ([3, 2, 1, 2], "l-", "cao"),
    ([2, 1, 2, 2], "-", "coe"),
    ([2, 2, 2, 1], "-l", "cawoe"),
    ([1, 1, 1, 1], "l", "p"),
    ([3, 2, 1, 2], "l-", "pae"),
    ([2, 2, 2, 1], "-l", "pawoe"),
    ([2, 2, 2, 1], "-l", "cawoein"),
    ([3, 2, 1, 2], "l-", "pi"),
    ([1, 1, 1, 1], "-", "cn"),
    ([2, 1, 2, 2], "l", "cd"),
    ([3, 2, 2, 2], "-l", "cdawoe"),
    ([2, 2, 1, 1], "l-", "cs"),
    ([3, 2, 2, 2], "-l", "csawoe"),
    ([2, 1, 2, 1], "l", "cwid"),
    ([3, 2, 2, 2], "-l", "cawuoe"),
    ([2, 2, 2, 1], "--", "pwu"),
    ([2, 2, 1, 1], "l-", "ctoe"),
    ([3, 2, 2, 2], "-l", "ptawoein"),
    ([2, 2, 2, 1], "-l", "ctwud"),
];

/// Numbers between -1 and 1, none of them zero, that follow no line.
pub(super) fn number(k: usize) -> f64 {
    let k = u32::try_from(k).map_or(f64::NAN, f64::from);
    (1.7 * k + 0.3 * k * k + 0.9).sin()
}

fn matrix((rows, columns): (usize, usize), seed: usize) -> String {
    let row = |i| (0..columns).map(|j| number(seed + 7 * i + 3 * j)).collect::<Vec<_>>();
    format!("{:?}", (0..rows).map(row).collect::<Vec<_>>())
}

/// The lines of a list of signals.
fn signals(list: &str, count: usize, (_, limits, features): Shape) -> Vec<String> {
    let mut lines = Vec::new();
    for k in 1..=count {
        lines.push(format!("[[{list}]]\nname = \"{list}{k}\""));
        if list == "actuators" && limits.as_bytes()[k - 1] == b'l' {
            lines.push("limits = [-9.0, 9.0]".to_owned());
        }
        if list != "faults" && features.contains('o') {
            lines.push(format!("operating = {}", number(k + list.len())));
        }
        if list == "faults" && k != 2 && features.contains('e') {
            lines.push("loss_of = \"actuators1\"\nleast_command = 0.7".to_owned());
        }
    }
    lines
}

/// The number of references of a shape.
fn references(([_, _, p, _], _, features): Shape) -> usize {
    if features.contains(['i', 'n']) { p.min(2) } else { 0 }
}

/// A controller with a full design: no element is zero. Limits are -9 and 9, out of reach.
pub(super) fn sized(of: Shape) -> AsoController {
    let ([n, m, p, q], _, features) = of;
    let t = references(of);
    let shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p), (q, q)];
    let shapes = shapes.into_iter().chain([(t, p), (m, t), (t, q), (t, m), (m, t), (q, p), (p, m)]);
    let names = [
        "A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f", "A_f", "H", "K_i", "F_i", "L_w", "N_r",
        "P_f", "D",
    ];
    let has = |letters: &str| letters.chars().all(|letter| features.contains(letter));
    let stated = |name| match name {
        "A_f" => has("a"),
        "H" | "K_i" | "L_w" => has("i"),
        "F_i" => has("iw"),
        "N_r" => has("n"),
        "P_f" => has("d"),
        "D" => has("u"),
        _ => true,
    };
    let mut lines = vec!["description = \"of any size\"\nt_on = 0.5".to_owned()];
    if features.contains('w') {
        let filter = (0..p).map(|k| 0.5 + 0.4 * number(k + 90)).collect::<Vec<_>>();
        lines.push(format!("filter = {filter:?}"));
    }
    if features.contains('t') {
        lines.push("transfer = 0.3".to_owned());
    }
    for (letter, estimator) in [('c', "current"), ('p', "prediction")] {
        if features.contains(letter) {
            lines.push(format!("sample_time = 0.1\nestimator = {estimator:?}"));
        }
    }
    for (seed, (name, shape)) in names.into_iter().zip(shapes).enumerate() {
        if stated(name) {
            lines.push(format!("{name} = {}", matrix(shape, 5 * seed)));
        }
    }
    if features.contains('s') {
        let numbers = |seed| (0..q).map(|k| 0.8 + 0.3 * number(seed + k)).collect::<Vec<_>>();
        lines.push(format!("[sliding_mode]\nrho = {:?}\ndelta = {:?}", numbers(3), numbers(8)));
    }
    lines.push("[experiment]\nstop_time = 1.0\nstep_size = 0.1".to_owned());
    for (list, count) in
        [("states", n), ("actuators", m), ("measurements", p), ("faults", q), ("references", t)]
    {
        lines.extend(signals(list, count, of));
    }
    let mut controller = super::with_design(&lines.join("\n")).unwrap();
    let starts = controller.x_hat_0.iter_mut().chain(&mut controller.f_hat_0);
    let starts = starts.chain(&mut controller.x_i_0);
    starts.enumerate().for_each(|(k, start)| *start = number(k + 40));
    let inputs = controller.values.y.iter_mut().chain(&mut controller.values.r);
    inputs.enumerate().for_each(|(k, input)| *input = number(k + 60));
    controller
}

/// A number of the controller: the name of its variable, and the function that borrows it.
pub(super) struct Real {
    pub(super) name: String,
    pub(super) field: Box<dyn Fn(&mut AsoController) -> &mut f64>,
}

fn real(name: String, field: impl Fn(&mut AsoController) -> &mut f64 + 'static) -> Real {
    Real { name, field: Box::new(field) }
}

/// The measurements and the references.
pub(super) fn inputs(controller: &AsoController) -> Vec<Real> {
    let Design { measurements, references, .. } = &*controller.design;
    let measured = measurements.iter().enumerate();
    let measured = measured.map(|(k, y)| real(y.name.clone(), move |model| &mut model.values.y[k]));
    let referred = references.iter().enumerate();
    let referred = referred.map(|(k, r)| real(r.name.clone(), move |model| &mut model.values.r[k]));
    measured.chain(referred).collect()
}

/// The elements of z.
fn estimates(controller: &AsoController) -> Vec<Real> {
    let names = names::estimates(&controller.design).enumerate();
    names.map(|(k, name)| real(name, move |model| &mut model.values.z[k])).collect()
}

/// The continuous states: the estimates, unless the controller is sampled.
pub(super) fn states(controller: &AsoController) -> Vec<Real> {
    if controller.sampler.is_some() { Vec::new() } else { estimates(controller) }
}

/// Commands, estimates, losses of effectiveness, derivatives.
pub(super) fn unknowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let command = |(j, actuator): (usize, &Actuator)| {
        real(actuator.name.clone(), move |model| &mut model.values.u[j])
    };
    let mut all: Vec<_> = design.actuators.iter().enumerate().map(command).collect();
    all.extend(estimates(controller));
    for (i, name) in channels("f_hat", controller.deviations.f_hat.len()).enumerate() {
        all.push(real(name, move |model| &mut model.deviations.f_hat[i]));
    }
    for (position, loss) in controller.losses.iter().enumerate() {
        let name = channel("E_hat", loss.fault, design.faults.len());
        all.push(real(name, move |model| &mut model.losses[position].estimate));
    }
    for (k, state) in states(controller).into_iter().enumerate() {
        all.push(real(format!("der({})", state.name), move |model| {
            &mut model.with_slopes().z_slopes[k]
        }));
    }
    all
}

/// The values of filter and operating point.
fn shared(design: &Design) -> Vec<Real> {
    let mut all = Vec::new();
    let filters = design.filter.as_ref().map_or(0, Vec::len);
    for (k, name) in channels("filter", filters).enumerate() {
        all.push(real(name, move |model| &mut model.design.filter.as_mut().unwrap()[k]));
    }
    let (n, m, p) = (design.states.len(), design.actuators.len(), design.measurements.len());
    for (k, name) in names::operating(design, "x_op", n).enumerate() {
        all.push(real(name, move |model| model.design.states[k].operating.as_mut().unwrap()));
    }
    for (k, name) in names::operating(design, "u_op", m).enumerate() {
        all.push(real(name, move |model| model.design.actuators[k].operating.as_mut().unwrap()));
    }
    for (k, name) in names::operating(design, "y_op", p).enumerate() {
        all.push(real(name, move |model| model.design.measurements[k].operating.as_mut().unwrap()));
    }
    for (k, name) in names::operating(design, "r_op", design.references.len()).enumerate() {
        all.push(real(name, move |model| model.design.references[k].operating.as_mut().unwrap()));
    }
    all
}

/// The matrix of this name.
fn place<'a>(design: &'a mut Design, name: &str) -> &'a mut Matrix {
    let stated = match name {
        "A" => return &mut design.a,
        "B" => return &mut design.b,
        "C" => return &mut design.c,
        "F_a" => return &mut design.f_a,
        "K_x" => return &mut design.k_x,
        "K_f" => return &mut design.k_f,
        "L_x" => return &mut design.l_x,
        "L_f" => return &mut design.l_f,
        "A_f" => &mut design.a_f,
        "D" => &mut design.d,
        "P_f" => &mut design.p_f,
        "H" => &mut design.h,
        "K_i" => &mut design.k_i,
        "F_i" => &mut design.f_i,
        "L_w" => &mut design.l_w,
        "N_r" => &mut design.n_r,
        other => panic!("no matrix {other}"),
    };
    stated.as_mut().unwrap()
}

/// Inputs and parameters.
pub(super) fn initial_knowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let (n, q) = (design.states.len(), design.faults.len());
    let mut all = inputs(controller);
    all.push(real("t_on".to_owned(), |model| &mut model.design.t_on));
    all.extend(shared(design));
    for (k, name) in names::starts(design).enumerate() {
        all.push(real(name, move |model| match k {
            k if k < n => &mut model.x_hat_0[k],
            k if k < n + q => &mut model.f_hat_0[k - n],
            k => &mut model.x_i_0[k - n - q],
        }));
    }
    for (j, actuator) in design.actuators.iter().enumerate() {
        for side in 0..actuator.limits.map_or(0, |limits| limits.len()) {
            all.push(real(names::limit(design, side, j), move |model| {
                &mut model.design.actuators[j].limits.as_mut().unwrap()[side]
            }));
        }
    }
    for bound in 0..2 * design.sliding_mode.as_ref().map_or(0, |model| model.rho.len()) {
        let (i, count) = (bound / 2, design.faults.len());
        let name = channel(["rho", "delta"][bound % 2], i, count);
        all.push(real(name, move |model| {
            let model = model.design.sliding_mode.as_mut().unwrap();
            &mut [&mut model.rho, &mut model.delta].into_iter().nth(bound % 2).unwrap()[i]
        }));
    }
    for (name, matrix) in design.matrices() {
        all.extend((0..matrix.values.len()).map(|k| {
            real(matrix.element(name, k), move |model| {
                &mut place(&mut model.design, name).values[k]
            })
        }));
    }
    all
}

/// The values of `reals` in `controller`.
pub(super) fn values(controller: &AsoController, reals: &[Real]) -> Vec<f64> {
    let mut copy = controller.clone();
    reals.iter().map(|real| *(real.field)(&mut copy)).collect()
}

/// A copy in which every number is zero: a direction to be filled.
pub(super) fn no_direction(controller: &AsoController) -> AsoController {
    let mut direction = controller.clone();
    for real in initial_knowns(controller).iter().chain(&unknowns(controller)) {
        *(real.field)(&mut direction) = 0.0;
    }
    direction
}
