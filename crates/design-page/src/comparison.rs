//! `comparison.html`: the laws that estimate faults on one plant, side by side.

use maud::{Markup, html};

use super::estimation::details;
use super::table::{Cell, table};
use crate::document;
use design_report::comparison::{Comparison, LawResult};

/// Returns the page of a comparison, a complete HTML document.
#[must_use]
pub fn comparison(comparison: &Comparison) -> String {
    let title = format!("Estimation laws for {}", comparison.plant_file);
    let body = html! {
        header {
            p.kind { "Comparison of estimation laws" }
            h1 { (title) }
            p {
                "All laws are designed for the same plant and the same requirement on the observer; \
                 the law that the plant file names has the parameters of the file, the others have \
                 default parameters. Feedback and compensation are the same."
            }
        }
        main {
            section aria-labelledby="overview" {
                h2 id="overview" { "Overview" }
                (overview(comparison))
            }
            @for law in &comparison.laws {
                section aria-labelledby=(law.law) {
                    h2 id=(law.law) { (law.law) }
                    (one(law))
                }
            }
        }
    };
    document(&title, &comparison.identity, &body)
}

/// A table with a row for each law and fault; a law that does not exist has one row.
fn overview(comparison: &Comparison) -> Markup {
    let mut rows = Vec::new();
    for law in &comparison.laws {
        let Some(result) = &law.result else {
            let mut row: Vec<Cell> = vec![law.law.as_str().into(), Cell::Holds(false)];
            row.resize_with(12, || Cell::Missing);
            rows.push(row);
            continue;
        };
        for one in &result.estimation.errors {
            rows.push(vec![
                law.law.as_str().into(),
                Cell::Holds(true),
                one.fault.as_str().into(),
                one.constant.into(),
                one.step_settling.into(),
                one.ramp.map_or_else(|| "grows".into(), Cell::Number),
                one.sine.into(),
                one.noise.into(),
                one.noise_peak.into(),
                result.disk_margin.map(|margin| margin[0]).into(),
                result.disk_margin.map(|margin| margin[1]).into(),
                result.verdict.level.word().into(),
            ]);
        }
    }
    let heads = [
        "law",
        "exists",
        "fault",
        "lasting error of a constant fault",
        "settling after a step (s)",
        "lasting error of a ramp (s)",
        "error of a sine",
        "noise, root mean square",
        "noise, peak",
        "disk margin at the commands",
        "disk margin at the measurements",
        "verdict",
    ];
    table("Laws and faults", heads, &rows)
}

fn one(law: &LawResult) -> Markup {
    html! {
        p { "Source: " (law.sources) "." }
        @if let Some(reason) = &law.reason {
            p { "The law does not exist for this plant: " (reason) "." }
        }
        @if let Some(result) = &law.result {
            (details(&result.estimation))
            @if !result.verdict.reasons.is_empty() {
                ul { @for reason in &result.verdict.reasons { li { (reason) } } }
            }
        }
    }
}
