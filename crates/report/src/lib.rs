//! The report of a run: one HTML file, which needs no other file and no network.
//!
//! [`page`] reads a results file and writes interactive plots and statistics of each variable; with a second results
//! file, the difference of both; with a bus trace, its frames. [`Run`] adds what the results file does not contain:
//! the system as a graph, the algorithm and the messages.
#![forbid(unsafe_code)]

mod columns;
mod difference;
mod frames;
mod graph;
mod page;
mod pictures;
mod plots;
mod samples;
mod signals;
mod statistics;

use std::path::Path;

use results::{Column, ColumnKind, ResultsError, Selection, Table};

use plots::{Group, Plots};
use samples::{Collector, Samples};
use serde::Serialize;
use signals::Signals;

pub use difference::{Comparison, Difference};
pub use statistics::{Basis, Statistics};

/// Largest number of variables in a report.
pub const VARIABLES: usize = 300;

/// Largest number of marks of each kind on the time axis.
const MARKS: usize = 1000;

/// The request for a report: its input files and the selected part.
#[derive(Debug)]
pub struct Request<'a> {
    /// The results file, of a format that [`Table`] reads.
    pub results: &'a Path,
    /// A second results file, from which the first one is subtracted.
    pub against: Option<&'a Path>,
    /// The variables to show, by name or pattern; if the list is empty, all variables.
    pub variables: &'a [String],
    /// The first and the last time of the rows that are read, in s; negative and positive infinity stand for the start
    /// and the end of the file.
    pub range: (f64, f64),
    /// The units of variables for files without units, such as CSV: name and unit.
    pub units: &'a [(String, String)],
    /// A trace of the buses in the form of candump, whose frames are shown.
    pub bus_trace: Option<&'a Path>,
    /// The properties of the run, if known.
    pub run: Option<&'a Run>,
}

/// The properties of a run that its results file does not contain.
#[derive(Debug, Default)]
pub struct Run {
    /// A sentence on the time reached and the duration of the run.
    pub outcome: String,
    /// Whether the run ended early.
    pub failed: bool,
    /// The FMUs, in the order of the system.
    pub fmus: Vec<Fmu>,
    /// The connections.
    pub connections: Vec<Connection>,
    /// The names of the outputs, such as `plant.x_p`.
    pub outputs: Vec<String>,
    /// Names of the connected inputs on which a fault acts, so that their values differ from the connected outputs.
    pub disturbed: Vec<String>,
    /// Variables, by name or pattern, whose plot the configuration requests.
    pub plotted: Vec<String>,
    /// Sentences on the algorithm and the reason of each setting.
    pub algorithm: Vec<String>,
    /// Changes and faults of the scenario, and interventions.
    pub marks: Vec<Mark>,
    /// Warnings and errors of the run, in their order.
    pub messages: Vec<Message>,
}

/// A warning or an error of a run.
#[derive(Clone, Debug)]
pub struct Message {
    /// Simulated time in s, if the message has one.
    pub time: Option<f64>,
    /// The sentence.
    pub text: String,
}

/// A mark on the time axis, for an event of the run.
#[derive(Clone, Debug, Serialize)]
pub struct Mark {
    /// The kind of the mark.
    pub kind: MarkKind,
    /// Time or start of the event in s.
    pub time: f64,
    /// End of the event in s; `None` for an instant.
    pub end: Option<f64>,
    /// Description of the event.
    pub text: String,
}

/// The kind of a [`Mark`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MarkKind {
    /// The scenario sets a variable.
    Change,
    /// The scenario disturbs a connection.
    Fault,
    /// The user changed the run while it was running.
    Intervention,
    /// A warning or an error.
    Message,
}

impl MarkKind {
    fn name(self) -> &'static str {
        match self {
            Self::Change => "change",
            Self::Fault => "fault",
            Self::Intervention => "intervention",
            Self::Message => "message",
        }
    }
}

