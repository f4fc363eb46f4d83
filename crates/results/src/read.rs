//! Reads result files row by row in bounded memory.

mod groups;
mod lines;
mod trajectories;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use lines::seconds_since_1970;

use super::{Column, Envelope, ResultsError, Selection};

/// A result file, written by a [`super::Sink`] or by another program. The time must be in the column
/// `time` or `t`, or in the first column.
///
/// The formats are CSV with commas, semicolons or tabs between the values, decimal commas, UTF-8 or UTF-16, and
/// optionally the units in the second line; Parquet without nested columns; and MAT files of version 4 with results
/// of Dymola or OpenModelica.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    layout: Layout,
    /// All columns, including the time.
    columns: Vec<Column>,
    /// Position of the time column.
    time: usize,
}

/// The format of a file, and the properties that are read when it is opened.
#[derive(Debug)]
enum Layout {
    Lines(lines::Layout),
    Groups,
    Trajectories(trajectories::Layout),
}

/// A function of the time and the values of the requested columns.
type Visitor<'a> = dyn FnMut(f64, &[f64]) + 'a;

impl Table {
    /// Opens a file and reads the names, units and types of the columns.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Extension`] for an extension other than `.csv`, `.parquet` and `.mat`,
    /// [`ResultsError::Read`] if the file cannot be read or has no columns.
    pub fn open(path: &Path) -> Result<Self, ResultsError> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (layout, columns) = match ending.to_str() {
            Some("csv") => {
                let (layout, columns) = lines::columns(path)?;
                (Layout::Lines(layout), columns)
            }
            Some("parquet") => (Layout::Groups, groups::columns(path)?),
            Some("mat") => {
                let (layout, columns) = trajectories::columns(path)?;
                (Layout::Trajectories(layout), columns)
            }
            _ => return Err(ResultsError::Extension { path: path.to_owned() }),
        };
        if columns.is_empty() {
            return Err(unreadable(path, &"it has no columns"));
        }
        Ok(Self { path: path.to_owned(), layout, time: time_position(&columns), columns })
    }

    /// Returns the columns in the order of the file, including the time; in MAT files, columns that vary come first.
    /// Columns of MAT files have the type Real, integers of Parquet the type Integer, also integers with 64
    /// bits; decimals and timestamps (in s) of Parquet have the type Real. Columns of CSV have the type Boolean or
    /// Integer if the first 1000 rows have only such values and, for an Integer, the file has a Real such as `0.0`;
    /// they have no unit, unless the second line of the file states units. Dates of ISO 8601 in the time column of
    /// CSV are in s since 1970.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Returns the position of the time column: the column `time`, in this or another case, or else `t`, each also with
    /// `[s]` behind it, or else the first.
    #[must_use]
    pub fn time(&self) -> usize {
        self.time
    }

    /// Returns the positions of the columns in a selection.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Selection`] if a pattern matches no column or no column is selected.
    pub fn choose(&self, selection: &Selection) -> Result<Vec<usize>, ResultsError> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        selection
            .choose(&names)
            .map_err(|source| ResultsError::Selection { path: self.path.clone(), source })
    }

    /// Calls a function for each row, with the time and the values of the columns at `positions`: a
    /// Boolean is 0 or 1, a missing value NaN. A last line of CSV that has no end of line and too few or too many
    /// values, or that ends within a number, is ignored, as incomplete.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Number`] if a cell is no number, [`ResultsError::Text`] if a column contains texts,
    /// [`ResultsError::Order`] if a time is earlier than the time before, [`ResultsError::Read`] if the file cannot be
    /// read, a time is no finite number, or several columns have the name of a requested one. The function was then
    /// called for some rows before the error.
    ///
    /// # Panics
    ///
    /// If a position is not below the number of columns.
    pub fn visit(
        &self,
        positions: &[usize],
        visitor: &mut Visitor<'_>,
    ) -> Result<(), ResultsError> {
        let mut columns = vec![self.time];
        columns.extend(positions);
        let (path, all) = (&self.path, &self.columns);
        let mut counts = HashMap::new();
        for column in all {
            *counts.entry(column.name.as_str()).or_insert(0) += 1;
        }
        let names = columns.iter().map(|position| all[*position].name.as_str());
        if let Some(name) = names.filter(|name| !name.is_empty()).find(|name| counts[name] > 1) {
            let reason = format!("two columns have the name {name:?}, expected different names");
            return Err(unreadable(path, &reason));
        }
        match &self.layout {
            Layout::Lines(layout) => lines::visit(path, layout, all, &columns, visitor),
            Layout::Groups => groups::visit(path, all, &columns, visitor),
            Layout::Trajectories(layout) => {
                trajectories::visit(path, layout, all, &columns, visitor)
            }
        }
    }

    /// Reads a whole column.
    ///
    /// # Errors
    ///
    /// Same as [`Table::visit`].
    pub fn column(&self, position: usize) -> Result<Vec<f64>, ResultsError> {
        let mut values = Vec::new();
        self.visit(&[position], &mut |_, row| values.push(row[0]))?;
        Ok(values)
    }

    /// Reduces the columns at `positions` to the samples that a plot needs, in memory that does not
    /// depend on the length of the file.
    ///
    /// # Errors
    ///
    /// Same as [`Table::visit`].
    pub fn envelopes(&self, positions: &[usize]) -> Result<Vec<Envelope>, ResultsError> {
        let mut envelopes = vec![Envelope::default(); positions.len()];
        self.visit(positions, &mut |time, row| {
            for (envelope, value) in envelopes.iter_mut().zip(row) {
                envelope.push(time, *value);
            }
        })?;
        Ok(envelopes)
    }
}

