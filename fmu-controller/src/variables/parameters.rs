//! The parameters: activation, initial estimates, filter, operating point, limits, matrices.

use fmu::Variable;

use super::with_unit;
use crate::controller::AsoController;
use crate::design::{Design, Estimator, Fault, Label, Signal};
use crate::matrix::Matrix;
use crate::names;
use crate::names::channel;

/// Returns one matrix of a design.
type Accessor = fn(&mut Design) -> &mut Matrix;

/// Meaning and accessor of the matrices, in the order of [`Design::matrices`].
const MATRICES: [(&str, Accessor); 9] = [
    ("system matrix A of (1)", |design| &mut design.a),
    ("input matrix B of (1)", |design| &mut design.b),
    ("measurement matrix C of (1)", |design| &mut design.c),
    ("fault distribution matrix F_a of (1)", |design| &mut design.f_a),
    ("state feedback gain K_x of (2)", |design| &mut design.k_x),
    ("fault compensation gain K_f of (2)", |design| &mut design.k_f),
    ("observer gain L_x of (4)", |design| &mut design.l_x),
    ("fault observer gain L_f of (5)", |design| &mut design.l_f),
    ("matrix A_f of the fault model", |design| design.a_f.get_or_insert_default()),
];

pub(super) fn of(design: &Design) -> Vec<Variable<AsoController>> {
    let mut all = switches(design);
    all.extend(starts(design));
    all.extend(filter(design));
    all.extend(operating_point(design));
    all.extend(limits(design));
    for ((name, matrix), (meaning, place)) in design.matrices().zip(MATRICES) {
        all.extend((0..matrix.values.len()).map(|k| {
            Variable::real(matrix.element(name, k), meaning, move |model: &mut AsoController| {
                &mut place(&mut model.design).values[k]
            })
            .parameter()
        }));
    }
    all
}

/// The parameters of the activation and the sample time of a sampled controller.
fn switches(design: &Design) -> Vec<Variable<AsoController>> {
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
    all.extend(design.estimator.map(|estimator| {
        let text = match estimator {
            Estimator::Current => "Sample time; the command follows the measurements of its sample",
            Estimator::Prediction => "Sample time; the command follows those of the sample before",
        };
        Variable::real("T_s", text, |model: &mut AsoController| {
            model.design.sample_time.get_or_insert_default()
        })
        .unit("s")
        .constant()
    }));
    all
}

/// Initial estimates.
fn starts(design: &Design) -> Vec<Variable<AsoController>> {
    let order = design.states.len();
    let labels = design.states.iter().map(Signal::label);
    let labels = labels.chain(design.faults.iter().map(Fault::label));
    names::starts(design)
        .zip(labels)
        .enumerate()
        .map(|(k, (name, Label { unit, meaning }))| {
            let text = format!("Initial estimate of {meaning}");
            let variable = Variable::real(name, text, move |model: &mut AsoController| {
                if k < order { &mut model.x_hat_0[k] } else { &mut model.f_hat_0[k - order] }
            });
            with_unit(variable, unit).parameter()
        })
        .collect()
}

fn filter(design: &Design) -> Vec<Variable<AsoController>> {
    let count = design.filter.as_ref().map_or(0, Vec::len);
    (0..count)
        .map(|k| {
            let name = channel("filter", k, count);
            let text = format!("Filter W: {}", design.measurements[k].label().meaning);
            let variable = Variable::real(name, text, move |model: &mut AsoController| {
                &mut model.design.filter.get_or_insert_default()[k]
            });
            let unit = if design.sample_time.is_some() { "1" } else { "1/s" };
            variable.unit(unit).parameter()
        })
        .collect()
}

fn operating_point(design: &Design) -> Vec<Variable<AsoController>> {
    let mut all = Vec::new();
    let states = names::operating(design, "x_op", design.states.len());
    for (k, (name, signal)) in states.zip(&design.states).enumerate() {
        all.push(operating(name, signal.label(), move |design| &mut design.states[k].operating));
    }
    let commands = names::operating(design, "u_op", design.actuators.len());
    for (k, (name, actuator)) in commands.zip(&design.actuators).enumerate() {
        all.push(operating(name, actuator.label(), move |design| {
            &mut design.actuators[k].operating
        }));
    }
    let measured = names::operating(design, "y_op", design.measurements.len());
    for (k, (name, signal)) in measured.zip(&design.measurements).enumerate() {
        all.push(operating(name, signal.label(), move |design| {
            &mut design.measurements[k].operating
        }));
    }
    all
}

fn operating(
    name: String,
    Label { unit, meaning }: Label<'_>,
    place: impl Fn(&mut Design) -> &mut Option<f64> + Send + Sync + 'static,
) -> Variable<AsoController> {
    let text = format!("Operating point: {meaning}");
    let variable = Variable::real(name, text, move |model: &mut AsoController| {
        place(&mut model.design).get_or_insert_default()
    });
    with_unit(variable, unit).parameter()
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
