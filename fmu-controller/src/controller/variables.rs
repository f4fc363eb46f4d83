//! The variables of the controller, which follow from the dimensions and names of the design.

mod detection;
mod parameters;

use fmu::description::unit::Unit;

use crate::controller::AsoController;
use crate::dependencies::Group;
use crate::{dependencies, names};
use aso_controller::channel;
use aso_controller::design::{Design, Label, Measurement, integral_unit};

type Variable = fmu::Variable<AsoController>;

/// All variables of `controller`, in the order of the description.
pub(crate) fn list(controller: &AsoController) -> Vec<Variable> {
    let design = &controller.design;
    let mut all = inputs(design);
    all.extend(commands(design));
    all.extend(faults(design));
    all.extend(estimates(design));
    all.extend(losses(controller));
    all.extend(schedule_at(design));
    all.extend(reconfiguration(design));
    all.extend(measurement_flags(design));
    if design.sample_time.is_none() {
        all.extend(slopes(design));
    }
    all.extend(parameters::of(design));
    all.extend(sample_clock(design));
    all.extend(detection::of(design));
    all
}

/// The clock of a sampled controller; FMI 2.0 has no clocks.
fn sample_clock(design: &Design) -> Option<Variable> {
    let text = "Clock of the samples";
    let clock = |period| {
        Variable::periodic_clock("sample_clock", text, period, |model| &mut model.sample_clock)
    };
    design.sample_time.map(clock)
}

fn with_unit(variable: Variable, unit: Option<&String>) -> Variable {
    match unit {
        Some(unit) => variable.unit(unit.clone()),
        None => variable,
    }
}

/// The unit per second: `m` gives `m/s`, `m/s` gives `m/s2`. `None` without a unit, or if FMI cannot write it.
fn per_second(unit: Option<&String>) -> Option<String> {
    let unit = unit?;
    let slope = if unit.ends_with("/s") { format!("{unit}2") } else { format!("{unit}/s") };
    Unit::parse(&slope).is_ok().then_some(slope)
}

/// The unit times a second, see [`integral_unit`]. `None` without a unit, or if FMI cannot write it.
fn times_second(unit: Option<&String>) -> Option<String> {
    let integral = integral_unit(unit?);
    Unit::parse(&integral).is_ok().then_some(integral)
}

/// Adds dependencies to a variable.
fn with_dependencies(variable: Variable, groups: Vec<Group>) -> Variable {
    groups.into_iter().fold(variable, |variable, (kind, names)| variable.depends(kind, names))
}

/// An output with its dependencies; an output of a sampled controller is discrete and has none.
fn output(design: &Design, variable: Variable, groups: Vec<Group>) -> Variable {
    match design.sample_time {
        None => with_dependencies(variable.output(&[]), groups),
        Some(_) => variable.output(&[]).discrete(),
    }
}

fn inputs(design: &Design) -> Vec<Variable> {
    let mut inputs: Vec<_> = design
        .measurements
        .iter()
        .enumerate()
        .map(|(k, signal)| {
            let Label { unit, meaning } = signal.label();
            let text = format!("Measurement: {meaning}{}", validity(signal));
            let is_checked = design.checks_measurements();
            let variable = Variable::real(&signal.name, text, move |model| {
                if is_checked {
                    &mut model.measurement_check_mut().y[k]
                } else {
                    &mut model.values.y[k]
                }
            });
            with_unit(variable, unit).input().derivative(move |model| {
                if is_checked {
                    &mut model.measurement_check_mut().y_slopes[k]
                } else {
                    &mut model.values.y_slopes[k]
                }
            })
        })
        .collect();
    inputs.extend(design.references.iter().enumerate().map(|(k, signal)| {
        let Label { unit, meaning } = signal.label();
        let text = format!("Reference: {meaning}");
        let variable = Variable::real(&signal.name, text, move |model| &mut model.values.r[k]);
        with_unit(variable, unit).input().derivative(move |model| &mut model.values.r_slopes[k])
    }));
    let text = "Whether the estimated fault is compensated from t_on on";
    inputs.push(Variable::boolean("compensate", text, |model| &mut model.compensate).input());
    inputs.extend(design.reconfigurations.iter().map(|case| {
        let j = case.actuator;
        let text = format!("Whether this actuator is gone: {}", case.gone);
        Variable::boolean(channel("actuator_gone", j, design.actuators.len()), text, move |model| {
            &mut model.reconfigurator.reported[j]
        })
        .input()
    }));
    let text = "Whether an unknown actuator has failed: the gains are those of the fall-back";
    inputs.extend(design.fallback.as_ref().map(|_| {
        Variable::boolean("fall_back", text, |model| &mut model.reconfigurator.fall_back).input()
    }));
    inputs.extend(schedule_input(design));
    inputs
}

