//! The section on the law that estimates the faults.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, Columns, table_of};
use design_report::robustness::Number;
use design_report::{Check, Estimation, EstimationErrors};

pub(super) fn estimation(estimation: &Estimation) -> Markup {
    html! {
        p { "Law " code { (estimation.law) } " (" (estimation.sources) "), with the gains above:" }
        (details(estimation))
    }
}

/// Shows equations, parameters, conditions and errors of a law.
pub(super) fn details(estimation: &Estimation) -> Markup {
    let parameters: Columns<'_, Number, 3> = [
        ("parameter", |one| (&one.name).into()),
        ("unit", |one| (&one.unit).into()),
        ("value", |one| one.value.into()),
    ];
    html! {
        ul { @for line in &estimation.equations { li { code { (line) } } } }
        (table_of("Parameters", &estimation.parameters, &parameters))
        (check_table("Conditions for its existence", "value", &estimation.conditions))
        (errors(&estimation.errors))
    }
}

/// Shows conditions as a table; `value_heading`: the head of the column of their values.
pub(super) fn check_table(caption: &str, value_heading: &str, checks: &[Check]) -> Markup {
    table_of(
        caption,
        checks,
        &[
            ("condition", |one| (&one.condition).into()),
            ("holds", |one| Cell::Holds(one.holds)),
            (value_heading, |one| one.value.into()),
            ("explanation", |one| (&one.explanation).into()),
        ],
    )
}

/// Shows the errors of the estimates and their noise.
fn errors(errors: &[EstimationErrors]) -> Markup {
    let columns: Columns<'_, EstimationErrors, 10> = [
        ("fault", |one| (&one.fault).into()),
        ("lasting error of a constant fault", |one| one.constant.into()),
        ("largest error after a step", |one| one.step_peak.into()),
        ("settling (s)", |one| one.step_settling.into()),
        ("lasting error of a ramp (s)", |one| {
            one.ramp.map_or_else(|| "grows".into(), Cell::Number)
        }),
        ("error of a sine", |one| one.sine.into()),
        ("peak gain", |one| one.peak_gain.into()),
        ("noise, root mean square", |one| one.noise.into()),
        ("noise, peak", |one| one.noise_peak.into()),
        ("unit of the noise", |one| (&one.unit).into()),
    ];
    html! {
        (table_of("Errors of the estimates, relative to the fault, and their noise", errors, &columns))
        @if let Some(one) = errors.first() {
            p {
                "The sine has " (number(one.sine_frequency)) " rad/s, a tenth of the mean rate of the \
                 augmented observer of the same requirement. The lasting error of a ramp is per rate of the fault. \
                 The peak gain is the largest error for any fault of at most 1. The errors of a sampled \
                 design are those at its samples. Root mean square: under the white noise assumed below; \
                 a direct term passes it without limit in continuous time. Peak: \
                 the largest amplitude for sinusoidal errors of the measurements of that size."
            }
        }
    }
}
