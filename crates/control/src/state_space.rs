//! The linear system {A, B, C, D}.

use crate::balance::{Balance, divide_rows, multiply_columns};
use crate::{Domain, Error, check, stability};
use nalgebra::{Complex, DMatrix};

/// A linear system with n states x, m inputs w and p outputs z.
///
/// ```text
/// x' = A x + B w,            z = C x + D w           continuous
/// x[k+1] = A x[k] + B w[k],  z[k] = C x[k] + D w[k]  sampled
/// ```
///
/// The fields are public and unchecked; functions of this crate that return a `Result` check what they use.
///
/// # Example
///
/// ```
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let lag = StateSpace {
///     a: one(-2.0),
///     b: one(1.0),
///     c: one(2.0),
///     d: one(0.0),
///     domain: Domain::Continuous,
/// };
/// assert!(lag.check().is_ok());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// D, p x m.
    pub d: DMatrix<f64>,
    /// Continuous or sampled time.
    pub domain: Domain,
}

impl StateSpace {
    /// The system {A, B, C, 0}.
    #[must_use]
    pub fn strictly_proper(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        domain: Domain,
    ) -> Self {
        let d = DMatrix::zeros(c.nrows(), b.ncols());
        Self { a, b, c, d, domain }
    }

    /// Checks shapes and finiteness of the four matrices, and the period.
    ///
    /// # Errors
    ///
    /// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`], naming the matrix;
    /// [`Error::OutOfRange`] for the period.
    pub fn check(&self) -> Result<(), Error> {
        let n = check::with_inputs(&self.a, &self.b)?;
        check::shape("C", &self.c, (self.c.nrows(), n))?;
        check::shape("D", &self.d, (self.c.nrows(), self.b.ncols()))?;
        self.domain.check()
    }

    /// Checks the system and that it is stable; returns the eigenvalues of A.
    pub(crate) fn stable_eigenvalues(&self) -> Result<Vec<Complex<f64>>, Error> {
        self.check()?;
        stability::require_stable("A", &self.a, self.domain)
    }

    /// The system in coordinates in which A is balanced as a part of [A, B; C, 0].
    pub(crate) fn balanced(&self) -> Self {
        let Balance { matrix, scale } = Balance::of_system(&self.a, &self.b, &self.c);
        let (b, c) = (divide_rows(&self.b, &scale), multiply_columns(&self.c, &scale));
        Self { a: matrix, b, c, d: self.d.clone(), domain: self.domain }
    }

    /// The system from one input to one output, both counted from zero.
    ///
    /// # Panics
    ///
    /// If the system has no such output or input.
    #[must_use]
    pub fn path(&self, output: usize, input: usize) -> Self {
        Self {
            a: self.a.clone(),
            b: self.b.columns(input, 1).into(),
            c: self.c.rows(output, 1).into(),
            d: self.d.view((output, input), (1, 1)).into(),
            domain: self.domain,
        }
    }

    /// The dual system {A', C', B', D'}.
    pub(crate) fn dual(&self) -> Self {
        Self {
            a: self.a.transpose(),
            b: self.c.transpose(),
            c: self.b.transpose(),
            d: self.d.transpose(),
            domain: self.domain,
        }
    }

    /// s I - A at the eigenvalue of a constant signal: -A in continuous time (s = 0), I - A in
    /// sampled time (z = 1). A constant input w leads to the state x with (s I - A) x = B w.
    pub(crate) fn dc_matrix(&self) -> DMatrix<f64> {
        match self.domain {
            Domain::Continuous => -&self.a,
            Domain::Sampled { .. } => DMatrix::identity(self.a.nrows(), self.a.nrows()) - &self.a,
        }
    }
}
