//! Estimates states and matrices from the compressed samples.

use nalgebra::{DMatrix, DVector};

use crate::check::as_number;
use crate::identification::{IdentifiedModel, Windows};
use crate::svd::Svd;
use crate::{Error, check};

/// Singular values below this fraction of the largest one count as rounding errors.
const ROUNDING: f64 = 1e-12;
/// Innovations below this fraction of the deviation of the outputs count as rounding errors.
const NO_INNOVATION: f64 = 1e-9;

/// The state sequence that the samples determine, for models of every order.
///
/// See [`crate::identification`] for the method.
///
/// # Example
///
/// ```
/// use control::identification::{Record, Subspace, Windows};
/// use nalgebra::DMatrix;
/// // x[k+1] = 0.9 x[k] + 0.5 u[k], y[k] = x[k]
/// let u = DMatrix::from_fn(1, 200, |_, k| f64::from(u8::from(k * k % 7 < 3)));
/// let mut y = DMatrix::zeros(1, 200);
/// for k in 1..200 {
///     y[k] = 0.9 * y[k - 1] + 0.5 * u[k - 1];
/// }
/// let windows = Windows::new(&Record { inputs: u, outputs: y }, 3, 0..200)?;
/// let model = Subspace::new(&windows, false)?.model(1)?;
/// assert!((model.a[(0, 0)] - 0.9).abs() < 1e-12);
/// assert!((model.c[(0, 0)] * model.b[(0, 0)] - 0.5).abs() < 1e-12);
/// # Ok::<(), control::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Subspace {
    windows: Windows,
    /// A factor of the windows, in `units` and as deviations from `means`.
    factor: DMatrix<f64>,
    means: DVector<f64>,
    units: Vec<f64>,
    /// T of the largest order: `x[k]` = T z.
    states: DMatrix<f64>,
    singular_values: Vec<f64>,
    feedthrough: bool,
}

impl Subspace {
    /// Steps 1 to 3 of [`crate::identification`]; D is zero without `feedthrough`.
    ///
    /// Cost: singular value decompositions of matrices with s (m + p) and s p columns.
    ///
    /// # Errors
    ///
    /// [`Error::TooFewSamples`] unless there are more windows than coefficients of the autoregressive model;
    /// [`Error::NotConverged`].
    pub fn new(windows: &Windows, feedthrough: bool) -> Result<Self, Error> {
        let (past, m) = (windows.past_columns().len(), windows.inputs);
        let regressors = past + if feedthrough { m } else { 0 };
        if windows.count <= 1 + regressors {
            let (expected, actual) = (windows.past + regressors + 2, windows.past + windows.count);
            return Err(Error::TooFewSamples { expected, actual });
        }
        let (factor, units) = windows.scaled();
        let width = factor.ncols() - 1;
        let means = factor.row(0).columns(1, width).transpose() / factor[(0, 0)];
        // The factor of the deviations is the factor without its first row; beside large means they would count as
        // rounding.
        let factor = factor.view((1, 1), (width, width)).into_owned();
        let outputs = factor.columns(past + m, windows.outputs).into_owned();
        let svd = Svd::new(&factor.columns(0, regressors).into_owned())?;
        let coefficients = svd.least_squares(&outputs, svd.rank(ROUNDING));
        let product = observability_product(windows, &coefficients);
        let deviations = factor.view((0, 0), (past, past));
        let svd = Svd::new(&(deviations * product.transpose()))?;
        let rank = svd.rank(ROUNDING);
        let balance = svd.values.rows(0, rank).map(f64::sqrt) * as_number(windows.count).powf(0.25);
        let balance = DMatrix::from_diagonal(&balance);
        let states = balance * svd.whitening(rank).transpose() * product;
        let singular_values = svd.values.iter().copied().take(rank).collect();
        let windows = windows.clone();
        Ok(Self { windows, factor, means, units, states, singular_values, feedthrough })
    }

    /// The singular values of step 3, descending; a gap after the n-th suggests n states.
    #[must_use]
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// The model of order `order`, step 4 of [`crate::identification`]. Its states are uncorrelated; the variance of
    /// each is the standard deviation of its effect on the next s measurements, in units of the signals' deviations.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] unless the order is between 1 and the number of singular values; [`Error::NotConverged`].
    pub fn model(&self, order: usize) -> Result<IdentifiedModel, Error> {
        let rule = "at least 1 and at most the number of states that the samples determine";
        let holds = (1..=self.states.nrows()).contains(&order);
        check::that(holds, "order", as_number(order), rule)?;
        let (past, signals) = (self.windows.past_columns().len(), self.windows.signals());
        let (m, p) = (self.windows.inputs, self.windows.outputs);
        let states = self.states.rows(0, order).into_owned();
        let transposed = states.transpose();
        let now = self.factor.columns(0, past) * &transposed;
        let next = self.factor.columns(signals, past) * &transposed;
        let inputs = self.factor.columns(past, m).into_owned();
        let outputs = self.factor.columns(past + m, p).into_owned();

        let no_inputs = inputs.columns(0, 0).into_owned();
        let direct = if self.feedthrough { &inputs } else { &no_inputs };
        let (of_outputs, innovations) = regression(&[&now, direct], &outputs)?;
        let (of_states, residuals) = regression(&[&now, &inputs], &next)?;
        let svd = Svd::new(&innovations)?;
        let rank = svd.rank_above(NO_INNOVATION * outputs.norm());
        let gain = svd.least_squares(&residuals, rank).transpose();

        let a = of_states.columns(0, order).into_owned();
        let b = of_states.columns(order, m).into_owned();
        let c = of_outputs.columns(0, order).into_owned();
        let mut d = DMatrix::zeros(p, m);
        d.columns_mut(0, direct.ncols()).copy_from(&of_outputs.columns(order, direct.ncols()));
        let mean = |first: usize, count: usize| self.means.rows(first, count).into_owned();
        let (x, x_next) = (&states * mean(0, past), &states * mean(signals, past));
        let (u, y) = (mean(past, m), mean(past + m, p));
        let scaled = IdentifiedModel {
            state_constant: x_next - &a * &x - &b * &u,
            output_constant: y - &c * x - &d * u,
            a,
            b,
            c,
            d,
            k: gain,
            past: states,
        };
        Ok(scaled.in_units(&self.units))
    }
}

/// The upper triangular block Toeplitz matrix of the predictor's coefficients, s p x s (m + p): times the s earlier
/// samples it is the extended observability matrix times `x[k]`. Block row j has the coefficients of `z[k-s]` to
/// `z[k-1]` for `y[k+j]`, zero for samples that are more than s before it.
fn observability_product(windows: &Windows, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
    let (past, signals, outputs) = (windows.past, windows.signals(), windows.outputs);
    DMatrix::from_fn(past * outputs, past * signals, |row, column| {
        let (ahead, output) = (row / outputs, row % outputs);
        let regressor = column.checked_sub(ahead * signals);
        regressor.map_or(0.0, |regressor| coefficients[(regressor, output)])
    })
}

/// Least squares: the coefficients, one row for each column of `targets`, and the residuals of the targets.
fn regression(
    parts: &[&DMatrix<f64>],
    targets: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    let columns: Vec<_> = parts.iter().flat_map(|part| part.column_iter()).collect();
    let all = DMatrix::from_columns(&columns);
    let svd = Svd::new(&all)?;
    let coefficients = svd.least_squares(targets, svd.rank(ROUNDING));
    let residuals = targets - &all * &coefficients;
    Ok((coefficients.transpose(), residuals))
}
