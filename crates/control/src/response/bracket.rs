//! Bounds of the entries of a matrix.

use nalgebra::DMatrix;

/// Lower and upper bounds of a matrix, entry by entry.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Bracket {
    /// p x m.
    pub lower: DMatrix<f64>,
    /// p x m.
    pub upper: DMatrix<f64>,
}
