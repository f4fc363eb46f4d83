//! Control allocation: distributes the effect of failed actuators over the remaining ones.

use crate::blocks::beside;
use crate::svd::{Svd, norm_2};
use crate::tracking::tracking_rank;
use crate::{Error, check};
use nalgebra::{DMatrix, DVector};

/// Singular values below this fraction of the largest count as zero.
const TOLERANCE: f64 = 1e-12;

/// The actuators of a plant, some of which have failed.
#[derive(Debug, Clone, Copy)]
pub struct Actuators<'a> {
    /// B, n x m: how the inputs act on the states.
    pub b: &'a DMatrix<f64>,
    /// The failed inputs, counted from zero.
    pub gone: &'a [usize],
    /// a, m positive numbers, for example the distance from each command to its nearest limit; inputs with a larger a
    /// do more.
    pub authority: &'a [f64],
}

impl Actuators<'_> {
    /// Checks the authority; returns `B_r` D of [`allocate`].
    fn remaining(&self) -> Result<DMatrix<f64>, Error> {
        let Self { b, gone, authority } = *self;
        check::column("authority", authority, b.ncols())?;
        authority.iter().try_for_each(|&limit| check::positive("authority", limit))?;
        let factor = |j: usize| if gone.contains(&j) { 0.0 } else { authority[j] };
        Ok(DMatrix::from_fn(b.nrows(), b.ncols(), |i, j| b[(i, j)] * factor(j)))
    }
}

/// Distribution of the effect of all inputs over the remaining inputs.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Allocation {
    /// M of u = M `u_d`, m x m; the rows of failed inputs are zero.
    pub matrix: DMatrix<f64>,
    /// 2-norm of B M - B divided by the 2-norm of B: the fraction of the effect that the remaining inputs cannot
    /// produce.
    pub residual: f64,
}

/// Computes the commands of the remaining inputs that have the effect of the commands `u_d` of all inputs,
/// as far as possible, with the least effort.
///
/// ```text
/// u = M u_d minimises the norm of B u - B u_d; of all such u the one with the least sum of (u_j / a_j)^2
/// M = D (B_r D)^+ B,  D = diag(a), B_r = B with zero columns for the inputs that are gone
/// ```
///
/// If the columns of B are in the range of `B_r`, the effect is exact, and a feedback `u_d` = K x closes the same loop
/// as before the failure. Singular values below 1e-12 of the largest count as zero.
///
/// Source: W. C. Durham, Constrained control allocation, J. Guidance, Control and Dynamics 16 (1993); M. Bodson,
/// Evaluation of optimization methods for control allocation, J. Guidance, Control and Dynamics 25 (2002), the weighted
/// pseudo-inverse.
///
/// # Example
///
/// Two of three forces on a mass take over the effect of the first; the stronger one does more:
///
/// ```
/// use control::allocation::{Actuators, allocate};
/// use nalgebra::DMatrix;
/// let b = DMatrix::from_row_slice(2, 3, &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
/// let actuators = Actuators { b: &b, gone: &[0], authority: &[1.0, 1.0, 2.0] };
/// let commands = allocate(&actuators)?;
/// assert!(commands.residual < 1e-15);
/// assert!((commands.matrix[(1, 0)] - 0.2).abs() < 1e-15);
/// assert!((commands.matrix[(2, 0)] - 0.8).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad B or `authority`;
/// [`Error::OutOfRange`] for an `authority` that is not above zero; [`Error::NotConverged`].
pub fn allocate(actuators: &Actuators<'_>) -> Result<Allocation, Error> {
    let Actuators { b, authority, .. } = *actuators;
    check::finite("B", b)?;
    let scaled = actuators.remaining()?;
    let svd = Svd::new(&scaled)?;
    let rank = svd.rank(TOLERANCE);
    let mut matrix = svd.least_squares(b, rank);
    matrix += svd.least_squares(&(b - &scaled * &matrix), rank);
    let residual = norm_2(&(&scaled * &matrix - b))?;
    let size = norm_2(b)?;
    Ok(Allocation {
        matrix: DMatrix::from_fn(b.ncols(), b.ncols(), |i, j| authority[i] * matrix[(i, j)]),
        residual: if size > 0.0 { residual / size } else { 0.0 },
    })
}

/// An equilibrium of a plant under a constant disturbance.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Equilibrium {
    /// The states, n.
    pub x: DVector<f64>,
    /// The m commands; 0 for failed inputs.
    pub u: DVector<f64>,
    /// Norm of C x, the outputs that should be zero at the equilibrium.
    pub left: f64,
}

/// Computes the equilibrium under a constant disturbance in which given outputs are as near to zero as
/// the remaining inputs allow.
///
/// ```text
/// A x + B_r u + w = 0;  of all such (x, u) those with the least norm of C x, and of these the one with the
/// least norm of x and u, u_j in units of a_j
/// ```
///
/// `a`: n x n; `outputs`: C, r x n, rows in comparable units; `disturbance`: w, n entries, for example a column of B
/// times the command at which an actuator is stuck. `B_r` has zero columns for failed inputs. An equilibrium exists for
/// every w if [A, `B_r`] has rank n, as for every stabilisable (A, `B_r`). C x = 0 is reached for every w if there are
/// as many independent remaining inputs as outputs and (A, `B_r`, C) has no invariant zero at 0.
///
/// Source: E. J. Davison, The feedforward control of linear multivariable time-invariant systems,
/// Automatica 9 (1973), for the existence.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`] for a bad
/// `authority`; [`Error::NotControllable`] if the rank of [A, `B_r`] is below n; [`Error::NotConverged`].
pub fn equilibrium(
    a: &DMatrix<f64>,
    actuators: &Actuators<'_>,
    outputs: &DMatrix<f64>,
    disturbance: &DVector<f64>,
) -> Result<Equilibrium, Error> {
    let Actuators { b, gone, authority } = *actuators;
    let (n, m) = (check::with_inputs(a, b)?, b.ncols());
    check::shape("outputs", outputs, (outputs.nrows(), n))?;
    let w = DMatrix::from_column_slice(disturbance.len(), 1, disturbance.as_slice());
    check::shape("disturbance", &w, (n, 1))?;
    let remaining = actuators.remaining()?;
    let whole = beside(a, &remaining);
    let svd = Svd::new(&whole)?;
    let rank = svd.rank(TOLERANCE);
    if rank < n {
        return Err(Error::NotControllable { rank, n });
    }
    // [x; u], u_j in units of a_j.
    let mut solution = svd.least_squares(&-&w, rank);
    solution -= svd.least_squares(&(&whole * &solution + &w), rank);
    let free = svd.right.columns(rank, n + m - rank);
    // The number of outputs that the remaining inputs can set independently; further singular values are rounding
    // errors.
    let reached = tracking_rank(a, &remaining, outputs)?.rank.saturating_sub(n);
    let svd = Svd::new(&(outputs * free.rows(0, n)))?;
    let correction = svd.least_squares(&-(outputs * solution.rows(0, n)), reached);
    solution += free * correction;
    let x: DVector<f64> = solution.column(0).rows(0, n).into();
    Ok(Equilibrium {
        left: (outputs * &x).norm(),
        u: DVector::from_fn(m, |j, _| {
            if gone.contains(&j) { 0.0 } else { authority[j] * solution[(n + j, 0)] }
        }),
        x,
    })
}
