//! The section on actuators that are gone.

use maud::{Markup, html};

use super::number::number;
use super::plane::Plane;
use super::table::{Cell, Columns, table, table_of};
use design_report::reconfiguration::{ReconfigurationReport, Reconfigured, ServedByFallback};
use design_report::robustness::Number;

/// Shows the controllers for actuators that are gone; `plane`: the plane of the eigenvalues.
pub(super) fn reconfiguration(section: &ReconfigurationReport, plane: Plane) -> Markup {
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
        @for case in &section.without { (without(&case.actuator, &case.outcome, plane)) }
        @for case in &section.several {
            (without(&case.actuators.join(", "), &case.outcome, plane))
        }
        (by_fallback(&section.by_fallback))
    }
}

/// A table of the sets of actuators without gains of their own: while they are gone, the fall-back is in force. Nothing
/// without such sets.
fn by_fallback(cases: &[ServedByFallback]) -> Markup {
    let columns: Columns<'_, ServedByFallback, 3> = [
        ("without", |case| (&case.actuators.join(", ")).into()),
        ("decay of the loop, 1/s", |case| case.decay.into()),
        ("stable", |case| Cell::Holds(case.stable)),
    ];
    html! {
        @if !cases.is_empty() {
            h3 { "Without gains of their own" }
            p {
                "While these actuators are gone the fall-back is in force; the observer knows their stuck \
                 commands."
            }
            (table_of("Actuators that are gone in the fall-back", cases, &columns))
        }
    }
}

fn without(name: &str, outcome: &Result<Reconfigured, String>, plane: Plane) -> Markup {
    html! {
        h3 { "Without " (name) }
        @match outcome {
            Err(reason) => p { strong { "There is no controller: " } (reason) "." },
            Ok(case) => (controller(name, case, plane)),
        }
    }
}

fn controller(name: &str, case: &Reconfigured, plane: Plane) -> Markup {
    let head = format!("eigenvalue of A + B K_x{}", plane.unit());
    let numbers = |signal, value| -> Columns<'_, Number, 3> {
        [
            (signal, |signal| (&signal.name).into()),
            (value, |signal| signal.value.into()),
            ("unit", |signal| (&signal.unit).into()),
        ]
    };
    let eigenvalues = case.eigenvalues.iter().enumerate();
    let eigenvalues: Vec<Vec<Cell>> = eigenvalues
        .map(|(at, value)| vec![Cell::Text((at + 1).to_string()), Some(*value).into()])
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
        (table(&format!("Eigenvalues without {name}"), ["number", &head], &eigenvalues))
        (table_of(
            &format!("Commands at rest without {name}"),
            &case.commands,
            &numbers("actuator", "command"),
        ))
        (table_of(
            &format!("Measurements at rest without {name}"),
            &case.measurements,
            &numbers("measurement", "deviation from the operating point"),
        ))
    }
}
