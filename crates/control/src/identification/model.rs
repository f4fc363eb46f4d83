//! An identified model and its predictions.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::identification::Record;
use crate::{Error, check};

/// A model in innovation form, `x[k+1]` = A `x[k]` + B `u[k]` + K `e[k]` + b, `y[k]` = C `x[k]` + D `u[k]` + `e[k]` +
/// d, see [`crate::identification`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct IdentifiedModel {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// D, p x m.
    pub d: DMatrix<f64>,
    /// The gain K of the innovation, n x p; zero if the samples have no noise.
    pub k: DMatrix<f64>,
    /// The constant b of the states, n.
    pub state_constant: DVector<f64>,
    /// The constant d of the outputs, p.
    pub output_constant: DVector<f64>,
    /// T, n x s (m + p): the estimate of `x[k]` is T [`z[k-s]`; ...; `z[k-1]`], z = [u; y].
    pub past: DMatrix<f64>,
}

impl IdentifiedModel {
    /// Predicts the outputs of the samples in `range`, one column for each, from the inputs. At the first sample and
    /// every `horizon` samples, the state is estimated from the s samples before.
    ///
    /// A horizon of the length of the range gives a simulation; 0 counts as 1.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad record or one with other numbers of signals;
    /// [`Error::TooFewSamples`] if there are fewer than s samples before the range, or if it ends after the record.
    pub fn predict(
        &self,
        record: &Record,
        range: Range<usize>,
        horizon: usize,
    ) -> Result<DMatrix<f64>, Error> {
        check::shape("u", &record.inputs, (self.b.ncols(), record.len()))?;
        check::shape("y", &record.outputs, (self.c.nrows(), record.len()))?;
        let signals = self.b.ncols() + self.c.nrows();
        let past = self.past.ncols() / signals;
        if range.start < past || range.end > record.len() {
            let expected = range.end.max(past + range.len());
            return Err(Error::TooFewSamples { expected, actual: record.len() });
        }
        let mut predictions = DMatrix::zeros(self.c.nrows(), range.len());
        let mut x = DVector::zeros(self.a.nrows());
        for (column, k) in range.enumerate() {
            if column % horizon.max(1) == 0 {
                x = &self.past * window(record, k - past..k);
            }
            let u = record.inputs.column(k);
            let y = &self.c * &x + &self.d * u + &self.output_constant;
            predictions.set_column(column, &y);
            x = &self.a * &x + &self.b * u + &self.state_constant;
        }
        Ok(predictions)
    }

    /// Converts the model to signals that are the signals of this model, [u; y], times `units`.
    pub(super) fn in_units(mut self, units: &[f64]) -> Self {
        let inputs = self.b.ncols();
        for (input, unit) in units[..inputs].iter().enumerate() {
            self.b.column_mut(input).unscale_mut(*unit);
            self.d.column_mut(input).unscale_mut(*unit);
        }
        for (output, unit) in units[inputs..].iter().enumerate() {
            self.c.row_mut(output).scale_mut(*unit);
            self.d.row_mut(output).scale_mut(*unit);
            self.k.column_mut(output).unscale_mut(*unit);
            self.output_constant[output] *= unit;
        }
        for column in 0..self.past.ncols() {
            self.past.column_mut(column).unscale_mut(units[column % units.len()]);
        }
        self
    }
}

/// The samples of `range` as one column, [`z[first]`; ...; `z[last]`].
fn window(record: &Record, range: Range<usize>) -> DVector<f64> {
    let samples = range.flat_map(|k| {
        record.inputs.column(k).iter().chain(record.outputs.column(k)).copied().collect::<Vec<_>>()
    });
    DVector::from_vec(samples.collect())
}
