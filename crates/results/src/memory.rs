//! Results in memory: one array for each column.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::{Column, ColumnKind, ResultsError, Row, Sink, Widths, check_names, create};

/// The values of a column, one for each row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// A column of kind [`ColumnKind::Real`].
    Real(Vec<f64>),
    /// A column of kind [`ColumnKind::Integer`].
    Integer(Vec<i32>),
    /// A column of kind [`ColumnKind::Long`].
    Long(Vec<i64>),
    /// A column of kind [`ColumnKind::Boolean`].
    Boolean(Vec<bool>),
    /// A column of kind [`ColumnKind::String`].
    String(Texts),
}

impl Values {
    fn new(kind: ColumnKind) -> Self {
        match kind {
            ColumnKind::Real => Self::Real(Vec::new()),
            ColumnKind::Integer => Self::Integer(Vec::new()),
            ColumnKind::Long => Self::Long(Vec::new()),
            ColumnKind::Boolean => Self::Boolean(Vec::new()),
            ColumnKind::String => Self::String(Texts::default()),
        }
    }
}

/// Texts in one block of memory, in the layout of Apache Arrow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Texts {
    /// The start of each text in `bytes`, and the end of the last one.
    pub offsets: Vec<i64>,
    /// The texts in UTF-8.
    pub bytes: Vec<u8>,
}

impl Default for Texts {
    fn default() -> Self {
        Self { offsets: vec![0], bytes: Vec::new() }
    }
}

impl Texts {
    fn push(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.offsets.push(i64::try_from(self.bytes.len()).unwrap_or(i64::MAX));
    }

    /// Returns the text of a row; `None` beyond the last row.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<&str> {
        let start = usize::try_from(*self.offsets.get(row)?).ok()?;
        let end = usize::try_from(*self.offsets.get(row + 1)?).ok()?;
        std::str::from_utf8(self.bytes.get(start..end)?).ok()
    }
}

/// Results in memory.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Columns {
    /// Times of the rows in s.
    pub time: Vec<f64>,
    /// The columns with their values.
    pub columns: Vec<(Column, Values)>,
    /// For each clocked column, in their order, whether it has a value in each row.
    pub present: Vec<Vec<bool>>,
}

impl Columns {
    /// Creates columns without rows.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name.
    pub fn new(columns: &[Column]) -> Result<Self, ResultsError> {
        check_names(columns)?;
        let empty = |column: &Column| (column.clone(), Values::new(column.kind));
        let clocked = columns.iter().filter(|column| column.clocked);
        Ok(Self {
            time: Vec::new(),
            columns: columns.iter().map(empty).collect(),
            present: clocked.map(|_| Vec::new()).collect(),
        })
    }

    /// Adds a row. An integer beyond the range of its column's type is limited to that range. A value that
    /// `row` lacks is 0, false or empty.
    fn push(&mut self, time: f64, row: &Row<'_>) {
        self.time.push(time);
        let mut reals = row.reals.iter().copied();
        let mut integers = row.integers.iter().copied();
        let mut booleans = row.booleans.iter().copied();
        let mut strings = row.strings.iter();
        for (_, values) in &mut self.columns {
            match values {
                Values::Real(list) => list.push(reals.next().unwrap_or_default()),
                Values::Integer(list) => list.push(limited(integers.next().unwrap_or_default())),
                Values::Long(list) => list.push(integers.next().unwrap_or_default()),
                Values::Boolean(list) => list.push(booleans.next().unwrap_or_default() != 0),
                Values::String(list) => list.push(strings.next().map_or("", String::as_str)),
            }
        }
        for (number, flags) in self.present.iter_mut().enumerate() {
            flags.push(row.present.get(number).copied().unwrap_or(true));
        }
    }

    /// Writes the rows to a file, `.csv` or `.parquet`.
    ///
    /// # Errors
    ///
    /// Same as [`create`] and [`Sink::finish`].
    pub fn write(&self, path: &Path) -> Result<(), ResultsError> {
        let columns: Vec<_> = self.columns.iter().map(|(column, _)| column.clone()).collect();
        let mut sink = create(path, &columns)?;
        let (mut reals, mut integers) = (Vec::new(), Vec::new());
        let (mut booleans, mut strings, mut present) = (Vec::new(), Vec::new(), Vec::new());
        for (row, &time) in self.time.iter().enumerate() {
            reals.clear();
            integers.clear();
            booleans.clear();
            strings.clear();
            for (_, values) in &self.columns {
                match values {
                    Values::Real(list) => reals.push(list[row]),
                    Values::Integer(list) => integers.push(list[row].into()),
                    Values::Long(list) => integers.push(list[row]),
                    Values::Boolean(list) => booleans.push(list[row].into()),
                    Values::String(list) => strings.push(list.get(row).unwrap_or("").to_owned()),
                }
            }
            present.clear();
            present.extend(self.present.iter().map(|flags| flags[row]));
            let (reals, integers) = (&reals[..], &integers[..]);
            let (booleans, strings, present) = (&booleans[..], &strings[..], &present[..]);
            sink.row(time, &Row { reals, integers, booleans, strings, present })?;
        }
        sink.finish()
    }
}