/// The scheduling variable as an input; `None` if it is a measurement, or without a schedule.
fn schedule_input(design: &Design) -> Option<Variable> {
    let schedule =
        design.schedule.as_ref().filter(|schedule| schedule.measurement(design).is_none())?;
    let meaning = &schedule.description;
    let meaning = if meaning.is_empty() { &schedule.variable } else { meaning };
    let text = format!("Scheduling variable: {meaning}");
    let variable = Variable::real(&schedule.variable, text, |model| &mut model.schedule_input);
    let variable = with_unit(variable, schedule.unit.as_ref()).input();
    Some(variable.derivative(|model| &mut model.schedule_slope))
}

/// The value of the scheduling variable that the last sample used, or that a continuous controller uses; `None` without
/// a schedule.
fn schedule_at(design: &Design) -> Option<Variable> {
    let schedule = design.schedule.as_ref()?;
    let unit = match schedule.measurement(design) {
        Some(k) => design.measurements[k].unit.as_ref(),
        None => schedule.unit.as_ref(),
    };
    let of = if design.sample_time.is_some() { " of the last sample" } else { "" };
    let text = format!("{}{of}, held within the schedule", schedule.variable);
    let variable = Variable::real("schedule_at", text, |model| &mut model.schedule_at);
    let initial = vec![schedule.variable.clone()];
    let groups = dependencies::groups_by_schedule(design, Vec::new());
    Some(output(design, with_unit(variable, unit), groups).initially(initial))
}

/// The output with the number of the actuator that is gone, if the design has reconfigurations or a fall-back.
fn reconfiguration(design: &Design) -> Option<Variable> {
    let mut text =
        "Number of the actuator that the controller does without; 0 if there is none".to_owned();
    if design.fallback.is_some() {
        text += "; -1 in the fall-back";
    }
    let variable =
        Variable::integer("reconfiguration", text, |model| &mut model.reconfigurator.output);
    design.is_reconfigurable().then(|| variable.output(&[]))
}

/// Describes in words when a measurement is used; empty if it always is.
fn validity(signal: &Measurement) -> String {
    let range = signal.range.map(|[low, high]| format!("; used from {low} to {high}"));
    let hold = signal.longest_hold.map(|time| format!("; held for {time} s at most"));
    range.into_iter().chain(hold).collect()
}

/// The outputs that state whether measurements are held, and whether one is held for too long; none if every
/// measurement is used.
fn measurement_flags(design: &Design) -> Vec<Variable> {
    if !design.checks_measurements() {
        return Vec::new();
    }
    let names = || design.measurements.iter().map(|signal| signal.name.clone()).collect::<Vec<_>>();
    let output = |variable: Variable| variable.output(&[]).discrete().initially(names());
    vec![
        output(Variable::boolean(
            "measurement_held",
            "Whether a measurement is outside of its range: its last value is used",
            |model| &mut model.measurement_check_mut().is_held,
        )),
        output(Variable::boolean(
            "measurement_lost",
            "Whether a last value is used for too long: commands and estimates are those of the operating point",
            |model| &mut model.measurement_check_mut().is_lost,
        )),
    ]
}

fn commands(design: &Design) -> Vec<Variable> {
    let actuators = &design.actuators;
    actuators
        .iter()
        .enumerate()
        .map(|(j, actuator)| {
            let Label { unit, meaning } = actuator.label();
            let text = format!("Command: {meaning}");
            let variable =
                Variable::real(&actuator.name, text, move |model| &mut model.values.u[j]);
            output(design, with_unit(variable, unit), dependencies::of_command(design, j))
                .initially(dependencies::of_initial_command(design, j))
                .derivative(move |model| &mut model.with_slopes().u_slopes[j])
        })
        .collect()
}

/// An element of the estimates z, with its variables.
struct State {
    position: usize,
    name: String,
    /// The descriptions of the state and of its derivative.
    texts: [String; 2],
    /// The units of the state and of its derivative.
    units: [Option<String>; 2],
}

fn states(design: &Design) -> Vec<State> {
    let kind = if design.p_f.is_some() { "Integral part of the estimate" } else { "Estimate" };
    let mut labels = Vec::new();
    labels.extend(design.states.iter().map(|signal| ("Estimate", signal.label())));
    labels.extend(design.faults.iter().map(|fault| (kind, fault.label())));
    if design.filter.is_some() {
        labels.extend(design.measurements.iter().map(|signal| ("Filtered value", signal.label())));
    }
    if design.k_i.is_some() {
        labels.extend(design.references.iter().map(|signal| ("Integral", signal.label())));
    }
    if design.transfer.is_some() {
        labels.extend(design.actuators.iter().map(|signal| ("Bumpless transfer", signal.label())));
    }
    names::estimates(design)
        .zip(labels)
        .enumerate()
        .map(|(position, (name, (kind, Label { unit, meaning })))| {
            let derivative =
                format!("Derivative of the {} of {meaning}", kind.to_ascii_lowercase());
            let texts = [format!("{kind} of {meaning}"), derivative];
            let units = match kind {
                "Integral" => [times_second(unit), unit.cloned()],
                _ => [unit.cloned(), per_second(unit)],
            };
            State { position, name, texts, units }
        })
        .collect()
}

