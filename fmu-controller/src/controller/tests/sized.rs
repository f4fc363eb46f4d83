//! Designs of any size, and every number of a controller by the name of its variable.

use crate::controller::AsoController;
use crate::design::{Actuator, Design};
use crate::matrix::Matrix;
use crate::names;

/// Numbers of states, actuators, measurements and faults.
pub(super) type Sizes = [usize; 4];

/// Sizes; an `l` for each actuator with limits; what else the design has: `a` a fault model A_f, `w`
/// a filter, `o` an operating point, `e` losses of effectiveness, `c` or `p` samples, with a current
/// or a prediction estimator.
pub(super) type Shape = (Sizes, &'static str, &'static str);

pub(super) const LIMITED: [Shape; 6] = [
    ([1, 1, 1, 1], "l", ""),
    ([2, 2, 2, 2], "ll", ""),
    ([3, 2, 1, 1], "l-", ""),
    ([4, 3, 2, 3], "-l-", ""),
    ([2, 2, 2, 2], "ll", "o"),
    ([3, 2, 2, 3], "-l", "awoe"),
];
pub(super) const FREE: [Shape; 9] = [
    ([1, 1, 1, 1], "-", ""),
    ([2, 2, 2, 2], "--", ""),
    ([3, 1, 1, 2], "-", ""),
    ([4, 2, 3, 1], "--", ""),
    ([2, 1, 2, 2], "-", "a"),
    ([2, 2, 2, 1], "--", "w"),
    ([3, 1, 1, 2], "-", "o"),
    ([2, 2, 1, 2], "--", "e"),
    ([1, 1, 1, 1], "-", "awoe"),
];
pub(super) const SAMPLED: [Shape; 8] = [
    ([1, 1, 1, 1], "l", "c"),
    ([2, 2, 2, 2], "--", "c"),
    ([3, 2, 1, 2], "l-", "cao"),
    ([2, 1, 2, 2], "-", "coe"),
    ([2, 2, 2, 1], "-l", "cawoe"),
    ([1, 1, 1, 1], "l", "p"),
    ([3, 2, 1, 2], "l-", "pae"),
    ([2, 2, 2, 1], "-l", "pawoe"),
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

/// A controller with a full design: no element is zero. Limits are -9 and 9, out of reach.
pub(super) fn sized(of: Shape) -> AsoController {
    let ([n, m, p, q], _, features) = of;
    let shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p), (q, q)];
    let names = ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f", "A_f"];
    let mut lines = vec!["description = \"of any size\"\nt_on = 0.5".to_owned()];
    if features.contains('w') {
        let filter = (0..p).map(|k| 0.5 + 0.4 * number(k + 90)).collect::<Vec<_>>();
        lines.push(format!("filter = {filter:?}"));
    }
    for (letter, estimator) in [('c', "current"), ('p', "prediction")] {
        if features.contains(letter) {
            lines.push(format!("sample_time = 0.1\nestimator = {estimator:?}"));
        }
    }
    let stated = if features.contains('a') { 9 } else { 8 };
    for (seed, (name, shape)) in names.iter().zip(shapes).enumerate().take(stated) {
        lines.push(format!("{name} = {}", matrix(shape, 5 * seed)));
    }
    lines.push("[experiment]\nstop_time = 1.0\nstep_size = 0.1".to_owned());
    for (list, count) in [("states", n), ("actuators", m), ("measurements", p), ("faults", q)] {
        lines.extend(signals(list, count, of));
    }
    let mut controller = super::with_design(&lines.join("\n")).unwrap();
    let starts = controller.x_hat_0.iter_mut().chain(&mut controller.f_hat_0);
    starts.enumerate().for_each(|(k, start)| *start = number(k + 40));
    controller.values.y.iter_mut().enumerate().for_each(|(k, y)| *y = number(k + 60));
    controller
}

/// A number of the controller.
pub(super) struct Real {
    pub(super) name: String,
    pub(super) field: Box<dyn Fn(&mut AsoController) -> &mut f64>,
}

