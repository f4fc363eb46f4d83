//! The summary: which checks hold, which fail, and the most important numbers.

use maud::{Markup, html};

use super::number::number;
use super::plane::Plane;
use crate::report::robustness::Level;
use crate::report::{Loop, Report};

pub(super) fn verdict(report: &Report) -> Markup {
    let failures = failures(report);
    let count = report.checks.len();
    let limits = &report.verdict.limits;
    let parameters =
        report.robustness.as_ref().is_some_and(|found| !found.tolerance.parameters.is_empty());
    let level = if failures.is_empty() { report.verdict.level } else { Level::Red };
    // The checks are shown above with their explanations.
    let checked = |reason: &&String| !reason.starts_with("does not hold: ");
    let warnings: Vec<_> = report.verdict.reasons.iter().filter(checked).collect();
    html! {
        div.verdict .passed[level == Level::Green] .warned[level == Level::Amber]
            .failed[level == Level::Red] {
            @if failures.is_empty() {
                p.outcome {
                    (sign(level)) " "
                    @match count {
                        0 => "Both loops are stable; nothing else was checked.",
                        1 => "The check holds; both loops are stable.",
                        _ => { "All " (count) " checks hold; both loops are stable." }
                    }
                }
            } @else {
                p.outcome { "✗ This design fails:" }
                ul {
                    @for (what, why) in &failures {
                        li {
                            strong { (what) }
                            @if !why.is_empty() { ": " (why) }
                        }
                    }
                }
            }
            @if !report.warnings.is_empty() {
                p.outcome { "Warnings" }
                ul { @for warning in &report.warnings { li { (warning) } } }
            }
            @if !warnings.is_empty() {
                p.outcome { "Robustness: " (level.word()) }
                ul { @for warning in &warnings { li { (warning) } } }
            }
            p {
                "Verdict: " (report.verdict.level.word()) ". A peak of S above " (number(limits.amber))
                " is amber, above " (number(limits.red)) " red, as are parameters within their \
                 tolerances that make the loop unstable"
                @if !parameters {
                    ": "
                    @for (index, (name, tolerance)) in limits.of_matrices(&report.plant.matrices).enumerate() {
                        @if index > 0 { ", " }
                        (number(tolerance)) " of each entry of " (name)
                    }
                } @else {
                    ": those of the FMU that the section on robustness lists"
                }
                "."
            }
            @if let Err(reason) = &report.certificate.printed {
                p { "Theorem 1 as printed does not apply: " (reason) }
            }
            @if let Err(reason) = &report.certificate.free {
                p { "No certificate with free P: " (reason) }
            }
        }
        (key_numbers(report))
    }
}

fn sign(level: Level) -> &'static str {
    match level {
        Level::Green => "✓",
        Level::Amber => "!",
        Level::Red => "✗",
    }
}

fn failures(report: &Report) -> Vec<(&str, &str)> {
    let plane = Plane::of(report);
    let unstable = |system: &Loop, name| (!system.is_stable(plane)).then_some((name, ""));
    report
        .checks
        .iter()
        .filter(|check| !check.holds)
        .map(|check| (check.condition.as_str(), check.explanation.as_str()))
        .chain(unstable(&report.feedback, "The feedback loop is unstable"))
        .chain(unstable(&report.observer, "The observer is unstable"))
        .collect()
}

fn key_numbers(report: &Report) -> Markup {
    let plane = Plane::of(report);
    let plant = &report.plant;
    html! {
        dl.key {
            (key("Plant", &html! {
                (counted(plant.states.len(), "state")) ", "
                (counted(plant.actuators.len(), "actuator")) ", "
                (counted(plant.measurements.len(), "measurement")) ", "
                (counted(plant.faults.len(), "fault"))
            }))
            (key("Controller", &html! {
                @match &report.sampling {
                    None => "continuous",
                    Some(sampled) => {
                        "sampled every " (number(sampled.sample_time)) " s, "
                        (sampled.estimator) " estimator"
                    }
                }
            }))
            (slowest("Slowest of the feedback loop", &report.feedback, plane))
            (slowest("Slowest of the observer", &report.observer, plane))
            @for (name, condition) in [
                ("Condition of the feedback", report.feedback.condition),
                ("Condition of the observer", report.observer.condition),
            ] {
                @if let Some(condition) = condition {
                    (key(name, &number(condition)))
                }
            }
            @if let Some(robustness) = &report.robustness {
                @for point in &robustness.points {
                    (key(&format!("Peak of S at the {}", point.point), &number(point.judged)))
                }
                (key("Random cases that stay stable", &html! {
                    (number(100.0 * robustness.tolerance.stable)) " %"
                }))
            }
            (settling(report))
            @if let Ok(theorem) = &report.certificate.printed {
                (key("δ of theorem 1", &number(theorem.delta)))
            }
            @if let Ok(free) = &report.certificate.free {
                (key("δ with free P", &number(free.delta)))
            }
            @for entry in &report.effectiveness {
                (key("Stable up to a loss of", &html! {
                    (number(entry.largest_stable_loss)) " of " (entry.actuator)
                }))
            }
        }
    }
}

fn key(name: &str, value: &Markup) -> Markup {
    html! { div { dt { (name) } dd { (value) } } }
}

fn counted(count: usize, name: &str) -> Markup {
    html! { (count) " " (name) @if count != 1 { "s" } }
}

fn slowest(name: &str, system: &Loop, plane: Plane) -> Markup {
    html! {
        @if let Some(rate) = system.slowest(plane) {
            (key(name, &html! { (number(rate)) " 1/s" }))
        }
    }
}

/// Shows the curve with the longest settling time over all faults.
fn settling(report: &Report) -> Markup {
    let curves = report.steps.iter().flat_map(|step| &step.curves);
    let last = curves.max_by(|a, b| a.settling_time.total_cmp(&b.settling_time));
    html! {
        @if let Some(curve) = last {
            (key("Settled after a change of a fault", &html! {
                "within " (number(curve.settling_time)) " s (" (curve.name) ")"
            }))
        }
    }
}
