//! The summary of a design on the terminal.

use design::report::detection::Detection;
use design::report::fallback::FallbackReport;
use design::report::family::MemberReport;
use design::report::losses::LossLoop;
use design::report::number::{NO_LIMIT, settled};
use design::report::reconfiguration::ReconfigurationReport;
use design::report::robustness::{LoopPoint, Number, ToleranceProof, ToleranceResult};
use design::report::schedule::ScheduleReport;
use design::report::{CommandPeak, Loop, Matrix, PidController, ReferenceStep};
use design::{Comparison, Report};

/// Largest number of rows or columns of a gain, of eigenvalues and of commands that are printed.
const LARGEST_SHOWN: usize = 16;

/// Entries of a gain below this fraction of the largest entry, and steady-state errors below this value, are printed as
/// 0.
const ROUNDING: f64 = 1e-14;

/// Prints the summary: gains, eigenvalues, robustness, families and schedules, detection, losses, checks that fail,
/// warnings, and the verdict with its reasons and remedies.
pub(crate) fn summarise(report: &Report) {
    report.gains.iter().for_each(print_gain);
    report.pid.iter().for_each(print_pid);
    [&report.feedback, &report.observer].into_iter().for_each(print_loop);
    report.references.iter().for_each(print_reference);
    println!("estimation law: {}", report.estimation.law);
    if let Some(robustness) = &report.robustness {
        println!("peak of S: {}", peaks(&robustness.points));
        let [delay, hold] = [robustness.delay_margin, robustness.longest_hold].map(seconds);
        match (&report.plant.sample_time, &report.sampling) {
            (Some(_), _) => println!("delay margin: {delay}, in whole samples"),
            (None, Some(_)) => println!("delay margin: {delay}; longest sample time: {hold}"),
            (None, None) => println!("delay margin: {delay}; longest hold: {hold}"),
        }
        if let Some(delays) = &robustness.delays {
            let [at_input, at_output] = delays.s_peaks.map(number);
            println!(
                "with the delays themselves, at {} frequencies: peak of S: {at_input} at the input, {at_output} at the output; {}",
                delays.frequencies,
                if delays.difference < 1.0 { "stable" } else { "stability is not shown" }
            );
        }
        print_tolerance(&robustness.tolerance);
        print_proof(&robustness.tolerance, &robustness.tolerance_proof);
    }
    if let Some(family) = &report.family {
        let members: Vec<_> = family.members.iter().collect();
        print_members("member", &members);
        match &family.whole {
            Ok(whole) => println!(
                "one P for the whole family: proven for a plant that moves between its members in any \
                 way, margin {:.1e}",
                whole.margin
            ),
            Err(reason) => println!(
                "a plant that moves between the members: not proven ({reason}); the above is for \
                 constant members"
            ),
        }
    }
    report.schedule.iter().for_each(print_schedule);
    report.detection.iter().for_each(print_detection);
    if let Some(losses) = &report.losses {
        losses.loops.iter().for_each(print_losses);
    }
    report.reconfiguration.iter().for_each(print_reconfigurations);
    report.fallback.iter().for_each(print_fallback);
    for check in report.checks.iter().filter(|check| !check.holds) {
        println!("does not hold: {} ({})", check.condition, check.explanation);
    }
    for warning in &report.warnings {
        println!("warning: {warning}");
    }
    println!("verdict: {}", report.verdict.level.word());
    // Checks that fail are printed above.
    let is_new = |reason: &&String| {
        let mut remedies = report.verdict.remedies.iter();
        !reason.starts_with("does not hold: ") || remedies.any(|remedy| remedy.reason == **reason)
    };
    // Consecutive reasons may have the same remedy, which is printed once.
    let mut stated = "";
    for reason in report.verdict.reasons.iter().filter(is_new) {
        println!("    {reason}");
        let remedies = report.verdict.remedies.iter();
        for remedy in remedies.filter(|remedy| remedy.reason == *reason) {
            if remedy.change == stated {
                println!("        the same change");
                continue;
            }
            stated = &remedy.change;
            println!("        {stated}");
            for line in &remedy.lines {
                println!("        {line}");
            }
        }
    }
}

