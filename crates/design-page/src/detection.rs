//! The section on the detection of faults.

use maud::{Markup, html};

use super::matrix::matrix;
use super::number::number;
use super::table::{Cell, table};
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
    let decoupled = |inputs: &[DecoupledInput]| {
        let one = |input: &DecoupledInput| {
            let how = if input.exact { "" } else { " (approximately)" };
            format!("{}{how}", input.name)
        };
        inputs.iter().map(one).collect::<Vec<_>>().join(", ")
    };
    #[expect(clippy::cast_precision_loss, reason = "a number of residuals")]
    let row = |test: &Test| {
        vec![
            Cell::from(test.name.as_str()),
            Cell::from(test.residuals as f64),
            Cell::from(test.drift),
            Cell::from(test.window.map(f64::from)),
            Cell::from(Some(test.model_error).filter(|error| *error > 0.0)),
            Cell::from(test.interior_excess),
            Cell::from(test.threshold),
            Cell::from(test.false_alarm_interval),
            Cell::from(decoupled(&test.decoupled).as_str()),
        ]
    };
    let heads = [
        "test",
        "residuals",
        "drift",
        "window, samples",
        "mean by model errors",
        "of it above the corners, relative",
        "threshold",
        "between false alarms, s",
        "insensitive to",
    ];
    table("Tests", &heads, &tests.iter().map(row).collect::<Vec<_>>())
}

/// Says which parameters of an FMU the means by model errors are for.
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
    let row = |fault: &DetectedFault| {
        vec![
            Cell::from(fault.fault.as_str()),
            Cell::from(fault.size),
            Cell::from(&fault.unit),
            Cell::from(fault.mean),
            Cell::from(fault.delay),
            Cell::from(fault.delay_90),
            Cell::from(fault.least),
            Cell::from(fault.within),
        ]
    };
    let heads = [
        "fault",
        "size of its step",
        "unit",
        "mean of the residuals",
        "mean delay, s",
        "90 % within, s",
        "least detectable",
        "within, s",
    ];
    table("Predicted detection", &heads, &faults.iter().map(row).collect::<Vec<_>>())
}

fn reactions(section: &Detection) -> Markup {
    let mut heads = vec!["test"];
    heads.extend(section.faults.iter().map(|fault| fault.fault.as_str()));
    let row = |(test, reacts): (&Test, &Vec<bool>)| {
        let mut cells = vec![Cell::from(test.name.as_str())];
        let sign = |reacts: &bool| Cell::from(if *reacts { "1" } else { "0" });
        cells.extend(reacts.iter().map(sign));
        cells
    };
    let rows: Vec<_> = section.tests.iter().zip(&section.reacts).map(row).collect();
    table("Structure", &heads, &rows)
}
