//! The HTML document.

use std::path::Path;

use figure::interactive::{
    BASE_STYLE, COLOURS, FOLD, LINKED, LINKED_STYLE, UPLOT, UPLOT_LICENCE, UPLOT_STYLE, USAGE,
};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use results::Column;

use serde::Serialize;

use crate::difference::{Comparison, Difference};
use crate::plots::Plots;
use crate::statistics::{Basis, Statistics};
use crate::{
    Events, MARKS, Mark, MarkKind, Request, Run, frames, graph, identity, interval, listed,
};

const STYLE: &str = include_str!("page/page.css");
const ROWS: &str = include_str!("page/rows.js");
const SCRIPT: &str = include_str!("page/plots.js");
/// The content security policy: the page loads nothing, even if a text contains markup.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:";
/// Largest number of entries of a list: marks, messages, connections, identifiers, names.
const LISTED: usize = 200;
/// Largest number of rows of a table that is not folded, and number of differences that are shown unfolded.
const OPEN: usize = 10;
/// The range of all times.
const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// The content of a page except the plots.
pub(crate) struct Content<'a> {
    pub(crate) request: &'a Request<'a>,
    pub(crate) columns: &'a [Column],
    pub(crate) statistics: &'a [Statistics],
    /// The positions of variables that do not change and have no plot.
    pub(crate) flat: Vec<usize>,
    pub(crate) events: &'a Events,
    /// The first and the last time; empty without rows.
    pub(crate) span: &'a [f64],
    /// Variables that are texts.
    pub(crate) texts: &'a [String],
    /// Integers that are rounded to doubles.
    pub(crate) rounded: &'a [String],
    /// Number of variables that are not shown.
    pub(crate) left_out: usize,
    /// The frames of the bus trace by bus and identifier, if there is a trace.
    pub(crate) frames: Option<&'a [frames::Message]>,
    pub(crate) comparison: Option<&'a Comparison>,
    /// The first plots as SVG, for a reader without JavaScript.
    pub(crate) picture: String,
}

/// The data of the scripts.
#[derive(Serialize)]
struct Data<'a> {
    #[serde(flatten)]
    plots: &'a Plots,
    marks: &'a [Mark],
    /// The times of events.
    events: &'a [f64],
    /// The first and the last time.
    span: &'a [f64],
    /// The command for a page of the same files, from [`command`].
    command: String,
}

/// Returns the HTML document.
pub(crate) fn render(content: &Content<'_>, plots: &Plots) -> String {
    let request = content.request;
    let file = request.results.display().to_string();
    let other = request.against.map(|path| path.display().to_string());
    let marks = marks(request.run);
    let events = &content.events.times;
    let (span, command) = (content.span, command(request));
    let data = Data { plots, marks: &marks, events, span, command };
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
                    @if let (Some(comparison), Some(other)) = (content.comparison, &other) { (largest(comparison, other)) }
                    @if request.range != ALL { p { "Rows " (interval(request.range)) " only." } }
                }
                main {
                    section aria-labelledby="plots" {
                        h2 #plots { "Plots" }
                        (controls(other.as_deref()))
                        noscript {
                            p { "Interactive plots need JavaScript; this picture and the tables do not." }
                            (PreEscaped(&content.picture))
                        }
                        div.figures #figures {}
                        div #more {}
                        (unchanged(content))
                        @if content.left_out > 0 {
                            p { (content.left_out) " more variables of the file are not shown; " code { "--variables" } " chooses others." }
                        }
                        @if !content.rounded.is_empty() {
                            p.outcome.warned {
                                "Integers beyond 2" sup { "53" } " = 9007199254740992 are rounded, and differences below the rounding are not seen: "
                                (listed(content.rounded, LISTED)) "."
                            }
                        }
                        @if !content.texts.is_empty() { p { "Texts are not shown: " (listed(content.texts, LISTED)) "." } }
                        details.said.stays {
                            summary { "How to zoom, read values and differences, by mouse, keyboard and touch" }
                            @for sentence in USAGE { p { (sentence) } }
                            p {
                                "The values below a plot are those of the row at the stated time, with all digits; – is an empty cell. \
                                 All plots have the same axis of time. Marks: triangles are changes, faults and messages, the bar at the \
                                 top is the time of a fault, short lines at the axis are events. Below a plot stands what happened at the cursor."
                            }
                        }
                    }
                    @if let Some(comparison) = content.comparison { (differences(comparison, other.as_deref().unwrap_or_default())) }
                    (timeline(&marks, content.events))
                    (statistics(content))
                    @if let (Some(messages), Some(file)) = (content.frames, request.bus_trace) { (bus_frames(messages, file)) }
                    @if let Some(run) = request.run { (system(run)) (messages(run)) }
                }
                footer {
                    p { "Written by aso-ftc " (env!("CARGO_PKG_VERSION")) ". Plots by uPlot." }
                    details.stays { summary { "Licence of uPlot" } pre { (UPLOT_LICENCE) } }
                }
                script type="application/json" #data { (PreEscaped(data)) }
                script { (PreEscaped(UPLOT)) (PreEscaped(LINKED)) }
                script { (PreEscaped(FOLD)) (PreEscaped(ROWS)) (PreEscaped(SCRIPT)) }
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
                @for text in [UPLOT_STYLE, COLOURS, BASE_STYLE, LINKED_STYLE, STYLE] { (PreEscaped(text)) }
            }
        }
    }
}

