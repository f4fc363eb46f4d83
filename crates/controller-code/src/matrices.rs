//! Matrices by their symbols.

use nalgebra::DMatrix;

use super::parts::dense;
use super::symbols::Matrix;

/// Matrices by their symbols.
pub(super) struct Matrices(pub(super) Vec<(Matrix, DMatrix<f64>)>);

impl Matrices {
    /// The stated matrices, whose names are those of [`Matrix`].
    pub(super) fn of<'a>(
        stated: impl Iterator<Item = (&'static str, &'a aso_controller::Matrix)>,
    ) -> Self {
        let stated: Vec<_> = stated.collect();
        let named = |matrix: Matrix| {
            let (_, values) = stated.iter().find(|(name, _)| *name == matrix.name())?;
            Some((matrix, dense(values)))
        };
        Self(Matrix::ALL.into_iter().filter_map(named).collect())
    }

    pub(super) fn get(&self, matrix: Matrix) -> Option<&DMatrix<f64>> {
        self.0.iter().find(|(other, _)| *other == matrix).map(|(_, values)| values)
    }
}
