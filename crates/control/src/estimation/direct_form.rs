//! The coordinates in which each fault acts on one output only.

use super::eigenvalue;
use crate::blocks::{beside, stacked};
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::faulty_plant::FaultyPlant;
use crate::placement::place_balanced;
use crate::rank::controllable_part;
use crate::sampled::place_estimator;
use crate::stability::is_clearly_stable;
use crate::svd::Svd;
use crate::{Domain, Error};
use nalgebra::{Complex, DMatrix};

/// Singular values of C `F_a` below this fraction of the largest possible value count as zero.
const TOLERANCE: f64 = 1e-8;

/// A plant in coordinates [`y_1`; w] of its states and [`y_1`; `y_2`] of its outputs.
///
/// ```text
/// y_1' = A_11 y_1 + A_12 w + f,  w' = A_21 y_1 + A_22 w,  y_2 = C_2 w        (without commands)
/// y_1 = M_1 y,  M_1 C F_a = I;   y_2 = M_2 y,  M_2 C F_a = 0;   w = N x,  N F_a = 0
/// ```
///
/// `M_1` is the pseudo-inverse of C `F_a`; `M_2` and N have orthonormal rows. In sampled time the left
/// sides are the next values. The form exists if rank C `F_a` = q. The modes of (`A_22`, `C_2`) that are
/// not observable are the invariant zeros of (A, `F_a`, C).
///
/// Source: the form of B. L. Walcott and S. H. Zak, State observation of nonlinear uncertain dynamical systems,
/// IEEE Transactions on Automatic Control 32 (1987), as used by C. Edwards, S. K. Spurgeon and R. J. Patton,
/// Sliding mode observers for fault detection and isolation, Automatica 36 (2000).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DirectForm {
    /// `M_1`, q x p: `M_1` e shows the error of each fault.
    pub m_1: DMatrix<f64>,
    /// The invariant zeros of (A, `F_a`, C).
    pub zeros: Vec<Complex<f64>>,
    m_2: DMatrix<f64>,
    /// T = [`M_1` C; N], n x n, from x to the coordinates [`y_1`; w].
    to: DMatrix<f64>,
    /// T^-1 = [`F_a`, (I - `F_a` `M_1` C) N'].
    from: DMatrix<f64>,
    /// A in the coordinates [`y_1`; w].
    a: DMatrix<f64>,
    c_2: DMatrix<f64>,
    pub(super) domain: Domain,
}

impl DirectForm {
    /// Transforms the plant.
    ///
    /// Rows of C and columns of `F_a` are scaled to length one for the decision on the rank; singular
    /// values below 1e-8 count as zero.
    ///
    /// # Errors
    ///
    /// [`Error::FaultsNotDirect`] if the rank of C `F_a` is below q; [`Error::UnstableZeros`] if an invariant zero of
    /// (A, `F_a`, C) is not stable in `domain`; same as [`FaultyPlant::check`] and [`controllable_part`] otherwise.
    pub fn new(plant: &FaultyPlant, domain: Domain) -> Result<Self, Error> {
        plant.check()?;
        let FaultyPlant { a, c, f_a, .. } = plant;
        let (n, q) = f_a.shape();
        let c_f_a = c * f_a;
        let rank = scaled_rank(c, f_a)?;
        if rank < q {
            return Err(Error::FaultsNotDirect { rank, faults: q });
        }
        let m_1 = Svd::new(&c_f_a)?.least_squares(&DMatrix::identity(c.nrows(), c.nrows()), q);
        let m_2 = left_null_space(&c_f_a, q)?;
        let rest = left_null_space(f_a, q)?;
        let to = stacked(&(&m_1 * c), &rest);
        let rest = rest.transpose();
        let from = beside(f_a, &(&rest - f_a * (&m_1 * c * &rest)));
        let c_2 = &m_2 * c * from.columns(q, n - q);
        let mut form = Self { a: &to * a * &from, m_1, m_2, to, from, c_2, zeros: vec![], domain };
        form.zeros = form.invariant_zeros()?;
        let mut unstable = Vec::new();
        for &zero in &form.zeros {
            if !is_clearly_stable(zero, a, domain)? {
                unstable.push(zero);
            }
        }
        if unstable.is_empty() { Ok(form) } else { Err(Error::UnstableZeros { zeros: unstable }) }
    }

    /// `A_22`, (n - q) x (n - q): the dynamics of w without `y_1`.
    fn rest(&self) -> DMatrix<f64> {
        let (n, q) = (self.a.nrows(), self.m_1.nrows());
        self.a.view((q, q), (n - q, n - q)).into()
    }

