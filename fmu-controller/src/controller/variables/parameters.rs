//! The parameters: activation, initial estimates, filter, operating point, limits, matrices.

use super::{Variable, times_second, with_unit};
use crate::names;
use aso_controller::Matrix;
use aso_controller::channel;
use aso_controller::design::{
    Actuator, Design, Estimator, Fault, Label, Measurement, Reconfiguration, Signal, SlidingMode,
};

/// A function that borrows one matrix of a design.
type Accessor = fn(&mut Design) -> &mut Matrix;

/// Meaning and accessor of a matrix of [`Design::matrices`].
fn meaning_and_accessor(name: &str) -> (&'static str, Accessor) {
    match name {
        "A" => ("system matrix A of (1)", |design| &mut design.a),
        "B" => ("input matrix B of (1)", |design| &mut design.b),
        "C" => ("measurement matrix C of (1)", |design| &mut design.c),
        "D" => ("direct feedthrough D", |design| design.d.get_or_insert_default()),
        "F_a" => ("fault distribution matrix F_a of (1)", |design| &mut design.f_a),
        "K_x" => ("state feedback gain K_x of (2)", |design| &mut design.k_x),
        "K_f" => ("fault compensation gain K_f of (2)", |design| &mut design.k_f),
        "L_x" => ("observer gain L_x of (4)", |design| &mut design.l_x),
        "L_f" => ("fault observer gain L_f of (5)", |design| &mut design.l_f),
        "P_f" => {
            ("direct term P_f of the fault estimate", |design| design.p_f.get_or_insert_default())
        }
        "H" => ("matrix H of the integral action", |design| design.h.get_or_insert_default()),
        "K_i" => ("gain K_i of the integral action", |design| design.k_i.get_or_insert_default()),
        "F_i" => ("sensor faults F_i in the integral action", |design| {
            design.f_i.get_or_insert_default()
        }),
        "L_w" => ("back-calculation gain L_w", |design| design.l_w.get_or_insert_default()),
        "N_r" => ("feedforward gain N_r", |design| design.n_r.get_or_insert_default()),
        _ => ("matrix A_f of the fault model", |design| design.a_f.get_or_insert_default()),
    }
}

pub(super) fn of(design: &Design) -> Vec<Variable> {
    let mut all = switches(design);
    all.extend(starts(design));
    all.extend(filter(design));
    all.extend(operating_point(design));
    all.extend(limits(design));
    all.extend(sliding_mode(design));
    all.extend(stuck(design));
    if design.schedule.is_some() {
        // The matrices depend on the scheduling variable.
        return all;
    }
    for (name, matrix) in design.matrices() {
        let (meaning, accessor) = meaning_and_accessor(name);
        all.extend((0..matrix.values.len()).map(|k| {
            Variable::real(matrix.element(name, k), meaning, move |model| {
                &mut accessor(&mut model.design).values[k]
            })
            .parameter()
        }));
    }
    all
}

/// The parameters `t_on` and `monitor`, and the sample time of a sampled controller.
fn switches(design: &Design) -> Vec<Variable> {
    let text = "Compensation starts at this time";
    let mut all = vec![
        Variable::real("t_on", text, |model| &mut model.design.t_on).unit("s").parameter(),
        Variable::boolean(
            "monitor",
            "Whether the fault is estimated while it is not compensated",
            |model| &mut model.design.monitor,
        )
        .parameter(),
    ];
    all.extend(design.estimator.map(|estimator| {
        let text = match estimator {
            Estimator::Current => "Sample time; the command follows the measurements of its sample",
            Estimator::Prediction => "Sample time; the command follows those of the sample before",
        };
        Variable::real("T_s", text, |model| model.design.sample_time.get_or_insert_default())
            .unit("s")
            .constant()
    }));
    all
}

/// Initial estimates and integrals.
fn starts(design: &Design) -> Vec<Variable> {
    let (n, q) = (design.states.len(), design.faults.len());
    let labels = design.states.iter().map(Signal::label);
    let labels = labels.chain(design.faults.iter().map(Fault::label));
    let labels = labels
        .map(|Label { unit, meaning }| (format!("Initial estimate of {meaning}"), unit.cloned()));
    let integrals = design.references.iter().map(Signal::label).map(|Label { unit, meaning }| {
        (format!("Initial integral of {meaning}"), times_second(unit))
    });
    names::starts(design)
        .zip(labels.chain(integrals))
        .enumerate()
        .map(|(k, (name, (text, unit)))| {
            let variable = Variable::real(name, text, move |model| match k {
                k if k < n => &mut model.x_hat_0[k],
                k if k < n + q => &mut model.f_hat_0[k - n],
                k => &mut model.x_i_0[k - n - q],
            });
            let variable = with_unit(variable, unit.as_ref()).parameter();
            if (n..n + q).contains(&k) { variable.difference() } else { variable }
        })
        .collect()
}

