//! The difference of two runs.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use results::{Column, ResultsError, Table};

use crate::plots::Group;
use crate::samples::{Collector, Samples};
use crate::statistics::{root, squares};
use crate::{Error, View};

/// The difference of a variable between two runs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Difference {
    /// Name of the variable.
    pub name: String,
    /// The largest absolute difference; infinite if a value differs from NaN or infinity.
    pub largest: f64,
    /// The time of the largest difference in s; NaN if the variables are equal.
    pub at: f64,
    /// The root of the mean square over [`Difference::rows`].
    pub rms: f64,
    /// Number of the compared rows, at which at least one of the runs has a value.
    pub rows: u64,
    /// The largest absolute difference, divided by the range of the variable in both runs; 0 if the runs are
    /// equal, infinite if they differ and the range is 0.
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
    /// Variables that only the other run has; empty if the user chose variables.
    pub only_there: Vec<String>,
    /// Variables of this run that are texts, which are not compared.
    pub texts: Vec<String>,
    /// Integers of this run with values that a double cannot distinguish from their neighbours.
    pub rounded: Vec<String>,
    /// Number of variables of this run that are beyond [`VARIABLES`](crate::VARIABLES) and are not compared.
    pub left_out: usize,
    /// Number of rows of this run that were compared.
    pub rows: u64,
    /// Number of rows of this run before or after the other run.
    pub outside: u64,
    /// Number of rows of the other run before or after this run; 0 if a range of time was requested.
    pub outside_there: u64,
}

impl Comparison {
    /// Whether all compared values are equal.
    #[must_use]
    pub fn is_equal(&self) -> bool {
        self.differences.iter().all(|difference| difference.largest <= 0.0)
    }