    /// The unobservable eigenvalues of (`A_22`, `C_2`).
    fn invariant_zeros(&self) -> Result<Vec<Complex<f64>>, Error> {
        let a_22 = self.rest();
        if a_22.is_empty() {
            return Ok(Vec::new());
        }
        if self.c_2.is_empty() {
            return eigenvalues(&a_22);
        }
        let part = controllable_part(&a_22.transpose(), &self.c_2.transpose())?;
        Ok(part.fixed.iter().map(|mode| mode.eigenvalue).collect())
    }

    /// `L_x`, n x p, with A - `L_x` C = [`pole` I, \*; 0, `A_22` - `L_w` `C_2`] in these coordinates.
    ///
    /// The zeros are eigenvalues of the last block; its other eigenvalues get rates from `rate` to twice `rate`, in
    /// 1/s. \* is the part of `A_12` that `y_2` cannot cancel. Let P = `T'` diag(I, p `P_w`) T with T = [`M_1` C; N],
    /// `P_w` from the Lyapunov equation of the last block and a large number p. The symmetric part of P (A - `L_x` C)
    /// is then negative definite and `F_a`' P = `M_1` C: the strictly-positive-real condition.
    ///
    /// # Errors
    ///
    /// Same as [`controllable_part`] and [`place_balanced`], in sampled time [`place_estimator`].
    pub fn observer_gain(&self, pole: f64, rate: f64) -> Result<DMatrix<f64>, Error> {
        let (n, q) = (self.a.nrows(), self.m_1.nrows());
        let shifted = self.a.view((0, 0), (q, q)) - DMatrix::identity(q, q) * pole;
        let a_21 = self.a.view((q, 0), (n - q, q));
        let mut gain = stacked(&(shifted * &self.m_1), &(a_21 * &self.m_1));
        if !self.c_2.is_empty() {
            let svd = Svd::new(&self.c_2.transpose())?;
            let coupling = self.a.view((0, q), (q, n - q)).transpose();
            let l_12 = svd.least_squares(&coupling, svd.rank(TOLERANCE)).transpose();
            let mut rows = gain.rows_mut(0, q);
            rows += l_12 * &self.m_2;
            let mut rows = gain.rows_mut(q, n - q);
            rows += self.rest_gain(rate)? * &self.m_2;
        }
        Ok(&self.from * gain)
    }

    /// `L_w`, (n - q) x (p - q), which places all eigenvalues of `A_22` - `L_w` `C_2` except the zeros.
    fn rest_gain(&self, rate: f64) -> Result<DMatrix<f64>, Error> {
        let (a, c) = (self.rest().transpose(), self.c_2.transpose());
        let part = controllable_part(&a, &c)?;
        let order = part.a.nrows();
        if order == 0 {
            return Ok(DMatrix::zeros(a.nrows(), c.ncols()));
        }
        let (a, c) = part.pair(&a, &c);
        let faster = |i: usize| 2_f64.powf(as_number(i) / as_number(order));
        let pole = |i: usize| eigenvalue(rate * faster(i), self.domain);
        let poles: Vec<_> = (0..order).map(|i| Complex::new(pole(i), 0.0)).collect();
        let gain = match self.domain {
            Domain::Continuous => -place_balanced(a, c, &poles)?.gain,
            Domain::Sampled { .. } => {
                place_estimator(&a.transpose(), &c.transpose(), &poles)?.0.transpose()
            }
        };
        Ok(part.complete(&gain).transpose())
    }

    /// T = [`M_1` C; N], n x n: from x to the coordinates [`y_1`; w].
    #[must_use]
    pub fn coordinates(&self) -> &DMatrix<f64> {
        &self.to
    }
}

/// The rank of C `F_a` with rows of C and columns of `F_a` of length one.
fn scaled_rank(c: &DMatrix<f64>, f_a: &DMatrix<f64>) -> Result<usize, Error> {
    let (mut c, mut f_a) = (c.clone(), f_a.clone());
    let unit = |length: f64| if length > 0.0 { 1.0 / length } else { 0.0 };
    c.row_iter_mut().for_each(|mut row| row *= unit(row.norm()));
    f_a.column_iter_mut().for_each(|mut column| column *= unit(column.norm()));
    Ok(Svd::new(&(c * f_a))?.rank_above(TOLERANCE))
}

/// Orthonormal rows that span the left null space of a matrix of rank `rank`.
fn left_null_space(m: &DMatrix<f64>, rank: usize) -> Result<DMatrix<f64>, Error> {
    Ok(Svd::new(&m.transpose())?.right.columns(rank, m.nrows() - rank).transpose())
}
