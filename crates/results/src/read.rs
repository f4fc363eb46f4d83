//! Reads result files row by row in bounded memory.

mod groups;
mod lines;

use std::path::{Path, PathBuf};

use super::{Column, Envelope, Format, ResultsError, Selection};

/// A result file, written by a [`super::Sink`] or by another program. The time must be in the column
/// `time` or in the first column.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    format: Format,
    /// All columns, including the time.
    columns: Vec<Column>,
    /// Position of the time column.
    time: usize,
}

/// A function of the time and the values of the requested columns.
type Visitor<'a> = dyn FnMut(f64, &[f64]) + 'a;

impl Table {
    /// Opens a file and reads the names of the columns; for Parquet also their types and units.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Format`] for an extension other than `.csv` and `.parquet`, [`ResultsError::Read`]
    /// if the file cannot be read.
    pub fn open(path: &Path) -> Result<Self, ResultsError> {
        let format = Format::of(path)?;
        let columns = match format {
            Format::Csv => lines::columns(path)?,
            Format::Parquet => groups::columns(path)?,
        };
        if columns.is_empty() {
            return Err(unreadable(path, &"it has no columns"));
        }
        let time = columns.iter().position(|column| column.name == super::TIME).unwrap_or(0);
        Ok(Self { path: path.to_owned(), format, columns, time })
    }

    /// Returns the columns in the order of the file, including the time. Columns of CSV have the type Real
    /// and no unit.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Returns the position of the time column: the column `time` or else the first.
    #[must_use]
    pub fn time(&self) -> usize {
        self.time
    }

    /// Returns the positions of the columns in a selection.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Selection`] if a pattern matches no column or no column is left.
    pub fn choose(&self, selection: &Selection) -> Result<Vec<usize>, ResultsError> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        selection
            .choose(&names)
            .map_err(|source| ResultsError::Selection { path: self.path.clone(), source })
    }

    /// Calls a function for each row, with the time and the values of the columns at `positions`: a
    /// Boolean is 0 or 1, a missing value NaN. An incomplete last line of CSV is ignored.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Number`] if a cell is no number, [`ResultsError::Text`] if a column contains texts,
    /// [`ResultsError::Read`] if the file cannot be read.
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
        match self.format {
            Format::Csv => lines::visit(&self.path, &self.columns, &columns, visitor),
            Format::Parquet => groups::visit(&self.path, &self.columns, &columns, visitor),
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

fn unreadable(path: &Path, reason: &impl ToString) -> ResultsError {
    let mut reason = reason.to_string();
    if let Some((_, compression)) = reason.split_once("Disabled feature at compile time: ") {
        reason = format!(
            "it is compressed by {compression}; expected Snappy (the default of pandas) or no compression, \
             as by `to_parquet(..., compression=\"snappy\")`"
        );
    }
    ResultsError::Read { path: path.to_owned(), reason }
}

#[cfg(test)]
mod tests;
