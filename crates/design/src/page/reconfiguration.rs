//! The section on actuators that are gone.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, table};
use crate::reconfiguration_report::{Reconfigured, WithoutActuator};
use crate::report::Report;
use crate::robust_report::Number;

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
        @for own in &found.without { (without(own)) }
    }
}

fn without(own: &WithoutActuator) -> Markup {
    html! {
        h3 { "Without " (own.actuator) }
        @match &own.outcome {
            Err(reason) => p { strong { "There is no controller: " } (reason) "." },
            Ok(found) => (controller(own, found)),
        }
    }
}

fn controller(own: &WithoutActuator, found: &Reconfigured) -> Markup {
    let name = &own.actuator;
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
