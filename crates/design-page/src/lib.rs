//! `report.html`: the design report as one self-contained page.

mod advice;
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
mod plots;
mod pole_map;
mod reconfiguration;
mod references;
mod region;
mod robustness;
mod table;
mod verdict;

pub use comparison::comparison;
use figure::interactive::{
    BASE_STYLE, COLOURS, FOLD, LINKED, LINKED_STYLE, UPLOT, UPLOT_LICENCE, UPLOT_STYLE, USAGE,
};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use plane::Plane;
use plots::Plots;

use design_report::Report;

const STYLE: &str = include_str!("page.css");
const COPY: &str = include_str!("copy.js");
const FIGURES: &str = include_str!("figures.js");
/// The content security policy: the page loads nothing, even if a text contains markup.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// Returns the page of a design, a complete HTML document. Equal reports give equal bytes.
///
/// `plant.eigenvalues` are eigenvalues of the continuous plant in 1/s, or with `plant.sample_time` in the z-plane; the
/// eigenvalues of the loops are in the z-plane if the design is sampled. `identity` names the design in the page's
/// head.
#[must_use]
pub fn page(report: &Report, identity: &str) -> String {
    let title =
        if report.description.is_empty() { &report.plant_file } else { &report.description };
    let mut plots = Plots::default();
    let sections = sections(report, &mut plots);
    let body = html! {
        header {
            p.kind { "Design report" }
            h1 { (title) }
            p.file { "Plant file " code { (report.plant_file) } }
            (verdict::verdict(report))
            @if !plots.is_empty() {
                (about_plots())
                noscript {
                    p.warned {
                        "The curves over time and frequency need JavaScript; their points come from "
                        code { "aso-ftc design --json" } ", too. Tables and maps need no JavaScript."
                    }
                }
            }
        }
        main {
            @for (index, section) in sections.iter().enumerate() {
                section aria-labelledby=(section.id) {
                    details {
                        summary { h2 id=(section.id) { (index + 1) ". " (section.title) } }
                        (section.content)
                    }
                }
            }
        }
        footer {
            p {
                "Written by aso-ftc " (env!("CARGO_PKG_VERSION")) ". Numbers are shown with \
                 five digits, the pointer shows all. The same numbers, and the points of \
                 the curves, come from "
                code { "aso-ftc design --json" } "."
            }
            @if !plots.is_empty() {
                p { "Plots by uPlot." }
                details.stays { summary { "Licence of uPlot" } pre tabindex="0" { (UPLOT_LICENCE) } }
            }
            p role="status" #copied {}
        }
        (script(FOLD))
        @if !plots.is_empty() {
            script type="application/json" #curves { (PreEscaped(plots.json())) }
            @for text in [UPLOT, LINKED, FIGURES] { (script(text)) }
        }
        (script(COPY))
    };
    document(title, identity, &body)
}

/// Returns a complete HTML document.
fn document(title: &str, identity: &str, body: &Markup) -> String {
    let document = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title, identity))
            body { (body) }
        }
    };
    document.into_string().replace(|sign: char| sign.is_control() && sign != '\n', " ")
}

/// Explains how to use the plots.
fn about_plots() -> Markup {
    html! {
        details.said.stays {
            summary { "How to zoom, read values and differences in the plots, by mouse, keyboard and touch" }
            @for sentence in USAGE { p { (sentence) } }
        }
    }
}

/// A script that is the same in HTML and in XML: as a CDATA section, `<` and `&` are no markup in XML.
fn script(text: &str) -> Markup {
    html! { script { "/*" (PreEscaped("<![CDATA[")) "*/\n" (PreEscaped(text)) "\n/*" (PreEscaped("]]>")) "*/" } }
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
            style {
                @for text in [UPLOT_STYLE, COLOURS, BASE_STYLE, LINKED_STYLE, STYLE] { (PreEscaped(text)) }
            }
        }
    }
}

struct Section {
    id: &'static str,
    title: &'static str,
    content: Markup,
}

/// Returns the non-empty sections in reading order.
fn sections<'a>(report: &'a Report, plots: &mut Plots<'a>) -> Vec<Section> {
    let Report { checks, gains, estimation, robustness, family, schedule, detection, .. } = report;
    let Report { frequency, references, steps, bounds, assumptions, effectiveness, .. } = report;
    let Report { reconfiguration, fallback, interface, .. } = report;
    let family = family.as_ref().map(|family| family::family(report, family));
    let schedule = schedule.as_ref().map(|schedule| family::schedule(report, schedule));
    let without = |section| reconfiguration::reconfiguration(section, Plane::of(report));
    let law = || estimation::estimation(estimation);
    let robustness = robustness.as_ref().map(|all| robustness::robustness(report, all, plots));
    let all = [
        ("plant", "Plant", Some(plant::plant(&report.plant))),
        ("checks", "Checks", any(checks, || plant::checks(report))),
        ("gains", "Gains", any(gains, || plant::gains(report))),
        ("poles", "Eigenvalues", Some(loops::poles(report))),
        ("conditioning", "Condition and pole errors", Some(loops::conditioning(report))),
        ("estimation", "Estimation of the faults", any(&estimation.errors, law)),
        ("robustness", "Robustness", robustness),
        ("family", "Family of plants", family),
        ("schedule", "Schedule", schedule),
        ("detection", "Detection of faults", detection.as_ref().map(detection::detection)),
        ("frequency", "Singular values", any(frequency, || curves::frequencies(report, plots))),
        ("references", "References", any(references, || references::references(report, plots))),
        ("steps", "Sudden faults", any(steps, || curves::responses(report, plots))),
        ("bounds", "Bounds of the errors", any(bounds, || certificate::bounds(report))),
        ("certificate", "Certificate", Some(certificate::certificate(report))),
        ("assumptions", "Assumptions", any(assumptions, || plant::assumptions(report))),
        ("effectiveness", "Loss of effectiveness", any(effectiveness, || losses::losses(report))),
        ("reconfiguration", "Without an actuator", reconfiguration.as_ref().map(without)),
        ("fallback", "Fall-back", fallback.as_ref().map(fallback::fallback)),
        ("interface", "Interface of the FMU", any(interface, || plant::interface(report))),
    ];
    let section = |(id, title, content)| Some(Section { id, title, content: content? });
    all.into_iter().filter_map(section).collect()
}

/// Returns the content of a section about a list; `None` if the list is empty.
fn any<T>(list: &[T], content: impl FnOnce() -> Markup) -> Option<Markup> {
    (!list.is_empty()).then(content)
}

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
