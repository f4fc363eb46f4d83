//! The difference of two runs.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use results::{Column, ResultsError, Table};

use crate::plots::Group;
use crate::samples::{Collector, Samples};
use crate::statistics::{SCALE, root};
use crate::{Error, View};

/// How much a variable differs from that of another run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Difference {
    /// The variable.
    pub name: String,
    /// The largest absolute difference.
    pub largest: f64,
    /// Its time in s.
    pub at: f64,
    /// The root of the mean square over [`Difference::rows`].
    pub rms: f64,
    /// The number of rows that were compared: those at which one of the runs has a value.
    pub rows: u64,
    /// The largest absolute difference, divided by the range of the variable in both runs; 0 if they are
    /// equal, infinite if only the range is 0.
    pub relative: f64,
}

/// The comparison of a run with another one.
#[derive(Debug, Default)]
#[non_exhaustive]
pub struct Comparison {
    /// The differences, the largest relative one first.
    pub differences: Vec<Difference>,
    /// Variables that only this run has.
    pub only_here: Vec<String>,
    /// Variables that only the other run has; empty if variables were chosen.
    pub only_there: Vec<String>,
    /// Variables of this run that are texts, which are not compared.
    pub texts: Vec<String>,
    /// Number of variables of this run that are beyond [`VARIABLES`](crate::VARIABLES) and are not compared.
    pub left_out: usize,
    /// Number of rows of this run that were compared.
    pub rows: u64,
    /// Number of rows of this run outside of the time of the other one.
    pub outside: u64,
    /// Number of rows of the other run outside of the time of this one.
    pub outside_there: u64,
}

impl Comparison {
    /// Whether all that was compared is equal.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        self.differences.iter().all(|difference| difference.largest <= 0.0)
    }

    /// Returns a sentence for each part of the runs that was not compared. `here` and `there` name them; a list has at
    /// most `limit` names.
    #[must_use]
    pub fn uncompared(&self, here: &str, there: &str, limit: usize) -> Vec<String> {
        let rows =
            |count: u64| if count == 1 { "1 row".to_owned() } else { format!("{count} rows") };
        let mut sentences = Vec::new();
        for (count, one, other) in [(self.outside, here, there), (self.outside_there, there, here)]
        {
            if count > 0 {
                sentences.push(format!("{} of {one} outside of the time of {other}", rows(count)));
            }
        }
        for (names, whose) in [(&self.only_here, here), (&self.only_there, there)] {
            if !names.is_empty() {
                sentences.push(format!("only in {whose}: {}", crate::listed(names, limit)));
            }
        }
        if !self.texts.is_empty() {
            sentences.push(format!("texts: {}", crate::listed(&self.texts, limit)));
        }
        if self.left_out > 0 {
            sentences.push(format!(
                "{} more variables of {here}; --variables chooses them",
                self.left_out
            ));
        }
        sentences
    }
}

/// What two runs have in common.
pub(crate) struct Compared {
    pub(crate) comparison: Comparison,
    /// Whether the other run has each of the columns.
    pub(crate) common: Vec<bool>,
    /// By column: the largest difference divided by the range of the column, or 0 for a column that the other run lacks.
    pub(crate) relative: Vec<f64>,
}

