//! The variables of the controller: they follow from the dimensions and names of the design.

use fmi2::Variable;
use fmi2::description::DependencyKind;
use fmi2::unit::Unit;

use crate::controller::AsoController;
use crate::design::{Design, Signal};
use crate::matrix::Matrix;
use crate::names::channel;
use crate::{dependencies, names};

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
    all.extend(commands(design));
    all.extend(estimates(design));
    all.extend(slopes(design));
    all.extend(switches(design));
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

fn with_unit(variable: Variable<AsoController>, unit: Option<&String>) -> Variable<AsoController> {
    match unit {
        Some(unit) => variable.unit(unit.clone()),
        None => variable,
    }
}

/// The unit per second, where it can be written: `m` gives `m/s`, `m/s` gives `m/s2`.
fn per_second(unit: Option<&String>) -> Option<String> {
    let unit = unit?;
    let slope = if unit.ends_with("/s") { format!("{unit}2") } else { format!("{unit}/s") };
    Unit::parse(&slope).is_ok().then_some(slope)
}

/// States what the variable depends on.
fn depending<const GROUPS: usize>(
    variable: Variable<AsoController>,
    groups: [(DependencyKind, Vec<String>); GROUPS],
) -> Variable<AsoController> {
    groups.into_iter().fold(variable, |variable, (kind, names)| variable.depends(kind, names))
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

fn commands(design: &Design) -> Vec<Variable<AsoController>> {
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
            let variable = with_unit(variable, actuator.unit.as_ref())
                .output(&[])
                .initially(dependencies::of_initial_command(design, j))
                .derivative(move |model| &mut model.u_slopes[j]);
            depending(variable, dependencies::of_command(design, j))
        })
        .collect()
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

/// The derivatives of the estimates, which are the continuous states.
fn slopes(design: &Design) -> Vec<Variable<AsoController>> {
    let order = design.states.len();
    let signals = design.states.iter().chain(&design.faults);
    names::estimates(design)
        .zip(signals)
        .enumerate()
        .map(|(k, (state, signal))| {
            let text = format!("Derivative of the estimate of {}", meaning(signal));
            let variable =
                Variable::real(format!("der({state})"), text, move |model: &mut AsoController| {
                    &mut model.estimate_slopes[k]
                });
            let variable =
                with_unit(variable, per_second(signal.unit.as_ref()).as_ref()).derivative_of(state);
            if k < order {
                depending(variable, dependencies::of_state_slope(design))
                    .initially(dependencies::of_initial_state_slope(design, k))
            } else {
                depending(variable, dependencies::of_fault_slope(design))
                    .initially(dependencies::of_initial_fault_slope(design, k - order))
            }
        })
        .collect()
}

/// Activation, initial estimates and, where the design states them, the limits.
fn switches(design: &Design) -> Vec<Variable<AsoController>> {
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
    all.extend(limits(design));
    all
}

fn limits(design: &Design) -> Vec<Variable<AsoController>> {
    let mut all = Vec::new();
    for (side, text) in ["Smallest command", "Largest command"].into_iter().enumerate() {
        for (j, actuator) in design.actuators.iter().enumerate() {
            if actuator.limits.is_none() {
                continue;
            }
            let name = names::limit(design, side, j);
            let variable = Variable::real(name, text, move |model: &mut AsoController| {
                &mut model.design.actuators[j].limits.get_or_insert([0.0; 2])[side]
            });
            all.push(with_unit(variable, actuator.unit.as_ref()).tunable());
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_derivative_has_the_unit_of_its_state_per_second() {
        for (unit, wanted) in [
            ("m", "m/s"),
            ("rad/s", "rad/s2"),
            ("N", "N/s"),
            ("J/(kg.K)", "J/(kg.K)/s"),
            ("km/h", "km/h/s"),
            ("s-1", "s-1/s"),
            ("%", "%/s"),
        ] {
            let slope = per_second(Some(&unit.to_owned())).unwrap();
            assert_eq!(slope, wanted);
            let [of, per] = [unit, &slope].map(|unit| Unit::parse(unit).unwrap().base.unwrap());
            assert_eq!(fmi2::unit::BaseUnit { s: of.s - 1, ..of }, per);
        }
    }

    #[test]
    fn a_derivative_has_no_unit_where_none_can_be_written() {
        for unit in [None, Some(String::new()), Some("degC".to_owned())] {
            assert_eq!(per_second(unit.as_ref()), None);
        }
    }
}
