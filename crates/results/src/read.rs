//! Results read back, row by row in bounded memory.

mod groups;
mod lines;

use std::path::{Path, PathBuf};

use super::{Column, Envelope, Format, ResultsError, Selection};

/// A file of results, of a [`super::Sink`] or another with a column `time` or with the time first.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    format: Format,
    /// Every column, the time among them.
    columns: Vec<Column>,
    /// Which of them is the time.
    time: usize,
}

/// Told the time and the values of the columns asked for.
type Visitor<'a> = dyn FnMut(f64, &[f64]) + 'a;

impl Table {
    /// Reads the names of the columns; Parquet also has their types and units.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Format`], [`ResultsError::Read`].
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

    /// The columns in the order of the file, the time among them. What CSV says nothing of is
    /// taken for Real, without unit.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Position of the column that is the time: the one of that name, otherwise the first.
    #[must_use]
    pub fn time(&self) -> usize {
        self.time
    }

    /// Positions of the columns that a selection chooses.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Selection`].
    pub fn choose(&self, selection: &Selection) -> Result<Vec<usize>, ResultsError> {
        let names: Vec<&str> = self.columns.iter().map(|column| column.name.as_str()).collect();
        selection
            .choose(&names)
            .map_err(|source| ResultsError::Selection { path: self.path.clone(), source })
    }

    /// Goes through all rows with the values of the columns at `positions`: Boolean as 0 or 1, a
    /// missing value as NaN. A last line of CSV that is cut short counts as no row.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Number`], [`ResultsError::Text`], [`ResultsError::Read`].
    ///
    /// # Panics
    ///
    /// Where there is no column at a position.
    pub fn visit(
        &self,
        positions: &[usize],
        visitor: &mut Visitor<'_>,
    ) -> Result<(), ResultsError> {
        let mut wanted = vec![self.time];
        wanted.extend(positions);
        match self.format {
            Format::Csv => lines::visit(&self.path, &self.columns, &wanted, visitor),
            Format::Parquet => groups::visit(&self.path, &self.columns, &wanted, visitor),
        }
    }

    /// The whole of one column.
    ///
    /// # Errors
    ///
    /// As [`Table::visit`].
    pub fn column(&self, position: usize) -> Result<Vec<f64>, ResultsError> {
        let mut values = Vec::new();
        self.visit(&[position], &mut |_, row| values.push(row[0]))?;
        Ok(values)
    }

    /// What a drawing needs of the columns at `positions`, in memory that does not depend on the
    /// length of the file.
    ///
    /// # Errors
    ///
    /// As [`Table::visit`].
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
    ResultsError::Read { path: path.to_owned(), reason: reason.to_string() }
}

#[cfg(test)]
mod tests;
