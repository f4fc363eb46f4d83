//! The orthogonal factor of a QR decomposition by Householder reflections.

use nalgebra::{ComplexField, DMatrix, DVector};

/// The Q of M = Q R, as the product of the reflections H = I - tau v v*.
///
/// Q has the signs and the columns, also the columns orthogonal to M, that LAPACK computes.
pub(crate) struct Reflections<T> {
    rows: usize,
    /// tau and v of each reflection; v of reflection k lacks its first k entries, which are zero, and
    /// begins with 1. tau = 0 if column k is zero below its diagonal.
    all: Vec<(T, DVector<T>)>,
}

impl<T: ComplexField<RealField = f64>> Reflections<T> {
    /// Decomposes `m`. Cost: about r c^2 multiplications for r x c, r > c.
    pub(crate) fn new(mut m: DMatrix<T>) -> Self {
        let (rows, columns) = m.shape();
        let mut all = Vec::with_capacity(columns);
        for k in 0..rows.min(columns) {
            let mut v: DVector<T> = m.view((k, k), (rows - k, 1)).column(0).into_owned();
            let first = v[0].clone();
            let rest = v.rows(1, rows - k - 1).norm();
            if rest <= 0.0 && first.clone().imaginary().abs() <= 0.0 {
                all.push((T::zero(), v));
                continue;
            }
            let pivot =
                T::from_real(-first.clone().modulus().hypot(rest).copysign(first.clone().real()));
            let tau = (pivot.clone() - first.clone()) / pivot.clone();
            v /= first - pivot;
            v[0] = T::one();
            for column in k + 1..columns {
                let mut part = m.view_mut((k, column), (rows - k, 1));
                let factor = tau.clone().conjugate() * v.dotc(&part);
                part.zip_apply(&v, |entry, v| *entry -= v * factor.clone());
            }
            all.push((tau, v));
        }
        Self { rows, all }
    }

    /// The last `count` columns of Q.
    pub(crate) fn last_columns(&self, count: usize) -> DMatrix<T> {
        let first = self.rows - count;
        let mut q = DMatrix::zeros(self.rows, count);
        q.rows_mut(first, count).fill_with_identity();
        for (k, (tau, v)) in self.all.iter().enumerate().rev() {
            for column in 0..count {
                let mut part = q.view_mut((k, column), (self.rows - k, 1));
                let factor = tau.clone() * v.dotc(&part);
                part.zip_apply(v, |entry, v| *entry -= v * factor.clone());
            }
        }
        q
    }
}
