//! The HTML document.

use std::path::Path;

use figure::interactive::{COLOURS, LINKED, LINKED_STYLE, UPLOT, UPLOT_LICENCE, UPLOT_STYLE};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use results::Column;

use serde::Serialize;

use crate::difference::Comparison;
use crate::frames::Message;
use crate::plots::Plots;
use crate::statistics::{Basis, Statistics};
use crate::{Request, Run, graph, identity, listed};

const STYLE: &str = include_str!("page/page.css");
const ROWS: &str = include_str!("page/rows.js");
const SCRIPT: &str = include_str!("page/plots.js");
/// The content security policy: the page loads nothing, even if a text contains markup.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";
/// Largest number of connections and of messages that are listed.
const LISTED: usize = 200;
/// The range of all times.
const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

pub(crate) struct Content<'a> {
    pub(crate) request: &'a Request<'a>,
    pub(crate) columns: &'a [Column],
    pub(crate) statistics: &'a [Statistics],
    /// Variables that are texts.
    pub(crate) texts: &'a [String],
    /// Number of variables that are not shown.
    pub(crate) left_out: usize,
    /// The messages of the bus trace, if there is one.
    pub(crate) frames: Option<&'a [Message]>,
    pub(crate) comparison: Option<&'a Comparison>,
}

/// The data of the scripts.
#[derive(Serialize)]
struct Data<'a> {
    #[serde(flatten)]
    plots: &'a Plots,
    /// The command that writes such a page.
    command: String,
}

pub(crate) fn render(content: &Content<'_>, plots: &Plots) -> String {
    let request = content.request;
    let file = request.results.display().to_string();
    let other = request.against.map(|path| path.display().to_string());
    let data = Data { plots, command: command(request) };
    let data = serde_json::to_string(&data).unwrap_or_default().replace('<', "\\u003c");
    let document = html! {
        (DOCTYPE)
        html lang="en" {
            (head(&file, request))
            body {
                header {
                    p.kind { "Report of a run" }
                    h1 { (file) @if let Some(other) = &other { " against " (other) } }
                    @if let Some(run) = request.run { (outcome(run)) }
                    @if request.range != ALL { p { "Rows from t = " (request.range.0) " s to t = " (request.range.1) " s only." } }
                }
                main {
                    section aria-labelledby="plots" {
                        h2 #plots { "Plots" }
                        (controls(other.as_deref()))
                        noscript { p.warned { "The plots need JavaScript; the tables do not." } }
                        div #figures {}
                        p.said {
                            "Drag over a plot to zoom, double-click to show all; all plots have the same time \
                             axis and cursor. On a touch screen two fingers zoom, a double tap shows all. In a plot, arrow keys move the cursor, + and − zoom, 0 shows all. A \
                             click on a name hides its curve. The values below a plot are those of the row at the stated time, with all digits; – is an empty cell."
                            @if content.left_out > 0 {
                                " " (content.left_out) " more variables of the file are not shown; "
                                code { "--variables" } " chooses others."
                            }
                            @if !content.texts.is_empty() {
                                " Texts are not shown: " (listed(content.texts, LISTED)) "."
                            }
                        }
                    }
                    @if let Some(comparison) = content.comparison { (differences(comparison, other.as_deref().unwrap_or_default())) }
                    (statistics(content))
                    @if let (Some(messages), Some(file)) = (content.frames, request.bus_trace) { (frames(messages, file)) }
                    @if let Some(run) = request.run { (system(run)) (messages(run)) }
                }
                footer {
                    p { "Written by aso-ftc " (env!("CARGO_PKG_VERSION")) ". Plots by uPlot." }
                    details { summary { "Licence of uPlot" } pre { (UPLOT_LICENCE) } }
                }
                script type="application/json" #data { (PreEscaped(data)) }
                script { (PreEscaped(UPLOT)) (PreEscaped(LINKED)) }
                script { (PreEscaped(ROWS)) (PreEscaped(SCRIPT)) }
            }
        }
    };
    document.into_string().replace(|sign: char| sign.is_control() && sign != '\n', " ")
}