/// Prints the gains of a controller of low order, and `T_i` and `T_d` if all its gains have the same sign.
fn print_pid(controller: &PidController) {
    let PidController { command, measurement, proportional, integral, .. } = controller;
    let mut gains =
        vec![format!("K = {}", number(*proportional)), format!("K_i = {} 1/s", number(*integral))];
    gains.extend(controller.derivative.map(|gain| format!("K_d = {} s", number(gain))));
    let higher = controller.higher_derivatives.iter().zip(2..);
    gains.extend(higher.map(|(gain, k)| format!("K_{k} = {} s^{k}", number(*gain))));
    gains.extend(controller.set_point.map(|gain| format!("N_r = {}", number(gain))));
    let name = match (controller.derivative, controller.higher_derivatives.len()) {
        (None, _) => "PI".to_owned(),
        (_, 0) => "PID".to_owned(),
        (_, higher) => format!("controller of order {}", higher + 2),
    };
    println!(
        "{name} from {measurement} to {command}: {}, filter at {} rad/s",
        gains.join(", "),
        number(controller.corner)
    );
    let integral_time = proportional / integral;
    let derivative_time = controller.derivative.map_or(0.0, |gain| gain / proportional);
    if integral_time > 0.0 && derivative_time >= 0.0 && integral_time.is_finite() {
        let derivative = controller.derivative.map(|_| number(derivative_time));
        let derivative = derivative.map_or(String::new(), |time| format!(", T_d = {time} s"));
        println!("    T_i = {} s{derivative}", number(integral_time));
    }
}

/// Prints the entries or parameters that vary within their tolerances, and whether the loop stays stable.
fn print_tolerance(tolerance: &ToleranceResult) {
    if !tolerance.is_examined() {
        println!("parameter tolerances: not examined, no entry of the plant varies");
        return;
    }
    let (count, kind) = match tolerance.parameters.len() {
        0 => (tolerance.entries as usize, "entries"),
        count => (count, "parameters"),
    };
    println!("parameter tolerances: {count} {kind} vary, {}", tolerance.range());
    let worst = match tolerance.first_unstable {
        limit if limit.is_infinite() => "no unstable case found".to_owned(),
        limit => format!("an unstable case from {} of the tolerances on", number(limit)),
    };
    println!("    {}, {worst}", stable_cases(tolerance));
}

/// Prints the fraction of the tolerances for which stability is proven, or why nothing is proven; prints nothing
/// without tolerances.
fn print_proof(tested: &ToleranceResult, proof: &Result<ToleranceProof, String>) {
    match proof {
        _ if !tested.is_examined() => {}
        Ok(proof) => println!(
            "    proven: stable for every plant within {} of the tolerances",
            number(proof.fraction)
        ),
        Err(reason) => println!("    stability of all cases: {reason}"),
    }
}

/// Formats the percentage of random cases that are stable.
fn stable_cases(tolerance: &ToleranceResult) -> String {
    tolerance.stable.map_or("no random cases".to_owned(), |part| {
        format!("{} % of {} random cases are stable", number(100.0 * part), tolerance.cases)
    })
}

/// Prints the controller for the loss of each actuator, and of several actuators, or why there is no controller.
fn print_reconfigurations(reconfiguration: &ReconfigurationReport) {
    let single = reconfiguration.without.iter().map(|loss| (loss.actuator.clone(), &loss.outcome));
    let several =
        reconfiguration.several.iter().map(|loss| (loss.actuators.join(", "), &loss.outcome));
    for (names, outcome) in single.chain(several) {
        match outcome {
            Ok(outcome) => println!("without {names}: {}", outcome.method),
            Err(reason) => println!("without {names}: no controller: {reason}"),
        }
    }
    for loss in &reconfiguration.by_fallback {
        let names = loss.actuators.join(", ");
        if loss.stable {
            println!("without {names}: the fall-back, decay {} 1/s", number(loss.decay));
        } else {
            println!("without {names}: the fall-back, which is not stable then");
        }
    }
}

/// Prints the decay and the largest noise on the commands with the fall-back, for each case.
fn print_fallback(fallback: &FallbackReport) {
    let compensates = if fallback.compensates { "compensated" } else { "not compensated" };
    println!("fall-back: {} Estimated faults are {compensates}.", fallback.method);
    for case in &fallback.cases {
        let price = case.worst_price().map_or(String::new(), |price| {
            format!(
                ", noise on the commands to {} {} times as large",
                price.name,
                number(price.value)
            )
        });
        println!("    {}: decay {} 1/s{price}", case.name, number(case.decay));
    }
    println!("    intact controller: decay {} 1/s", number(fallback.intact_decay));
    if let Err(reason) = &fallback.whole {
        println!("    losses that change with time: not proven ({reason})");
    }
}

