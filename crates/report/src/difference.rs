//! The difference of two runs.

use results::{Column, Table};

use crate::Error;
use crate::trace::Trace;

/// Number of columns of the second file that are in memory at a time.
const COLUMNS: usize = 16;

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
    /// The root of the mean square over the rows.
    pub rms: f64,
    /// The largest absolute difference, divided by the range of the variable in both runs; 0 if they are
    /// equal, infinite if only the range is 0.
    pub relative: f64,
}

/// The comparison with another run.
pub(crate) struct Compared {
    pub(crate) differences: Vec<Difference>,
    /// The other run and this one minus the other, for each variable of this run that the other one has.
    pub(crate) curves: Vec<Option<(Trace, Trace)>>,
    /// Variables of one run only.
    pub(crate) only_here: Vec<String>,
    pub(crate) only_there: Vec<String>,
    /// Number of rows outside of the time of the other run.
    pub(crate) outside: u64,
}

/// Compares the columns at `positions` with those of the same names in `other`, at the times of the rows
/// of `table`. Between rows, the other run is interpolated linearly; integers and Booleans are held. Rows
/// with the same time, as at events, are compared in their order.
pub(crate) fn compare(
    table: &Table,
    positions: &[usize],
    other: &Table,
) -> Result<Compared, Error> {
    let named =
        |table: &Table, name: &str| table.columns().iter().position(|column| column.name == name);
    let pair = |&at: &usize| {
        let name = &table.columns()[at].name;
        named(other, name).filter(|there| *there != other.time()).map(|there| (at, there))
    };
    let pairs: Vec<_> = positions.iter().map(pair).collect();
    let only = |all: &Table, rest: &Table| -> Vec<String> {
        let names = all.columns().iter().enumerate().filter(|(at, _)| *at != all.time());
        let missing = names.filter(|(_, column)| named(rest, &column.name).is_none());
        missing.map(|(_, column)| column.name.clone()).collect()
    };
    let mut compared = Compared {
        differences: Vec::new(),
        curves: vec![None; positions.len()],
        only_here: only(table, other),
        only_there: only(other, table),
        outside: 0,
    };
    let numbered: Vec<_> =
        pairs.iter().enumerate().filter_map(|(at, pair)| pair.map(|pair| (at, pair))).collect();
    for chunk in numbered.chunks(COLUMNS) {
        let (here, there): (Vec<_>, Vec<_>) = chunk.iter().map(|(_, pair)| *pair).unzip();
        let mut series = Series::read(other, &there)?;
        let mut sums: Vec<_> = here.iter().map(|at| Sum::new(&table.columns()[*at])).collect();
        let mut outside = 0;
        table.visit(&here, &mut |time, row| match series.at(time) {
            Some(place) => {
                for (column, (sum, value)) in sums.iter_mut().zip(row).enumerate() {
                    sum.push(time, *value, series.value(column, place, sum.holds));
                }
            }
            None => outside += 1,
        })?;
        compared.outside = outside;
        for ((at, _), sum) in chunk.iter().zip(sums) {
            let (difference, curves) = sum.finish();
            compared.differences.push(difference);
            compared.curves[*at] = Some(curves);
        }
    }
    compared.differences.sort_by(|one, other| other.relative.total_cmp(&one.relative));
    Ok(compared)
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
    count: f64,
    range: (f64, f64),
    other: Trace,
    difference: Trace,
}

impl Sum {
    fn new(column: &Column) -> Self {
        Self {
            name: column.name.clone(),
            holds: crate::holds(column),
            largest: (0.0, f64::NAN),
            squares: 0.0,
            count: 0.0,
            range: (f64::INFINITY, f64::NEG_INFINITY),
            other: Trace::default(),
            difference: Trace::default(),
        }
    }

    fn push(&mut self, time: f64, value: f64, other: f64) {
        // Two values that are not finite are equal; one of them differs from any number.
        let same = value.to_bits() == other.to_bits() || value.is_nan() && other.is_nan();
        let difference = if same { 0.0 } else { value - other };
        self.other.push(time, other);
        self.difference.push(time, difference);
        let size = if difference.is_nan() { f64::INFINITY } else { difference.abs() };
        if size > self.largest.0 {
            self.largest = (size, time);
        }
        self.squares += size * size;
        self.count += 1.0;
        for finite in [value, other].into_iter().filter(|value| value.is_finite()) {
            self.range = (self.range.0.min(finite), self.range.1.max(finite));
        }
    }

    fn finish(self) -> (Difference, (Trace, Trace)) {
        let (largest, at) = self.largest;
        let range = (self.range.1 - self.range.0).max(0.0);
        let relative = if largest > 0.0 { largest / range } else { 0.0 };
        let rms = (self.squares / self.count.max(1.0)).sqrt();
        let difference = Difference { name: self.name, largest, at, rms, relative };
        (difference, (self.other, self.difference))
    }
}