/// An FMU of a run.
#[derive(Debug)]
pub struct Fmu {
    /// The name of the FMU in the system.
    pub name: String,
    /// Model, version of FMI, interface and tool.
    pub details: Vec<String>,
}

/// A connection from an output to an input. FMUs are stated by their position in [`Run::fmus`].
#[derive(Debug)]
pub struct Connection {
    /// The FMU of the output.
    pub from: usize,
    /// The name of the output.
    pub output: String,
    /// The FMU of the input.
    pub to: usize,
    /// The name of the input.
    pub input: String,
}

/// A report.
#[derive(Debug)]
#[non_exhaustive]
pub struct Page {
    /// The HTML document.
    pub html: String,
    /// The comparison with the second run, if there is one.
    pub comparison: Option<Comparison>,
}

/// An error of a report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum Error {
    /// A results file cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A file has no variable with numbers.
    #[error(
        "{file}: no variable to show, expected at least one with numbers beside the time; CSV has commas, semicolons \
         or tabs between its values"
    )]
    Empty { file: String },
    /// A file has no row in the range of time.
    #[error("{file}: no row {}", interval((*from, *to)))]
    NoRows {
        file: String,
        /// The start of the range; negative infinity: the start of the file.
        from: f64,
        /// The end of the range; positive infinity: the end of the file.
        to: f64,
    },
    /// A bus trace cannot be read.
    #[error("{file}: {source}")]
    Trace { file: String, source: std::io::Error },
    /// A line of a bus trace is no frame.
    #[error(
        "{file}: line {line}: expected a frame as candump writes it, such as \
         `(0.001200) can0 101#0080`, found `{actual}`; `--bus-trace NAME.log` writes such a trace"
    )]
    Frame { file: String, line: usize, actual: String },
    /// The two files have no variable with numbers in common.
    #[error("{file} and {other} have no variable in common")]
    Apart { file: String, other: String },
}

/// Returns the text that marks a report of a results file of this name, in any folder. A later report of such a file
/// may replace a page that contains this text. Characters that HTML escapes are replaced by `_`.
#[must_use]
pub fn identity(results: &Path) -> String {
    let identity = format!("aso-ftc report of {}", name(results));
    identity.replace(|sign: char| "&<>\"".contains(sign) || sign.is_control(), "_")
}