/// Returns `value`, limited to 32 bits.
pub(super) fn limited(value: i64) -> i32 {
    i32::try_from(value).unwrap_or(if value < 0 { i32::MIN } else { i32::MAX })
}

/// The rows of a [`MemorySink`] that was finished or dropped.
#[derive(Debug, Clone, Default)]
pub struct Recorded(Arc<Mutex<Columns>>);

impl Recorded {
    /// Moves the rows out. Returns no rows before the sink is finished or dropped, and in a second call.
    #[must_use]
    pub fn take(&self) -> Columns {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A sink that keeps the rows in memory and, if there is a second sink, passes them on.
pub struct MemorySink {
    widths: Widths,
    columns: Columns,
    recorded: Recorded,
    second: Option<Box<dyn Sink>>,
}

impl MemorySink {
    /// Creates a sink without rows. When it is finished or dropped, its rows are in `recorded`.
    ///
    /// # Errors
    ///
    /// [`ResultsError::Duplicate`] for two columns of one name.
    pub fn new(
        columns: &[Column],
        recorded: Recorded,
        second: Option<Box<dyn Sink>>,
    ) -> Result<Self, ResultsError> {
        let (widths, columns) = (Widths::new(columns), Columns::new(columns)?);
        Ok(Self { widths, columns, recorded, second })
    }
}

impl Sink for MemorySink {
    fn row(&mut self, time: f64, row: &Row<'_>) -> Result<(), ResultsError> {
        self.widths.check(row)?;
        self.columns.push(time, row);
        self.second.as_mut().map_or(Ok(()), |second| second.row(time, row))
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        self.second.as_mut().map_or(Ok(()), |second| second.flush())
    }

    fn finish(mut self: Box<Self>) -> Result<(), ResultsError> {
        self.second.take().map_or(Ok(()), Sink::finish)
    }
}

impl Drop for MemorySink {
    fn drop(&mut self) {
        let mut recorded = self.recorded.0.lock().unwrap_or_else(PoisonError::into_inner);
        *recorded = std::mem::take(&mut self.columns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, kind: ColumnKind) -> Column {
        Column { name: name.to_owned(), kind, unit: None, clocked: kind == ColumnKind::Long }
    }

    #[test]
    fn columns_in_memory_hold_what_the_rows_held_and_write_the_same_file() {
        let kinds = [
            ColumnKind::Real,
            ColumnKind::String,
            ColumnKind::Integer,
            ColumnKind::Boolean,
            ColumnKind::Long,
        ];
        let columns: Vec<_> =
            kinds.iter().enumerate().map(|(k, kind)| column(&format!("a{k}"), *kind)).collect();
        let folder = tempfile::tempdir().unwrap();
        let (direct, later) = (folder.path().join("direct.csv"), folder.path().join("later.csv"));
        let recorded = Recorded::default();
        let second = create(&direct, &columns).unwrap();
        let mut sink = Box::new(MemorySink::new(&columns, recorded.clone(), Some(second)).unwrap());
        let texts = ["a".to_owned(), String::new(), "\u{e9}\"\n".to_owned()];
        for (k, (x, text)) in [0.1, 1.1, 2.1].into_iter().zip(&texts).enumerate() {
            let strings = std::slice::from_ref(text);
            let row = Row {
                reals: &[x],
                integers: &[i64::MAX, i64::MIN + 5],
                booleans: &[i32::from(k == 1)],
                strings,
                present: &[k != 1],
            };
            sink.row(x / 3.0, &row).unwrap();
        }
        sink.finish().unwrap();
        let kept = recorded.take();
        assert_eq!(kept.time.len(), 3);
        assert_eq!(kept.columns[0].1, Values::Real(vec![0.1, 1.1, 2.1]));
        assert_eq!(kept.columns[2].1, Values::Integer(vec![i32::MAX; 3]));
        assert_eq!(kept.present, [[true, false, true]]);
        assert_eq!(kept.columns[3].1, Values::Boolean(vec![false, true, false]));
        let Values::String(column) = &kept.columns[1].1 else { panic!("no texts") };
        assert_eq!(
            (0..4).map(|row| column.get(row)).collect::<Vec<_>>(),
            [Some(texts[0].as_str()), Some(""), Some(texts[2].as_str()), None]
        );
        kept.write(&later).unwrap();
        let read = |path| std::fs::read_to_string(path).unwrap();
        // The file has the integer in full; the memory limits it to the range of the column's type.
        let limited = read(&direct).replace(&i64::MAX.to_string(), &i32::MAX.to_string());
        assert_eq!(read(&later), limited);
    }

    #[test]
    fn two_columns_of_one_name_are_refused_and_so_is_a_row_of_other_columns() {
        let twice = [column("a", ColumnKind::Real), column("a", ColumnKind::Real)];
        assert!(matches!(Columns::new(&twice), Err(ResultsError::Duplicate { .. })));
        let mut sink = MemorySink::new(&twice[..1], Recorded::default(), None).unwrap();
        assert!(matches!(sink.row(0.0, &Row::default()), Err(ResultsError::Values { .. })));
    }
}
