//! The eigenvectors that a feedback can assign to each eigenvalue.

use super::pole_block::PoleBlock;
use crate::Error;
use crate::balance::{
    Balance, divide_columns, divide_rows, multiply_columns, multiply_rows, power_of_two_or_one,
    similar,
};
use crate::blocks::beside;
use crate::check::as_number;
use crate::svd::Svd;
use nalgebra::{DMatrix, DVector};

const SCALING_PASSES: usize = 20;

/// For each eigenvalue, or pair, with real block M the subspace of all (V, G) with A V + B G = V M.
/// If G = K V, the columns of V span eigenvectors of A + B K.
///
/// V and G have one column for a real eigenvalue, two for a pair. Stacked, the columns of V are X w
/// and the columns of G are Y w for a direction w. B has r independent columns; w has r entries for
/// each column of V.
pub(crate) struct AssignableSubspaces {
    /// One subspace for each eigenvalue or pair.
    pub(crate) spaces: Vec<AssignableSubspace>,
    /// Units of the states that give eigenvectors entries of similar size; powers of two.
    pub(crate) scale: DVector<f64>,
    /// Units of the responses G; powers of two.
    pub(crate) response_scale: DVector<f64>,
}

/// The eigenvectors that can be assigned to one eigenvalue or pair.
pub(crate) struct AssignableSubspace {
    pub(crate) poles: PoleBlock,
    /// X: orthonormal columns in the given coordinates, times the root of the number of eigenvalues, so that a w
    /// of length one gives eigenvectors of length one.
    pub(crate) states: DMatrix<f64>,
    /// Y: the stacked columns of G are Y w, in units of `response_scale`.
    pub(crate) responses: DMatrix<f64>,
}

impl AssignableSubspaces {
    /// Computes the subspaces for `a`, n x n, and `b`, n x r of rank r, a controllable pair; the error is
    /// [`Error::NotConverged`].
    pub(crate) fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        blocks: &[PoleBlock],
    ) -> Result<Self, Error> {
        let (n, r) = b.shape();
        let mut units = DVector::from_element(n + r, 1.0);
        units.rows_mut(0, n).copy_from(&Balance::new(a).scale);
        for _ in 0..SCALING_PASSES {
            let rough = in_units(a, b, blocks, &units).iter().map(rough_basis).collect::<Vec<_>>();
            let factors = row_sizes(&rough, blocks, n);
            if factors.iter().all(|factor| (factor - 1.0).abs() <= 0.0) {
                break;
            }
            units.component_mul_assign(&factors);
        }
        let solutions =
            in_units(a, b, blocks, &units).iter().map(basis).collect::<Result<Vec<_>, _>>()?;
        let scale: DVector<f64> = units.rows(0, n).into();
        let space = |(solution, &poles): (&DMatrix<f64>, &PoleBlock)| {
            let count = poles.count();
            let (top, bottom) = (solution.rows(0, count * n), solution.rows(count * n, count * r));
            let original = multiply_rows(&top.into(), &repeated(&scale, count));
            let whitening = Svd::new(&original)?.whitening(count * r) * root(count);
            Ok(AssignableSubspace {
                poles,
                states: original * &whitening,
                responses: bottom * whitening,
            })
        };
        let spaces = solutions.iter().zip(blocks).map(space).collect::<Result<_, Error>>()?;
        Ok(Self { spaces, scale, response_scale: units.rows(n, r).into() })
    }

    /// r, the number of free parameters in w for each eigenvector.
    pub(crate) fn inputs(&self) -> usize {
        self.response_scale.len()
    }

    /// The columns of all V side by side, in the given coordinates.
    pub(crate) fn eigenvectors(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        let columns = self.spaces.iter().zip(directions).map(|(space, w)| &space.states * w);
        side_by_side(self.scale.len(), columns)
    }

    /// The columns of all V side by side, in units of `scale`.
    pub(crate) fn scaled_eigenvectors(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        divide_rows(&self.eigenvectors(directions), &self.scale)
    }

    /// The columns of all G = K V side by side, in units of `response_scale`.
    pub(crate) fn scaled_responses(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        let columns = self.spaces.iter().zip(directions).map(|(space, w)| &space.responses * w);
        side_by_side(self.inputs(), columns)
    }

    /// The columns of all V side by side with the states divided by `units`, eigenvectors of length one.
    pub(crate) fn unit_eigenvectors(
        &self,
        directions: &[DVector<f64>],
        units: &DVector<f64>,
    ) -> DMatrix<f64> {
        let columns = self.spaces.iter().zip(directions).map(|(space, w)| {
            let count = space.poles.count();
            let v = (&space.states * w).component_div(&repeated(units, count));
            v.normalize() * root(count)
        });
        side_by_side(units.len(), columns)
    }

    /// The directions, of length one, nearest to `eigenvectors`, which have one column for a real eigenvalue, two for a
    /// pair.
    pub(crate) fn directions_of(&self, eigenvectors: &DMatrix<f64>) -> Vec<DVector<f64>> {
        let mut column = 0;
        let direction = |space: &AssignableSubspace| {
            let columns = eigenvectors.columns(column, space.poles.count()).into_owned();
            column += space.poles.count();
            space.states.tr_mul(&DVector::from_column_slice(columns.as_slice())).normalize()
        };
        self.spaces.iter().map(direction).collect()
    }

    /// Inverse of the matrix of eigenvectors, in the given coordinates; None if singular.
    pub(crate) fn inverse(&self, directions: &[DVector<f64>]) -> Option<DMatrix<f64>> {
        let inverse = self.scaled_eigenvectors(directions).lu().try_inverse()?;
        Some(divide_columns(&inverse, &self.scale))
    }
}