/// Creates the report of a results file.
///
/// At most [`VARIABLES`] variables are shown; the page says how many are left out. The plots have all rows, unless
/// these are more than two million values; then each plot says how many of the rows it has. Files are read row by row
/// (the first one twice: for the statistics, then for the plots), so that long files need no more memory.
///
/// # Errors
///
/// [`Error`]: a file cannot be read, has no variable with numbers, no row in the requested range, or no variable in
/// common with the other file; a requested variable does not exist; a line of the bus trace is no frame.
pub fn page(request: &Request<'_>) -> Result<Page, Error> {
    let table = Table::open(request.results)?;
    let view = View { table: &table, range: request.range };
    let read = read(&view, request)?;
    let FirstPass { positions, columns, statistics, texts, .. } = &read;
    let (rows, left_out) = (read.rows, read.left_out);
    if rows == 0 && view.is_part() {
        let (from, to) = request.range;
        return Err(Error::NoRows { file: name(request.results), from, to });
    }
    let signals = Signals::new(columns, request.run);
    let groups = plots::groups(columns, statistics, &signals, rows, request.against.is_some());
    let rounded = rounded(columns, statistics);
    let (compared, samples) = match request.against {
        Some(path) => {
            let other = Table::open(path)?;
            let (mut compared, samples) = difference::compare(&view, positions, &groups, &other)?;
            let comparison = &mut compared.comparison;
            if comparison.differences.is_empty() {
                return Err(Error::Apart { file: name(request.results), other: name(path) });
            }
            comparison.only_here = difference::missing(&table, positions, &other);
            if request.variables.is_empty() {
                let all: Vec<usize> = (0..other.columns().len()).collect();
                comparison.only_there = difference::missing(&other, &all, &table);
            }
            (comparison.texts, comparison.left_out) = (texts.clone(), left_out);
            comparison.rounded.clone_from(&rounded);
            (Some(compared), samples)
        }
        None => (None, collect(&view, positions, &groups)?),
    };
    let frames = request.bus_trace.map(|path| frames::read(path, request.range)).transpose()?;
    let mut plots = Plots::default();
    let is_compared = compared.as_ref().map_or(&[][..], |compared| &compared.common);
    let difference = |group: &Group| {
        let relative = compared.as_ref().map(|compared| &compared.relative);
        let relative = relative.map(|all| group.members.iter().map(|at| all[*at]));
        relative.into_iter().flatten().fold(0.0, f64::max)
    };
    let all = groups.iter().zip(&samples);
    let (mut drawn, flat): (Vec<_>, Vec<_>) =
        all.partition(|(group, _)| !group.is_flat || difference(group) > 0.0);
    drawn.sort_by(|one, other| difference(other.0).total_cmp(&difference(one.0)));
    plots.add_all(&drawn, columns, &signals.fmus, is_compared);
    plots.add_frames(frames.as_deref().unwrap_or_default());
    let content = page::Content {
        request,
        columns,
        statistics,
        flat: flat.iter().flat_map(|(group, _)| &group.members).copied().collect(),
        events: &read.events,
        span: &read.span,
        texts,
        rounded: &rounded,
        left_out,
        frames: frames.as_deref(),
        comparison: compared.as_ref().map(|compared| &compared.comparison),
        picture: pictures::svg(&name(request.results), &drawn, columns),
    };
    let html = page::render(&content, &plots);
    Ok(Page { html, comparison: compared.map(|compared| compared.comparison) })
}

/// The rows of a file in a range of time.
struct View<'a> {
    table: &'a Table,
    range: (f64, f64),
}

impl View<'_> {
    fn visit(
        &self,
        positions: &[usize],
        visitor: &mut dyn FnMut(f64, &[f64]),
    ) -> Result<(), ResultsError> {
        let (from, to) = self.range;
        self.table.visit(positions, &mut |time, row| {
            if (from..=to).contains(&time) {
                visitor(time, row);
            }
        })
    }

    /// Whether rows of the file may be outside of the range.
    fn is_part(&self) -> bool {
        self.range.0.is_finite() || self.range.1.is_finite()
    }
}

/// Collects the rows of the plots.
fn collect(view: &View<'_>, positions: &[usize], groups: &[Group]) -> Result<Vec<Samples>, Error> {
    let collector = |group: &Group| Collector::new(group.members.len(), group.block, false);
    let mut collectors: Vec<_> = groups.iter().map(collector).collect();
    view.visit(positions, &mut |time, row| {
        for (group, collector) in groups.iter().zip(&mut collectors) {
            collector.push(time, group.members.iter().map(|at| row[*at]));
        }
    })?;
    Ok(collectors.into_iter().map(Collector::finish).collect())
}

/// The result of the first pass over the results file.
struct FirstPass {
    /// The positions of the variables in the file.
    positions: Vec<usize>,
    columns: Vec<Column>,
    statistics: Vec<Statistics>,
    /// The number of rows.
    rows: usize,
    /// The first and the last time; empty without rows.
    span: Vec<f64>,
    events: Events,
    /// Variables that are texts.
    texts: Vec<String>,
    /// Number of variables beyond [`VARIABLES`].
    left_out: usize,
}

