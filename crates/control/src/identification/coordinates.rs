//! States that are measurements and their rates.

use nalgebra::{DMatrix, DVector, RowDVector};

use crate::svd::Svd;
use crate::{Error, check};

/// Measurements and rates count as independent if their rows, scaled to unit length, have an inverse condition number
/// above this.
const SMALLEST: f64 = 1e-3;

/// States of a continuous plant that are its measurements and their rates.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MeasuredStates {
    /// T, n x n: the new states are z = T x, with C T^-1 = [I, 0].
    pub change: DMatrix<f64>,
    /// The inverse T^-1.
    pub inverse: DMatrix<f64>,
    /// The measurements i, from 0, whose rates without commands, `C[i] A x`, are the remaining states.
    pub rates: Vec<usize>,
}

impl MeasuredStates {
    /// Chooses the measurements C x as states and, if there are further states, the rates that depend least on the
    /// states before them: T = [C; C A] for n = 2 p, such as positions and speeds.
    ///
    /// `a`: n x n; `c`: p x n. Rows are compared by their directions, so the states should be balanced. None if n is
    /// less than p or more than 2 p, or if the rows of T, at unit length, have a condition number of 1000 or more.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::NotConverged`].
    pub fn new(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<Option<Self>, Error> {
        let (n, p) = (check::with_outputs(a, c)?, c.nrows());
        if n < p || n > 2 * p {
            return Ok(None);
        }
        let all_rates = c * a;
        let mut rows: Vec<_> = c.row_iter().map(RowDVector::from).collect();
        let mut rates = Vec::new();
        while rows.len() < n {
            let mut independence = Vec::new();
            for at in (0..p).filter(|at| !rates.contains(at)) {
                let mut candidate = rows.clone();
                candidate.push(all_rates.row(at).into());
                independence.push((inverse_condition(&candidate)?, at));
            }
            let most = independence.into_iter().max_by(|one, other| one.0.total_cmp(&other.0));
            let Some((_, at)) = most else { return Ok(None) };
            rows.push(all_rates.row(at).into());
            rates.push(at);
        }
        let is_independent = inverse_condition(&rows)? > SMALLEST;
        let change = DMatrix::from_rows(&rows);
        let inverse = change.clone().try_inverse().filter(|_| is_independent);
        Ok(inverse.map(|inverse| Self { change, inverse, rates }))
    }
}

/// The smallest over the largest singular value of the rows, scaled to unit length; 0 if a row is zero.
fn inverse_condition(rows: &[RowDVector<f64>]) -> Result<f64, Error> {
    let columns: Vec<_> = rows.iter().map(RowDVector::transpose).collect();
    if columns.iter().any(|column| column.norm() <= 0.0) {
        return Ok(0.0);
    }
    let directions: Vec<_> = columns.iter().map(DVector::normalize).collect();
    let values = Svd::new(&DMatrix::from_columns(&directions))?.values;
    Ok(values[values.len() - 1] / values[0])
}
