//! The variables of the controller: they follow from the dimensions and names of the design.

use fmi2::Variable;

use crate::controller::AsoController;
use crate::design::{Design, Signal};
use crate::matrix::Matrix;

/// Reaches one matrix of the design.
type Place = fn(&mut Design) -> &mut Matrix;

/// Name, meaning and place of the eight matrices.
const MATRICES: [(&str, &str, Place); 8] = [
    ("A", "system matrix A of (1)", |design| &mut design.a),
    ("B", "input matrix B of (1)", |design| &mut design.b),
    ("C", "measurement matrix C of (1)", |design| &mut design.c),
    ("F_a", "fault distribution matrix F_a of (1)", |design| &mut design.f_a),
    ("K_x", "state feedback gain K_x of (2)", |design| &mut design.k_x),
    ("K_f", "fault compensation gain K_f of (2)", |design| &mut design.k_f),
    ("L_x", "observer gain L_x of (4)", |design| &mut design.l_x),
    ("L_f", "fault observer gain L_f of (5)", |design| &mut design.l_f),
];

/// All variables of `controller`, in the order of the description.
pub(crate) fn of(controller: &AsoController) -> Vec<Variable<AsoController>> {
    let design = &controller.design;
    let mut all = inputs(design);
    all.extend(commands(controller));
    all.extend(estimates(design));
    all.extend(switches(controller));
    for (name, meaning, place) in MATRICES {
        let matrix = place(&mut design.clone()).clone();
        all.extend((0..matrix.values.len()).map(|k| {
            Variable::real(matrix.element(name, k), meaning, move |model: &mut AsoController| {
                &mut place(&mut model.design).values[k]
            })
            .parameter()
        }));
    }
    all
}

/// `name` for the only channel, `name[k]` for channel k of several.
fn channel(name: &str, position: usize, count: usize) -> String {
    if count == 1 { name.to_owned() } else { format!("{name}[{}]", position + 1) }
}

/// Name of the lower (0) or upper (1) limit of actuator `position`.
pub(crate) fn limit_name(controller: &AsoController, side: usize, position: usize) -> String {
    channel(["u_min", "u_max"][side], position, controller.design.actuators.len())
}

fn with_unit(variable: Variable<AsoController>, unit: Option<&String>) -> Variable<AsoController> {
    match unit {
        Some(unit) => variable.unit(unit.clone()),
        None => variable,
    }
}

/// What a signal is: its description, or its name where it has none.
fn meaning(signal: &Signal) -> &str {
    if signal.description.is_empty() { &signal.name } else { &signal.description }
}

fn inputs(design: &Design) -> Vec<Variable<AsoController>> {
    let mut inputs: Vec<_> = design
        .measurements
        .iter()
        .enumerate()
        .map(|(k, signal)| {
            let text = format!("Measurement: {}", meaning(signal));
            let variable = Variable::real(&signal.name, text, move |model: &mut AsoController| {
                &mut model.measurements[k]
            });
            with_unit(variable, signal.unit.as_ref())
                .input()
                .derivative(move |model| &mut model.measurement_slopes[k])
        })
        .collect();
    let text = "Whether the estimated fault is compensated from t_on on";
    inputs.push(
        Variable::boolean("compensate", text, |model: &mut AsoController| &mut model.compensate)
            .input(),
    );
    inputs
}

fn commands(controller: &AsoController) -> Vec<Variable<AsoController>> {
    let design = &controller.design;
    let actuators = &design.actuators;
    actuators
        .iter()
        .enumerate()
        .map(|(j, actuator)| {
            let name = channel("u", j, actuators.len());
            let text = match actuator.description.as_str() {
                "" => format!("Command: {}", actuator.name),
                description => format!("Command: {description}"),
            };
            let variable =
                Variable::real(name, text, move |model: &mut AsoController| &mut model.u[j]);
            with_unit(variable, actuator.unit.as_ref())
                .output(&[])
                .initially(on_which_commands_depend(controller, j))
                .derivative(move |model| &mut model.u_slopes[j])
        })
        .collect()
}