/// The variables of the fault estimates in a design with a direct term, where the estimates are no states.
fn faults(design: &Design) -> Vec<Variable> {
    let count = design.p_f.as_ref().map_or(0, |p_f| p_f.rows);
    (0..count)
        .map(|i| {
            let Label { unit, meaning } = design.faults[i].label();
            let (name, text) = (channel("f_hat", i, count), format!("Estimate of {meaning}"));
            let variable = Variable::real(name, text, move |model| &mut model.deviations.f_hat[i]);
            let variable = with_unit(variable, unit).difference();
            output(design, variable, dependencies::of_fault(design, i))
                .initially(dependencies::of_initial_fault(design, i))
                .derivative(move |model| &mut model.with_slopes().f_slopes[i])
        })
        .collect()
}

fn estimates(design: &Design) -> Vec<Variable> {
    let (n, q) = (design.states.len(), design.faults.len());
    let is_difference = |k: usize| (n..n + q).contains(&k) || k >= design.transfer_at(0);
    let mut states = states(design);
    let others = states.split_off(n);
    others
        .into_iter()
        .chain(states)
        .map(|State { position: k, name, texts: [text, _], units: [unit, _] }| {
            let variable = Variable::real(name, text, move |model| &mut model.values.z[k]);
            let variable = with_unit(variable, unit.as_ref());
            let variable = if is_difference(k) { variable.difference() } else { variable };
            output(design, variable, Vec::new())
                .initially(dependencies::of_initial_estimate(design, k))
                .derivative(move |model| &mut model.with_slopes().z_slopes[k])
        })
        .collect()
}

/// The estimates of lost effectiveness.
fn losses(controller: &AsoController) -> Vec<Variable> {
    let design = &controller.design;
    let losses = controller.losses.iter().enumerate();
    losses
        .map(|(position, loss)| {
            let name = channel("E_hat", loss.fault, design.faults.len());
            let meaning = design.actuators[loss.actuator].label().meaning;
            let text = format!("Estimated loss of effectiveness: {meaning}");
            let variable =
                Variable::real(name, text, move |model| &mut model.losses[position].estimate);
            output(design, variable.unit("1"), dependencies::of_loss(design, loss))
                .initially(dependencies::of_initial_loss(design, loss))
                .derivative(move |model| &mut model.with_slopes().losses[position].slope)
        })
        .collect()
}

/// The derivatives of z, the continuous states.
fn slopes(design: &Design) -> Vec<Variable> {
    states(design)
        .into_iter()
        .map(|State { position: k, name: state, texts: [_, text], units: [_, unit] }| {
            let variable = Variable::real(format!("der({state})"), text, move |model| {
                &mut model.with_slopes().z_slopes[k]
            });
            let variable = with_unit(variable, unit.as_ref()).derivative_of(state);
            with_dependencies(variable, dependencies::of_slope(design, k))
                .initially(dependencies::of_initial_slope(design, k))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_derivative_has_the_unit_of_its_state_per_second() {
        for (unit, rate) in [
            ("m", "m/s"),
            ("rad/s", "rad/s2"),
            ("N", "N/s"),
            ("J/(kg.K)", "J/(kg.K)/s"),
            ("km/h", "km/h/s"),
            ("s-1", "s-1/s"),
            ("%", "%/s"),
        ] {
            let slope = per_second(Some(&unit.to_owned())).unwrap();
            assert_eq!(slope, rate);
            let [of, per] = [unit, &slope].map(|unit| Unit::parse(unit).unwrap().base.unwrap());
            assert_eq!(fmu::description::unit::BaseUnit { s: of.s - 1, ..of }, per);
        }
    }

    #[test]
    fn an_integral_has_the_unit_of_its_reference_times_a_second() {
        for (unit, integral) in [
            ("m", "m.s"),
            ("rad/s", "rad"),
            ("1/s", "1"),
            ("km/h", "s.km/h"),
            ("J/(kg.K)", "s.J/(kg.K)"),
        ] {
            let product = times_second(Some(&unit.to_owned())).unwrap();
            assert_eq!(product, integral);
            let [of, times] = [unit, &product].map(|unit| Unit::parse(unit).unwrap().base.unwrap());
            assert_eq!(fmu::description::unit::BaseUnit { s: of.s + 1, ..of }, times);
        }
    }

    #[test]
    fn a_derivative_has_no_unit_where_none_can_be_written() {
        for unit in [None, Some(String::new()), Some("degC".to_owned())] {
            assert_eq!(per_second(unit.as_ref()), None);
        }
    }
}
