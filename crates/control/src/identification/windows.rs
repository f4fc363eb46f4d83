//! The samples of records, compressed to one triangular factor.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::blocks::stacked;
use crate::check::as_number;
use crate::svd::Svd;
use crate::{Error, check};

/// Rows that are factored at once, as a multiple of the columns.
const ROWS_AT_ONCE: usize = 3;
/// Largest number of columns of R, which then needs 800 MB.
const LARGEST: usize = 10_000;

/// Samples of inputs and outputs at equidistant instants.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// u, m x N: a column for each sample.
    pub inputs: DMatrix<f64>,
    /// y, p x N: a column for each sample.
    pub outputs: DMatrix<f64>,
}

impl Record {
    /// N, the number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.inputs.ncols()
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks that inputs and outputs are finite and have the same number of samples.
    fn check(&self) -> Result<(), Error> {
        check::finite("u", &self.inputs)?;
        check::shape("y", &self.outputs, (self.outputs.nrows(), self.len()))
    }

    /// Entry `number`, from 0, of [u; y] in a sample.
    fn signal(&self, number: usize, sample: usize) -> f64 {
        let inputs = self.inputs.nrows();
        if number < inputs {
            self.inputs[(number, sample)]
        } else {
            self.outputs[(number - inputs, sample)]
        }
    }
}

/// All windows of s + 1 successive samples of a record, as the triangular factor R of the matrix whose rows are
/// [1, `z[k-s]`', ..., `z[k-1]`', `u[k]`', `y[k]`'], z = [u; y].
///
/// R' R has all sums of products for least squares. R is c x c, c = 1 + (s + 1) (m + p), for any number of samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Windows {
    /// s, the number of past samples in a window.
    pub(super) past: usize,
    /// m, the number of inputs.
    pub(super) inputs: usize,
    /// p, the number of outputs.
    pub(super) outputs: usize,
    pub(super) count: usize,
    /// The triangular factor R.
    pub(super) factor: DMatrix<f64>,
}

impl Windows {
    /// Factors the windows whose last sample is in `range`, by Householder reflections: 2 N c^2 multiplications.
    ///
    /// `past`: s, one or more; c is at most 10,000. Windows that would start before the record or end after it are left
    /// out; the factor of a range without windows is zero.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad record; [`Error::OutOfRange`] for `past`.
    pub fn new(record: &Record, past: usize, range: Range<usize>) -> Result<Self, Error> {
        record.check()?;
        check::positive("past", as_number(past))?;
        let (inputs, outputs) = (record.inputs.nrows(), record.outputs.nrows());
        let signals = inputs + outputs;
        let columns = past.saturating_add(1).saturating_mul(signals).saturating_add(1);
        let rule = "a number with which R has at most 10,000 columns";
        check::that(columns <= LARGEST, "past", as_number(past), rule)?;
        let range = range.start.max(past)..range.end.min(record.len());
        let entry = |at: usize, column: usize| {
            let Some(column) = column.checked_sub(1) else { return 1.0 };
            record.signal(column % signals, at - past + column / signals)
        };
        let mut factor = DMatrix::zeros(columns, columns);
        for start in range.clone().step_by(ROWS_AT_ONCE * columns) {
            let rows = (range.end - start).min(ROWS_AT_ONCE * columns);
            let part = DMatrix::from_fn(rows, columns, |row, column| entry(start + row, column));
            factor = stacked_factor(&[&factor, &part]);
        }
        Ok(Self { past, inputs, outputs, count: range.len(), factor })
    }

    /// Joins the windows of all parts, which must have the same signals and windows of the same length.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without parts, [`Error::Shape`] for parts whose factors differ in size.
    pub fn joined(parts: &[&Self]) -> Result<Self, Error> {
        let first = *parts.first().ok_or(Error::Empty { matrix: "parts", actual: (0, 0) })?;
        let mut all = first.clone();
        for part in &parts[1..] {
            check::shape("R", &part.factor, first.factor.shape())?;
            all.count += part.count;
        }
        all.factor = stacked_factor(&parts.iter().map(|part| &part.factor).collect::<Vec<_>>());
        Ok(all)
    }

    /// The number of windows.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The mean of each signal, [u; y], at the last sample of the windows; NaN without windows.
    #[must_use]
    pub fn means(&self) -> Vec<f64> {
        let first = self.past_columns().end;
        (0..self.signals()).map(|at| self.factor[(0, first + at)] / self.factor[(0, 0)]).collect()
    }

