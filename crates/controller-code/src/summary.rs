//! The description of the code for its users: the same sentences for C and Rust.

mod options;

use super::arithmetic::{Arithmetic, Memory};
use super::controller::Controller;
use super::fields::Fields;
use super::parts::Signal;
use super::rounding::RoundingBound;
use super::symbols::Matrix;
use super::text::{aligned, ascii, filled, one_line};
use super::{Precision, Request};
use aso_controller::design::{Estimator, Loss, SlidingMode, integral_unit};

/// The functions and flags of a language, in the notation of the language.
pub(super) struct Vocabulary {
    pub(super) init: String,
    pub(super) init_at: String,
    pub(super) step: String,
    pub(super) held: String,
    pub(super) at_limit: String,
    pub(super) overflow: String,
    pub(super) outside: String,
    pub(super) lost: String,
    pub(super) real: &'static str,
    /// How the order of operations is kept: the options of a C compiler, or the statement that rustc keeps it.
    pub(super) compiler: &'static str,
}

/// One line on each signal: name, unit and description, in ASCII.
pub(super) fn descriptions(signals: &[Signal]) -> Vec<String> {
    let described = |signal: &Signal| {
        let unit = signal.unit.as_ref().map_or_else(String::new, |unit| format!(" in {unit}"));
        let text = one_line(&signal.description);
        let text = text.trim_end_matches('.');
        let text = if text.is_empty() { String::new() } else { format!(": {text}") };
        ascii(&format!("`{}`{unit}{text}", one_line(&signal.name)))
    };
    signals.iter().map(described).collect()
}

/// One line on each of the [`Fields::estimates`].
pub(super) fn descriptions_of_estimates(controller: &Controller) -> Vec<String> {
    let estimate = |text: String| format!("Estimate of {text}");
    let states = descriptions(&controller.states).into_iter().map(estimate);
    let faults = descriptions(&controller.faults).into_iter().map(estimate);
    let name = |loss: &Loss| ascii(&one_line(&controller.actuators[loss.actuator].name));
    let losses = controller.losses.iter();
    let losses =
        losses.map(|loss| format!("Estimate of the lost part of the effect of `{}`", name(loss)));
    let integrals = controller.references.iter().filter(|_| controller.has(Matrix::H));
    let integrals = integrals.map(|signal| {
        let unit = signal.unit.as_deref().map(integral_unit);
        let unit = unit.map_or_else(String::new, |unit| format!(" in {unit}"));
        ascii(&format!("Integral for the reference `{}`{unit}", one_line(&signal.name)))
    });
    states.chain(faults).chain(losses).chain(integrals).collect()
}

/// Returns the lines that describe a controller, in ASCII.
pub(super) fn summary(
    request: &Request<'_>,
    controller: &Controller,
    fields: &Fields,
    bound: Option<&RoundingBound>,
    vocabulary: &Vocabulary,
) -> Vec<String> {
    let mut lines = vec![
        format!("Sampled controller: {}", one_line(&controller.description)),
        format!("Written by {}, version {}.", request.identity, env!("CARGO_PKG_VERSION")),
        format!("Verdict of the design: {}.", request.verdict),
    ];
    section(&mut lines, "USE", &[usage(controller, vocabulary)]);
    section(&mut lines, "TIMING", &timing(request, controller, vocabulary));
    section(&mut lines, "COMPENSATION AND LIMITS", &modes(controller));
    section(&mut lines, "SCHEDULE", &options::schedule(controller, vocabulary));
    section(&mut lines, "DETECTION", &options::detection(controller, request.precision));
    section(&mut lines, "RECONFIGURATION", &options::reconfiguration(controller, fields));
    lines.extend([String::new(), "SIGNALS".to_owned()]);
    lines.extend(signals(controller, fields));
    section(&mut lines, "STATUS", &status(controller, vocabulary));
    section(&mut lines, "COST", &costs(request, controller));
    section(&mut lines, "PRECISION", &precision(request, vocabulary));
    if let Some(bound) = bound {
        lines.extend(bound.lines(controller, fields));
    }
    for line in &mut lines {
        *line = ascii(line);
    }
    lines
}

/// Adds a title and paragraphs, broken into lines; nothing without paragraphs.
fn section(lines: &mut Vec<String>, title: &str, paragraphs: &[String]) {
    if paragraphs.is_empty() {
        return;
    }
    lines.extend([String::new(), title.to_owned()]);
    for paragraph in paragraphs {
        lines.extend(filled(paragraph));
    }
}

fn usage(controller: &Controller, vocabulary: &Vocabulary) -> String {
    let Vocabulary { init, init_at, step, .. } = vocabulary;
    let filtered = match controller.filter {
        Some(_) => ", the filtered measurements at the first measurements",
        None => "",
    };
    let start = match controller.schedule {
        None => "the operating point",
        Some(_) => "the values of the column `start`",
    };
    format!(
        "Call {init} once for each instance, then {step} once in every sample. The estimates of \
         the states start at {start}, those of the faults at 0{filtered}; {init_at} starts \
         them elsewhere. A call uses no heap, no global variable and no library, and ends after a \
         bounded number of operations. Instances are independent. Signals are values, as in the plant \
         file, not deviations from the operating point."
    )
}

