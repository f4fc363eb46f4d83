//! Changes that may improve a design that is not green.

use maud::{Markup, html};

use super::number::number;
use design_report::Report;
use design_report::robustness::{LoopPoint, Robustness};

/// Peak of S of a linear-quadratic design, relative to that of the design, below which the page recommends it.
const BETTER: f64 = 0.9;

/// Returns the changes to try: a sentence if a check does not hold, then the computed remedies, each change once;
/// without remedies general advice on peaks of S and on tolerances.
pub(super) fn advice(report: &Report) -> Vec<Markup> {
    let mut advice = Vec::new();
    if report.checks.iter().any(|check| !check.holds) {
        advice.push(html! {
            "A condition that does not hold needs another plant file, such as one more measurement or fewer \
             faults; its explanation is under " (link("checks", "Checks")) "."
        });
    }
    let remedies = &report.verdict.remedies;
    for (index, remedy) in remedies.iter().enumerate() {
        // One change may remove several reasons.
        if remedies[..index].iter().any(|earlier| earlier.change == remedy.change) {
            continue;
        }
        advice.push(html! {
            (remedy.change)
            @for line in &remedy.lines { div { code { (line) } } }
        });
    }
    // Remedies are computed for this design, and replace the general advice.
    if let Some(robustness) = &report.robustness
        && remedies.is_empty()
    {
        advice.extend(lower_peaks(robustness, report.verdict.limits.amber));
        let tolerance = &robustness.tolerance;
        if tolerance.is_unstable() {
            advice.push(html! {
                "The worst plant found is unstable from " (number(tolerance.first_unstable)) " of the tolerances on. Lower the peak of \
                 S, or measure the parameters more exactly and state smaller tolerances in " code { "[robustness]" } "."
            });
        }
    }
    advice
}

/// Describes how to lower the peaks of S above `limit`; `None` without such peaks.
fn lower_peaks(robustness: &Robustness, limit: f64) -> Option<Markup> {
    let high: Vec<_> = robustness.points.iter().filter(|point| point.judged > limit).collect();
    // The linear-quadratic peak is in the units of the plant file; so is `judged`, unless it is lower than `s_peak`.
    let linear_quadratic = |point: &LoopPoint| {
        let name = format!("peak of S at the {}", point.point);
        let compared = robustness.comparison.iter().find(|compared| compared.name == name)?;
        let peak = compared.linear_quadratic.filter(|_| point.judged >= point.s_peak)?;
        (peak < BETTER * point.judged).then_some(peak)
    };
    (!high.is_empty()).then(|| {
        html! {
            "Lower the peak of S to " (number(limit)) ": "
            @for (index, point) in high.iter().enumerate() {
                @if index > 0 { ", " }
                "at the " (point.point) " it is " (number(point.judged))
                @if let Some(peak) = linear_quadratic(point) { " (" (number(peak)) " for the linear-quadratic design of the same speed)" }
            }
            @if high.iter().any(|point| linear_quadratic(point).is_some()) {
                ". State " code { "feedback.Q" } ", " code { "feedback.R" } " and " code { "observer.W" } ", " code { "observer.V" }
                " in place of eigenvalues"
            } @else {
                ". Try a slower observer, then a slower feedback, or " code { "h_infinity = \"least\"" }
            }
            " (" (link("robustness", "Robustness")) ")."
        }
    })
}

/// A link to a section.
fn link(id: &str, title: &str) -> Markup {
    html! { a href={ "#" (id) } { (title) } }
}
