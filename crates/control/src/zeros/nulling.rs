//! The motions that the outputs of a system do not show.

use super::{TOLERANCE_PER_SIGNAL, reduce};
use crate::balance::{Balance, column_lengths, divide_rows, multiply_columns};
use crate::blocks::stacked;
use crate::svd::Svd;
use crate::{Error, StateSpace, check};
use nalgebra::DMatrix;

/// The motions for which y stays zero: v' = S v with w = W v and z = Z v, where v has s entries.
pub(crate) struct Nulling {
    /// S, s x s, whose eigenvalues are the invariant zeros.
    pub(crate) dynamics: DMatrix<f64>,
    /// W, k x s, of the inputs w = W v.
    pub(crate) input: DMatrix<f64>,
    /// Z, r x s, of the outputs z = Z v.
    pub(crate) output: DMatrix<f64>,
    /// The size of the rounding errors of the dynamics S.
    pub(crate) rounding: f64,
}

/// Computes the motions of x' = A x + B w that y = C x + D w does not show, with z = E x + G w.
///
/// `system`: A to D; `output`: E, r x n; `direct`: G, r x k. None if w is not determined by y: D of the reduced
/// system is not square then, and some w has no effect on y. Method: [`super::zeros()`], with D; states are
/// balanced, columns of [B; D] and rows of [C, D] scaled to the norm of A.
pub(crate) fn output_nulling(
    system: &StateSpace,
    output: &DMatrix<f64>,
    direct: &DMatrix<f64>,
) -> Result<Option<Nulling>, Error> {
    let Balance { matrix: a, scale } = Balance::of_system(&system.a, &system.b, &system.c);
    let size = if a.norm().is_normal() { a.norm() } else { 1.0 };
    let (b, c) = (divide_rows(&system.b, &scale), multiply_columns(&system.c, &scale));
    let columns = column_lengths(&stacked(&b, &system.d)).map(|length| size / length);
    let rows = stacked(&c.transpose(), &system.d.transpose());
    let rows = column_lengths(&rows).map(|length| size / length);
    let signals = a.nrows() + b.ncols() + c.nrows();
    let scaled = StateSpace {
        b: multiply_columns(&b, &columns),
        c: DMatrix::from_diagonal(&rows) * c,
        d: DMatrix::from_diagonal(&rows) * multiply_columns(&system.d, &columns),
        a,
        domain: system.domain,
    };
    let norms = [&scaled.a, &scaled.b, &scaled.c, &scaled.d].map(DMatrix::norm);
    let size = norms.into_iter().fold(0.0, f64::hypot);
    let zero = TOLERANCE_PER_SIGNAL * check::as_number(signals) * size;
    let (core, output) = reduce(scaled, multiply_columns(output, &scale), zero)?;
    let inputs = core.b.ncols();
    if core.d.nrows() != inputs || Svd::new(&core.d)?.rank_above(zero) < inputs {
        return Ok(None);
    }
    let quotient = core.d.lu().solve(&core.c).ok_or(Error::Overflow { what: "D^-1 C" })?;
    let dynamics = check::in_range("A - B D^-1 C", core.a - core.b * &quotient)?;
    let input = -(DMatrix::from_diagonal(&columns) * quotient);
    let output = output + direct * &input;
    Ok(Some(Nulling { dynamics, output, input, rounding: zero }))
}
