//! The plant with commands, disturbances and faults.

use super::decoupled::{Gap, observable_states, size_or_one};
use crate::balance::{Balance, divide_rows, multiply_columns, unit_columns};
use crate::blocks::beside;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// A plant with n states x, m commands u, disturbances d, q faults f and p measurements y.
///
/// ```text
/// x' = A x + B_u u + B_d d + B_f f,   y = C x + D_u u + D_d d + D_f f
/// ```
///
/// with `x[k+1]` for x' in sampled time. There may be no disturbances: `B_d` n x 0, `D_d` p x 0. An actuator fault has
/// the column of its command, a sensor fault a column of `D_f` that is a column of the identity matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct DisturbedPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// `B_u`, n x m: the effect of the commands on the states.
    pub b_u: DMatrix<f64>,
    /// `B_d`, n x (number of disturbances): the effect of the disturbances on the states.
    pub b_d: DMatrix<f64>,
    /// `B_f`, n x q: the effect of the faults on the states.
    pub b_f: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// `D_u`, p x m: the effect of the commands on the measurements.
    pub d_u: DMatrix<f64>,
    /// `D_d`, p x (number of disturbances): the effect of the disturbances on the measurements.
    pub d_d: DMatrix<f64>,
    /// `D_f`, p x q: the effect of the faults on the measurements.
    pub d_f: DMatrix<f64>,
    /// Continuous or sampled time.
    pub domain: Domain,
}

impl DisturbedPlant {
    /// Checks shapes and finiteness of the eight matrices, and the period.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix;
    /// [`Error::OutOfRange`] for the period.
    pub fn check(&self) -> Result<(), Error> {
        let (n, p) = (check::square("A", &self.a)?, self.c.nrows());
        let (m, q, disturbances) = (self.b_u.ncols(), self.b_f.ncols(), self.b_d.ncols());
        check::shape("B_u", &self.b_u, (n, m))?;
        check::shape("B_f", &self.b_f, (n, q))?;
        check::shape("C", &self.c, (p, n))?;
        check::shape("D_u", &self.d_u, (p, m))?;
        check::shape("D_f", &self.d_f, (p, q))?;
        for (name, matrix, rows) in [("B_d", &self.b_d, n), ("D_d", &self.d_d, p)] {
            if matrix.shape() != (rows, 0) || disturbances > 0 {
                check::shape(name, matrix, (rows, disturbances))?;
            }
        }
        self.domain.check()
    }

    /// `B_d` and `D_d`, extended by the columns of `B_f` and `D_f` for the faults to decouple.
    pub(super) fn unknown_inputs(&self, decoupled: &[bool]) -> (DMatrix<f64>, DMatrix<f64>) {
        let faults: Vec<usize> = (0..decoupled.len()).filter(|&j| decoupled[j]).collect();
        let with_faults =
            |m: &DMatrix<f64>, of: &DMatrix<f64>| beside(m, &of.select_columns(&faults));
        (with_faults(&self.b_d, &self.b_f), with_faults(&self.d_d, &self.d_f))
    }

    /// The plant in balanced coordinates without the modes that no input moves, and the number of these modes.
    ///
    /// Such a mode, for example the norm of a quaternion, depends on the initial state alone.
    /// [`super::residual_generator`] leaves it out, so that its initial value counts as zero. Method: A is
    /// balanced; then the staircase form of (A, [`B_u`, `B_d`, `B_f`]) by orthogonal transformations,
    /// where singular values below `tolerance` count as zero, relative to |A| and to columns of length one.
    ///
    /// # Errors
    ///
    /// Same as [`DisturbedPlant::check`]; [`Error::NotConverged`] if singular values are not found.
    pub fn reachable_part(&self, tolerance: f64) -> Result<(Self, usize), Error> {
        self.check()?;
        let n = self.a.nrows();
        let Balance { matrix, scale } = Balance::new(&self.a);
        let size = size_or_one(&matrix);
        let [b_u, b_d, b_f] = [&self.b_u, &self.b_d, &self.b_f].map(|b| divide_rows(b, &scale));
        let inputs = unit_columns(&beside(&beside(&b_u, &b_d), &b_f)).transpose();
        let mut gap = Gap::none();
        let dual = (&matrix / size).transpose();
        let (basis, _) = observable_states(&dual, &inputs, tolerance, &mut gap)?;
        // If all modes are reachable, only the scale of the coordinates changes.
        let unreachable = n - basis.ncols();
        let basis = if unreachable == 0 { DMatrix::identity(n, n) } else { basis };
        let part = Self {
            a: basis.tr_mul(&matrix) * &basis,
            b_u: basis.tr_mul(&b_u),
            b_d: basis.tr_mul(&b_d),
            b_f: basis.tr_mul(&b_f),
            c: multiply_columns(&self.c, &scale) * basis,
            ..self.clone()
        };
        Ok((part, unreachable))
    }
}