fn outcome(run: &Run) -> Markup {
    html! {
        p.outcome.failed[run.failed] role="status" { (run.outcome) }
        @if !run.messages.is_empty() {
            p { a href="#messages" { (message_count(run.messages.len())) } }
        }
    }
}

fn message_count(messages: usize) -> String {
    match messages {
        1 => "1 warning or error".to_owned(),
        several => format!("{several} warnings and errors"),
    }
}

/// Says at the top of the page how much the two runs differ, or that they have no time in common.
fn largest(comparison: &Comparison, other: &str) -> Markup {
    html! {
        @if comparison.rows == 0 {
            p.outcome.warned { "Nothing was compared with " (other) ": the two runs have no time in common." }
        } @else if comparison.is_equal() {
            p.outcome { "All " (comparison.differences.len()) " common variables are equal in all " (comparison.rows) " common rows." }
        } @else if let Some(largest) = comparison.differences.first() {
            p.outcome.warned {
                "The largest difference to " (other) ", relative to the range, is that of " strong { (largest.name) } ": " (short(largest.largest))
                " at t = " (moment(largest.at)) " s, " (short(100.0 * largest.relative)) " % of its range. The plots start with the largest difference."
            }
        }
    }
}

/// Returns the marks in the order of their times: up to [`MARKS`] of the run, and up to [`MARKS`] messages with a time.
fn marks(run: Option<&Run>) -> Vec<Mark> {
    let Some(run) = run else { return Vec::new() };
    let messages = run.messages.iter().filter_map(|message| {
        let (kind, text) = (MarkKind::Message, message.text.clone());
        Some(Mark { kind, time: message.time?, end: None, text })
    });
    let mut marks: Vec<Mark> =
        run.marks.iter().take(MARKS).cloned().chain(messages.take(MARKS)).collect();
    marks.sort_by(|one, other| one.time.total_cmp(&other.time));
    marks
}

/// A table that is folded if its number of rows, `count`, is larger than [`OPEN`].
fn folded(count: usize, summary: &str, table: &Markup) -> Markup {
    html! { details open[count <= OPEN] { summary { (summary) } (table) } }
}

/// The titles of a table: columns of texts, then columns of numbers, then columns of texts.
fn titles(texts: &[&str], numbers: &[&str], last: &[&str]) -> Markup {
    html! {
        thead {
            tr {
                @for title in texts { th scope="col" { (title) } }
                @for title in numbers { th.number scope="col" { (title) } }
                @for title in last { th scope="col" { (title) } }
            }
        }
    }
}

/// The marks in a table, and the number of events.
fn timeline(marks: &[Mark], events: &Events) -> Markup {
    let table = html! {
        div.scroll tabindex="0" role="region" aria-labelledby="happened" {
            table {
                (titles(&[], &["t in s"], &["kind", "what"]))
                tbody {
                    @for mark in marks.iter().take(LISTED) {
                        tr {
                            (instant(mark.time))
                            td { (mark.kind.name()) }
                            th scope="row" { (mark.text) }
                        }
                    }
                }
            }
        }
    };
    html! {
        @if !marks.is_empty() || events.count > 0 {
            section aria-labelledby="happened" {
                h2 #happened { "What happened when" }
                @if !marks.is_empty() {
                    (folded(marks.len(), &format!("{} marks on the axis of time", marks.len()), &table))
                    @if marks.len() > LISTED { p { "and " (marks.len() - LISTED) " more, in the plots." } }
                }
                @if events.count > 0 {
                    p {
                        "At " (events.count) @if events.count == 1 { " instant" } @else { " instants" } " the file has several rows, as at events."
                        @if events.count > events.times.len() { " The plots mark the first " (events.times.len()) "." }
                    }
                }
            }
        }
    }
}

