//! The section on the law that estimates the faults.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, table};
use design_report::robustness::Number;
use design_report::{Check, Estimation, EstimationErrors, Report};

pub(super) fn estimation(report: &Report) -> Markup {
    let estimation = &report.estimation;
    html! {
        p { "Law " code { (estimation.law) } " (" (estimation.sources) "), with the gains above:" }
        ul { @for line in &estimation.equations { li { code { (line) } } } }
        (parameters(estimation))
        (conditions(estimation))
        (errors(&estimation.errors))
    }
}

pub(super) fn parameters(estimation: &Estimation) -> Markup {
    let row = |one: &Number| vec![one.name.as_str().into(), (&one.unit).into(), one.value.into()];
    let rows: Vec<Vec<Cell>> = estimation.parameters.iter().map(row).collect();
    table("Parameters", &["parameter", "unit", "value"], &rows)
}

pub(super) fn conditions(estimation: &Estimation) -> Markup {
    let row = |one: &Check| {
        vec![
            one.condition.as_str().into(),
            Cell::Holds(one.holds),
            one.value.into(),
            one.explanation.as_str().into(),
        ]
    };
    let rows: Vec<Vec<Cell>> = estimation.conditions.iter().map(row).collect();
    table("Conditions for its existence", &["condition", "holds", "value", "explanation"], &rows)
}

/// Shows the errors of the estimates and their noise.
pub(super) fn errors(errors: &[EstimationErrors]) -> Markup {
    let rows: Vec<Vec<Cell>> = errors
        .iter()
        .map(|one| {
            vec![
                one.fault.as_str().into(),
                one.constant.into(),
                one.step_peak.into(),
                one.step_settling.into(),
                one.ramp.map_or_else(|| "grows".into(), Cell::Number),
                one.sine.into(),
                one.peak_gain.into(),
                one.noise.into(),
                one.noise_peak.into(),
                (&one.unit).into(),
            ]
        })
        .collect();
    let heads = [
        "fault",
        "lasting error of a constant fault",
        "largest error after a step",
        "settling (s)",
        "lasting error of a ramp (s)",
        "error of a sine",
        "peak gain",
        "noise, root mean square",
        "noise, peak",
        "unit of the noise",
    ];
    html! {
        (table("Errors of the estimates, relative to the fault, and their noise", &heads, &rows))
        @if let Some(one) = errors.first() {
            p {
                "The sine has " (number(one.sine_frequency)) " rad/s, a tenth of the mean rate of the \
                 augmented observer of the same requirement. The lasting error of a ramp is per rate of the fault. \
                 The peak gain is the largest error for any fault of at most 1. Root mean square: under the \
                 white noise assumed below; a direct term passes it without limit in continuous time. Peak: \
                 the largest amplitude for sinusoidal errors of the measurements of that size."
            }
        }
    }
}
