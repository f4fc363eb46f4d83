//! The eigenvectors a feedback can give to each wanted eigenvalue.

use crate::Error;
use crate::balance::power_of_two;
use crate::balance::{Balance, divide_columns, divide_rows, multiply_columns, multiply_rows};
use crate::singular::Singular;
use nalgebra::{DMatrix, DVector};

const SCALING_PASSES: usize = 20;

/// For each pole p all (v, g) with (A - p I) v + B g = 0: with g = K v, v is an eigenvector of A +
/// B K.
///
/// B has r independent columns, so the solutions for one pole are v = X w, g = Y w with w of length
/// r.
pub(crate) struct Assignable {
    /// X for each pole, n x r, orthonormal in the given coordinates.
    pub(crate) states: Vec<DMatrix<f64>>,
    /// Y for each pole, r x r, in units of `response_scale`.
    responses: Vec<DMatrix<f64>>,
    /// Units of the states that give eigenvectors entries of similar size; powers of two.
    pub(crate) scale: DVector<f64>,
    /// Units of the responses g.
    pub(crate) response_scale: DVector<f64>,
}

impl Assignable {
    /// `a`: n x n, `b`: n x r of rank r, the pair controllable.
    pub(crate) fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, poles: &[f64]) -> Result<Self, Error> {
        let (n, r) = b.shape();
        let mut units = DVector::from_element(n + r, 1.0);
        units.rows_mut(0, n).copy_from(&Balance::of(a).scale);
        let mut solutions = null_spaces(a, b, poles, &units)?;
        for _ in 0..SCALING_PASSES {
            let factors = row_sizes(&solutions);
            if factors.iter().all(|factor| (factor - 1.0).abs() <= 0.0) {
                break;
            }
            units.component_mul_assign(&factors);
            solutions = null_spaces(a, b, poles, &units)?;
        }
        let mut found = Self {
            states: Vec::with_capacity(poles.len()),
            responses: Vec::with_capacity(poles.len()),
            scale: units.rows(0, n).into(),
            response_scale: units.rows(n, r).into(),
        };
        for solution in &solutions {
            let given = multiply_rows(&solution.rows(0, n).into(), &found.scale);
            let whitening = Singular::of(&given)?.whitening(r);
            found.states.push(given * &whitening);
            found.responses.push(solution.rows(n, r) * whitening);
        }
        Ok(found)
    }

    /// Number of free parameters w per eigenvector.
    pub(crate) fn inputs(&self) -> usize {
        self.response_scale.len()
    }

    /// Eigenvectors as columns, in the given coordinates.
    pub(crate) fn eigenvectors(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        columns(&self.states, directions)
    }

    /// Eigenvectors as columns, in units of `scale`.
    pub(crate) fn scaled_eigenvectors(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        divide_rows(&self.eigenvectors(directions), &self.scale)
    }

    /// K times the scaled eigenvectors, as columns in units of `response_scale`.
    pub(crate) fn scaled_responses(&self, directions: &[DVector<f64>]) -> DMatrix<f64> {
        columns(&self.responses, directions)
    }

    /// Inverse of the matrix of eigenvectors, in the given coordinates; None if singular.
    pub(crate) fn inverse(&self, directions: &[DVector<f64>]) -> Option<DMatrix<f64>> {
        let inverse = self.scaled_eigenvectors(directions).lu().try_inverse()?;
        Some(divide_columns(&inverse, &self.scale))
    }
}

fn columns(bases: &[DMatrix<f64>], directions: &[DVector<f64>]) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = bases.iter().zip(directions).map(|(x, w)| x * w).collect();
    DMatrix::from_columns(&columns)
}

/// Orthonormal solutions (v; g) in the given units, one (n + r) x r matrix per pole.
fn null_spaces(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    poles: &[f64],
    units: &DVector<f64>,
) -> Result<Vec<DMatrix<f64>>, Error> {
    let (n, r) = b.shape();
    let state_units: DVector<f64> = units.rows(0, n).into();
    let both = DMatrix::from_fn(n, n + r, |i, j| if j < n { a[(i, j)] } else { b[(i, j - n)] });
    let scaled = divide_rows(&multiply_columns(&both, units), &state_units);
    let solve = |pole: &f64| {
        let mut shifted = scaled.clone();
        for state in 0..n {
            shifted[(state, state)] -= pole;
        }
        Ok(Singular::of(&shifted)?.right.columns(n, r).into())
    };
    poles.iter().map(solve).collect()
}

/// Size of each row over all solutions, as powers of two around one.
fn row_sizes(solutions: &[DMatrix<f64>]) -> DVector<f64> {
    let (rows, _) = solutions[0].shape();
    let total: f64 = solutions.iter().map(DMatrix::norm_squared).sum();
    DVector::from_fn(rows, |row, _| {
        let size: f64 = solutions.iter().map(|solution| solution.row(row).norm_squared()).sum();
        #[expect(clippy::cast_precision_loss, reason = "a matrix order is far below 2^52")]
        let factor = power_of_two((size * rows as f64 / total).sqrt());
        if factor.is_normal() { factor } else { 1.0 }
    })
}