/// Shows the constant variables with their values.
fn unchanged(content: &Content<'_>) -> Markup {
    let count = content.flat.len();
    html! {
        @if count > 0 {
            details #unchanged {
                summary { (count) @if count == 1 { " signal does" } @else { " signals do" } " not change" }
                div.scroll tabindex="0" role="region" aria-label="Signals that do not change" {
                    table {
                        (titles(&["variable"], &["value"], &["unit"]))
                        tbody {
                            @for at in &content.flat {
                                tr {
                                    th scope="row" { (content.columns[*at].name) }
                                    (number(content.statistics[*at].first))
                                    td { (content.columns[*at].unit.as_deref().unwrap_or_default()) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn controls(other: Option<&str>) -> Markup {
    html! {
        form #controls {
            label { "signals " input #filter type="search" placeholder="filter by name" autocomplete="off"; }
            span.said #found role="status" {}
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

/// Returns the command for a page of the same files, quoted for a shell, without range, variables, units and trace.
fn command(request: &Request<'_>) -> String {
    let is_plain = |sign: char| sign.is_ascii_alphanumeric() || "_-./".contains(sign);
    let quoted = |path: &Path| {
        let text = path.display().to_string();
        if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
    };
    let against = request.against.map(|path| format!(" --against {}", quoted(path)));
    format!("aso-ftc report {}{}", quoted(request.results), against.unwrap_or_default())
}

/// A cell with a number in six digits, and with all digits in a tooltip.
fn number(value: f64) -> Markup {
    html! { td.number title=(value) { (short(value)) } }
}

/// A cell with a time in s, and with all digits in a tooltip.
fn instant(time: f64) -> Markup {
    html! { td.number title=(time) { (moment(time)) } }
}

/// Returns a time in s with six significant digits; from 1e6 s on, such as seconds since 1970, with all digits down to
/// 1 µs.
fn moment(time: f64) -> String {
    if (1e6..1e15).contains(&time.abs()) {
        format!("{}", (time * 1e6).round() / 1e6)
    } else {
        short(time)
    }
}

/// Returns a number with six significant digits; a dash for NaN.
fn short(value: f64) -> String {
    // The sum has no negative zero.
    let rounded = format!("{value:.5e}").parse().unwrap_or(value) + 0.0;
    if value.is_nan() {
        "–".to_owned()
    } else if rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// Returns the quantity over which the mean and the rms of a variable are taken, as text.
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
    let table = html! {
            div.scroll tabindex="0" role="region" aria-labelledby="statistics" {
                table {
                    (titles(
                        &["variable", "unit"],
                        &["first", "last", "smallest", "at t in s", "largest", "at t in s", "mean", "rms"],
                        &["mean and rms over"],
                    ))
                    tbody {
                        @for (column, statistics) in rows {
                            tr {
                                th scope="row" { (column.name) }
                                td { (column.unit.as_deref().unwrap_or_default()) }
                                @for value in [statistics.first, statistics.last] { (number(value)) }
                                @for (value, time) in [statistics.smallest, statistics.largest] { (number(value)) (instant(time)) }
                                @for value in [statistics.mean, statistics.rms] { (number(value)) }
                                td { (basis(statistics)) }
                            }
                        }
                    }
                }
            }
    };
    html! {
        section aria-labelledby="statistics" {
            h2 #statistics { "Statistics" }
            (folded(content.columns.len(), &format!("First, last, smallest and largest values, mean and rms of {} variables", content.columns.len()), &table))
            p.said {
                "Over time: integrals by the trapezoidal rule (integers and Booleans are held), divided by the length of the run. Over values, if some \
                 rows have none: each value has the same weight."
            }
        }
    }
}

fn bus_frames(messages: &[frames::Message], file: &Path) -> Markup {
    html! {
        section aria-labelledby="frames" {
            h2 #frames { "Frames on the bus" }
            @if messages.is_empty() { p { (file.display()) " has no frame at the times of this page." } }
            div.scroll tabindex="0" role="region" aria-labelledby="frames" {
                table {
                    (titles(
                        &["bus and identifier"],
                        &["frames", "first at t in s", "last at t in s", "shortest interval in ms", "mean in ms", "longest in ms"],
                        &[],
                    ))
                    tbody {
                        @for message in messages.iter().take(LISTED) {
                            tr {
                                th scope="row" { (message.name) }
                                td.number title=(message.count) { (message.count) }
                                @for time in [message.first, message.last] { (instant(time)) }
                                @for value in [1e3 * message.shortest, 1e3 * message.mean(), 1e3 * message.longest] { (number(value)) }
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
    let count = comparison.differences.len();
    let (largest, rest) = comparison.differences.split_at(count.min(OPEN));
    html! {
        section aria-labelledby="differences" {
            h2 #differences { "Difference to " (other) }
            @if !uncompared.is_empty() {
                div.outcome.failed {
                    "Not compared:"
                    ul { @for sentence in uncompared { li { (capitalised(sentence)) "." } } }
                }
            }
            (difference_table("The largest differences", largest))
            @if !rest.is_empty() {
                details {
                    summary { (rest.len()) " smaller differences" }
                    (difference_table("Smaller differences", rest))
                }
            }
            p.said {
                "This run minus the other one, at the rows of this run; between its rows the other one is interpolated \
                 linearly, integers and Booleans are held. The rms is over the rows at which one of the runs has a value."
            }
        }
    }
}

fn difference_table(name: &str, differences: &[Difference]) -> Markup {
    html! {
            div.scroll tabindex="0" role="region" aria-label=(name) {
                table {
                    (titles(
                        &["variable"],
                        &["largest difference", "at t in s", "rms", "largest, relative to the range", "rows"],
                        &[],
                    ))
                    tbody {
                        @for difference in differences {
                            tr {
                                th scope="row" { (difference.name) }
                                (number(difference.largest)) (instant(difference.at))
                                @for value in [difference.rms, difference.relative] { (number(value)) }
                                td.number { (difference.rows) }
                            }
                        }
                    }
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
            ul { @for message in run.messages.iter().take(LISTED) { li { (message.text) } } }
            @if run.messages.len() > LISTED { p { "and " (run.messages.len() - LISTED) " more." } }
        }
    }
}
