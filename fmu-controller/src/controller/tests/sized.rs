//! Designs of any size, and every number of a controller by the name of its variable.

use crate::controller::AsoController;
use crate::design::Design;
use crate::matrix::Matrix;
use crate::names;

/// Numbers of states, actuators, measurements and faults.
pub(super) type Sizes = [usize; 4];

/// One of several actuators has no limits in the last two.
pub(super) const LIMITED: [(Sizes, &str); 4] =
    [([1, 1, 1, 1], "l"), ([2, 2, 2, 2], "ll"), ([3, 2, 1, 1], "l-"), ([4, 3, 2, 3], "-l-")];
pub(super) const FREE: [(Sizes, &str); 4] =
    [([1, 1, 1, 1], "-"), ([2, 2, 2, 2], "--"), ([3, 1, 1, 2], "-"), ([4, 2, 3, 1], "--")];

/// Numbers between -1 and 1, none of them zero, that follow no line.
pub(super) fn number(k: usize) -> f64 {
    let k = u32::try_from(k).map_or(f64::NAN, f64::from);
    (1.7 * k + 0.3 * k * k + 0.9).sin()
}

fn matrix((rows, columns): (usize, usize), seed: usize) -> String {
    let row = |i| (0..columns).map(|j| number(seed + 7 * i + 3 * j)).collect::<Vec<_>>();
    format!("{:?}", (0..rows).map(row).collect::<Vec<_>>())
}

/// A controller with a full design: no element is zero. `limits` has an `l` for each actuator with
/// limits, which are -9 and 9, out of reach.
pub(super) fn sized([n, m, p, q]: Sizes, limits: &str) -> AsoController {
    let shapes = [(n, n), (n, m), (p, n), (n, q), (m, n), (m, q), (n, p), (q, p)];
    let mut lines = vec!["description = \"of any size\"\nt_on = 0.5".to_owned()];
    for (seed, (name, shape)) in
        ["A", "B", "C", "F_a", "K_x", "K_f", "L_x", "L_f"].iter().zip(shapes).enumerate()
    {
        lines.push(format!("{name} = {}", matrix(shape, 5 * seed)));
    }
    lines.push("[experiment]\nstop_time = 1.0\nstep_size = 0.1".to_owned());
    for (list, count) in [("states", n), ("actuators", m), ("measurements", p), ("faults", q)] {
        for k in 1..=count {
            lines.push(format!("[[{list}]]\nname = \"{list}{k}\""));
            if list == "actuators" && limits.as_bytes()[k - 1] == b'l' {
                lines.push("limits = [-9.0, 9.0]".to_owned());
            }
        }
    }
    let mut controller = super::with_design(&lines.join("\n")).unwrap();
    let starts = controller.x_hat_0.iter_mut().chain(&mut controller.f_hat_0);
    starts.enumerate().for_each(|(k, start)| *start = number(k + 40));
    controller.measurements.iter_mut().enumerate().for_each(|(k, y)| *y = number(k + 60));
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
    signals.map(|(k, y)| real(y.name.clone(), move |own| &mut own.measurements[k])).collect()
}

/// The estimates, which are the continuous states.
pub(super) fn states(controller: &AsoController) -> Vec<Real> {
    let names = names::estimates(&controller.design).enumerate();
    names.map(|(k, name)| real(name, move |own| &mut own.estimate[k])).collect()
}

/// Commands, estimates, derivatives.
pub(super) fn unknowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let commands = names::channels("u", design.actuators.len()).enumerate();
    let mut all: Vec<_> = commands.map(|(j, name)| real(name, move |own| &mut own.u[j])).collect();
    all.extend(states(controller));
    all.extend(
        names::estimates(design)
            .enumerate()
            .map(|(k, name)| real(format!("der({name})"), move |own| &mut own.estimate_slopes[k])),
    );
    all
}

/// Inputs and parameters.
pub(super) fn initial_knowns(controller: &AsoController) -> Vec<Real> {
    let design = &controller.design;
    let n = design.states.len();
    let mut all = inputs(controller);
    all.push(real("t_on".to_owned(), |own| &mut own.design.t_on));
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
    let places: [fn(&mut Design) -> &mut Matrix; 8] = [
        |design| &mut design.a,
        |design| &mut design.b,
        |design| &mut design.c,
        |design| &mut design.f_a,
        |design| &mut design.k_x,
        |design| &mut design.k_f,
        |design| &mut design.l_x,
        |design| &mut design.l_f,
    ];
    for ((name, matrix), place) in design.matrices().into_iter().zip(places) {
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
