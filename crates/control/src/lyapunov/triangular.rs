//! Lyapunov equations by substitution in Schur form.

use crate::Error;
use crate::eigen::{reflection, schur};
use nalgebra::{Complex, DMatrix};

/// The complex Schur form A = U T U*, T upper triangular.
pub(super) struct Triangular {
    u: DMatrix<Complex<f64>>,
    t: DMatrix<Complex<f64>>,
}

impl Triangular {
    /// Computes the form, by a reflected A if the QR algorithm does not converge for A.
    pub(super) fn new(a: &DMatrix<f64>) -> Result<Self, Error> {
        let complex = |m: &DMatrix<f64>| m.map(|entry| Complex::new(entry, 0.0));
        if let Ok(form) = schur(&complex(a)) {
            let (u, t) = form.unpack();
            return Ok(Self { u, t });
        }
        let h = reflection(a.nrows());
        let (u, t) = schur(&complex(&(&h * a * &h)))?.unpack();
        Ok(Self { u: complex(&h) * u, t })
    }

    /// Solves A' P + P A = -Q: T* Y + Y T = -U* Q U column by column, forward in the rows; P = Re(U Y U*).
    pub(super) fn continuous(&self, q: &DMatrix<f64>) -> DMatrix<f64> {
        let (t, n) = (&self.t, self.t.nrows());
        let mut y = self.enter_schur_basis(q);
        for col in 0..n {
            for row in 0..n {
                let mut sum = -y[(row, col)];
                for k in 0..col {
                    sum -= y[(row, k)] * t[(k, col)];
                }
                for k in 0..row {
                    sum -= t[(k, row)].conj() * y[(k, col)];
                }
                y[(row, col)] = sum / (t[(row, row)].conj() + t[(col, col)]);
            }
        }
        self.leave_schur_basis(&y)
    }

    /// Solves A' P A - P = -Q: T* Y T - Y = -U* Q U column by column, forward in the rows; P = Re(U Y U*).
    pub(super) fn discrete(&self, q: &DMatrix<f64>) -> DMatrix<f64> {
        let (t, n) = (&self.t, self.t.nrows());
        let mut y = self.enter_schur_basis(q);
        for col in 0..n {
            // Column `col` of Y T without the entries of Y that are not known yet.
            let mut product = y.columns(0, col) * t.view((0, col), (col, 1));
            for row in 0..n {
                let mut sum = -y[(row, col)];
                for k in 0..row {
                    sum -= t[(k, row)].conj() * product[k];
                }
                sum -= t[(row, row)].conj() * product[row];
                y[(row, col)] = sum / (t[(row, row)].conj() * t[(col, col)] - 1.0);
                product[row] += y[(row, col)] * t[(col, col)];
            }
        }
        self.leave_schur_basis(&y)
    }

    fn enter_schur_basis(&self, q: &DMatrix<f64>) -> DMatrix<Complex<f64>> {
        self.u.adjoint() * q.map(|entry| Complex::new(entry, 0.0)) * &self.u
    }

    fn leave_schur_basis(&self, y: &DMatrix<Complex<f64>>) -> DMatrix<f64> {
        (&self.u * y * self.u.adjoint()).map(|entry| entry.re)
    }
}
