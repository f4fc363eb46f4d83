//! The controllable part of a pair, for feedback of a pair that is only stabilisable.

use super::{Mode, Staircase, modes_of};
use crate::balance::{divide_columns, multiply_rows};
use crate::{Error, check};
use nalgebra::DMatrix;

/// The controllable part of x' = A x + B u, and the modes that no feedback moves.
///
/// ```text
/// z = T x:  z' = A_1 z + (effect of the uncontrollable states) + B_1 u
/// eigenvalues of A + B K_1 T = those of A_1 + B_1 K_1 and those of the fixed modes
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ControllablePart {
    /// `A_1`, r x r: the dynamics of the controllable part, with r the rank of the controllability matrix.
    pub a: DMatrix<f64>,
    /// `B_1`, r x m: the effect of the inputs on the controllable part.
    pub b: DMatrix<f64>,
    /// T, r x n: from x to the states z of the controllable part.
    pub coordinates: DMatrix<f64>,
    /// V, n x r: its columns span the controllable subspace, T V = I.
    pub basis: DMatrix<f64>,
    /// The n - r uncontrollable modes, see [`super::uncontrollable_modes`].
    pub fixed: Vec<Mode>,
}

impl ControllablePart {
    /// The pair to compute a gain for: (`A_1`, `B_1`), or without fixed modes (A, B) in its own coordinates.
    #[must_use]
    pub fn pair<'a>(
        &'a self,
        a: &'a DMatrix<f64>,
        b: &'a DMatrix<f64>,
    ) -> (&'a DMatrix<f64>, &'a DMatrix<f64>) {
        if self.fixed.is_empty() { (a, b) } else { (&self.a, &self.b) }
    }

    /// K, m x n, from the gain of the pair of [`Self::pair`].
    #[must_use]
    pub fn complete(&self, gain: &DMatrix<f64>) -> DMatrix<f64> {
        if self.fixed.is_empty() { gain.clone() } else { self.gain(gain) }
    }

    /// K, m x n, of the feedback u = `K_1` z of the controllable part: K = `K_1` T.
    #[must_use]
    pub fn gain(&self, part_gain: &DMatrix<f64>) -> DMatrix<f64> {
        part_gain * &self.coordinates
    }
}

/// Splits x' = A x + B u into the controllable part and the uncontrollable modes.
///
/// `a`: n x n; `b`: n x m. T = `Q_1`' S^-1 with the scales S of the states and the orthonormal basis
/// `Q_1` of the controllable states in the staircase form. Method, cost and tolerance: see [`super::controllability`].
///
/// # Example
///
/// The mode -2 is not controllable; the other eigenvalue is moved to -3:
///
/// ```
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, -2.0]);
/// let b = DMatrix::from_row_slice(2, 1, &[1.0, 0.0]);
/// let part = control::rank::controllable_part(&a, &b)?;
/// let k_1 = DMatrix::from_element(1, 1, (-3.0 - part.a[(0, 0)]) / part.b[(0, 0)]);
/// let closed = control::eigen::eigenvalues(&(&a + &b * part.gain(&k_1)))?;
/// assert!((closed[0] + 3.0).norm() < 1e-14 && (closed[1] + 2.0).norm() < 1e-14);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`super::controllability`].
pub fn controllable_part(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<ControllablePart, Error> {
    check::with_inputs(a, b)?;
    let staircase = Staircase::new(a, b)?;
    Ok(ControllablePart {
        a: staircase.reached_dynamics(),
        b: staircase.reached_input(b),
        coordinates: divide_columns(&staircase.controllable_basis.transpose(), &staircase.scale),
        basis: multiply_rows(&staircase.controllable_basis, &staircase.scale),
        fixed: modes_of(&staircase)?,
    })
}
