//! Checks of arguments: shape, finiteness, sign.

use crate::Error;
use nalgebra::DMatrix;

/// Checks that every entry is finite and that there is at least one.
pub(crate) fn finite(matrix: &'static str, m: &DMatrix<f64>) -> Result<(), Error> {
    if m.is_empty() {
        return Err(Error::Empty { matrix, actual: m.shape() });
    }
    let Some(at) = m.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let (row, col) = (at % m.nrows() + 1, at / m.nrows() + 1);
    Err(Error::NotFinite { matrix, row, col, value: m[at] })
}

/// Checks that a matrix has the expected shape, is not empty and is finite.
pub(crate) fn shape(
    matrix: &'static str,
    m: &DMatrix<f64>,
    expected: (usize, usize),
) -> Result<(), Error> {
    if m.shape() != expected {
        return Err(Error::Shape { matrix, expected, actual: m.shape() });
    }
    finite(matrix, m)
}

/// Checks that a matrix is square, not empty and finite; returns its order.
pub(crate) fn square(matrix: &'static str, m: &DMatrix<f64>) -> Result<usize, Error> {
    shape(matrix, m, (m.nrows(), m.nrows()))?;
    Ok(m.nrows())
}

/// Checks A, n x n, and B, n x m; returns n.
pub(crate) fn with_inputs(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<usize, Error> {
    let n = square("A", a)?;
    shape("B", b, (n, b.ncols()))?;
    Ok(n)
}

/// Checks A, n x n, and C, p x n; returns n.
pub(crate) fn with_outputs(a: &DMatrix<f64>, c: &DMatrix<f64>) -> Result<usize, Error> {
    let n = square("A", a)?;
    shape("C", c, (c.nrows(), n))?;
    Ok(n)
}

/// Checks that a column has `rows` entries, at least one, and that all are finite.
pub(crate) fn column(name: &'static str, entries: &[f64], rows: usize) -> Result<(), Error> {
    shape(name, &DMatrix::from_column_slice(entries.len(), 1, entries), (rows, 1))
}

/// Checks the number of entries, not their values.
pub(crate) fn length<T>(matrix: &'static str, list: &[T], expected: usize) -> Result<(), Error> {
    if list.len() == expected {
        return Ok(());
    }
    Err(Error::Shape { matrix, expected: (expected, 1), actual: (list.len(), 1) })
}

/// Checks that a number is finite and above zero.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    that(value.is_finite() && value > 0.0, name, value, "a finite number above zero")
}

/// Returns [`Error::OutOfRange`] with `rule` unless the rule `holds`.
pub(crate) fn that(
    holds: bool,
    name: &'static str,
    value: f64,
    rule: &'static str,
) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::OutOfRange { name, value, rule }) }
}

/// Checks that a computed matrix is within the range of double precision.
pub(crate) fn in_range(what: &'static str, m: DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    if m.iter().all(|value| value.is_finite()) { Ok(m) } else { Err(Error::Overflow { what }) }
}

#[expect(clippy::cast_precision_loss, reason = "far below 2^52")]
pub(crate) fn as_number(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_entry_that_is_not_finite_is_named_by_row_and_column_from_one() {
        let mut m = DMatrix::zeros(2, 3);
        m[(1, 2)] = f64::INFINITY;
        let expected = Error::NotFinite { matrix: "B", row: 2, col: 3, value: f64::INFINITY };
        assert_eq!(finite("B", &m), Err(expected));
    }

    #[test]
    fn an_empty_matrix_is_refused() {
        assert!(matches!(finite("B", &DMatrix::zeros(3, 0)), Err(Error::Empty { .. })));
    }

    #[test]
    fn a_number_that_is_not_positive_is_refused() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(positive("h", value), Err(Error::OutOfRange { .. })));
        }
    }
}
