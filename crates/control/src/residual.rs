//! Residual generators: linear systems from commands and measurements to residuals.

use crate::blocks::beside;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// A residual generator with n states, m commands u, p measurements y and k residuals r.
///
/// ```text
/// x_r'     = A x_r    + B_u u    + B_y y,     r    = C x_r    + D_u u    + D_y y       continuous
/// x_r[k+1] = A x_r[k] + B_u u[k] + B_y y[k],  r[k] = C x_r[k] + D_u u[k] + D_y y[k]    sampled
/// ```
///
/// Without faults, disturbances and noise r converges to 0 for all commands. The fields are public; functions that
/// return a `Result` check them.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualGenerator {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// `B_u`, n x m: the effect of the commands on the states.
    pub b_u: DMatrix<f64>,
    /// `B_y`, n x p: the effect of the measurements on the states.
    pub b_y: DMatrix<f64>,
    /// C, k x n.
    pub c: DMatrix<f64>,
    /// `D_u`, k x m: the effect of the commands on the residuals.
    pub d_u: DMatrix<f64>,
    /// `D_y`, k x p: the effect of the measurements on the residuals.
    pub d_y: DMatrix<f64>,
    /// Continuous or sampled time.
    pub domain: Domain,
}

impl ResidualGenerator {
    /// Checks shapes and finiteness of the matrices, and the period. n (a static generator) and m may be 0.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix; [`Error::OutOfRange`]
    /// for the period.
    pub fn check(&self) -> Result<(), Error> {
        let (n, k) = (self.a.nrows(), self.d_y.nrows());
        let (m, p) = (self.d_u.ncols(), self.d_y.ncols());
        check::shape("D_y", &self.d_y, (k, p))?;
        let all = [
            ("A", &self.a, (n, n)),
            ("B_u", &self.b_u, (n, m)),
            ("B_y", &self.b_y, (n, p)),
            ("C", &self.c, (k, n)),
            ("D_u", &self.d_u, (k, m)),
        ];
        for (name, matrix, shape) in all {
            if shape.0 > 0 && shape.1 > 0 {
                check::shape(name, matrix, shape)?;
            } else if matrix.shape() != shape {
                let (expected, actual) = (shape, matrix.shape());
                return Err(Error::Shape { matrix: name, expected, actual });
            }
        }
        self.domain.check()
    }

    /// Returns the generator as one system from [u; y] to r: B = [`B_u`, `B_y`], D = [`D_u`, `D_y`].
    ///
    /// # Panics
    ///
    /// If the shapes do not fit, see [`Self::check`].
    #[must_use]
    pub fn system(&self) -> StateSpace {
        StateSpace {
            a: self.a.clone(),
            b: beside(&self.b_u, &self.b_y),
            c: self.c.clone(),
            d: beside(&self.d_u, &self.d_y),
            domain: self.domain,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn generator() -> ResidualGenerator {
        ResidualGenerator {
            a: DMatrix::from_element(1, 1, -2.0),
            b_u: DMatrix::from_element(1, 1, 1.0),
            b_y: DMatrix::from_row_slice(1, 2, &[3.0, 4.0]),
            c: DMatrix::from_element(1, 1, 5.0),
            d_u: DMatrix::from_element(1, 1, 6.0),
            d_y: DMatrix::from_row_slice(1, 2, &[7.0, 8.0]),
            domain: Domain::Continuous,
        }
    }

    #[test]
    fn the_system_has_the_commands_before_the_measurements() {
        let system = generator().system();
        assert_eq!(system.b.as_slice(), [1.0, 3.0, 4.0]);
        assert_eq!(system.d.as_slice(), [6.0, 7.0, 8.0]);
        assert!(system.check().is_ok());
    }

    #[test]
    fn a_matrix_of_the_wrong_shape_is_named_and_a_generator_may_have_no_states() {
        let mut wrong = generator();
        wrong.b_y = DMatrix::zeros(1, 1);
        assert!(matches!(wrong.check(), Err(Error::Shape { matrix: "B_y", .. })));
        let empty = |rows, columns| DMatrix::zeros(rows, columns);
        let constant = ResidualGenerator {
            a: empty(0, 0),
            b_u: empty(0, 1),
            b_y: empty(0, 2),
            c: empty(1, 0),
            ..generator()
        };
        assert_eq!(constant.check(), Ok(()));
    }
}
