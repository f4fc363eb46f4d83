//! The sections on the plant, the checks, the gains and the interface.

use maud::{Markup, html};

use super::estimation::check_table;
use super::matrix::{literals, matrices};
use super::table::{Columns, table_of};
use design_report::{Effectiveness, PidController, Plant, Report, Signal};

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
    table_of(
        caption,
        signals,
        &[
            ("name", |signal| (&signal.name).into()),
            ("unit", |signal| (&signal.unit).into()),
            ("description", |signal| (&signal.description).into()),
            ("operating point", |signal| signal.operating.into()),
            ("notes", |signal| (&signal.notes).into()),
        ],
    )
}

pub(super) fn checks(report: &Report) -> Markup {
    check_table("What must hold, and whether it does", "number", &report.checks)
}

pub(super) fn gains(report: &Report) -> Markup {
    let all: Vec<_> = report.plant.matrices.iter().chain(&report.gains).collect();
    html! {
        (pid(&report.pid))
        (matrices("gains", &report.gains))
        (literals("all", "Plant and gains together", &all))
    }
}

/// Shows controllers of low order; nothing without them.
fn pid(controllers: &[PidController]) -> Markup {
    if controllers.is_empty() {
        return Markup::default();
    }
    let columns: Columns<'_, PidController, 11> = [
        ("command", |one| (&one.command).into()),
        ("measurement", |one| (&one.measurement).into()),
        ("K", |one| one.proportional.into()),
        ("K_i (1/s)", |one| one.integral.into()),
        ("K_d (s)", |one| one.derivative.into()),
        ("K_2 (s²)", |one| one.higher_derivatives.first().copied().into()),
        ("K_3 (s³)", |one| one.higher_derivatives.get(1).copied().into()),
        ("K_4 (s⁴)", |one| one.higher_derivatives.get(2).copied().into()),
        ("K_5 (s⁵)", |one| one.higher_derivatives.get(3).copied().into()),
        ("N_r", |one| one.set_point.into()),
        ("ω (rad/s)", |one| one.corner.into()),
    ];
    html! {
        p {
            "u = N_r r − K y_f + K_i ∫ (r − y) dt − K_d y_f′ − K_2 y_f″ − … + K_f f_hat, in deviations from the operating point. \
             y_f is y behind the filter 1 / (1 + s/ω) of a PI controller, 1 / (1 + √2 s/ω + s²/ω²) of a PID controller, a Butterworth filter of order n of a controller of order n. \
             K has the unit of the command per unit of the measurement."
        }
        (table_of("Controllers of low order", controllers, &columns))
    }
}

pub(super) fn assumptions(report: &Report) -> Markup {
    html! { ul { @for assumption in &report.assumptions { li { (assumption) } } } }
}

pub(super) fn effectiveness(report: &Report) -> Markup {
    let columns: Columns<'_, Effectiveness, 2> = [
        ("actuator", |entry| (&entry.actuator).into()),
        ("largest stable loss", |entry| entry.largest_stable_loss.into()),
    ];
    html! {
        p {
            "An actuator with loss E gives (1 − E) u. Of 50 losses from 0 to 1 that were tested for each \
             actuator, the loop is stable with all up to the one stated."
        }
        (table_of("Loss of effectiveness", &report.effectiveness, &columns))
    }
}

pub(super) fn interface(report: &Report) -> Markup {
    table_of(
        "Variables of the controller FMU",
        &report.interface,
        &[
            ("name", |variable| (&variable.name).into()),
            ("causality", |variable| (&variable.causality).into()),
            ("variability", |variable| (&variable.variability).into()),
            ("unit", |variable| (&variable.unit).into()),
            ("start", |variable| (&variable.start).into()),
            ("description", |variable| (&variable.description).into()),
        ],
    )
}