fn filter(design: &Design) -> Vec<Variable> {
    let count = design.filter.as_ref().map_or(0, Vec::len);
    (0..count)
        .map(|k| {
            let name = channel("filter", k, count);
            let text = format!("Filter W: {}", design.measurements[k].label().meaning);
            let variable = Variable::real(name, text, move |model| {
                &mut model.design.filter.get_or_insert_default()[k]
            });
            let unit = if design.sample_time.is_some() { "1" } else { "1/s" };
            variable.unit(unit).parameter()
        })
        .collect()
}

/// rho and delta of a sliding-mode law, if the design has one.
fn sliding_mode(design: &Design) -> Vec<Variable> {
    let Some(SlidingMode { rho, delta }) = &design.sliding_mode else {
        return Vec::new();
    };
    let bounds = |name, text, list: &[f64], accessor: fn(&mut SlidingMode) -> &mut Vec<f64>| {
        let count = list.len();
        (0..count).map(move |k| {
            let Label { unit, meaning } = design.faults[k].label();
            let (name, text) = (channel(name, k, count), format!("{text}: {meaning}"));
            let variable = Variable::real(name, text, move |model| {
                &mut accessor(model.design.sliding_mode.get_or_insert_default())[k]
            });
            with_unit(variable, unit).difference().parameter()
        })
    };
    bounds("rho", "Largest estimate", rho, |law| &mut law.rho)
        .chain(bounds("delta", "Half-width of the boundary layer", delta, |law| &mut law.delta))
        .collect()
}

/// A function that borrows the value of one signal at the operating point.
type Operating = fn(&mut Design, usize) -> &mut Option<f64>;

fn operating_point(design: &Design) -> Vec<Variable> {
    let Design { states, actuators, measurements, references, .. } = design;
    let signals: [(_, Vec<_>, Operating); 4] = [
        ("x_op", states.iter().map(Signal::label).collect(), |design, k| {
            &mut design.states[k].operating
        }),
        ("u_op", actuators.iter().map(Actuator::label).collect(), |design, k| {
            &mut design.actuators[k].operating
        }),
        ("y_op", measurements.iter().map(Measurement::label).collect(), |design, k| {
            &mut design.measurements[k].operating
        }),
        ("r_op", references.iter().map(Signal::label).collect(), |design, k| {
            &mut design.references[k].operating
        }),
    ];
    let mut all = Vec::new();
    for (name, labels, accessor) in signals {
        let names = names::operating(design, name, labels.len());
        for (k, (name, Label { unit, meaning })) in names.zip(labels).enumerate() {
            let text = format!("Operating point: {meaning}");
            let variable = Variable::real(name, text, move |model| {
                accessor(&mut model.design, k).get_or_insert_default()
            });
            all.push(with_unit(variable, unit).parameter());
        }
    }
    all
}

/// The parameters for the commands at which actuators are stuck when they are gone.
fn stuck(design: &Design) -> Vec<Variable> {
    let one = |(at, case): (usize, &Reconfiguration)| {
        let name = channel("u_stuck", case.actuator, design.actuators.len());
        let text = format!("Command at which the actuator is stuck when it is gone: {}", case.gone);
        let variable = Variable::real(name, text, move |model| {
            &mut model.design.reconfigurations[at].stuck_at
        });
        with_unit(variable, design.actuators[case.actuator].unit.as_ref()).tunable()
    };
    design.reconfigurations.iter().enumerate().map(one).collect()
}

fn limits(design: &Design) -> Vec<Variable> {
    let mut all = Vec::new();
    for (side, text) in ["Smallest command", "Largest command"].into_iter().enumerate() {
        for (j, actuator) in design.actuators.iter().enumerate() {
            if actuator.limits.is_none() {
                continue;
            }
            let name = names::limit(design, side, j);
            let variable = Variable::real(name, text, move |model| {
                &mut model.design.actuators[j].limits.get_or_insert([0.0; 2])[side]
            });
            all.push(with_unit(variable, actuator.unit.as_ref()).tunable());
        }
    }
    all
}