/// Splits stacked columns into columns of `rows` entries and places them side by side.
fn side_by_side(rows: usize, stacked: impl Iterator<Item = DVector<f64>>) -> DMatrix<f64> {
    let entries: Vec<f64> = stacked.flat_map(|column| column.data.as_vec().clone()).collect();
    DMatrix::from_vec(rows, entries.len() / rows, entries)
}

/// The Frobenius norm of the real V of `count` eigenvectors of length one.
fn root(count: usize) -> f64 {
    if count == 2 { std::f64::consts::SQRT_2 } else { 1.0 }
}

fn repeated(v: &DVector<f64>, times: usize) -> DVector<f64> {
    DVector::from_fn(times * v.len(), |i, _| v[i % v.len()])
}

/// [`equations`] in the given units of states and responses.
fn in_units(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    blocks: &[PoleBlock],
    units: &DVector<f64>,
) -> Vec<DMatrix<f64>> {
    let (n, r) = b.shape();
    let (of_states, of_responses) = (units.rows(0, n).into(), units.rows(n, r).into());
    let a = similar(a, &of_states);
    let b = divide_rows(&multiply_columns(b, &of_responses), &of_states);
    blocks.iter().map(|&poles| equations(&a, &b, poles)).collect()
}

/// A V - V M + B G as a matrix that multiplies the stacked columns of V and G.
pub(crate) fn equations(a: &DMatrix<f64>, b: &DMatrix<f64>, poles: PoleBlock) -> DMatrix<f64> {
    let (n, count) = (b.nrows(), poles.count());
    let one = DMatrix::identity(count, count);
    let shifted = one.kronecker(a) - poles.block().transpose().kronecker(&DMatrix::identity(n, n));
    beside(&shifted, &one.kronecker(b))
}

/// An orthonormal basis of the null space of a matrix with independent rows; small entries of the basis are precise,
/// too.
pub(crate) fn basis(equations: &DMatrix<f64>) -> Result<DMatrix<f64>, Error> {
    let (rank, all) = equations.shape();
    Ok(Svd::new(equations)?.right.columns(rank, all - rank).into())
}

/// [`basis`] by reflections: faster, with rounding errors relative to the largest entry.
fn rough_basis(equations: &DMatrix<f64>) -> DMatrix<f64> {
    let (rank, all) = equations.shape();
    let q = equations.clone().resize_vertically(all, 0.0).transpose().qr().q();
    q.columns(rank, all - rank).into()
}

/// Size of each state and each response over all solutions, as powers of two around one.
fn row_sizes(solutions: &[DMatrix<f64>], blocks: &[PoleBlock], n: usize) -> DVector<f64> {
    let rows = solutions[0].nrows() / blocks[0].count();
    let mut sizes = DVector::<f64>::zeros(rows);
    for (solution, poles) in solutions.iter().zip(blocks) {
        let count = poles.count();
        for (row, entries) in solution.row_iter().enumerate() {
            let states = count * n;
            let signal = if row < states { row % n } else { n + (row - states) % (rows - n) };
            sizes[signal] += entries.norm_squared();
        }
    }
    let total = sizes.sum();
    sizes.map(|size| power_of_two_or_one((size * as_number(rows) / total).sqrt()))
}
