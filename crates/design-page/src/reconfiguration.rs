//! The section on actuators that are gone.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, table};
use design_report::Report;
use design_report::reconfiguration::{Reconfigured, ServedByFallback};
use design_report::robustness::Number;

pub(super) fn reconfiguration(report: &Report) -> Markup {
    let Some(found) = &report.reconfiguration else {
        return html! {};
    };
    html! {
        p {
            "An actuator that is gone is stuck at a constant command. The controller FMU then uses that \
             command in its observer and the gains below for the other actuators. The input actuator_gone \
             says that an actuator is gone"
            @if let Some([loss, time]) = found.by_estimate {
                "; an estimated loss of effectiveness above " (number(loss)) " for " (number(time))
                " s does the same"
            }
            ". The observer stays the same, so that its eigenvalues and those of the feedback are those of \
             the loop."
        }
        @for own in &found.without { (without(&own.actuator, &own.outcome)) }
        @for own in &found.several { (without(&own.actuators.join(", "), &own.outcome)) }
        (by_fallback(&found.by_fallback))
    }
}

/// A table of the sets of actuators that have no gains of their own: when they are gone, the controller falls back.
fn by_fallback(found: &[ServedByFallback]) -> Markup {
    let row = |own: &ServedByFallback| {
        let stable = Cell::Holds(own.stable);
        vec![own.actuators.join(", ").as_str().into(), own.decay.into(), stable]
    };
    let rows: Vec<Vec<Cell>> = found.iter().map(row).collect();
    html! {
        @if !rows.is_empty() {
            h3 { "Without gains of their own" }
            p {
                "While these actuators are gone the fall-back is in force; the observer knows their stuck \
                 commands."
            }
            (table(
                "Actuators that are gone in the fall-back",
                &["without", "decay of the loop, 1/s", "stable"],
                &rows,
            ))
        }
    }
}

fn without(name: &str, outcome: &Result<Reconfigured, String>) -> Markup {
    html! {
        h3 { "Without " (name) }
        @match outcome {
            Err(reason) => p { strong { "There is no controller: " } (reason) "." },
            Ok(found) => (controller(name, found)),
        }
    }
}

fn controller(name: &str, found: &Reconfigured) -> Markup {
    let numbers = |all: &[Number]| -> Vec<Vec<Cell>> {
        let row =
            |own: &Number| vec![own.name.as_str().into(), own.value.into(), (&own.unit).into()];
        all.iter().map(row).collect()
    };
    let eigenvalues: Vec<Vec<Cell>> = found
        .eigenvalues
        .iter()
        .enumerate()
        .map(|(at, value)| vec![(at + 1).to_string().as_str().into(), Some(*value).into()])
        .collect();
    html! {
        p { (found.method) }
        p {
            "Norm of K" sub { "x" } " " (number(found.gain_norm)) ", with all actuators "
            (number(found.intact_gain_norm)) ". Part of the effect that the others cannot produce: "
            (number(found.residual)) ". "
            @if found.kept {
                "The measurements that must be kept rest at the operating point."
            } @else {
                "The measurements that must be kept do not rest at the operating point, but as near as \
                 the other actuators allow."
            }
            @if !found.beyond_limits.is_empty() {
                " " strong { "Beyond their limits: " } (found.beyond_limits.join(", ")) "."
            }
        }
        (table(&format!("Eigenvalues without {name}"), &["number", "eigenvalue of A + B K_x"], &eigenvalues))
        (table(
            &format!("Commands at rest without {name}"),
            &["actuator", "command", "unit"],
            &numbers(&found.commands),
        ))
        (table(
            &format!("Measurements at rest without {name}"),
            &["measurement", "deviation from the operating point", "unit"],
            &numbers(&found.measurements),
        ))
    }
}
