//! The staircase algorithm: separates the controllable from the uncontrollable states.

use super::Rank;
use crate::Error;
use crate::balance::{Balance, divide_rows, multiply_rows, unit_columns};
use crate::check::as_number;
use crate::svd::Svd;
use nalgebra::{DMatrix, DVector};

/// A singular value counts as zero below this times the number of states and the norm of the scaled matrix.
const TOLERANCE_PER_STATE: f64 = 100.0 * f64::EPSILON;

/// The controllable and the uncontrollable states of a pair (A, B).
///
/// With x = S z: S^-1 A S [Q1, Q2] = [Q1, Q2] [A1, *; 0, R], Q2' S^-1 B = 0.
pub(crate) struct Staircase {
    pub(crate) decision: Rank,
    /// Q1, n x rank, orthonormal: the controllable states.
    pub(crate) controllable_basis: DMatrix<f64>,
    /// Q2, n x (n - rank), orthonormal: the uncontrollable states, Q2' S^-1 A S = R Q2'.
    pub(crate) uncontrollable_basis: DMatrix<f64>,
    /// R, the dynamics of the uncontrollable states.
    pub(crate) uncontrollable: DMatrix<f64>,
    /// The scales of the states: the diagonal of S, powers of two.
    pub(crate) scale: DVector<f64>,
    /// The balanced A: S^-1 A S.
    balanced: DMatrix<f64>,
}

impl Staircase {
    /// Computes the form in balanced coordinates; without balancing, or with the ends of chains scaled as well, if the
    /// rank is then larger. Balancing scales states that do not act on each other without end, and does not scale
    /// states that act on no others, whose units would decide.
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>) -> Result<Self, Error> {
        let mut best = Self::in_coordinates(Balance::new(a), b)?;
        for balance in [Balance::none, Balance::with_ends] {
            if best.decision.is_full() {
                break;
            }
            let other = Self::in_coordinates(balance(a), b)?;
            if other.decision.rank > best.decision.rank {
                best = other;
            }
        }
        Ok(best)
    }

    fn in_coordinates(balance: Balance, b: &DMatrix<f64>) -> Result<Self, Error> {
        let Balance { matrix: balanced, scale } = balance;
        let n = balanced.nrows();
        let (mut uncontrollable, mut basis) = (balanced.clone(), DMatrix::identity(n, n));
        let mut controllable = Vec::with_capacity(n);
        let mut link = unit_columns(&divide_rows(b, &scale));
        let tolerance = TOLERANCE_PER_STATE * as_number(n);
        let mut margin = f64::INFINITY;
        let size = uncontrollable.norm();
        let mut reference = link.norm();
        while !uncontrollable.is_empty() {
            let step = Svd::new(&link.transpose())?;
            let rank = step.rank_above(tolerance * reference);
            if rank == 0 {
                break;
            }
            margin = margin.min(step.values[rank - 1] / reference);
            let transformed = step.right.transpose() * &uncontrollable * &step.right;
            let remaining = transformed.nrows() - rank;
            link = transformed.view((rank, 0), (remaining, rank)).into();
            uncontrollable = transformed.view((rank, rank), (remaining, remaining)).into();
            let new_basis: DMatrix<f64> = basis * step.right;
            controllable.extend((0..rank).map(|column| new_basis.column(column).into_owned()));
            basis = new_basis.columns(rank, remaining).into();
            reference = size;
        }
        let rank = controllable.len();
        let margin = if rank == 0 { 0.0 } else { margin };
        Ok(Self {
            decision: Rank { rank, n, tolerance, margin },
            controllable_basis: DMatrix::from_fn(n, rank, |i, j| controllable[j][i]),
            uncontrollable_basis: basis,
            uncontrollable,
            scale,
            balanced,
        })
    }

    /// Q1' S^-1 A S Q1: the dynamics of the controllable states.
    pub(crate) fn reached_dynamics(&self) -> DMatrix<f64> {
        self.controllable_basis.tr_mul(&self.balanced) * &self.controllable_basis
    }

    /// Q1' S^-1 B for a B whose columns are in the span of the controllable states.
    pub(crate) fn reached_input(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        self.controllable_basis.tr_mul(&divide_rows(b, &self.scale))
    }

    /// Returns Q1' S C', the transposed output matrix of the controllable states, and the norm of S C', for C'.
    pub(crate) fn reached_output(&self, c_transposed: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
        let scaled = multiply_rows(c_transposed, &self.scale);
        (self.controllable_basis.tr_mul(&scaled), scaled.norm())
    }
}
