//! The section on references: responses to their steps.

use maud::{Markup, html};

use super::chart::{legend, line_sample};
use super::curves;
use super::number::number;
use super::plots::Plots;
use super::table::{Cell, Columns, table_of};
use design_report::robustness::Number;
use design_report::{CommandPeak, ReferenceStep, Report};

/// Shows the response to a step of each reference.
pub(super) fn references<'a>(report: &'a Report, plots: &mut Plots<'a>) -> Markup {
    html! {
        p {
            "The reference changes at time 0 by the size stated and then stays; the loop was at rest, \
             without a fault. All signals are deviations from the operating point. The limits of the \
             commands are ignored here: beyond the largest step within the limits the response is slower."
        }
        @for (index, step) in report.references.iter().enumerate() {
            (self::step(&format!("reference-{}", index + 1), step, plots))
        }
    }
}

fn step<'a>(id: &str, step: &'a ReferenceStep, plots: &mut Plots<'a>) -> Markup {
    let unit = step.unit.as_deref().unwrap_or_default();
    let caption = format!("Response to a step of {}", step.reference);
    let columns: Columns<'_, ReferenceStep, 6> = [
        ("rise time (s)", |step| step.rise_time.into()),
        ("overshoot, relative", |step| step.overshoot.into()),
        ("settled after (s)", |step| step.settling_time.into()),
        ("steady-state error, relative", |step| step.steady_state_error.into()),
        ("largest negative step", |step| limit(step.largest_step[0])),
        ("largest step", |step| limit(step.largest_step[1])),
    ];
    let of_commands: Columns<'_, CommandPeak, 7> = [
        ("command", |peak| (&peak.name).into()),
        ("unit", |peak| (&peak.unit).into()),
        ("smallest", |peak| peak.range[0].into()),
        ("largest", |peak| peak.range[1].into()),
        ("finally", |peak| peak.final_value.into()),
        ("lower limit", |peak| peak.limits.map(|limits| limits[0]).into()),
        ("upper limit", |peak| peak.limits.map(|limits| limits[1]).into()),
    ];
    let of_others: Columns<'_, Number, 3> = [
        ("output", |other| (&other.name).into()),
        ("unit", |other| (&other.unit).into()),
        ("largest magnitude", |other| other.value.into()),
    ];
    let sized = |at: usize| (at == 0).then_some(step.size);
    let entries = [
        (line_sample("mark"), "settled, within 2 %".to_owned()),
        (line_sample("size"), "reference".to_owned()),
    ];
    html! {
        h3 id=(id) {
            "A step of " (step.reference) " by " (number(step.size)) " " (unit)
        }
        (table_of(&caption, [step], &columns))
        div.figures.small {
            @for (index, curve) in step.curves.iter().enumerate() {
                @let after = format!("a step of {}", step.reference);
                (curves::curve(format!("{id}-{}", index + 1), curve, &after, sized(index), plots))
            }
        }
        (legend(&entries))
        (curves::peaks(&format!("Peaks and settling after a step of {}", step.reference), &step.curves))
        (table_of(&format!("Commands after a step of {}", step.reference), &step.commands, &of_commands))
        (table_of(
            &format!("Largest movement of other outputs after a step of {}", step.reference),
            &step.others,
            &of_others,
        ))
    }
}

fn limit(value: f64) -> Cell {
    if value.is_finite() { value.into() } else { "no limit".into() }
}