    /// The standard deviation of each signal, [u; y], at the last sample of the windows; 0 without windows.
    #[must_use]
    pub fn deviations(&self) -> Vec<f64> {
        let first = self.past_columns().end;
        let rows = self.factor.nrows() - 1;
        let norm = |at| self.factor.view((1, first + at), (rows, 1)).norm();
        (0..self.signals()).map(|at| norm(at) / as_number(self.count.max(1)).sqrt()).collect()
    }

    /// The rank of the input sequences of s + 1 samples, m (s + 1) if they are persistently exciting of
    /// this order; 0 for constant inputs and without windows.
    ///
    /// Singular values below `tolerance` of the largest count as zero; inputs in units of their deviations.
    ///
    /// # Errors
    ///
    /// [`Error::NotConverged`].
    pub fn excitation(&self, tolerance: f64) -> Result<usize, Error> {
        let (factor, _) = self.scaled();
        let signals = self.signals();
        let is_input = |column: &usize| (column - 1) % signals < self.inputs;
        let columns: Vec<_> = (1..factor.ncols()).filter(is_input).collect();
        let sequences = factor.rows(1, factor.nrows() - 1).select_columns(&columns);
        let svd = Svd::new(&sequences)?;
        // An input that varies has a singular value of at least sqrt(count), as its unit is its deviation; if none
        // varies, all singular values are rounding.
        let largest = svd.values[0].max(as_number(self.count).sqrt());
        Ok(svd.rank_above(tolerance * largest))
    }

    /// The number m + p of signals in a sample.
    pub(super) fn signals(&self) -> usize {
        self.inputs + self.outputs
    }

    /// The columns of R for `z[k-s]` to `z[k-1]`.
    pub(super) fn past_columns(&self) -> Range<usize> {
        1..1 + self.past * self.signals()
    }

    /// Returns the factor of signals divided by their units, and the units: the deviations, or 1 for a constant signal
    /// and without windows.
    ///
    /// A signal counts as constant if its deviation is at most the rounding of the factorisation, one eps of the mean
    /// for each row; smaller deviations of a column are zero in the factor.
    pub(super) fn scaled(&self) -> (DMatrix<f64>, Vec<f64>) {
        let rounding = f64::EPSILON * as_number(self.count + self.factor.nrows());
        let mut units = self.deviations();
        for (unit, mean) in units.iter_mut().zip(self.means()) {
            if self.count == 0 || *unit <= rounding * mean.abs() {
                *unit = 1.0;
            }
        }
        let mut factor = self.factor.clone();
        for at in 1..factor.ncols() {
            let mut column = factor.column_mut(at);
            let least = rounding * column[0].abs();
            let mut deviations = column.rows_mut(1, self.factor.nrows() - 1);
            if deviations.norm() <= least {
                deviations.fill(0.0);
            }
            column.unscale_mut(units[(at - 1) % units.len()]);
        }
        (factor, units)
    }
}

/// The triangular factor of the stacked matrices.
fn stacked_factor(parts: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let all = parts[1..].iter().fold(parts[0].clone(), |all, part| stacked(&all, part));
    all.qr().r()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(value: f64) -> Record {
        let outputs = DMatrix::from_fn(1, 500, |_, k| (0.3 * as_number(k)).sin());
        Record { inputs: DMatrix::from_element(1, 500, value), outputs }
    }

    #[test]
    fn a_constant_signal_has_the_unit_one_and_excites_nothing() {
        for value in [20.0, 0.1, 0.0] {
            let windows = Windows::new(&record(value), 4, 0..500).unwrap();
            let (_, units) = windows.scaled();
            assert_eq!(units[0].to_bits(), 1.0_f64.to_bits(), "{value}: {units:?}");
            assert!((units[1] - 0.5_f64.sqrt()).abs() < 0.01, "{units:?}");
            assert_eq!(windows.excitation(1e-6), Ok(0), "{value}");
        }
    }

    /// 1 + (4999 + 1) 2 = 10,001 columns.
    #[test]
    fn a_past_with_more_than_10_000_columns_is_refused() {
        for past in [4999, usize::MAX] {
            let refused = Windows::new(&record(20.0), past, 0..500);
            assert!(matches!(refused, Err(Error::OutOfRange { name: "past", .. })), "{past}");
        }
    }

    #[test]
    fn a_range_without_windows_excites_nothing() {
        let windows = Windows::new(&record(20.0), 4, 0..3).unwrap();
        assert_eq!((windows.count(), windows.excitation(1e-6)), (0, Ok(0)));
    }
}