/// Prints the peaks of S and the stable cases within the tolerances of each plant.
fn print_members(kind: &str, members: &[&MemberReport]) {
    for member in members {
        let Some(margins) = &member.margins else {
            println!("{kind} {}: not stable", member.name);
            continue;
        };
        let tolerance = margins.tolerance.as_ref().map_or(String::new(), |tolerance| {
            let cases = stable_cases(tolerance);
            format!("; {} entries vary: {cases}", tolerance.entries)
        });
        println!("{kind} {}: peak of S {}{tolerance}", member.name, peaks(&margins.points));
    }
}

fn peaks(points: &[LoopPoint]) -> String {
    let peak = |point: &LoopPoint| format!("{} at the {}", number(point.judged), point.point);
    points.iter().map(peak).collect::<Vec<_>>().join(", ")
}

fn print_schedule(schedule: &ScheduleReport) {
    print_members("point", &schedule.points.iter().map(|point| &point.closed).collect::<Vec<_>>());
    match (&schedule.any_rate, &schedule.bounded_rate) {
        (Ok(proof), _) => println!(
            "schedule: proven between the points for any rate of {}, margin {:.1e}",
            schedule.variable, proof.margin
        ),
        (_, Ok(proof)) => println!(
            "schedule: proven between the points while {} changes by at most {} per s, margin {:.1e}",
            schedule.variable,
            number(proof.rate),
            proof.margin
        ),
        (Err(any), Err(bounded)) => println!(
            "schedule: not proven while {} changes (any rate: {any}; bounded rate: {bounded})",
            schedule.variable
        ),
    }
    println!(
        "schedule: the worst of {} constant values is {} = {}, stability figure {}",
        schedule.checked,
        schedule.variable,
        number(schedule.worst_at),
        number(schedule.worst_instability)
    );
}

/// Prints delay and least detectable size of each fault, and for each test its threshold and the faults to which it
/// reacts.
fn print_detection(detection: &Detection) {
    println!(
        "detection ({}) every {} s: a false alarm every {} s on average",
        detection.method,
        number(detection.sample_time),
        number(detection.false_alarm_interval)
    );
    for fault in &detection.faults {
        let delay = |time: Option<f64>| time.map_or_else(|| "never for sure".to_owned(), seconds);
        let least = fault.least.map_or_else(|| "none".to_owned(), number);
        println!(
            "    {} of {}: mean delay {}, 90 % within {}; least detectable within {} s: {least}",
            fault.fault,
            number(fault.size),
            delay(fault.delay),
            delay(fault.delay_90),
            number(fault.within),
        );
    }
    for (test, reacts) in detection.tests.iter().zip(&detection.reacts) {
        let faults = detection.faults.iter().zip(reacts).filter(|(_, reacts)| **reacts);
        let names: Vec<_> = faults.map(|(fault, _)| fault.fault.as_str()).collect();
        println!(
            "    test {}: threshold {}, reacts to {}",
            test.name,
            number(test.threshold),
            names.join(", ")
        );
    }
}

/// Prints the stability that is proven for losses of effectiveness in one loop.
fn print_losses(loss: &LossLoop) {
    let described = |losses: &[Number]| {
        let one = |loss: &Number| format!("{} {}", loss.name, number(loss.value));
        losses.iter().map(one).collect::<Vec<_>>().join(", ")
    };
    let proven = match &loss.proof {
        Ok(_) => "the stated losses are proven".to_owned(),
        Err(reason) => format!("the stated losses are not proven: {reason}"),
    };
    println!("losses of effectiveness, {}: {proven}", loss.name);
    if let Some(certified) = loss.certified.first() {
        println!("    proven, also if they vary, up to {}", described(&certified.losses));
    }
    let limit = &loss.constant[0];
    let stable = if limit.stable { "stable up to" } else { "unstable beyond" };
    println!("    constant losses: {stable} {}", described(&limit.losses));
}