fn real(name: String, field: impl Fn(&mut AsoController) -> &mut f64 + 'static) -> Real {
    Real { name, field: Box::new(field) }
}

/// The measurements.
pub(super) fn inputs(controller: &AsoController) -> Vec<Real> {
    let signals = controller.design.measurements.iter().enumerate();
    signals.map(|(k, y)| real(y.name.clone(), move |own| &mut own.values.y[k])).collect()
}

/// Estimates and filtered measurements.
fn estimates(controller: &AsoController) -> Vec<Real> {
    let names = names::estimates(&controller.design).enumerate();
    names.map(|(k, name)| real(name, move |own| &mut own.values.z[k])).collect()
}

/// The continuous states: the estimates, unless the controller is sampled.
pub(super) fn states(controller: &AsoController) -> Vec<Real> {
    if controller.sampler.is_some() { Vec::new() } else { estimates(controller) }
}

/// Commands, estimates, losses of effectiveness, derivatives.
pub(super) fn unknowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let command = |(j, actuator): (usize, &Actuator)| {
        real(actuator.name.clone(), move |own| &mut own.values.u[j])
    };
    let mut all: Vec<_> = design.actuators.iter().enumerate().map(command).collect();
    all.extend(estimates(controller));
    for (position, loss) in controller.losses.iter().enumerate() {
        let name = names::channel("E_hat", loss.fault, design.faults.len());
        all.push(real(name, move |own| &mut own.losses[position].estimate));
    }
    for (k, state) in states(controller).into_iter().enumerate() {
        all.push(real(format!("der({})", state.name), move |own| {
            &mut own.with_slopes().z_slopes[k]
        }));
    }
    all
}

/// The values of filter and operating point.
fn shared(design: &Design) -> Vec<Real> {
    let mut all = Vec::new();
    let filters = design.filter.as_ref().map_or(0, Vec::len);
    for (k, name) in names::channels("filter", filters).enumerate() {
        all.push(real(name, move |own| &mut own.design.filter.as_mut().unwrap()[k]));
    }
    let (n, m, p) = (design.states.len(), design.actuators.len(), design.measurements.len());
    for (k, name) in names::operating(design, "x_op", n).enumerate() {
        all.push(real(name, move |own| own.design.states[k].operating.as_mut().unwrap()));
    }
    for (k, name) in names::operating(design, "u_op", m).enumerate() {
        all.push(real(name, move |own| own.design.actuators[k].operating.as_mut().unwrap()));
    }
    for (k, name) in names::operating(design, "y_op", p).enumerate() {
        all.push(real(name, move |own| own.design.measurements[k].operating.as_mut().unwrap()));
    }
    all
}

/// Inputs and parameters.
pub(super) fn initial_knowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let n = design.states.len();
    let mut all = inputs(controller);
    all.push(real("t_on".to_owned(), |own| &mut own.design.t_on));
    all.extend(shared(design));
    for (k, name) in names::starts(design).enumerate() {
        all.push(real(
            name,
            move |own| {
                if k < n { &mut own.x_hat_0[k] } else { &mut own.f_hat_0[k - n] }
            },
        ));
    }
    for (j, actuator) in design.actuators.iter().enumerate() {
        for side in 0..actuator.limits.map_or(0, |limits| limits.len()) {
            all.push(real(names::limit(design, side, j), move |own| {
                &mut own.design.actuators[j].limits.as_mut().unwrap()[side]
            }));
        }
    }
    let places: [fn(&mut Design) -> &mut Matrix; 9] = [
        |design| &mut design.a,
        |design| &mut design.b,
        |design| &mut design.c,
        |design| &mut design.f_a,
        |design| &mut design.k_x,
        |design| &mut design.k_f,
        |design| &mut design.l_x,
        |design| &mut design.l_f,
        |design| design.a_f.as_mut().unwrap(),
    ];
    for ((name, matrix), place) in design.matrices().zip(places) {
        all.extend((0..matrix.values.len()).map(|k| {
            real(matrix.element(name, k), move |own| &mut place(&mut own.design).values[k])
        }));
    }
    all
}

/// The values of `reals`.
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
