//! The summary: which checks hold, which fail, and the most important numbers.

use maud::{Markup, html};

use super::number::number;
use super::plane::Plane;
use crate::report::{Loop, Report};

pub(super) fn verdict(report: &Report) -> Markup {
    let failures = failures(report);
    let count = report.checks.len();
    html! {
        div.verdict .passed[failures.is_empty()] .failed[!failures.is_empty()] {
            @if failures.is_empty() {
                p.outcome {
                    "✓ "
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