/// Prints a table with a row for each law and fault, and the reason for each law that does not exist.
pub(crate) fn compare(comparison: &Comparison) {
    let heads = [
        "law",
        "fault",
        "constant",
        "settling/s",
        "ramp/s",
        "sine",
        "noise",
        "noise peak",
        "disk u",
        "disk y",
        "verdict",
    ];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for law in &comparison.laws {
        let Some(result) = &law.result else { continue };
        let disk =
            |at: usize| result.disk_margin.map_or("-".to_owned(), |margins| number(margins[at]));
        for one in &result.estimation.errors {
            let stated = |value: Option<f64>| value.map_or("-".to_owned(), number);
            rows.push(vec![
                law.law.clone(),
                one.fault.clone(),
                number(one.constant),
                if one.step_settling.is_finite() {
                    number(one.step_settling)
                } else {
                    "never".to_owned()
                },
                one.ramp.map_or("grows".to_owned(), number),
                number(one.sine),
                stated(one.noise),
                stated(one.noise_peak),
                disk(0),
                disk(1),
                result.verdict.level.word().to_owned(),
            ]);
        }
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
    let widths: Vec<_> = (0..heads.len()).map(|column| width(column).unwrap_or(0)).collect();
    for row in &rows {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}"));
        println!("{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    for law in &comparison.laws {
        if let Some(reason) = &law.reason {
            println!("{} does not exist: {reason}", law.law);
        }
    }
}

/// Prints a gain; of a gain with more than [`LARGEST_SHOWN`] rows or columns only the size and the largest entry.
fn print_gain(matrix: &Matrix) {
    let Matrix { name, meaning, values, .. } = matrix;
    let (rows, columns) = (values.len(), values.first().map_or(0, Vec::len));
    let largest = values.iter().flatten().fold(0.0, |largest: f64, entry| largest.max(entry.abs()));
    if rows > LARGEST_SHOWN || columns > LARGEST_SHOWN {
        let largest = number(largest);
        println!("{name} ({meaning}): {rows} x {columns}, entries up to {largest} in size");
        return;
    }
    println!("{name} ({meaning}):");
    for row in values {
        let entries = row.iter().map(|entry| {
            let rounding = entry.abs() < ROUNDING * largest;
            format!("{:>12}", number(if rounding { 0.0 } else { *entry }))
        });
        println!("  {}", entries.collect::<Vec<_>>().join(" "));
    }
}

fn print_reference(step: &ReferenceStep) {
    let unit = step.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    let rise = step.rise_time.map_or("none".to_owned(), |time| format!("{} s", number(time)));
    println!(
        "step of {} by {}{unit}: rise time {rise}, overshoot {} %, {}, steady-state error {} %",
        step.reference,
        number(step.size),
        number(100.0 * step.overshoot),
        settled(step.settling_time, number),
        number(if step.steady_state_error.abs() < ROUNDING {
            0.0
        } else {
            100.0 * step.steady_state_error
        }),
    );
    let command = |peak: &CommandPeak| {
        let [low, high] = peak.range.map(number);
        let unit = peak.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
        format!("{} from {low} to {high}{unit}", peak.name)
    };
    let commands: Vec<_> = step.commands.iter().take(LARGEST_SHOWN).map(command).collect();
    println!("    commands, as deviations: {}", commands.join(", "));
    if step.largest_step.iter().any(|limit| limit.is_finite()) {
        let [low, high] = step.largest_step.map(number);
        println!("    within the limits: steps from {low} to {high}{unit}");
    }
}

fn print_loop(feedback_loop: &Loop) {
    println!("{}: {}", feedback_loop.matrix, feedback_loop.method);
    let shown: Vec<_> = feedback_loop.eigenvalues.iter().filter(|[_, im]| *im >= 0.0).collect();
    let text = shown.iter().take(LARGEST_SHOWN).map(|[re, im]| {
        if *im == 0.0 { number(*re) } else { format!("{} ± {}i", number(*re), number(*im)) }
    });
    let rest = shown.len().saturating_sub(LARGEST_SHOWN);
    let rest = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    println!("    eigenvalues {}{rest}", text.collect::<Vec<_>>().join(", "));
    if let Some(condition) = feedback_loop.condition {
        let error = feedback_loop.pole_error.map_or(String::new(), |error| {
            format!(", error of the eigenvalues {error:.1e}, relative")
        });
        println!("    condition of the eigenvectors {condition:.3e}{error}");
    }
}

/// Formats a time; an infinite one has no unit.
fn seconds(time: f64) -> String {
    if time.is_finite() { format!("{} s", number(time)) } else { number(time) }
}

/// Formats a number with about five digits.
fn number(value: f64) -> String {
    if value.is_infinite() {
        return if value > 0.0 { NO_LIMIT } else { "-infinite" }.to_owned();
    }
    let size = value.abs();
    if size == 0.0 || (1e-3..1e5).contains(&size) {
        let decimals = if size >= 1e3 {
            1
        } else if size >= 10.0 {
            3
        } else {
            5
        };
        let text = format!("{value:.decimals$}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.4e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_without_end_has_no_unit() {
        let expected = ["settled after 0.25 s", "not settled at the end of the response"];
        assert_eq!([0.25, f64::INFINITY].map(|time| settled(time, number)), expected);
        assert_eq!([0.25, f64::INFINITY].map(seconds), ["0.25 s", "no limit"]);
    }
}
