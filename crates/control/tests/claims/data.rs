//! The matrices of `tests/data/faults.txt`, written by `scripts/reference/reference_faults.py`.

use crate::matrix;
use nalgebra::DMatrix;

const FILE: &str = include_str!("../data/faults.txt");

/// Returns the matrix with that name.
pub(crate) fn reference(name: &str) -> DMatrix<f64> {
    let mut lines = FILE.lines();
    let head = lines.find(|line| line.split(' ').next() == Some(name));
    let sizes: Vec<usize> =
        head.expect(name).split(' ').skip(1).map(|size| size.parse().expect("a size")).collect();
    let rows: Vec<&str> = lines.take(sizes[0]).collect();
    let entries: Vec<f64> = rows
        .iter()
        .flat_map(|row| row.split(' '))
        .map(|entry| entry.parse().expect("a number"))
        .collect();
    matrix(sizes[0], sizes[1], &entries)
}