fn timing(request: &Request<'_>, controller: &Controller, vocabulary: &Vocabulary) -> Vec<String> {
    let (period, step) = (controller.sample_time, &vocabulary.step);
    let estimator = match controller.estimator {
        Estimator::Current => format!(
            "The estimator is current: the commands of {step} follow from the measurements of the same \
             call. Apply them at once: the time from measuring to applying is a delay that the design \
             does not know."
        ),
        Estimator::Prediction => format!(
            "The estimator is a predictor: the commands of {step} follow from the measurements of earlier \
             calls. Call it as soon as the sample starts, and apply its commands in the same sample; its \
             measurements count for the next one."
        ),
    };
    let mut all = vec![format!(
        "Sample time: {period:?} s. Sample k is at k times the sample time. {estimator}"
    )];
    if controller.has(Matrix::D) {
        let text = "The measurements contain the commands (D): take them just before new commands are applied, so \
                    that they contain those of the sample before.";
        all.push(text.to_owned());
    }
    all.extend(request.delay_margin.map(delay));
    all
}

/// States the delay margin, in s.
fn delay(margin: f64) -> String {
    if margin.is_finite() {
        format!("The loop is stable with a further delay of all commands below {margin:.3e} s.")
    } else {
        "The loop is stable with any further delay of all commands.".to_owned()
    }
}

fn modes(controller: &Controller) -> Vec<String> {
    let Controller { t_on, first_compensated, .. } = controller;
    let start = match first_compensated {
        0 => "the first sample".to_owned(),
        sample => format!("sample {sample} (t_on = {t_on:?} s)"),
    };
    let estimated = match (controller.monitor, controller.has(Matrix::PF)) {
        (true, _) => "They are estimated in every sample (monitor).",
        (false, false) => {
            "They are estimated while they are compensated; otherwise their estimates keep their values."
        }
        (false, true) => {
            "They are estimated while they are compensated; otherwise their estimates are f_hat_i, which keeps \
             its value."
        }
    };
    let list = |values: &[f64]| {
        values.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(", ")
    };
    let mut all = vec![format!(
        "Faults are compensated from {start} on while `compensate` is true. {estimated}"
    )];
    if controller.has(Matrix::PF) {
        let text = "The estimates of faults have a direct term: f_hat = f_hat_i + P_f e, with the innovation e of \
                    the corrected estimate. The observer predicts with the integral part f_hat_i, which `init_at` \
                    sets, and which is the estimate after an overflow.";
        all.push(text.to_owned());
    }
    if let Some(SlidingMode { rho, delta }) = &controller.sliding_mode {
        all.push(format!(
            "The law that estimates the faults is a sliding mode: f_hat = rho s / (|s| + delta), s = L_f e, for \
             each fault; rho = {}, delta = {}. So no estimate exceeds rho.",
            list(rho),
            list(delta)
        ));
    }
    if let Some(filter) = &controller.filter {
        all.push(format!(
            "Measurements are filtered: y_f := y_f + filter (y - y_f), filter = {}.",
            list(filter)
        ));
    }
    if controller.is_limited() {
        let text = "A command beyond a limit is set to it, and the observer uses the limited command, so \
                    that no estimate winds up.";
        all.push(text.to_owned());
    }
    if let Some(transfer) = controller.transfer {
        all.push(format!(
            "When the law of the commands changes (compensation, gains), each command stays where it is and approaches \
             the new law: the distance u_t at this sample is added to it, and u_t := u_t - {transfer:?} u_t."
        ));
    }
    if controller.has(Matrix::H) {
        let text = "The integrals x_i of the distances of the measurements from their references start at 0; \
                    while a command is at a limit, they follow the limited command (L_w).";
        let plain = "The integrals x_i of the distances of the measurements from their references start at 0.";
        all.push(if controller.has(Matrix::LW) { text } else { plain }.to_owned());
    }
    all
}