/// The reason why the first column is the time, for messages.
const FIRST: &str = " (no column is called time or t, so the first one is the time)";

/// Returns the position of the time: the column of [`named_time`], otherwise the first.
fn time_position(columns: &[Column]) -> usize {
    named_time(columns).unwrap_or(0)
}

/// Returns the position of the column `time`, otherwise of that name in another case, otherwise of `t`. The names may
/// have `[s]` behind them.
fn named_time(columns: &[Column]) -> Option<usize> {
    fn plain(column: &Column) -> &str {
        column.name.strip_suffix("[s]").map_or(column.name.as_str(), str::trim_end)
    }
    let exact = |name: &str| columns.iter().position(|column| plain(column) == name);
    let similar =
        || columns.iter().position(|column| plain(column).eq_ignore_ascii_case(super::TIME));
    exact(super::TIME).or_else(similar).or_else(|| exact("t"))
}

fn unreadable(path: &Path, reason: &impl ToString) -> ResultsError {
    ResultsError::Read { path: path.to_owned(), reason: reason.to_string() }
}

/// Checks that the times of the rows are finite and do not decrease.
struct Clock<'a> {
    path: &'a Path,
    /// Name of the time column.
    name: &'a str,
    /// Says that the first column is the time for want of a better one; otherwise empty.
    hint: &'static str,
    before: f64,
}

impl<'a> Clock<'a> {
    fn new(path: &'a Path, columns: &'a [Column], time: usize) -> Self {
        let hint = if named_time(columns).is_some() { "" } else { FIRST };
        Self { path, name: &columns[time].name, hint, before: f64::NEG_INFINITY }
    }

    /// Says that a text in the time column is no time.
    fn refusal(&self, text: &str) -> String {
        let Self { name, hint, .. } = self;
        format!(
            "{name} is {text:?}, expected a time in s or a date of ISO 8601, such as 2026-12-01 08:00:00{hint}"
        )
    }

    /// Checks the next time; `place` returns its line or row for the error.
    fn check(&mut self, time: f64, place: impl Fn() -> String) -> Result<(), ResultsError> {
        if !time.is_finite() {
            let actual = if time.is_nan() { "no number" } else { "infinite" };
            let Self { name, hint, .. } = self;
            let reason = format!("{}: {name} is {actual}, expected a time in s{hint}", place());
            return Err(unreadable(self.path, &reason));
        }
        if time >= self.before {
            self.before = time;
            return Ok(());
        }
        Err(ResultsError::Order {
            path: self.path.to_owned(),
            place: place(),
            name: self.name.to_owned(),
            time,
            before: self.before,
            hint: self.hint,
        })
    }
}

#[cfg(test)]
mod tests;
