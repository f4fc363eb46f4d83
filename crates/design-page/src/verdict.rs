//! The first screen: the verdict, its reasons, changes to try, and the most important numbers.

use maud::{Markup, html};

use super::advice::advice;
use super::number::{number, seconds};
use super::plane::Plane;
use design_report::robustness::Level;
use design_report::{Loop, Report};

pub(super) fn verdict(report: &Report) -> Markup {
    let failures = failures(report);
    let count = report.checks.len();
    let level = if failures.is_empty() { report.verdict.level } else { Level::Red };
    // `failures` has the checks that do not hold, with their explanations.
    let is_other = |reason: &&String| !reason.starts_with("does not hold: ");
    let reasons: Vec<_> = report.verdict.reasons.iter().filter(is_other).collect();
    let advice = if level == Level::Green { Vec::new() } else { advice(report) };
    html! {
        div.verdict .passed[level == Level::Green] .warned[level == Level::Amber]
            .failed[level == Level::Red] {
            p.outcome {
                (sign(level)) " Verdict: " (level.word())
                @if failures.is_empty() && reasons.is_empty() { "; " (holding(count)) }
            }
            @if !failures.is_empty() || !reasons.is_empty() {
                ul {
                    @for (what, why) in &failures {
                        li {
                            strong { (what) }
                            @if !why.is_empty() { ": " (why) }
                        }
                    }
                    @for reason in &reasons { li { (reason) } }
                }
                @if failures.is_empty() { p { (capitalised(&holding(count))) } }
            }
            @if !advice.is_empty() {
                p.outcome { "What to change" }
                ul { @for entry in &advice { li { (entry) } } }
            }
            @if !report.warnings.is_empty() {
                p.outcome { "Warnings" }
                ul { @for warning in &report.warnings { li { (warning) } } }
            }
        }
        dl.key.first { (figures(report)) }
        details {
            summary { "More figures, and the limits of the verdict" }
            (limits(report))
            (key_numbers(report))
        }
    }
}

/// The limits of the verdict, the tolerances, and the certificates that do not exist.
fn limits(report: &Report) -> Markup {
    let limits = &report.verdict.limits;
    html! {
        p {
            "A peak of S above " (number(limits.amber))
            " is amber, above " (number(limits.red)) " red, as are parameters within their \
             tolerances that make the loop unstable"
            @if let Some(robustness) = &report.robustness {
                @if robustness.tolerance.is_examined() { ": " (robustness.tolerance.range()) }
                @else { ", which were not examined, because nothing varies" }
            }
            ". The tolerances of the entries of A, B, C and D are "
            @for (index, tolerance) in limits.tolerance.iter().enumerate() {
                @if index > 0 { ", " }
                (number(*tolerance))
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
}

/// The three most important figures: of the robustness, or, if it is missing, slowest eigenvalues and settling time.
fn figures(report: &Report) -> Markup {
    let plane = Plane::of(report);
    let Some(robustness) = &report.robustness else {
        return html! {
            (slowest("Slowest of the feedback loop", &report.feedback, plane))
            (slowest("Slowest of the observer", &report.observer, plane))
            (settling(report))
        };
    };
    let (tolerance, limits) = (&robustness.tolerance, &report.verdict.limits);
    html! {
        (key("Peak of S", &html! {
            @for (index, point) in robustness.points.iter().enumerate() {
                @if index > 0 { ", " }
                (number(point.judged)) " at the " (point.point)
            }
            " (amber above " (number(limits.amber)) ", red above " (number(limits.red)) ")"
        }))
        (key("Delay margin", &seconds(robustness.delay_margin)))
        (key("Parameters within their tolerances", &html! {
            @if let Some(part) = tolerance.stable {
                (number(100.0 * part)) " % of " (tolerance.cases) " random cases stable, "
            }
            @if !tolerance.is_examined() {
                "not examined: nothing varies"
            } @else if tolerance.first_unstable.is_infinite() {
                "no unstable case found"
            } @else {
                "unstable from " (number(tolerance.first_unstable)) " of the tolerances on"
            }
            @if let Ok(proof) = &robustness.tolerance_proof {
                ", proven to be stable within " (number(proof.fraction)) " of them"
            }
        }))
    }
}

/// Says that all checks hold, and both loops are stable.
fn holding(checks: usize) -> String {
    match checks {
        0 => "both loops are stable; nothing else was checked.".to_owned(),
        1 => "the check holds; both loops are stable.".to_owned(),
        _ => format!("all {checks} checks hold; both loops are stable."),
    }
}

fn capitalised(sentence: &str) -> String {
    let mut signs = sentence.chars();
    signs.next().map_or_else(String::new, |first| first.to_uppercase().chain(signs).collect())
}

fn sign(level: Level) -> &'static str {
    match level {
        Level::Green => "✓",
        Level::Amber => "!",
        Level::Red => "✗",
    }
}

/// The checks that do not hold, with their explanations, and the loops that are not stable.
fn failures(report: &Report) -> Vec<(&str, &str)> {
    let plane = Plane::of(report);
    let unstable = |system: &Loop, name| {
        let is_stable = system.eigenvalues.iter().all(|pole| plane.is_stable(*pole));
        (!is_stable).then_some((name, ""))
    };
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
                (plural(plant.states.len(), "state")) ", "
                (plural(plant.actuators.len(), "actuator")) ", "
                (plural(plant.measurements.len(), "measurement")) ", "
                (plural(plant.faults.len(), "fault"))
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

fn plural(count: usize, name: &str) -> Markup {
    html! { (count) " " (name) @if count != 1 { "s" } }
}

fn slowest(name: &str, system: &Loop, plane: Plane) -> Markup {
    html! {
        @if let Some(rate) = plane.slowest(system) {
            (key(name, &html! { (number(rate)) " 1/s" }))
        }
    }
}

/// Shows the longest settling time of all curves after changes of faults; nothing without curves that settle.
fn settling(report: &Report) -> Markup {
    let curves = report.steps.iter().flat_map(|step| &step.curves);
    // A signal that only rounding moves never settles.
    let settled = curves.filter(|curve| curve.settling_time.is_finite());
    let last = settled.max_by(|a, b| a.settling_time.total_cmp(&b.settling_time));
    html! {
        @if let Some(curve) = last {
            (key("Settled after a change of a fault", &html! {
                "within " (number(curve.settling_time)) " s (" (curve.name) ")"
            }))
        }
    }
}
