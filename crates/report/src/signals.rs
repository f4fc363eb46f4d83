//! The FMU of each variable of a report, and the order in which variables are shown.

use std::collections::HashSet;

use results::{Column, Selection};

use crate::{Connection, Run};

/// Largest number of FMUs that are taken from the names of the columns, if the run is not known.
const NAMED: usize = 8;

/// The importance of a variable: lower ranks are shown first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Rank {
    /// The configuration plots the variable.
    Asked,
    /// A connected output, or an input on which a fault acts.
    Connected,
    /// An output without a connection.
    Output,
    /// Any other variable.
    Other,
}

/// The FMU and the rank of each variable, by the position of its column.
pub(crate) struct Signals {
    /// The names of the FMUs in the order of the system, then an empty name for variables of no FMU.
    pub(crate) fmus: Vec<String>,
    /// The position of each variable's FMU in `fmus`.
    pub(crate) fmu_positions: Vec<usize>,
    /// The rank of each variable; [`Rank::Other`] for all if the run is not known.
    pub(crate) ranks: Vec<Rank>,
}

impl Signals {
    pub(crate) fn new(columns: &[Column], run: Option<&Run>) -> Self {
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        let mut fmus = run.map_or_else(
            || first_parts(&names),
            |run| run.fmus.iter().map(|fmu| fmu.name.clone()).collect(),
        );
        fmus.push(String::new());
        let fmu_positions = names.iter().map(|name| position(&fmus, name)).collect();
        let ranks = match run {
            Some(run) => ranks(&names, run),
            None => vec![Rank::Other; names.len()],
        };
        Self { fmus, fmu_positions, ranks }
    }
}

/// Returns the distinct parts of the names before the first point; none if a name has no point or if there are more
/// than [`NAMED`] parts.
fn first_parts(names: &[&str]) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    for name in names {
        match name.split_once('.') {
            Some((part, _)) if parts.iter().any(|known| known == part) => {}
            Some((part, _)) if parts.len() < NAMED => parts.push(part.to_owned()),
            _ => return Vec::new(),
        }
    }
    parts
}

/// Returns the position in `fmus` of the longest FMU name that `name` starts with; the last position if there is none.
fn position(fmus: &[String], name: &str) -> usize {
    let is_of = |fmu: &str| name.strip_prefix(fmu).is_some_and(|rest| rest.starts_with('.'));
    let matching = fmus.iter().enumerate().filter(|(_, fmu)| !fmu.is_empty() && is_of(fmu));
    matching.max_by_key(|(_, fmu)| fmu.len()).map_or(fmus.len() - 1, |(at, _)| at)
}

/// Returns the ranks of the variables; patterns of plots that match nothing have no effect.
fn ranks(names: &[&str], run: &Run) -> Vec<Rank> {
    let selection = Selection { include: run.plotted.clone(), exclude: Vec::new() };
    let chosen = if run.plotted.is_empty() { Ok(Vec::new()) } else { selection.choose(names) };
    let asked: HashSet<usize> = chosen.unwrap_or_default().into_iter().collect();
    let fmu = |at: usize| run.fmus.get(at).map_or("", |fmu| fmu.name.as_str());
    let source =
        |connection: &Connection| format!("{}.{}", fmu(connection.from), connection.output);
    let mut connected: HashSet<String> = run.connections.iter().map(source).collect();
    connected.extend(run.disturbed.iter().cloned());
    let outputs: HashSet<&str> = run.outputs.iter().map(String::as_str).collect();
    let rank = |(at, name): (usize, &&str)| {
        if asked.contains(&at) {
            Rank::Asked
        } else if connected.contains(*name) {
            Rank::Connected
        } else if outputs.contains(*name) {
            Rank::Output
        } else {
            Rank::Other
        }
    };
    names.iter().enumerate().map(rank).collect()
}
