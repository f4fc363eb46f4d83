//! The difference of two runs.

use results::{Column, Table};

use crate::plots::Group;
use crate::samples::{Collector, Samples};
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
    pub(crate) is_compared: Vec<bool>,
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
    let mut comparison = Comparison::default();
    let mut samples = Vec::new();
    for group in groups {
        let members = group.members.iter().map(|at| (positions[*at], partners[*at]));
        let (here, there): (Vec<usize>, Vec<Option<usize>>) = members.unzip();
        let mut series = Series::read(other, &there.iter().flatten().copied().collect::<Vec<_>>())?;
        let mut sums: Vec<_> = here.iter().map(|at| Sum::new(&table.columns()[*at])).collect();
        let mut collector = Collector::new(2 * here.len(), group.block, true);
        let mut others = vec![f64::NAN; here.len()];
        let mut times: Option<(f64, f64)> = None;
        (comparison.rows, comparison.outside) = (0, 0);
        view.visit(&here, &mut |time, row| {
            let place = series.at(time);
            let mut column = 0;
            for ((sum, value), (there, other)) in
                sums.iter_mut().zip(row).zip(there.iter().zip(&mut others))
            {
                *other = f64::NAN;
                if there.is_none() {
                    continue;
                }
                if let Some(place) = place {
                    *other = series.value(column, place, sum.holds);
                    sum.push(time, *value, *other);
                }
                column += 1;
            }
            let count =
                if place.is_some() { &mut comparison.rows } else { &mut comparison.outside };
            *count += 1;
            times = Some((times.map_or(time, |(first, _)| first), time));
            collector.push(time, row.iter().chain(&others).copied());
        })?;
        if let Some((first, last)) = times.filter(|_| !view.is_part()) {
            let beyond = series.time.iter().filter(|time| !(first..=last).contains(*time));
            comparison.outside_there = beyond.count() as u64;
        }
        let compared = sums.into_iter().zip(&there).filter(|(_, there)| there.is_some());
        comparison.differences.extend(compared.map(|(sum, _)| sum.finish()));
        samples.push(collector.finish());
    }
    comparison.differences.sort_by(|one, other| other.relative.total_cmp(&one.relative));
    Ok((
        Compared { comparison, is_compared: partners.iter().map(Option::is_some).collect() },
        samples,
    ))
}

/// Returns the names of the columns of `all` but the time that `rest` does not have.
pub(crate) fn missing<'a>(all: &'a Table, positions: &[usize], rest: &Table) -> Vec<String> {
    let columns = positions.iter().filter(|at| **at != all.time()).map(|at| &all.columns()[*at]);
    let is_missing =
        |column: &&'a Column| rest.columns().iter().all(|other| other.name != column.name);
    columns.filter(is_missing).map(|column| column.name.clone()).collect()
}

/// Columns of the other run.
struct Series {
    time: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// The first row that was not used yet.
    next: usize,
}

/// A row, and the part of the way to the next one.
#[derive(Clone, Copy)]
struct Place {
    row: usize,
    part: f64,
}

impl Series {
    fn read(table: &Table, positions: &[usize]) -> Result<Self, Error> {
        let (mut time, mut columns) = (Vec::new(), vec![Vec::new(); positions.len()]);
        table.visit(positions, &mut |at, row| {
            time.push(at);
            columns.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
        })?;
        Ok(Self { time, columns, next: 0 })
    }

    /// The place of `time`, which does not decrease from call to call; None outside of the run.
    #[expect(clippy::float_cmp, reason = "rows of the same time")]
    fn at(&mut self, time: f64) -> Option<Place> {
        while self.time.get(self.next).is_some_and(|next| *next < time) {
            self.next += 1;
        }
        if self.time.get(self.next).is_some_and(|next| *next == time) {
            self.next += 1;
            return Some(Place { row: self.next - 1, part: 0.0 });
        }
        let row = self.next.checked_sub(1)?;
        let start = self.time[row];
        if start == time {
            return Some(Place { row, part: 0.0 });
        }
        let end = self.time.get(self.next)?;
        Some(Place { row, part: (time - start) / (end - start) })
    }

    fn value(&self, column: usize, Place { row, part }: Place, holds: bool) -> f64 {
        let values = &self.columns[column];
        if holds || part == 0.0 {
            return values[row];
        }
        values[row] * (1.0 - part) + values[row + 1] * part
    }
}

/// Collects the difference of a variable row by row.
struct Sum {
    name: String,
    holds: bool,
    largest: (f64, f64),
    squares: f64,
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
        let rms = (self.squares / self.rows.max(1) as f64).sqrt();
        Difference { name: self.name, largest, at, rms, rows: self.rows, relative }
    }
}