    /// Returns a sentence for each part of the runs that was not compared. `here` and `there` are the names of the two
    /// runs; a list has at most `limit` names.
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
        for (names, run) in [(&self.only_here, here), (&self.only_there, there)] {
            if !names.is_empty() {
                sentences.push(format!("only in {run}: {}", crate::listed(names, limit)));
            }
        }
        if !self.texts.is_empty() {
            sentences.push(format!("texts: {}", crate::listed(&self.texts, limit)));
        }
        if !self.rounded.is_empty() {
            let names = crate::listed(&self.rounded, limit);
            sentences.push(format!("digits of integers beyond 2^53, which are rounded: {names}"));
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

/// The comparison of two runs, and its results by column.
pub(crate) struct ComparisonResult {
    pub(crate) comparison: Comparison,
    /// Whether the other run has each of the columns.
    pub(crate) common: Vec<bool>,
    /// [`Difference::relative`] of each column; 0 for a column without a counterpart in the other run.
    pub(crate) relative: Vec<f64>,
}

/// Compares the columns at `positions` with the columns of the same names in `other`, at the times of the rows
/// of `view`. Between rows, the other run is interpolated linearly; integers and Booleans are held. Rows
/// with the same time, as at events, are compared in their order.
///
/// Also returns the rows for the plot of each group: the columns of this run, then the columns of the other run, with
/// NaN where the other run has no value.
pub(crate) fn compare(
    view: &View<'_>,
    positions: &[usize],
    groups: &[Group],
    other: &Table,
) -> Result<(ComparisonResult, Vec<Samples>), Error> {
    let table = view.table;
    let partner = |at: &usize| {
        let name = &table.columns()[*at].name;
        let partner = other.columns().iter().position(|column| column.name == *name);
        partner.filter(|partner| *partner != other.time())
    };
    let partners: Vec<Option<usize>> = positions.iter().map(partner).collect();
    let other_positions: Vec<usize> = partners.iter().flatten().copied().collect();
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(BATCHES);
        let reader = scope.spawn(move || send_rows(other, &other_positions, &sender));
        let mut series = Series::new(receiver);
        let mut sums: Vec<_> = positions.iter().map(|at| Sum::new(&table.columns()[*at])).collect();
        let collector = |group: &Group| Collector::new(2 * group.members.len(), group.block, true);
        let mut collectors: Vec<_> = groups.iter().map(collector).collect();
        let mut others = vec![f64::NAN; positions.len()];
        let mut comparison = Comparison::default();
        view.visit(positions, &mut |time, row| {
            let fraction = series.advance_to(time);
            let count =
                if fraction.is_some() { &mut comparison.rows } else { &mut comparison.outside };
            *count += 1;
            let mut column = 0;
            for ((sum, value), (partner, other)) in
                sums.iter_mut().zip(row).zip(partners.iter().zip(&mut others))
            {
                *other = f64::NAN;
                if partner.is_none() {
                    continue;
                }
                if let Some(fraction) = fraction {
                    *other = series.value(column, fraction, sum.is_held);
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
        let outside_there = series.outside();
        reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        if !view.is_part() {
            comparison.outside_there = outside_there;
        }
        let common: Vec<bool> = partners.iter().map(Option::is_some).collect();
        let differences: Vec<_> = sums.into_iter().map(Sum::finish).collect();
        let relative = differences.iter().map(|difference| difference.relative).collect();
        let compared = differences.into_iter().zip(&common).filter(|(_, is_common)| **is_common);
        comparison.differences = compared.map(|(difference, _)| difference).collect();
        comparison.differences.sort_by(|one, other| other.relative.total_cmp(&one.relative));
        let samples = collectors.into_iter().map(Collector::finish).collect();
        Ok((ComparisonResult { comparison, common, relative }, samples))
    })
}

/// Returns the names of the columns of `table` at `positions` that `other` does not have, except the time.
pub(crate) fn missing(table: &Table, positions: &[usize], other: &Table) -> Vec<String> {
    let columns = positions.iter().filter(|at| **at != table.time());
    let names = columns.map(|at| &table.columns()[*at].name);
    let is_missing = |name: &&String| other.columns().iter().all(|column| column.name != **name);
    names.filter(is_missing).cloned().collect()
}

/// Number of rows of the other run that the reading thread sends at once.
const BATCH: usize = 1024;
/// Largest number of batches of rows that wait for the comparison.
const BATCHES: usize = 8;

/// A row: its time and its values.
type Row = (f64, Vec<f64>);

/// Sends the rows of a file in batches.
fn send_rows(
    table: &Table,
    positions: &[usize],
    sender: &SyncSender<VecDeque<Row>>,
) -> Result<(), ResultsError> {
    let mut rows = VecDeque::new();
    // A send fails only after the comparison has ended by an error, which is reported instead.
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

/// The rows of the other run around the present time of the comparison.
struct Series {
    receiver: Receiver<VecDeque<Row>>,
    /// The rows of the last batch received that follow `next`.
    rows: VecDeque<Row>,
    /// The last row up to the present time.
    before: Option<Row>,
    /// The row after `before`.
    next: Option<Row>,
    /// The times of the first and of the last call of [`Series::advance_to`].
    requested: Option<(f64, f64)>,
    /// Number of rows before the first requested time.
    early: u64,
}

impl Series {
    fn new(receiver: Receiver<VecDeque<Row>>) -> Self {
        let rows = VecDeque::new();
        let (before, next, requested) = (None, None, None);
        let mut series = Self { receiver, rows, before, next, requested, early: 0 };
        series.advance();
        series
    }

    /// Waits for the next row and advances by one row.
    fn advance(&mut self) {
        if self.rows.is_empty() {
            self.rows = self.receiver.recv().unwrap_or_default();
        }
        self.before =
            std::mem::replace(&mut self.next, self.rows.pop_front()).or(self.before.take());
    }

    /// Advances to `time`, which must not decrease from call to call. Returns the position of `time` between the rows
    /// `before` (0) and `next` (1), `None` outside of the run. If several rows have this time, each further call with
    /// this time advances by one row.
    #[expect(clippy::float_cmp, reason = "rows of the same time")]
    fn advance_to(&mut self, time: f64) -> Option<f64> {
        let is_first = self.requested.is_none();
        self.requested = Some((self.requested.map_or(time, |(first, _)| first), time));
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

    /// Returns the value of a column at the position `fraction` between the two rows: interpolated linearly, or the
    /// value of the row `before` if the column is held.
    fn value(&self, column: usize, fraction: f64, is_held: bool) -> f64 {
        let value = |row: &Option<Row>| row.as_ref().map_or(f64::NAN, |row| row.1[column]);
        if is_held || fraction == 0.0 {
            return value(&self.before);
        }
        value(&self.before) * (1.0 - fraction) + value(&self.next) * fraction
    }

    /// Reads the remaining rows. Returns the number of rows outside of the times of the first and the last call of
    /// [`Series::advance_to`]; 0 without a call.
    fn outside(&mut self) -> u64 {
        let Some((_, last)) = self.requested else { return 0 };
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
    /// Whether the variable keeps its value between two rows, so that it is not interpolated.
    is_held: bool,
    /// The largest absolute difference and the time of this difference.
    largest: (f64, f64),
    /// Sums of the [`squares`] of the differences.
    squares: [f64; 3],
    rows: u64,
    /// The smallest and the largest finite value of both runs.
    range: (f64, f64),
}

impl Sum {
    fn new(column: &Column) -> Self {
        Self {
            name: column.name.clone(),
            is_held: column.is_held(),
            largest: (0.0, f64::NAN),
            squares: [0.0; 3],
            rows: 0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
        }
    }

    fn push(&mut self, time: f64, value: f64, other: f64) {
        if value.is_nan() && other.is_nan() {
            return;
        }
        // A value that is not finite differs by infinity from every other value.
        let difference = if value.to_bits() == other.to_bits() { 0.0 } else { value - other };
        let size = if difference.is_nan() { f64::INFINITY } else { difference.abs() };
        if size > self.largest.0 {
            self.largest = (size, time);
        }
        self.squares.iter_mut().zip(squares(size)).for_each(|(sum, square)| *sum += square);
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
        let rms = root(self.squares.map(|sum| sum / rows));
        Difference { name: self.name, largest, at, rms, rows: self.rows, relative }
    }
}
