//! The rows of a plot: all rows of a short run; of a longer run, the rows with the extremes of the curves.

/// Rows of some columns.
#[derive(Debug, Default)]
pub(crate) struct Samples {
    pub(crate) time: Vec<f64>,
    /// For each column, a value at each of the times.
    pub(crate) columns: Vec<Vec<f64>>,
    /// The number of all rows of the run; the samples may have fewer.
    pub(crate) total: usize,
}

/// Collects the rows of a plot one by one.
///
/// Of each block of consecutive rows, keeps the rows at which a column, or the difference of a pair of columns, is
/// lowest or highest, and the first and the last row at which this column or difference has no finite value. Also keeps
/// the first and the last row of the run.
pub(crate) struct Collector {
    /// The rows that are kept.
    samples: Samples,
    /// The rows of the present block, from which extremes are chosen.
    block: Samples,
    /// Number of rows of a block; with 1, all rows are kept.
    length: usize,
    /// Whether the columns are pairs: column k of the first half and column k of the second half.
    is_paired: bool,
    /// Whether the present block is the last one.
    is_last: bool,
}

impl Collector {
    pub(crate) fn new(columns: usize, length: usize, is_paired: bool) -> Self {
        let empty = || Samples { columns: vec![Vec::new(); columns], ..Samples::default() };
        Self { samples: empty(), block: empty(), length, is_paired, is_last: false }
    }

    /// Returns the largest number of rows kept of a block, not counting the first and the last row of the run.
    pub(crate) fn max_rows(columns: usize, is_paired: bool, has_gaps: bool) -> usize {
        let curves = if is_paired { columns + columns / 2 } else { columns };
        curves * if has_gaps { 4 } else { 2 }
    }

    pub(crate) fn push(&mut self, time: f64, values: impl Iterator<Item = f64>) {
        // A full block waits for the next row, because it may be the last block of the run.
        if self.length > 1 && self.block.time.len() == self.length {
            self.reduce();
        }
        let samples = if self.length > 1 { &mut self.block } else { &mut self.samples };
        samples.time.push(time);
        samples.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        self.samples.total += 1;
    }

    pub(crate) fn finish(mut self) -> Samples {
        self.is_last = true;
        self.reduce();
        self.samples
    }

    /// Moves the rows to keep from the block to the samples, and empties the block.
    fn reduce(&mut self) {
        let rows = self.block.time.len();
        let mut marks = vec![false; rows];
        let mut mark = |row: Option<usize>| {
            row.and_then(|row| marks.get_mut(row)).into_iter().for_each(|mark| *mark = true);
        };
        if self.samples.time.is_empty() {
            mark(Some(0));
        }
        if self.is_last {
            mark(rows.checked_sub(1));
        }
        for column in &self.block.columns {
            extremes(column.iter().copied()).into_iter().for_each(&mut mark);
        }
        if self.is_paired {
            let (these, others) = self.block.columns.split_at(self.block.columns.len() / 2);
            for (one, other) in these.iter().zip(others) {
                let difference = one.iter().zip(other).map(|(one, other)| one - other);
                extremes(difference).into_iter().for_each(&mut mark);
            }
        }
        let move_rows = |from: &mut Vec<f64>, to: &mut Vec<f64>| {
            to.extend(from.drain(..).zip(&marks).filter_map(|(value, mark)| mark.then_some(value)));
        };
        move_rows(&mut self.block.time, &mut self.samples.time);
        for (from, to) in self.block.columns.iter_mut().zip(&mut self.samples.columns) {
            move_rows(from, to);
        }
    }
}

/// Returns the rows with the lowest and the highest finite value, and the first and the last row without a finite
/// value; `None` for a row that does not exist, and for the last one if it equals the first.
fn extremes(values: impl Iterator<Item = f64> + Clone) -> [Option<usize>; 4] {
    let finite = || values.clone().enumerate().filter(|(_, value)| value.is_finite());
    let lowest = finite().min_by(|one, other| one.1.total_cmp(&other.1));
    let highest = finite().max_by(|one, other| one.1.total_cmp(&other.1));
    let mut gaps = values.enumerate().filter(|(_, value)| !value.is_finite());
    let first = gaps.next();
    let last = gaps.last();
    [lowest, highest, first, last].map(|row| row.map(|(row, _)| row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_rows_with_the_extremes_of_each_column_and_of_the_difference_remain() {
        let mut collector = Collector::new(2, 100, true);
        for row in 0_u32..1000 {
            let wave = (f64::from(row) * 0.1).sin();
            let (one, other) = match row {
                345 => (9.0, wave),
                678 => (wave, f64::NAN),
                777 => (0.9, -0.9),
                _ => (wave, wave),
            };
            collector.push(f64::from(row), [one, other].into_iter());
        }
        let samples = collector.finish();
        assert_eq!(
            (samples.total, samples.time[0], samples.time.last()),
            (1000, 0.0, Some(&999.0))
        );
        assert!(samples.time.len() < 120, "{}", samples.time.len());
        assert!(samples.time.is_sorted());
        for time in [345.0, 678.0, 777.0] {
            assert!(samples.time.contains(&time), "{time}");
        }
        let at = samples.time.partition_point(|time| *time < 345.0);
        assert_eq!((samples.columns[0][at], samples.columns[1][at]), (9.0, 34.5_f64.sin()));
    }

    #[test]
    fn the_last_row_of_a_run_remains_if_it_ends_with_a_full_block() {
        let mut collector = Collector::new(1, 100, false);
        (0_u32..1000).map(|row| 0.1 * f64::from(row)).for_each(|time| {
            collector.push(time, [time.sin()].into_iter());
        });
        assert_eq!(collector.finish().time.last(), Some(&(0.1 * 999.0)));
    }

    #[test]
    fn a_block_of_one_row_keeps_all() {
        let mut collector = Collector::new(1, 1, false);
        (0..5).for_each(|row| collector.push(f64::from(row), [f64::NAN].into_iter()));
        let samples = collector.finish();
        assert_eq!((samples.time.len(), samples.total, samples.columns[0].len()), (5, 5, 5));
    }
}
