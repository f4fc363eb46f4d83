//! A matrix as a list of rows: the form of the design file and of the FMI variables.

use serde::{Deserialize, Serialize};

/// Rows times columns numbers, row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Vec<f64>>", into = "Vec<Vec<f64>>")]
pub struct Matrix {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// The elements, row by row.
    pub values: Vec<f64>,
}

impl Matrix {
    /// Name of the element at position `k` of `values`, as FMI writes it: `A[1,2]`.
    #[must_use]
    pub fn element(&self, name: &str, k: usize) -> String {
        format!("{name}[{},{}]", k / self.columns + 1, k % self.columns + 1)
    }

    /// The elements of row `i`, counted from 0.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..][..self.columns]
    }

    /// Sets all elements to zero.
    pub(crate) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds row i times `vector` to `sums[i]`, for each row. With `WHOLE` the products of a row are summed first,
    /// otherwise they are added to `sums[i]` one after the other.
    ///
    /// For short rows, the loop is unrolled, because it would cost more than the products.
    pub fn add_product<const WHOLE: bool>(&self, vector: &[f64], sums: &mut [f64]) {
        match self.columns {
            1 => add_rows::<1, WHOLE>(self.values.as_chunks().0, vector, sums),
            2 => add_rows::<2, WHOLE>(self.values.as_chunks().0, vector, sums),
            3 => add_rows::<3, WHOLE>(self.values.as_chunks().0, vector, sums),
            4 => add_rows::<4, WHOLE>(self.values.as_chunks().0, vector, sums),
            columns => {
                for (sum, row) in sums.iter_mut().zip(self.values.chunks_exact(columns)) {
                    add_row::<WHOLE>(row, vector, sum);
                }
            }
        }
    }
}

fn add_rows<const N: usize, const WHOLE: bool>(
    rows: &[[f64; N]],
    vector: &[f64],
    sums: &mut [f64],
) {
    if let Some(vector) = vector.first_chunk::<N>() {
        for (sum, row) in sums.iter_mut().zip(rows) {
            add_row::<WHOLE>(row, vector, sum);
        }
    }
}

#[inline]
fn add_row<const WHOLE: bool>(row: &[f64], vector: &[f64], sum: &mut f64) {
    let start = if WHOLE { -0.0 } else { *sum };
    let total = row.iter().zip(vector).fold(start, |total, (entry, x)| total + entry * x);
    *sum = if WHOLE { *sum + total } else { total };
}

impl TryFrom<Vec<Vec<f64>>> for Matrix {
    type Error = String;

    fn try_from(lines: Vec<Vec<f64>>) -> Result<Self, String> {
        let columns = lines.first().map_or(0, Vec::len);
        if let Some(row) = lines.iter().position(|line| line.len() != columns) {
            let length = lines[row].len();
            return Err(format!("row {} has {length} entries, row 1 has {columns}", row + 1));
        }
        if columns == 0 {
            return Err("a matrix needs at least one row and one column".to_owned());
        }
        Ok(Self { rows: lines.len(), columns, values: lines.concat() })
    }
}

impl From<Matrix> for Vec<Vec<f64>> {
    fn from(matrix: Matrix) -> Self {
        matrix.values.chunks(matrix.columns).map(<[f64]>::to_vec).collect()
    }
}