fn head(file: &str, request: &Request<'_>) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="generator" content=(identity(request.results));
            title { (file) ", report" }
            style {
                @for text in [UPLOT_STYLE, COLOURS, STYLE, LINKED_STYLE] { (PreEscaped(text)) }
            }
        }
    }
}

fn outcome(run: &Run) -> Markup {
    html! {
        p.outcome.failed[run.failed] role="status" { (run.outcome) }
    }
}

fn controls(other: Option<&str>) -> Markup {
    html! {
        form #controls {
            label { "from " input #from type="number" step="any"; " s" }
            label { "to " input #to type="number" step="any"; " s" }
            button type="submit" { "Show" }
            button type="button" #all { "Show all" }
            button type="button" #earlier aria-label="Earlier" { "←" }
            button type="button" #later aria-label="Later" { "→" }
            button type="button" #closer aria-label="Zoom in" { "+" }
            button type="button" #wider aria-label="Zoom out" { "−" }
            @if let Some(other) = other {
                fieldset {
                    legend { "Curves" }
                    label { input type="radio" name="shown" value="both" checked; " both runs (" (other) " dashed)" }
                    label { input type="radio" name="shown" value="difference"; " difference" }
                }
            }
        }
    }
}

/// The command for a page with the same content, in the words of a shell.
fn command(request: &Request<'_>) -> String {
    let is_plain = |sign: char| sign.is_ascii_alphanumeric() || "_-./".contains(sign);
    let quoted = |path: &Path| {
        let text = path.display().to_string();
        if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
    };
    let against = request.against.map(|path| format!(" --against {}", quoted(path)));
    format!("aso-ftc report {}{}", quoted(request.results), against.unwrap_or_default())
}

/// A number with six digits, all of them in a tooltip.
fn number(value: f64) -> Markup {
    html! { td.number title=(value) { (short(value)) } }
}

/// A number with six digits.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if value.is_nan() {
        "–".to_owned()
    } else if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// What mean and rms of a variable are over.
fn basis(statistics: &Statistics) -> String {
    match statistics.basis {
        Basis::Time(length) => format!("time, {} s", short(length)),
        Basis::Values(count) if statistics.not_finite == 0 => format!("{count} rows"),
        Basis::Values(count) => {
            format!("{count} values in {} rows", count + statistics.not_finite)
        }
    }
}

fn statistics(content: &Content<'_>) -> Markup {
    let rows = content.columns.iter().zip(content.statistics);
    html! {
        section aria-labelledby="statistics" {
            h2 #statistics { "Statistics" }
            div.scroll tabindex="0" role="region" aria-labelledby="statistics" {
                table {
                    thead {
                        tr {
                            th scope="col" { "variable" }
                            th scope="col" { "unit" }
                            @for title in ["first", "last", "smallest", "at t in s", "largest", "at t in s", "mean", "rms"] {
                                th.number scope="col" { (title) }
                            }
                            th scope="col" { "mean and rms over" }
                        }
                    }
                    tbody {
                        @for (column, statistics) in rows {
                            tr {
                                th scope="row" { (column.name) }
                                td { (column.unit.as_deref().unwrap_or_default()) }
                                @for value in [
                                    statistics.first, statistics.last, statistics.smallest.0, statistics.smallest.1,
                                    statistics.largest.0, statistics.largest.1, statistics.mean, statistics.rms,
                                ] { (number(value)) }
                                td { (basis(statistics)) }
                            }
                        }
                    }
                }
            }
            p.said {
                "Over time: integrals by the trapezoidal rule (integers and Booleans are held), divided by the length of the run. Over values, if some \
                 rows have none: each value has the same weight."
            }
        }
    }
}

