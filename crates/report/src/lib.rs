//! The report of a run: one HTML file, which needs no other file and no network.
//!
//! [`page`] reads a results file and writes interactive plots, statistics of each variable and, if it
//! is given a second results file, the difference of both; of a bus trace, the frames. [`Run`] adds what
//! only the run itself knows: the system as a graph, the algorithm and the messages.
#![forbid(unsafe_code)]

mod difference;
mod frames;
mod graph;
mod page;
mod plots;
mod statistics;
mod trace;

use std::path::Path;

use results::{Column, ColumnKind, ResultsError, Selection, Table};

use trace::Trace;

pub use difference::Difference;
pub use statistics::Statistics;

/// Largest number of variables in a report.
pub const VARIABLES: usize = 300;

/// What a report shows.
#[derive(Debug)]
pub struct Request<'a> {
    /// The results file, `.csv` or `.parquet`.
    pub results: &'a Path,
    /// A second results file, from which the first one is subtracted.
    pub against: Option<&'a Path>,
    /// The variables, by name or pattern; everything if it is empty.
    pub variables: &'a [String],
    /// The units of variables for files without units, such as CSV: name and unit.
    pub units: &'a [(String, String)],
    /// A trace of the buses in the form of candump, whose frames are shown.
    pub bus_trace: Option<&'a Path>,
    /// The run, if it is known.
    pub run: Option<&'a Run>,
}

/// What is known of a run beside its results.
#[derive(Debug, Default)]
pub struct Run {
    /// How far it came and how long it took.
    pub outcome: String,
    /// Whether it ended early.
    pub failed: bool,
    /// The FMUs, in the order of the system.
    pub fmus: Vec<Fmu>,
    /// The connections.
    pub connections: Vec<Connection>,
    /// The algorithm, and the reason of each setting.
    pub algorithm: Vec<String>,
    /// Warnings and errors of the run, in their order.
    pub messages: Vec<String>,
}

/// An FMU of a run.
#[derive(Debug)]
pub struct Fmu {
    /// Its name in the system.
    pub name: String,
    /// What it is: model, version of FMI, interface, tool.
    pub details: Vec<String>,
}

/// A connection from an output to an input; FMUs by their position in [`Run::fmus`].
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
    /// The differences to the second run, the largest relative one first.
    pub differences: Vec<Difference>,
}

/// An error of a report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A results file cannot be read.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A file has no variable with numbers.
    #[error("{file}: no variable to show, expected at least one with numbers")]
    Empty {
        /// The file.
        file: String,
    },
    /// A bus trace cannot be read.
    #[error("{file}: {source}")]
    Trace {
        /// The file.
        file: String,
        /// The reason.
        source: std::io::Error,
    },
    /// A line of a bus trace is no frame.
    #[error(
        "{file}: line {line}: expected a frame as candump writes it, such as \
         `(0.001200) can0 101#0080`, found `{found}`; `--bus-trace NAME.log` writes such a trace"
    )]
    Frame {
        /// The file.
        file: String,
        /// The number of the line.
        line: usize,
        /// Its start.
        found: String,
    },
    /// The two files have nothing in common.
    #[error("{file} and {other} have no variable in common")]
    Apart {
        /// The first file.
        file: String,
        /// The second file.
        other: String,
    },
}

/// The text by which a later report recognises a report of the results file `results`.
#[must_use]
pub fn identity(results: &Path) -> String {
    format!("aso-ftc report of {}", name(results))
}

/// Creates the report of a results file.
///
/// At most [`VARIABLES`] variables are shown; the page says how many are left out. Files are read row by
/// row: the memory does not depend on the length of the first file; of the second one, sixteen columns
/// are in memory at a time.
///
/// # Errors
///
/// [`Error`]: a file cannot be read, has no variable with numbers, or has none in common with the other.
pub fn page(request: &Request<'_>) -> Result<Page, Error> {
    let table = Table::open(request.results)?;
    let Read { positions, columns, statistics, traces, texts, left_out } = read(&table, request)?;
    let against = request.against.map(Table::open).transpose()?;
    let compared =
        against.map(|other| difference::compare(&table, &positions, &other)).transpose()?;
    if let (Some(compared), Some(other)) = (&compared, request.against)
        && compared.differences.is_empty()
    {
        return Err(Error::Apart { file: name(request.results), other: name(other) });
    }
    let frames = request.bus_trace.map(frames::read).transpose()?;
    let mut plots = plots::plots(&columns, &statistics, &traces, compared.as_ref());
    plots.extend(plots::of_frames(frames.as_deref().unwrap_or_default()));
    let content = page::Content {
        request,
        columns: &columns,
        statistics: &statistics,
        texts: &texts,
        left_out,
        frames: frames.as_deref(),
    };
    let html = page::render(&content, &plots, compared.as_ref());
    Ok(Page { html, differences: compared.map_or_else(Vec::new, |compared| compared.differences) })
}

/// The results file, read once.
struct Read {
    positions: Vec<usize>,
    columns: Vec<Column>,
    statistics: Vec<Statistics>,
    traces: Vec<Trace>,
    /// Variables that are texts.
    texts: Vec<String>,
    /// Number of variables beyond [`VARIABLES`].
    left_out: usize,
}

fn read(table: &Table, request: &Request<'_>) -> Result<Read, Error> {
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
        let mut traces = vec![Trace::default(); columns.len()];
        let visited = table.visit(positions, &mut |time, row| {
            for ((built, trace), value) in statistics.iter_mut().zip(&mut traces).zip(row) {
                built.push(time, *value);
                trace.push(time, *value);
            }
        });
        match visited {
            Ok(()) => {
                return Ok(Read {
                    positions: positions.to_vec(),
                    statistics: statistics.into_iter().map(statistics::Builder::finish).collect(),
                    columns,
                    traces,
                    texts,
                    left_out: rest.len(),
                });
            }
            // CSV states no types: a column of texts is found by its first one.
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

fn with_unit(column: &Column, request: &Request<'_>) -> Column {
    let known = request.units.iter().find(|(name, _)| *name == column.name);
    let unit = column.unit.clone().or_else(|| known.map(|(_, unit)| unit.clone()));
    Column { unit, ..column.clone() }
}

/// The name of a file, without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Whether a variable keeps its value between two rows.
fn holds(column: &Column) -> bool {
    !matches!(column.kind, ColumnKind::Real)
}
