//! The sections on the plant, the checks, the gains and the interface.

use maud::{Markup, html};

use super::matrix::{literals, matrices};
use super::table::{Cell, table};
use design_report::{PidController, Plant, Report, Signal};

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
        (pid(&report.pid))
        (matrices("gains", &report.gains))
        (literals("all", "Plant and gains together", &all))
    }
}

/// Shows PI and PID controllers; nothing without them.
fn pid(controllers: &[PidController]) -> Markup {
    if controllers.is_empty() {
        return Markup::default();
    }
    let row = |one: &PidController| {
        vec![
            one.command.as_str().into(),
            one.measurement.as_str().into(),
            Some(one.proportional).into(),
            Some(one.integral).into(),
            one.derivative.into(),
            one.set_point.into(),
            Some(one.corner).into(),
        ]
    };
    let rows: Vec<Vec<Cell>> = controllers.iter().map(row).collect();
    let heads = ["command", "measurement", "K", "K_i (1/s)", "K_d (s)", "N_r", "ω (rad/s)"];
    html! {
        p {
            "u = N_r r − K y_f + K_i ∫ (r − y) dt − K_d y_f′ + K_f f_hat, in deviations from the operating point. \
             y_f is y behind the filter 1 / (1 + s/ω) of a PI controller, 1 / (1 + √2 s/ω + s²/ω²) of a PID controller. \
             K has the unit of the command per unit of the measurement."
        }
        (table("PI and PID controllers", &heads, &rows))
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
