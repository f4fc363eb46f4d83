//! The section on actuators that are gone.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, table};
use design_report::Report;
use design_report::reconfiguration::{Reconfigured, ServedByFallback};
use design_report::robustness::Number;

pub(super) fn reconfiguration(report: &Report) -> Markup {
    let Some(section) = &report.reconfiguration else {
        return html! {};
    };
    html! {
        p {
            "An actuator that is gone is stuck at a constant command. The controller FMU then uses that \
             command in its observer and the gains below for the other actuators. The input actuator_gone \
             says that an actuator is gone"
            @if let Some([loss, time]) = section.by_estimate {
                "; an estimated loss of effectiveness above " (number(loss)) " for " (number(time))
                " s does the same"
            }
            ". The observer stays the same, so that its eigenvalues and those of the feedback are those of \
             the loop."
        }
        @for case in &section.without { (without(&case.actuator, &case.outcome)) }
        @for case in &section.several { (without(&case.actuators.join(", "), &case.outcome)) }
        (by_fallback(&section.by_fallback))
    }
}

/// A table of the sets of actuators that have no gains of their own: when they are gone, the controller falls back.
fn by_fallback(cases: &[ServedByFallback]) -> Markup {
    let row = |case: &ServedByFallback| {
        let stable = Cell::Holds(case.stable);
        vec![case.actuators.join(", ").as_str().into(), case.decay.into(), stable]
    };
    let rows: Vec<Vec<Cell>> = cases.iter().map(row).collect();
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
            Ok(case) => (controller(name, case)),
        }
    }
}

fn controller(name: &str, case: &Reconfigured) -> Markup {
    let numbers = |all: &[Number]| -> Vec<Vec<Cell>> {
        let row = |signal: &Number| {
            vec![signal.name.as_str().into(), signal.value.into(), (&signal.unit).into()]
        };
        all.iter().map(row).collect()
    };
    let eigenvalues: Vec<Vec<Cell>> = case
        .eigenvalues
        .iter()
        .enumerate()
        .map(|(at, value)| vec![(at + 1).to_string().as_str().into(), Some(*value).into()])
        .collect();
    html! {
        p { (case.method) }
        p {
            "Norm of K" sub { "x" } " " (number(case.gain_norm)) ", with all actuators "
            (number(case.intact_gain_norm)) ". Part of the effect that the others cannot produce: "
            (number(case.residual)) ". "
            @if case.kept {
                "The measurements that must be kept rest at the operating point."
            } @else {
                "The measurements that must be kept do not rest at the operating point, but as near as \
                 the other actuators allow."
            }
            @if !case.beyond_limits.is_empty() {
                " " strong { "Beyond their limits: " } (case.beyond_limits.join(", ")) "."
            }
        }
        (table(&format!("Eigenvalues without {name}"), &["number", "eigenvalue of A + B K_x"], &eigenvalues))
        (table(
            &format!("Commands at rest without {name}"),
            &["actuator", "command", "unit"],
            &numbers(&case.commands),
        ))
        (table(
            &format!("Measurements at rest without {name}"),
            &["measurement", "deviation from the operating point", "unit"],
            &numbers(&case.measurements),
        ))
    }
}
