//! The section on the fall-back.

use maud::{Markup, html};

use super::number::number;
use super::table::{Cell, Columns, table, table_of};
use design_report::fallback::{FallbackCase, FallbackReport};
use design_report::robustness::Number;

pub(super) fn fallback(fallback: &FallbackReport) -> Markup {
    html! {
        p {
            "The fall-back serves all cases below without knowing which one it is. It is in force while the \
             input fall_back of the controller FMU is true, and while actuators are gone for which there \
             are no other gains. The observer stays in the loop and does not know of the loss. " (fallback.method)
        }
        p {
            "The loop of plant, observer and feedback decays with at least " (number(fallback.decay))
            " 1/s in all cases, the intact controller with " (number(fallback.intact_decay))
            " 1/s. Norm of K" sub { "x" } " " (number(fallback.gain_norm)) ", of the intact controller "
            (number(fallback.intact_gain_norm)) ". "
            @if fallback.compensates {
                "The estimated faults are compensated: the loop with the compensation decays at the required \
                 rate, too."
            } @else {
                "The estimated faults are not compensated: with the compensation the loop would not decay \
                 at the required rate in all cases. Their effect on the states remains."
            }
        }
        @match &fallback.whole {
            Ok(certificate) => p {
                "One P serves the loops of all cases (margin " (number(certificate.margin)) "): the loop is \
                 stable while losses change in any way, if their fractions of the largest loss are at most \
                 1 in sum."
            },
            Err(reason) => p {
                strong { "Stability while losses change with time is not proven: " } (reason)
                ". The table is about constant losses."
            },
        }
        (cases(&fallback.cases))
        (at_rest("Commands of the fall-back at rest", &fallback.cases, |case| &case.commands))
        (at_rest(
            "Deviations of the measurements in the fall-back at rest",
            &fallback.cases,
            |case| &case.measurements,
        ))
    }
}

fn cases(cases: &[FallbackCase]) -> Markup {
    let columns: Columns<'_, FallbackCase, 8> = [
        ("case", |case| (&case.name).into()),
        ("decay of the loop, 1/s", |case| case.decay.into()),
        ("decay of A + B K_x, 1/s", |case| case.feedback_decay.into()),
        ("peak of S, input", |case| case.points.first().map(|point| point.judged).into()),
        ("peak of S, output", |case| case.points.get(1).map(|point| point.judged).into()),
        ("delay margin, s", |case| case.delay_margin.into()),
        ("price", |case| case.worst_price().map(|price| price.value).into()),
        ("of", |case| case.worst_price().map_or("", |price| &price.name).into()),
    ];
    html! {
        p {
            "The price is the root-mean-square value of a measurement under white noise, which acts as on the \
             commands of the intact plant, relative to that of the intact plant with the intact controller: \
             the largest one."
        }
        (table_of("Cases of the fall-back", cases, &columns))
    }
}

/// A table with a row for each signal and a column for each case; empty without cases.
fn at_rest(
    title: &str,
    cases: &[FallbackCase],
    numbers: impl Fn(&FallbackCase) -> &[Number],
) -> Markup {
    let Some(first) = cases.first() else { return html! {} };
    let row = |(at, signal): (usize, &Number)| {
        let values = cases.iter().map(|case| Cell::from(numbers(case)[at].value));
        [signal.name.as_str().into(), (&signal.unit).into()].into_iter().chain(values).collect()
    };
    let rows: Vec<Vec<Cell>> = numbers(first).iter().enumerate().map(row).collect();
    let names = cases.iter().map(|case| case.name.as_str());
    table(title, ["signal", "unit"].into_iter().chain(names), &rows)
}
