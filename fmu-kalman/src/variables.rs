//! The variables of the filter, by the dimensions and names of its design.

use aso_controller::design::Signal;
use aso_controller::kalman::{CarriedFault, KalmanDesign};
use aso_controller::{channel, channels};
use fmu::Enumeration;

use crate::{EXTENDED, KalmanFilter, UNSCENTED};

type Variable = fmu::Variable<KalmanFilter>;

/// All variables for `design`, in the order of the description.
pub(crate) fn list(design: &KalmanDesign) -> Vec<Variable> {
    let mut all = inputs(design);
    all.extend(estimates(design));
    all.extend(parameters(design));
    all
}

fn with_unit(variable: Variable, unit: Option<&String>) -> Variable {
    match unit {
        Some(unit) => variable.unit(unit.clone()),
        None => variable,
    }
}

/// The description of a fault, or its name if it has none.
fn meaning(fault: &CarriedFault) -> &String {
    if fault.description.is_empty() { &fault.name } else { &fault.description }
}

fn inputs(design: &KalmanDesign) -> Vec<Variable> {
    let text = |kind: &str, signal: &Signal| format!("{kind}: {}", signal.label().meaning);
    let measurements = design.measurements.iter().enumerate().map(|(k, signal)| {
        let variable =
            Variable::real(&signal.name, text("Measurement", signal), move |model| &mut model.y[k]);
        with_unit(variable, signal.unit.as_ref())
            .input()
            .derivative(move |model| &mut model.y_slopes[k])
    });
    let commands = design.commands.iter().enumerate().map(|(j, signal)| {
        let variable =
            Variable::real(&signal.name, text("Command that acts", signal), move |model| {
                &mut model.u[j]
            });
        with_unit(variable, signal.unit.as_ref()).input()
    });
    measurements.chain(commands).collect()
}

/// An element of z: the names of its variables, its meaning and its unit.
struct Element {
    estimate: String,
    deviation: String,
    initial: String,
    meaning: String,
    unit: Option<String>,
}

fn elements(design: &KalmanDesign) -> Vec<Element> {
    let (n, q) = (design.states.len(), design.fault_states());
    let states = design.states.iter().map(Signal::label);
    let states = states.map(|label| (label.meaning.to_owned(), label.unit.cloned()));
    let faults = design.faults.iter().map(|fault| (meaning(fault).clone(), fault.unit.clone()));
    let mut faults: Vec<_> = faults.collect();
    faults.resize(q, (String::new(), None));
    for fault in &design.faults {
        if let Some(rate) = fault.rate {
            let unit = fault.unit.as_ref().map(|unit| format!("{unit}/s"));
            let unit = unit.filter(|unit| fmu::description::unit::Unit::parse(unit).is_ok());
            faults[rate] = (format!("rate of {}", meaning(fault)), unit);
        }
    }
    let names = ["x", "f"].into_iter().zip([n, q]).flat_map(|(letter, count)| {
        (0..count).map(move |k| {
            ["_hat", "_deviation", "_hat_0"]
                .map(|suffix| channel(&format!("{letter}{suffix}"), k, count))
        })
    });
    names
        .zip(states.chain(faults))
        .map(|([estimate, deviation, initial], (meaning, unit))| Element {
            estimate,
            deviation,
            initial,
            meaning,
            unit,
        })
        .collect()
}

fn estimates(design: &KalmanDesign) -> Vec<Variable> {
    let (n, q) = (design.states.len(), design.fault_states());
    let inputs = design.measurements.iter().chain(&design.commands);
    // Sample 0, at the start time, corrects the initial estimates by the method.
    let known: Vec<String> = inputs
        .map(|signal| signal.name.clone())
        .chain(channels("x_hat_0", n))
        .chain(channels("f_hat_0", q))
        .chain(["time", "method"].map(str::to_owned))
        .collect();
    let output = |variable: Variable| variable.output(&[]).discrete().initially(known.clone());
    let mut all = Vec::new();
    for (k, Element { estimate, meaning, unit, .. }) in elements(design).into_iter().enumerate() {
        let text = format!("Estimate of {meaning}");
        let variable = Variable::real(estimate, text, move |model| &mut model.estimate.mean[k]);
        let variable = with_unit(variable, unit.as_ref());
        all.push(output(if k < n { variable } else { variable.difference() }));
    }
    for (k, Element { deviation, meaning, unit, .. }) in elements(design).into_iter().enumerate() {
        let text = format!("Standard deviation of the estimate of {meaning}");
        let variable = Variable::real(deviation, text, move |model| &mut model.deviations[k]);
        all.push(output(with_unit(variable, unit.as_ref()).difference()));
    }
    let text = "Square of the innovation relative to its covariance; on average the number of measurements";
    all.push(output(
        Variable::real("innovation_squared", text, |model| &mut model.innovation_squared).unit("1"),
    ));
    all
}

fn parameters(design: &KalmanDesign) -> Vec<Variable> {
    let methods = Enumeration::new("Method", [("extended", EXTENDED), ("unscented", UNSCENTED)]);
    let text = "How the estimate passes the equations of the plant: by tangents or by points";
    let mut all = vec![
        Variable::enumeration("method", text, methods, |model| &mut model.method).parameter(),
        Variable::integer(
            "integration_steps",
            "Number of integration steps in a sample",
            |model| &mut model.integration_steps,
        )
        .range(1.0, 1e6)
        .parameter(),
    ];
    let p = design.measurements.len();
    for (k, signal) in design.measurements.iter().enumerate() {
        let text = format!(
            "Number of samples between two in which the measurement {} is used",
            signal.label().meaning
        );
        let every =
            Variable::integer(channel("every", k, p), text, move |model| &mut model.every[k]);
        all.push(every.range(1.0, 1e6).parameter());
    }
    for (k, Element { initial, meaning, unit, .. }) in elements(design).into_iter().enumerate() {
        let text = format!("Estimate of {meaning} before the first sample");
        let variable = Variable::real(initial, text, move |model| &mut model.initial[k]);
        let variable = with_unit(variable, unit.as_ref()).parameter();
        all.push(if k < design.states.len() { variable } else { variable.difference() });
    }
    all
}