/// What decides the initial value of command `j`.
fn on_which_commands_depend(controller: &AsoController, j: usize) -> Vec<String> {
    let design = &controller.design;
    let mut names = vec!["time".to_owned(), "compensate".to_owned(), "t_on".to_owned()];
    let starts = |name, count| (0..count).map(move |k| channel(name, k, count));
    names.extend(starts("x_hat_0", design.states.len()));
    names.extend(starts("f_hat_0", design.faults.len()));
    for (name, gain) in [("K_x", &design.k_x), ("K_f", &design.k_f)] {
        names.extend((0..gain.columns).map(|k| gain.element(name, j * gain.columns + k)));
    }
    if design.actuators[j].limits.is_some() {
        names.extend([0, 1].map(|side| limit_name(controller, side, j)));
    }
    names
}

fn estimates(design: &Design) -> Vec<Variable<AsoController>> {
    let order = design.states.len();
    let faults = design.faults.iter().enumerate().map(|(k, signal)| {
        let name = channel("f_hat", k, design.faults.len());
        (order + k, name, channel("f_hat_0", k, design.faults.len()), signal)
    });
    let states =
        design.states.iter().enumerate().map(|(k, signal)| {
            (k, channel("x_hat", k, order), channel("x_hat_0", k, order), signal)
        });
    faults
        .chain(states)
        .map(|(k, name, start, signal)| {
            let text = format!("Estimate of {}", meaning(signal));
            let variable =
                Variable::real(name, text, move |model: &mut AsoController| &mut model.estimate[k]);
            with_unit(variable, signal.unit.as_ref())
                .output(&[])
                .initially([start])
                .derivative(move |model| &mut model.estimate_slopes[k])
        })
        .collect()
}

/// Activation, initial estimates and, where the design states them, the limits.
fn switches(controller: &AsoController) -> Vec<Variable<AsoController>> {
    let design = &controller.design;
    let (order, faults) = (design.states.len(), design.faults.len());
    let text = "Compensation starts at this time";
    let mut all = vec![
        Variable::real("t_on", text, |model: &mut AsoController| &mut model.design.t_on)
            .unit("s")
            .parameter(),
        Variable::boolean(
            "monitor",
            "Whether the fault is estimated while it is not compensated",
            |model: &mut AsoController| &mut model.design.monitor,
        )
        .parameter(),
    ];
    for (k, signal) in design.states.iter().enumerate() {
        let text = format!("Initial estimate of {}", meaning(signal));
        let name = channel("x_hat_0", k, order);
        let variable =
            Variable::real(name, text, move |model: &mut AsoController| &mut model.x_hat_0[k]);
        all.push(with_unit(variable, signal.unit.as_ref()).parameter());
    }
    for (k, signal) in design.faults.iter().enumerate() {
        let text = format!("Initial estimate of {}", meaning(signal));
        let name = channel("f_hat_0", k, faults);
        let variable =
            Variable::real(name, text, move |model: &mut AsoController| &mut model.f_hat_0[k]);
        all.push(with_unit(variable, signal.unit.as_ref()).parameter());
    }
    all.extend(limits(controller));
    all
}

fn limits(controller: &AsoController) -> Vec<Variable<AsoController>> {
    let mut all = Vec::new();
    for (side, text) in ["Smallest command", "Largest command"].into_iter().enumerate() {
        for (j, actuator) in controller.design.actuators.iter().enumerate() {
            if actuator.limits.is_none() {
                continue;
            }
            let name = limit_name(controller, side, j);
            let variable = Variable::real(name, text, move |model: &mut AsoController| {
                &mut model.design.actuators[j].limits.get_or_insert([0.0; 2])[side]
            });
            all.push(with_unit(variable, actuator.unit.as_ref()).tunable());
        }
    }
    all
}
