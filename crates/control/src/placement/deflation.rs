//! The gain for chosen eigenvectors.

use super::pole_block::PoleBlock;
use super::subspace::{AssignableSubspaces, basis, equations};
use crate::Error;
use crate::balance::{divide_columns, divide_rows, multiply_columns, multiply_rows, similar};
use crate::svd::Svd;
use nalgebra::{DMatrix, DVector};

/// An eigenvector counts as linearly dependent if its component normal to the previous eigenvectors is below this
/// fraction of its length.
const DEPENDENT: f64 = 1e-14;

/// Computes K such that A + B K has the requested eigenvalues, with eigenvectors as near to the
/// chosen ones as rounding permits.
///
/// The solution of K V = G would lose as many digits of the eigenvalues as the condition number of V has.
/// Instead, one eigenvalue or pair after the other is assigned in the part of the state space that is normal
/// to the previous eigenvectors. In the orthonormal basis of these parts A + B K is block triangular to a few
/// rounding errors of its norm. Source: deflation of Miminis and Paige, see [`super::place`].
pub(crate) fn gain(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    problem: &AssignableSubspaces,
    directions: &[DVector<f64>],
) -> Result<DMatrix<f64>, Error> {
    let (scale, response_scale) = (&problem.scale, &problem.response_scale);
    let a = similar(a, scale);
    let b = divide_rows(&multiply_columns(b, response_scale), scale);
    let vectors = problem.scaled_eigenvectors(directions);
    let responses = problem.scaled_responses(directions);
    let (n, r) = b.shape();
    let mut k = DMatrix::zeros(r, n);
    let mut rest = DMatrix::identity(n, n);
    let mut column = 0;
    for space in &problem.spaces {
        let count = space.poles.count();
        let v = vectors.columns(column, count);
        let inside = rest.tr_mul(&v);
        let g = responses.columns(column, count) - &k * v;
        let chosen = (inside.norm() > DEPENDENT * v.norm()).then_some((&inside, &g));
        let (v, g) = nearest_solution(&rest, &a, &b, space.poles, chosen)?;
        let basis = Svd::new(&v)?;
        let q = &rest * &basis.left;
        k += g * basis.whitening(count) * q.transpose();
        let across = Svd::new(&basis.left.transpose())?.right;
        rest = &rest * across.columns(count, across.ncols() - count);
        column += count;
    }
    Ok(divide_columns(&multiply_rows(&k, response_scale), scale))
}

/// The solution (V; G) nearest to a chosen one, in the part of the state space that `rest` spans;
/// without a choice the solution of length one with the largest V.
fn nearest_solution(
    rest: &DMatrix<f64>,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: PoleBlock,
    chosen: Option<(&DMatrix<f64>, &DMatrix<f64>)>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), Error> {
    // The solutions of A V - V M + B G = 0, columns stacked.
    let basis = basis(&equations(&(rest.tr_mul(a) * rest), &rest.tr_mul(b), poles))?;
    let (count, states) = (poles.count(), poles.count() * rest.ncols());
    let weights = if let Some((v, g)) = chosen {
        let size = v.norm();
        let entries = v.iter().chain(g).map(|entry| entry / size);
        basis.tr_mul(&DVector::from_iterator(basis.nrows(), entries))
    } else {
        Svd::new(&basis.rows(0, states).into())?.right.column(0).into()
    };
    let nearest = basis * weights;
    let part = |entries: &[f64]| DMatrix::from_column_slice(entries.len() / count, count, entries);
    let (v, g) = nearest.as_slice().split_at(states);
    Ok((part(v), part(g)))
}
