//! The section on the detection of faults.

use maud::{Markup, html};

use super::matrix::matrix;
use super::number::number;
use super::table::{Cell, Columns, table, table_of};
use design_report::detection::{DecoupledInput, DetectedFault, Detection, Test};

/// Shows tests, delays and structure.
pub(super) fn detection(section: &Detection) -> Markup {
    html! {
        p {
            "The residuals are white with variance 1 while there is no fault. They are tested every "
            (number(section.sample_time)) " s from " (number(section.from)) " s after the start on. All tests \
             together give a false alarm every " (number(section.false_alarm_interval)) " s on average, with \
             the stated noise. Process noise: " (section.process_noise)
        }
        (tests(&section.tests))
        (examined(section))
        (faults(&section.faults))
        p {
            "The largest mean of the residuals after a step of each fault by its size, in standard \
             deviations; below, the tests that react to each fault."
        }
        (matrix("detection-structure", &section.structure))
        (reactions(section))
        @for group in &section.confused {
            p { strong { "The residuals cannot tell these faults apart: " } (group.join(", ")) "." }
        }
    }
}

fn tests(tests: &[Test]) -> Markup {
    #[expect(clippy::cast_precision_loss, reason = "a number of residuals")]
    let columns: Columns<'_, Test, 9> = [
        ("test", |test| (&test.name).into()),
        ("residuals", |test| (test.residuals as f64).into()),
        ("drift", |test| test.drift.into()),
        ("window, samples", |test| test.window.map(f64::from).into()),
        ("mean by model errors", |test| Some(test.model_error).filter(|error| *error > 0.0).into()),
        ("of it above the corners, relative", |test| test.interior_excess.into()),
        ("threshold", |test| test.threshold.into()),
        ("between false alarms, s", |test| test.false_alarm_interval.into()),
        ("insensitive to", |test| (&decoupled(&test.decoupled)).into()),
    ];
    table_of("Tests", tests, &columns)
}

fn decoupled(inputs: &[DecoupledInput]) -> String {
    let one = |input: &DecoupledInput| {
        let how = if input.exact { "" } else { " (approximately)" };
        format!("{}{how}", input.name)
    };
    inputs.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Names the parameters of an FMU for which the means by model errors were computed; empty if no parameters vary.
fn examined(section: &Detection) -> Markup {
    let Some(cases) = &section.parameter_cases else { return html! {} };
    html! {
        p {
            "The means by model errors are the largest at the corners of the limits of the parameters and of "
            (cases.cases) " random parameters within (seed " (cases.seed) "), times the factor of the plant file. With a \
             confidence of 99 %, at most the part " (number(cases.uncovered)) " of the parameters within their \
             limits gives a test a larger mean, before the factor."
        }
    }
}

fn faults(faults: &[DetectedFault]) -> Markup {
    table_of(
        "Predicted detection",
        faults,
        &[
            ("fault", |fault| (&fault.fault).into()),
            ("size of its step", |fault| fault.size.into()),
            ("unit", |fault| (&fault.unit).into()),
            ("mean of the residuals", |fault| fault.mean.into()),
            ("mean delay, s", |fault| or(fault.delay, "never for sure")),
            ("90 % within, s", |fault| or(fault.delay_90, "never for sure")),
            ("least detectable", |fault| or(fault.least, "none")),
            ("within, s", |fault| fault.within.into()),
        ],
    )
}

fn or(number: Option<f64>, missing: &str) -> Cell {
    number.map_or_else(|| missing.into(), Cell::Number)
}

fn reactions(section: &Detection) -> Markup {
    let faults = section.faults.iter().map(|fault| fault.fault.as_str());
    let row = |(test, reacts): (&Test, &Vec<bool>)| {
        let signs = reacts.iter().map(|reacts| if *reacts { "1" } else { "0" });
        std::iter::once(test.name.as_str()).chain(signs).map(Cell::from).collect()
    };
    let rows: Vec<_> = section.tests.iter().zip(&section.reacts).map(row).collect();
    table("Structure", std::iter::once("test").chain(faults), &rows)
}
