//! The section on references: responses to their steps.

use maud::{Markup, html};

use super::chart::{legend, line_sample};
use super::curves;
use super::number::number;
use super::plots::Plots;
use super::table::{Cell, table};
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
    let heads = [
        "rise time (s)",
        "overshoot, relative",
        "settled after (s)",
        "steady-state error, relative",
        "largest negative step",
        "largest step",
    ];
    let limit = |value: f64| if value.is_finite() { value.into() } else { Cell::from("no limit") };
    let row = vec![
        step.rise_time.into(),
        step.overshoot.into(),
        step.settling_time.into(),
        step.steady_state_error.into(),
        limit(step.largest_step[0]),
        limit(step.largest_step[1]),
    ];
    let command = |peak: &CommandPeak| {
        let [low, high] = peak.limits.map_or([None; 2], |limits| limits.map(Some));
        vec![
            peak.name.as_str().into(),
            (&peak.unit).into(),
            peak.range[0].into(),
            peak.range[1].into(),
            peak.final_value.into(),
            low.into(),
            high.into(),
        ]
    };
    let commands: Vec<_> = step.commands.iter().map(command).collect();
    let others = step
        .others
        .iter()
        .map(|other| vec![other.name.as_str().into(), (&other.unit).into(), other.value.into()]);
    let others: Vec<Vec<Cell>> = others.collect();
    let command_heads =
        ["command", "unit", "smallest", "largest", "finally", "lower limit", "upper limit"];
    let sized = |at: usize| (at == 0).then_some(step.size);
    let entries = [
        (line_sample("mark"), "settled, within 2 %".to_owned()),
        (line_sample("size"), "reference".to_owned()),
    ];
    html! {
        h3 id=(id) {
            "A step of " (step.reference) " by " (number(step.size)) " " (unit)
        }
        (table(&caption, &heads, &[row]))
        div.figures.small {
            @for (index, curve) in step.curves.iter().enumerate() {
                @let after = format!("a step of {}", step.reference);
                (curves::curve(format!("{id}-{}", index + 1), curve, &after, sized(index), plots))
            }
        }
        (legend(&entries))
        (curves::peaks(&format!("Peaks and settling after a step of {}", step.reference), &step.curves))
        (table(&format!("Commands after a step of {}", step.reference), &command_heads, &commands))
        @if !others.is_empty() {
            (table(
                &format!("Largest movement of other outputs after a step of {}", step.reference),
                &["output", "unit", "largest magnitude"],
                &others,
            ))
        }
    }
}
