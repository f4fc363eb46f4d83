//! The sections on the plant, the checks, the gains and the interface.

use maud::{Markup, html};

use super::matrix::{literals, matrices};
use super::table::{Cell, table};
use design_report::{Plant, Report, Signal};

pub(super) fn plant(plant: &Plant) -> Markup {
    let kinds = [
        ("States", &plant.states),
        ("Actuators", &plant.actuators),
        ("Measurements", &plant.measurements),
        ("Faults", &plant.faults),
    ];
    html! {
        @if !plant.origin.is_empty() { p { (plant.origin) } }
        div.side { @for (caption, signals) in kinds { (self::signals(caption, signals)) } }
        (matrices("plant", &plant.matrices))
    }
}

fn signals(caption: &str, signals: &[Signal]) -> Markup {
    let row = |signal: &Signal| -> Vec<Cell> {
        vec![
            signal.name.as_str().into(),
            (&signal.unit).into(),
            signal.description.as_str().into(),
            signal.operating.into(),
            signal.notes.as_str().into(),
        ]
    };
    let heads = ["name", "unit", "description", "operating point", "notes"];
    table(caption, &heads, &signals.iter().map(row).collect::<Vec<_>>())
}

pub(super) fn checks(report: &Report) -> Markup {
    let rows: Vec<Vec<Cell>> = report
        .checks
        .iter()
        .map(|check| {
            vec![
                check.condition.as_str().into(),
                Cell::Holds(check.holds),
                check.value.into(),
                check.explanation.as_str().into(),
            ]
        })
        .collect();
    table(
        "What must hold, and whether it does",
        &["condition", "holds", "number", "explanation"],
        &rows,
    )
}

pub(super) fn gains(report: &Report) -> Markup {
    let all: Vec<_> = report.plant.matrices.iter().chain(&report.gains).collect();
    html! {
        (matrices("gains", &report.gains))
        (literals("all", "Plant and gains together", &all))
    }
}

pub(super) fn assumptions(report: &Report) -> Markup {
    html! { ul { @for assumption in &report.assumptions { li { (assumption) } } } }
}

pub(super) fn effectiveness(report: &Report) -> Markup {
    let rows: Vec<Vec<Cell>> = report
        .effectiveness
        .iter()
        .map(|entry| vec![entry.actuator.as_str().into(), entry.largest_stable_loss.into()])
        .collect();
    html! {
        p {
            "An actuator with loss E gives (1 − E) u. The loop is stable for every loss from 0 up \
             to the one stated."
        }
        (table("Loss of effectiveness", &["actuator", "largest stable loss"], &rows))
    }
}

pub(super) fn interface(report: &Report) -> Markup {
    let rows: Vec<Vec<Cell>> = report
        .interface
        .iter()
        .map(|variable| {
            vec![
                variable.name.as_str().into(),
                variable.causality.as_str().into(),
                variable.variability.as_str().into(),
                (&variable.unit).into(),
                (&variable.start).into(),
                variable.description.as_str().into(),
            ]
        })
        .collect();
    let heads = ["name", "causality", "variability", "unit", "start", "description"];
    table("Variables of the controller FMU", &heads, &rows)
}