/// Compares the columns at `positions` with those of the same names in `other`, at the times of the rows
/// of `view`. Between rows, the other run is interpolated linearly; integers and Booleans are held. Rows
/// with the same time, as at events, are compared in their order. Also returns the rows that the plots of the groups
/// have: the columns of this run, then those of the other one, which are NaN where it has no value.
pub(crate) fn compare(
    view: &View<'_>,
    positions: &[usize],
    groups: &[Group],
    other: &Table,
) -> Result<(Compared, Vec<Samples>), Error> {
    let table = view.table;
    let named =
        |table: &Table, name: &str| table.columns().iter().position(|column| column.name == name);
    let there =
        |at: usize| named(other, &table.columns()[at].name).filter(|there| *there != other.time());
    let partners: Vec<Option<usize>> = positions.iter().map(|at| there(*at)).collect();
    let positions_there: Vec<usize> = partners.iter().flatten().copied().collect();
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(BATCHES);
        let reader = scope.spawn(move || pass_on(other, &positions_there, &sender));
        let mut series = Series::new(receiver);
        let mut sums: Vec<_> = positions.iter().map(|at| Sum::new(&table.columns()[*at])).collect();
        let collector = |group: &Group| Collector::new(2 * group.members.len(), group.block, true);
        let mut collectors: Vec<_> = groups.iter().map(collector).collect();
        let mut others = vec![f64::NAN; positions.len()];
        let mut comparison = Comparison::default();
        view.visit(positions, &mut |time, row| {
            let part = series.advance_to(time);
            let count = if part.is_some() { &mut comparison.rows } else { &mut comparison.outside };
            *count += 1;
            let mut column = 0;
            for ((sum, value), (there, other)) in
                sums.iter_mut().zip(row).zip(partners.iter().zip(&mut others))
            {
                *other = f64::NAN;
                if there.is_none() {
                    continue;
                }
                if let Some(part) = part {
                    *other = series.value(column, part, sum.holds);
                    sum.push(time, *value, *other);
                }
                column += 1;
            }
            for (group, collector) in groups.iter().zip(&mut collectors) {
                let members = || group.members.iter();
                collector.push(
                    time,
                    members().map(|at| row[*at]).chain(members().map(|at| others[*at])),
                );
            }
        })?;
        let outside = series.outside();
        reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        if !view.is_part() {
            comparison.outside_there = outside;
        }
        let common: Vec<bool> = partners.iter().map(Option::is_some).collect();
        let differences: Vec<_> = sums.into_iter().map(Sum::finish).collect();
        let relative = differences.iter().map(|difference| difference.relative).collect();
        let compared = differences.into_iter().zip(&common).filter(|(_, is)| **is);
        comparison.differences = compared.map(|(difference, _)| difference).collect();
        comparison.differences.sort_by(|one, other| other.relative.total_cmp(&one.relative));
        let samples = collectors.into_iter().map(Collector::finish).collect();
        Ok((Compared { comparison, common, relative }, samples))
    })
}

/// Returns the names of the columns of `all` but the time that `rest` does not have.
pub(crate) fn missing<'a>(all: &'a Table, positions: &[usize], rest: &Table) -> Vec<String> {
    let columns = positions.iter().filter(|at| **at != all.time()).map(|at| &all.columns()[*at]);
    let is_missing =
        |column: &&'a Column| rest.columns().iter().all(|other| other.name != column.name);
    columns.filter(is_missing).map(|column| column.name.clone()).collect()
}

/// Rows of a file that a thread passes on at once, and the number of such batches that wait.
const BATCH: usize = 1024;
const BATCHES: usize = 8;

/// A row: its time and its values.
type Row = (f64, Vec<f64>);

/// Passes on the rows of a file in batches.
fn pass_on(
    table: &Table,
    positions: &[usize],
    sender: &SyncSender<VecDeque<Row>>,
) -> Result<(), ResultsError> {
    let mut rows = VecDeque::new();
    // Without a receiver, the comparison has ended by an error.
    let send = |rows: &mut VecDeque<Row>| drop(sender.send(std::mem::take(rows)));
    table.visit(positions, &mut |time, row| {
        rows.push_back((time, row.to_vec()));
        if rows.len() == BATCH {
            send(&mut rows);
        }
    })?;
    send(&mut rows);
    Ok(())
}

/// The rows of the other run: the last one up to a time, and the next one.
struct Series {
    receiver: Receiver<VecDeque<Row>>,
    rows: VecDeque<Row>,
    before: Option<Row>,
    next: Option<Row>,
    /// The first and the last time asked for.
    asked: Option<(f64, f64)>,
    /// Number of rows before the first time asked for.
    early: u64,
}