/// The table of the signals and their fields.
fn signals(controller: &Controller, fields: &Fields) -> Vec<String> {
    let operating = if controller.schedule.is_some() { "start" } else { "operating point" };
    let mut rows = vec![
        ["field", "name in the plant file", "unit", operating, "description"].map(str::to_owned),
    ];
    let groups = [
        ("Measurements", "", &controller.measurements[..], &fields.measurements),
        ("References", "", &controller.references, &fields.references),
        ("Schedule", "", controller.schedule_inputs(), &fields.schedule),
        ("Commands", "", &controller.actuators, &fields.actuators),
        ("Estimates", "x_hat_", &controller.states, &fields.states),
        ("Estimates", "f_hat_", &controller.faults, &fields.faults),
    ];
    for (owner, start, signals, fields) in groups {
        for (signal, field) in signals.iter().zip(fields) {
            let fault = start == "f_hat_";
            rows.push([
                format!("{owner}.{start}{field}"),
                one_line(&signal.name),
                signal.unit.clone().unwrap_or_default(),
                if fault { String::new() } else { format!("{:?}", signal.operating) },
                one_line(&signal.description),
            ]);
        }
    }
    for loss in &controller.losses {
        let [fault, actuator] =
            [&controller.faults[loss.fault], &controller.actuators[loss.actuator]];
        rows.push([
            format!("Estimates.E_hat_{}", fields.faults[loss.fault]),
            format!("loss of {}, {}", one_line(&actuator.name), one_line(&fault.name)),
            "1".to_owned(),
            String::new(),
            String::new(),
        ]);
    }
    for (field, reference) in fields.integrals.iter().zip(&controller.references) {
        rows.push([
            format!("Estimates.x_i_{field}"),
            format!("integral for {}", one_line(&reference.name)),
            reference.unit.as_deref().map(integral_unit).unwrap_or_default(),
            "0.0".to_owned(),
            String::new(),
        ]);
    }
    let mut lines = aligned(&rows);
    for (what, signals, fields) in [
        ("Limits of Commands", &controller.actuators, &fields.actuators),
        ("Range of Measurements", &controller.measurements, &fields.measurements),
    ] {
        for (signal, field) in signals.iter().zip(fields) {
            let range = signal.limits;
            lines.extend(range.map(|[low, high]| format!("{what}.{field}: {low:?} to {high:?}")));
        }
    }
    for loss in &controller.losses {
        let [fault, actuator] = [&fields.faults[loss.fault], &fields.actuators[loss.actuator]];
        lines.push(format!(
            "E_hat_{fault} = -u f_hat / (u^2 + u_e^2), u = Commands.{actuator}, u_e = {:?}",
            loss.least_command
        ));
    }
    lines
}

fn status(controller: &Controller, vocabulary: &Vocabulary) -> Vec<String> {
    let Vocabulary { held, at_limit, overflow, outside, lost, real, .. } = vocabulary;
    let inputs = match controller.schedule_inputs() {
        [] => "measurement or reference",
        _ => "measurement, a reference or the scheduling variable",
    };
    let place = match controller.schedule {
        None => "at the operating point",
        Some(_) => "in the column `start`",
    };
    let also_constant = match controller.detection {
        None => " and estimates",
        Some(_) => ", estimates, residuals, statistics and decision",
    };
    let (beyond, last) = if controller.checks_measurements() {
        (", or a measurement outside of its range", "its last other value")
    } else {
        ("", "its last finite value")
    };
    let mut all = vec![
        format!(
            "{held}: a {inputs} was NaN or infinite{beyond}; {last} was used, before the first \
             one its value {place}."
        ),
        format!("{at_limit}: a command is at a limit."),
        format!(
            "{overflow}: a sum was beyond the range of {real}; commands{also_constant} keep their values. \
             So every output is a finite number in every sample."
        ),
    ];
    all.extend(
        controller
            .schedule
            .is_some()
            .then(|| format!("{outside}: the scheduling variable is outside of the schedule.")),
    );
    all.extend(controller.limits_holds().then(|| rest(controller, lost)));
    all
}

/// A sentence on the controller while the last value of a measurement is too old.
fn rest(controller: &Controller, lost: &str) -> String {
    let measurements = controller.measurements.iter().zip(&controller.most_held);
    let longest: Vec<_> = measurements
        .filter_map(|(signal, most)| Some(format!("{} for {}", one_line(&signal.name), (*most)?)))
        .collect();
    let detection = match controller.detection {
        None => "",
        Some(_) => {
            " The detection does the same: its decision stays, residuals and statistics are 0, and tests begin as \
             after the start."
        }
    };
    format!(
        "{lost}: the last value of a measurement was used for more samples than it may be ({}). Commands and \
         estimates are those of the operating point, without faults; from the first sample in which no measurement \
         is lost, the controller continues from there.{detection}",
        longest.join(", ")
    )
}

fn costs(request: &Request<'_>, controller: &Controller) -> [String; 2] {
    let Arithmetic { multiplications, additions, comparisons, divisions } =
        Arithmetic::of(controller);
    let Memory { state, stack, constants } = Memory::of(controller, request.precision);
    [
        format!(
            "Floating-point operations of a sample, at most: {multiplications} multiplications, \
             {additions} additions, {comparisons} comparisons, {divisions} divisions."
        ),
        format!(
            "Memory: {state} bytes for an instance, {stack} bytes of vectors on the stack, {constants} \
             bytes of constants; the size of the program depends on the compiler."
        ),
    ]
}

fn precision(request: &Request<'_>, vocabulary: &Vocabulary) -> [String; 1] {
    let compiler = vocabulary.compiler;
    [match request.precision {
        Precision::Double => format!(
            "Double. The results have the bits of the controller FMU of the same design, if the compiler \
             neither contracts nor reorders operations: {compiler}"
        ),
        Precision::Single => format!(
            "Single. The compiler must not reorder operations: {compiler} The results differ from those \
             of the FMU of the same design."
        ),
    }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_that_bears_every_delay_has_no_number() {
        assert!(delay(0.0125).ends_with("below 1.250e-2 s."));
        assert!(delay(f64::INFINITY).ends_with("any further delay of all commands."));
    }
}
