//! `report.html`: the design report as one self-contained page.

mod certificate;
mod chart;
mod comparison;
mod curves;
mod detection;
mod estimation;
mod fallback;
mod family;
mod loops;
mod losses;
mod matrix;
mod number;
mod plane;
mod plant;
mod pole_map;
mod reconfiguration;
mod references;
mod region;
mod robustness;
mod table;
mod verdict;

pub(crate) use comparison::comparison;
use maud::{DOCTYPE, Markup, PreEscaped, html};
pub(crate) use number::rounded;

use super::report::Report;

const STYLE: &str = include_str!("page/page.css");
const SCRIPT: &str = concat!(include_str!("page/copy.js"), include_str!("page/cursor.js"));
/// The content security policy: the page loads nothing, even if a text contains markup.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// Returns the page of a design, a complete HTML document. Equal reports give equal bytes.
///
/// `plant.eigenvalues` are eigenvalues of the continuous plant in 1/s; the eigenvalues of the loops
/// are in the z-plane if the design is sampled. `identity` names the design in the head of the page.
pub(crate) fn page(report: &Report, identity: &str) -> String {
    let title =
        if report.description.is_empty() { &report.plant_file } else { &report.description };
    let sections = sections(report);
    let document = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title, identity))
            body {
                header {
                    p.kind { "Design report" }
                    h1 { (title) }
                    p.file { "Plant file " code { (report.plant_file) } }
                    (verdict::verdict(report))
                    (contents(&sections))
                }
                main {
                    @for (index, section) in sections.iter().enumerate() {
                        section aria-labelledby=(section.id) {
                            h2 id=(section.id) { (index + 1) ". " (section.title) }
                            (section.content)
                        }
                    }
                }
                footer {
                    p {
                        "Written by aso-ftc " (env!("CARGO_PKG_VERSION")) ". Numbers are shown with \
                         five digits, the pointer shows all. The same numbers, and the points of \
                         the curves, come from "
                        code { "aso-ftc design --json" } ". A pointer over a figure, or the arrow keys \
                         in it, read values from its curves, to about three digits; a click enlarges it."
                    }
                    p role="status" #copied {}
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    document.into_string().replace(|sign: char| sign.is_control() && sign != '\n', " ")
}

fn head(title: &str, identity: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="generator" content=(identity);
            title { (title) ", design report" }
            style { (PreEscaped(STYLE)) }
        }
    }
}

struct Section {
    id: &'static str,
    title: &'static str,
    content: Markup,
}

/// Returns the non-empty sections in reading order.
fn sections(report: &Report) -> Vec<Section> {
    let all = [
        (true, "plant", "Plant", plant::plant(&report.plant)),
        (!report.checks.is_empty(), "checks", "Checks", plant::checks(report)),
        (!report.gains.is_empty(), "gains", "Gains", plant::gains(report)),
        (true, "poles", "Eigenvalues", loops::poles(report)),
        (true, "conditioning", "Condition and pole errors", loops::conditioning(report)),
        (
            !report.estimation.errors.is_empty(),
            "estimation",
            "Estimation of the faults",
            estimation::estimation(report),
        ),
        (report.robustness.is_some(), "robustness", "Robustness", robustness::robustness(report)),
        (report.family.is_some(), "family", "Family of plants", family::family(report)),
        (report.schedule.is_some(), "schedule", "Schedule", family::schedule(report)),
        (
            report.detection.is_some(),
            "detection",
            "Detection of faults",
            report.detection.as_ref().map_or_else(Markup::default, detection::detection),
        ),
        (!report.frequency.is_empty(), "frequency", "Singular values", curves::frequencies(report)),
        (!report.references.is_empty(), "references", "References", references::references(report)),
        (!report.steps.is_empty(), "steps", "Sudden faults", curves::responses(report)),
        (!report.bounds.is_empty(), "bounds", "Bounds of the errors", certificate::bounds(report)),
        (true, "certificate", "Certificate", certificate::certificate(report)),
        (!report.assumptions.is_empty(), "assumptions", "Assumptions", plant::assumptions(report)),
        (
            !report.effectiveness.is_empty(),
            "effectiveness",
            "Loss of effectiveness",
            losses::losses(report),
        ),
        (
            report.reconfiguration.is_some(),
            "reconfiguration",
            "Without an actuator",
            reconfiguration::reconfiguration(report),
        ),
        (report.fallback.is_some(), "fallback", "Fall-back", fallback::fallback(report)),
        (
            !report.interface.is_empty(),
            "interface",
            "Interface of the FMU",
            plant::interface(report),
        ),
    ];
    all.into_iter()
        .filter(|(shown, ..)| *shown)
        .map(|(_, id, title, content)| Section { id, title, content })
        .collect()
}

fn contents(sections: &[Section]) -> Markup {
    html! {
        nav aria-label="Contents" {
            ul {
                @for (index, section) in sections.iter().enumerate() {
                    li { (index + 1) ". " a href={ "#" (section.id) } { (section.title) } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
