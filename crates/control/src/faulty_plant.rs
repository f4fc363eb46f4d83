//! The plant with faults.

use crate::balance::unit_columns;
use crate::blocks::block_2x2;
use crate::svd::Svd;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// Singular values of B, its columns scaled to length one, below this fraction of the largest count as zero.
const TOLERANCE: f64 = 1e-12;

/// The plant with faults, (1) of [`crate::aso`], and the fault model: x' = A x + B u + `F_a` f, f' = `A_f` f, y = C x;
/// in sampled time x[k+1], f[k+1] in place of x', f'.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultyPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// `F_a`, n x q: the effect of the faults on the states. A force against the actuator has `F_a` = -B.
    pub f_a: DMatrix<f64>,
    /// `A_f`, q x q: the fault model. 0 for constant faults; I for constant faults in sampled time.
    pub a_f: DMatrix<f64>,
}

impl FaultyPlant {
    /// Creates the plant of [`crate::aso`] with constant faults: `A_f` = 0.
    ///
    /// `a`: n x n; `b`: n x m; `c`: p x n; `f_a`: n x q, checked by the functions that use the plant.
    #[must_use]
    pub fn with_constant_faults(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        f_a: DMatrix<f64>,
    ) -> Self {
        let a_f = DMatrix::zeros(f_a.ncols(), f_a.ncols());
        Self { a, b, c, f_a, a_f }
    }

    /// The plant from the commands to the measurements, {A, B, C, 0}.
    #[must_use]
    pub fn commanded(&self, domain: Domain) -> StateSpace {
        StateSpace::strictly_proper(self.a.clone(), self.b.clone(), self.c.clone(), domain)
    }

    /// Checks shapes and finiteness of the five matrices.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], with the name of the matrix.
    pub fn check(&self) -> Result<(), Error> {
        let n = check::with_inputs(&self.a, &self.b)?;
        check::shape("C", &self.c, (self.c.nrows(), n))?;
        check::shape("F_a", &self.f_a, (n, self.f_a.ncols()))?;
        check::shape("A_f", &self.a_f, (self.f_a.ncols(), self.f_a.ncols()))
    }

    /// The dynamics of states and faults, `A_0` = [A, -`F_a`; 0, `A_f`], (n + q) x (n + q); (10) of [`crate::aso`] if B
    /// `K_f` = -`F_a`, `A_f` = 0.
    #[must_use]
    pub fn augmented_dynamics(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        block_2x2([&self.a, &-&self.f_a], [&DMatrix::zeros(q, n), &self.a_f])
    }

    /// The measurements of states and faults, `C_0` = [C, 0], p x (n + q).
    #[must_use]
    pub fn augmented_output(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        self.c.clone().resize_horizontally(n + q, 0.0)
    }

    /// `F_0` = [-`F_a`; 0], (n + q) x q: a fault f enters the error dynamics, (11) of [`crate::aso`], as -`F_0` f.
    #[must_use]
    pub fn augmented_fault(&self) -> DMatrix<f64> {
        let (n, q) = self.f_a.shape();
        (-&self.f_a).resize_vertically(n + q, 0.0)
    }

    /// The `K_f`, m x q, of least norm among those that minimise the norm of B `K_f` + `F_a`.
    ///
    /// This gain always exists. The compensation is complete if the columns of `F_a` are in the range of
    /// B; [`crate::aso::AsoDesign::cancellation_residual`] measures the part that is not cancelled.
    /// Singular values of B, its columns scaled to length one, below 1e-12 of the largest count as zero.
    ///
    /// # Errors
    ///
    /// Same as [`FaultyPlant::check`]; [`Error::NotConverged`].
    pub fn compensation_gain(&self) -> Result<DMatrix<f64>, Error> {
        self.check()?;
        let rank = Svd::new(&unit_columns(&self.b))?.rank(TOLERANCE);
        let b = Svd::new(&self.b)?;
        let gain = b.least_squares(&-&self.f_a, rank);
        let correction = b.least_squares(&(&self.b * &gain + &self.f_a), rank);
        Ok(gain - correction)
    }
}