impl Series {
    fn new(receiver: Receiver<VecDeque<Row>>) -> Self {
        let rows = VecDeque::new();
        let mut series = Self { receiver, rows, before: None, next: None, asked: None, early: 0 };
        series.advance();
        series
    }

    fn advance(&mut self) {
        if self.rows.is_empty() {
            self.rows = self.receiver.recv().unwrap_or_default();
        }
        self.before =
            std::mem::replace(&mut self.next, self.rows.pop_front()).or(self.before.take());
    }

    /// Advances to `time`, which does not decrease from call to call; returns the part of the way to the next row, None
    /// outside of the run.
    #[expect(clippy::float_cmp, reason = "rows of the same time")]
    fn advance_to(&mut self, time: f64) -> Option<f64> {
        let is_first = self.asked.is_none();
        self.asked = Some((self.asked.map_or(time, |(first, _)| first), time));
        while self.next.as_ref().is_some_and(|next| next.0 < time) {
            self.early += u64::from(is_first);
            self.advance();
        }
        if self.next.as_ref().is_some_and(|next| next.0 == time) {
            self.advance();
            return Some(0.0);
        }
        let start = self.before.as_ref()?.0;
        if start == time {
            return Some(0.0);
        }
        let end = self.next.as_ref()?.0;
        Some((time - start) / (end - start))
    }

    fn value(&self, column: usize, part: f64, holds: bool) -> f64 {
        let value = |row: &Option<Row>| row.as_ref().map_or(f64::NAN, |row| row.1[column]);
        if holds || part == 0.0 {
            return value(&self.before);
        }
        value(&self.before) * (1.0 - part) + value(&self.next) * part
    }

    /// Reads the rest, and returns the number of rows before the first and after the last time asked for.
    fn outside(&mut self) -> u64 {
        let Some((_, last)) = self.asked else { return 0 };
        let mut outside = self.early;
        while let Some(next) = &self.next {
            outside += u64::from(next.0 > last);
            self.advance();
        }
        outside
    }
}

/// Collects the difference of a variable row by row.
struct Sum {
    name: String,
    holds: bool,
    largest: (f64, f64),
    squares: f64,
    /// Sum of the squares of the scaled differences, for differences whose squares overflow.
    scaled_squares: f64,
    rows: u64,
    range: (f64, f64),
}

impl Sum {
    fn new(column: &Column) -> Self {
        Self {
            name: column.name.clone(),
            holds: crate::holds(column),
            largest: (0.0, f64::NAN),
            squares: 0.0,
            scaled_squares: 0.0,
            rows: 0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
        }
    }

    fn push(&mut self, time: f64, value: f64, other: f64) {
        if value.is_nan() && other.is_nan() {
            return;
        }
        // A value that is not finite differs from any number.
        let difference = if value.to_bits() == other.to_bits() { 0.0 } else { value - other };
        let size = if difference.is_nan() { f64::INFINITY } else { difference.abs() };
        if size > self.largest.0 {
            self.largest = (size, time);
        }
        self.squares += size * size;
        self.scaled_squares += (size * SCALE) * (size * SCALE);
        self.rows += 1;
        for finite in [value, other].into_iter().filter(|value| value.is_finite()) {
            self.range = (self.range.0.min(finite), self.range.1.max(finite));
        }
    }

    fn finish(self) -> Difference {
        let (largest, at) = self.largest;
        let range = (self.range.1 - self.range.0).max(0.0);
        let relative = if largest > 0.0 { largest / range } else { 0.0 };
        #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53 rows")]
        let rows = self.rows.max(1) as f64;
        let rms = root(self.squares / rows, self.scaled_squares / rows);
        Difference { name: self.name, largest, at, rms, rows: self.rows, relative }
    }
}