/// Reads the results file for the statistics, once, and again for each column of a CSV file that turns out to be texts.
fn read(view: &View<'_>, request: &Request<'_>) -> Result<FirstPass, Error> {
    let table = view.table;
    let selection = Selection { include: request.variables.to_vec(), exclude: Vec::new() };
    let mut chosen = table.choose(&selection)?;
    chosen.retain(|at| *at != table.time());
    let kind = |at: &usize| table.columns()[*at].kind;
    let (text, mut chosen): (Vec<_>, Vec<_>) =
        chosen.into_iter().partition(|at| kind(at) == ColumnKind::String);
    let mut texts: Vec<_> = text.iter().map(|at| table.columns()[*at].name.clone()).collect();
    loop {
        let (positions, rest) = chosen.split_at(chosen.len().min(VARIABLES));
        if positions.is_empty() {
            return Err(Error::Empty { file: name(request.results) });
        }
        let columns: Vec<_> =
            positions.iter().map(|at| with_unit(&table.columns()[*at], request)).collect();
        let mut statistics: Vec<_> = columns.iter().map(statistics::Builder::new).collect();
        let (mut rows, mut span, mut events) = (0, Vec::new(), Events::default());
        let visited = view.visit(positions, &mut |time, row| {
            rows += 1;
            span.truncate(1);
            span.push(time);
            events.push(time);
            statistics.iter_mut().zip(row).for_each(|(builder, value)| builder.push(time, *value));
        });
        match visited {
            Ok(()) => {
                return Ok(FirstPass {
                    positions: positions.to_vec(),
                    statistics: statistics.into_iter().map(statistics::Builder::finish).collect(),
                    columns,
                    rows,
                    span,
                    events,
                    texts,
                    left_out: rest.len(),
                });
            }
            // CSV states no types: a column of texts is recognised by its first text.
            Err(ResultsError::Number { name, .. })
                if columns.iter().any(|column| column.name == name) =>
            {
                chosen.retain(|at| table.columns()[*at].name != name);
                texts.push(name);
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// The times that occur in several consecutive rows, such as the times of events.
#[derive(Default)]
struct Events {
    /// The first [`MARKS`] times of this kind.
    times: Vec<f64>,
    /// The number of all such times.
    count: usize,
    /// The time of the row before.
    previous: Option<f64>,
    /// The last time that occurred in several rows.
    last_event: Option<f64>,
}

impl Events {
    fn push(&mut self, time: f64) {
        if self.previous == Some(time) && self.last_event != Some(time) {
            self.last_event = Some(time);
            self.count += 1;
            if self.times.len() < MARKS {
                self.times.push(time);
            }
        }
        self.previous = Some(time);
    }
}

/// Returns the column with the unit of the request, if the file states none.
fn with_unit(column: &Column, request: &Request<'_>) -> Column {
    let known = request.units.iter().find(|(name, _)| *name == column.name);
    let unit = column.unit.clone().or_else(|| known.map(|(_, unit)| unit.clone()));
    Column { unit, ..column.clone() }
}

/// Formats a range of times for a sentence; one end may be infinite.
fn interval((from, to): (f64, f64)) -> String {
    if from.is_infinite() {
        format!("up to t = {to} s")
    } else if to.is_infinite() {
        format!("from t = {from} s on")
    } else {
        format!("from t = {from} s to t = {to} s")
    }
}

/// Returns the name of a file, without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Returns the names of the integers with values that a double cannot distinguish from their neighbours.
fn rounded(columns: &[Column], statistics: &[Statistics]) -> Vec<String> {
    let is_rounded = |(column, of): &(&Column, &Statistics)| {
        let size = of.smallest.0.abs().max(of.largest.0.abs());
        matches!(column.kind, ColumnKind::Integer | ColumnKind::Long) && size >= 2_f64.powi(53)
    };
    let rounded = columns.iter().zip(statistics).filter(is_rounded);
    rounded.map(|(column, _)| column.name.clone()).collect()
}

/// Formats names for a sentence: at most `limit` of them, and the number of further ones.
fn listed(names: &[String], limit: usize) -> String {
    let more = names.len().saturating_sub(limit);
    let shown = names.iter().take(limit).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}