fn frames(messages: &[Message], file: &Path) -> Markup {
    html! {
        section aria-labelledby="frames" {
            h2 #frames { "Frames on the bus" }
            @if messages.is_empty() { p { "There is no frame in " (file.display()) "." } }
            div.scroll tabindex="0" role="region" aria-labelledby="frames" {
                table {
                    thead {
                        tr {
                            th scope="col" { "bus and identifier" }
                            @for title in ["frames", "first at t in s", "last at t in s", "shortest interval in ms", "mean in ms", "longest in ms"] {
                                th.number scope="col" { (title) }
                            }
                        }
                    }
                    tbody {
                        @for message in messages.iter().take(LISTED) {
                            tr {
                                th scope="row" { (message.name) }
                                td.number title=(message.count) { (message.count) }
                                @for value in [message.first, message.last, 1e3 * message.shortest, 1e3 * message.mean(), 1e3 * message.longest] { (number(value)) }
                            }
                        }
                    }
                }
            }
            @if messages.len() > LISTED { p { "and " (messages.len() - LISTED) " more identifiers." } }
            p.said {
                "From " (file.display()) ". In the plots each frame but the first is a dot: its height is the time since the frame before with the same \
                 identifier, so that a late or lost frame stands out. Of long traces, the shortest and the longest interval of each short time are shown."
            }
        }
    }
}

fn differences(comparison: &Comparison, other: &str) -> Markup {
    let capitalised = |sentence: String| {
        let mut signs = sentence.chars();
        signs
            .next()
            .map_or_else(String::new, |first| format!("{}{}", first.to_uppercase(), signs.as_str()))
    };
    let uncompared = comparison.uncompared("this run", other, LISTED);
    html! {
        section aria-labelledby="differences" {
            h2 #differences { "Difference to " (other) }
            @if comparison.is_equal() {
                p.outcome { "All " (comparison.differences.len()) " common variables are equal in all " (comparison.rows) " common rows." }
            }
            @if !uncompared.is_empty() {
                div.outcome.failed {
                    "Not compared:"
                    ul { @for sentence in uncompared { li { (capitalised(sentence)) "." } } }
                }
            }
            div.scroll tabindex="0" role="region" aria-labelledby="differences" {
                table {
                    thead {
                        tr {
                            th scope="col" { "variable" }
                            @for title in ["largest difference", "at t in s", "rms", "largest, relative to the range", "rows"] {
                                th.number scope="col" { (title) }
                            }
                        }
                    }
                    tbody {
                        @for difference in &comparison.differences {
                            tr {
                                th scope="row" { (difference.name) }
                                @for value in [difference.largest, difference.at, difference.rms, difference.relative] { (number(value)) }
                                td.number { (difference.rows) }
                            }
                        }
                    }
                }
            }
            p.said {
                "This run minus the other one, at the rows of this run; between its rows the other one is interpolated \
                 linearly, integers and Booleans are held. The rms is over the rows at which one of the runs has a value."
            }
        }
    }
}

fn system(run: &Run) -> Markup {
    let fmu = |at: usize| run.fmus.get(at).map_or("", |fmu| fmu.name.as_str());
    html! {
        section aria-labelledby="system" {
            h2 #system { "System" }
            div.scroll tabindex="0" role="region" aria-labelledby="system" { (graph::graph(run)) }
            ul { @for fmu in &run.fmus { li { strong { (fmu.name) } ": " (fmu.details.join(", ")) } } }
            details {
                summary { (run.connections.len()) " connections" }
                ul {
                    @for connection in run.connections.iter().take(LISTED) {
                        li { code { (fmu(connection.from)) "." (connection.output) } " to " code { (fmu(connection.to)) "." (connection.input) } }
                    }
                    @if run.connections.len() > LISTED { li { "and " (run.connections.len() - LISTED) " more" } }
                }
            }
            h3 { "Algorithm" }
            ul { @for line in &run.algorithm { li { (line) } } }
        }
    }
}

fn messages(run: &Run) -> Markup {
    html! {
        section aria-labelledby="messages" {
            h2 #messages { "Warnings and errors" }
            @if run.messages.is_empty() { p { "None." } }
            ul { @for message in run.messages.iter().take(LISTED) { li { (message) } } }
            @if run.messages.len() > LISTED { p { "and " (run.messages.len() - LISTED) " more." } }
        }
    }
}
