//! The two published methods from their usual start, as scipy's `place_poles` runs them.

use super::eigenvectors::{Directions, LARGEST_DESCENT};
use super::subspace::AssignableSubspaces;
use super::update_order::update_order;
use crate::blocks::{ComplexMatrix, stacked, to_complex};
use crate::svd::Svd;
use crate::{Error, reflections::Reflections};
use nalgebra::{Complex, DMatrix, DVector, SymmetricEigen};

/// Largest number of sweeps over all eigenvectors; a relative change of their determinant below [`CHANGE`] ends them.
const SWEEPS: usize = 30;
const CHANGE: f64 = 1e-3;
/// Relative and absolute difference of singular values that count as equal; entries up to `ZERO` count as
/// zero.
const EQUAL: f64 = 1e-5;
const ZERO: f64 = 1e-8;
const EIGEN_ITERATIONS: usize = 1000;

/// The directions of method 0 of Kautsky, Nichols and Van Dooren, and of the method of Tits and Yang.
///
/// `a`: n x n; `b`: n x r, independent columns. The first method needs real eigenvalues, otherwise it is None.
/// Both are None above 24 states or with one input. With as many inputs as states both give the unit
/// vectors. A result that is not finite is None.
///
/// Both methods enlarge the determinant of the eigenvectors of length one; the first changes one of them at a
/// time, the second two. The results are those of scipy up to rounding, because the start is the same: for each
/// eigenvalue the sum of the basis vectors of its subspace, from Householder reflections. The error is
/// [`Error::NotConverged`].
///
/// Sources: see [`super::place`]; the start: scipy 1.17, `scipy.signal.place_poles`.
pub(crate) fn standard_directions(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    problem: &AssignableSubspaces,
) -> Result<[Option<Directions>; 2], Error> {
    let (n, r) = b.shape();
    if r == 1 || n > LARGEST_DESCENT {
        return Ok([None, None]);
    }
    let is_real = problem.spaces.iter().all(|space| space.poles.count() == 1);
    let start = Iteration::new(a, b, problem);
    if n == r {
        let unit = start.directions(problem);
        return Ok([is_real.then(|| unit.clone()), Some(unit)]);
    }
    let mut knv = None;
    if is_real {
        let order: Vec<_> = (0..n).map(|column| (column, column)).collect();
        knv = Some(start.clone().run(&order)?.directions(problem));
    }
    let yt = start.clone().run(&update_order(start.reals, n))?.directions(problem);
    let is_finite =
        |all: &Directions| all.iter().flat_map(|w| w.iter()).all(|entry| entry.is_finite());
    Ok([knv.filter(is_finite), Some(yt).filter(is_finite)])
}

/// The eigenvectors and their subspaces in the iteration of both methods.
#[derive(Clone)]
struct Iteration {
    /// One column for each real eigenvalue, in ascending order; then real and imaginary part for each
    /// pair, of the eigenvalue with positive imaginary part.
    vectors: DMatrix<f64>,
    /// For each column of `vectors`, an orthonormal basis of the subspace of eigenvectors for its eigenvalue.
    kernels: Vec<ComplexMatrix>,
    /// Number of real eigenvalues.
    reals: usize,
    /// Indices of the subspaces in the order of the columns: real eigenvalues first.
    order: Vec<usize>,
}

impl Iteration {
    /// The start of scipy: for each eigenvalue p, the sum of the basis vectors of the null space of N' (A - p I), where
    /// the columns of N are normal to the columns of B. For r = n the start is the unit vectors.
    fn new(a: &DMatrix<f64>, b: &DMatrix<f64>, problem: &AssignableSubspaces) -> Self {
        let (n, r) = b.shape();
        let count = |number: &usize| problem.spaces[*number].poles.count();
        // The spaces are sorted by descending real part.
        let mut order: Vec<usize> = (0..problem.spaces.len()).rev().collect();
        order.sort_by_key(count);
        let reals = order.iter().filter(|number| count(number) == 1).count();
        let normal = to_complex(&Reflections::new(b.clone()).last_columns(n - r));
        let mut start = Self { vectors: DMatrix::identity(n, n), kernels: vec![], reals, order };
        if n == r {
            return start;
        }
        for number in start.order.clone() {
            let pole = problem.spaces[number].poles.pole.conj();
            let shifted = to_complex(&a.transpose()) - DMatrix::from_diagonal_element(n, n, pole);
            let kernel = Reflections::new(shifted * &normal).last_columns(r);
            let sum = kernel.column_sum().normalize();
            let column = start.kernels.len();
            start.vectors.set_column(column, &sum.map(|entry| entry.re));
            if count(&number) == 2 {
                start.vectors.set_column(column + 1, &sum.map(|entry| entry.im));
                start.kernels.push(kernel.clone());
            }
            start.kernels.push(kernel);
        }
        start
    }

    /// Improves pairs of columns in the given order, in at most 30 sweeps; a pair (j, j) is column j alone.
    fn run(mut self, order: &[(usize, usize)]) -> Result<Self, Error> {
        let floor = f64::EPSILON.sqrt();
        for _ in 0..SWEEPS {
            let before = self.vectors.determinant().abs();
            for &(i, j) in order {
                match (i == j, i < self.reals) {
                    (true, _) => self.improve_one(i),
                    (false, true) => self.improve_two(i, j)?,
                    (false, false) => self.improve_pair(i)?,
                }
            }
            let after = self.vectors.determinant().abs().max(floor);
            if after > floor && (after - before).abs() < CHANGE * after {
                break;
            }
        }
        Ok(self)
    }

    /// Orthonormal columns normal to all vectors except the given columns.
    fn normals(&self, columns: &[usize]) -> DMatrix<f64> {
        let others = self.vectors.clone().remove_columns_at(columns);
        Reflections::new(others).last_columns(columns.len())
    }

    /// The basis of the subspace of a real eigenvalue; `column`: the column of the eigenvector.
    fn kernel(&self, column: usize) -> DMatrix<f64> {
        self.kernels[column].map(|entry| entry.re)
    }

    /// Replaces column j: the normal of the plane that the other columns span, projected onto the subspace of column j.
    fn improve_one(&mut self, j: usize) {
        let kernel = self.kernel(j);
        let projection = &kernel * kernel.tr_mul(&self.normals(&[j]));
        if projection.amax() > ZERO {
            self.vectors.set_column(j, &projection.column(0).normalize());
        }
    }

    /// Replaces columns i and j by the vectors x and y of their subspaces with the largest x' (u v' - v u') y, where u
    /// and v are normal to the other columns.
    fn improve_two(&mut self, i: usize, j: usize) -> Result<(), Error> {
        let n = self.vectors.nrows();
        let normals = self.normals(&[i.min(j), i.max(j)]);
        let (u, v) = (normals.column(0), normals.column(1));
        let (first, second) = (self.kernel(i), self.kernel(j));
        let (of_u, of_v) = (first.tr_mul(&u), first.tr_mul(&v));
        let svd = Svd::new(
            &(of_u * second.tr_mul(&v).transpose() - of_v * second.tr_mul(&u).transpose()),
        )?;
        let count = if is_close(svd.values[0], svd.values[1]) { 2 } else { 1 };
        let (left, right) = (svd.left.columns(0, count), svd.right.columns(0, count));
        let plane = stacked(&(first * left), &(second * right));
        let both = self.vectors.select_columns([&i, &j]);
        let before = DVector::from_column_slice(both.as_slice());
        let mut pair = &plane * plane.tr_mul(&before);
        if pair.amax() > ZERO {
            pair *= std::f64::consts::SQRT_2 / pair.norm();
        } else {
            pair = plane.column(0).into();
        }
        self.vectors.set_column(i, &pair.rows(0, n));
        self.vectors.set_column(j, &pair.rows(n, n));
        Ok(())
    }

    /// Replaces columns i and i + 1 by the real and the imaginary part of the eigenvector that spans the largest volume
    /// with the other columns.
    fn improve_pair(&mut self, i: usize) -> Result<(), Error> {
        let normals = self.normals(&[i, i + 1]);
        let kernel = &self.kernels[i];
        let entry = |re, im| Complex::new(re, im);
        let root = std::f64::consts::SQRT_2;
        let u = normals.column(0).zip_map(&normals.column(1), entry) * Complex::new(root, 0.0);
        let (of_u, of_conjugate) = (kernel.ad_mul(&u), kernel.ad_mul(&u.conjugate()));
        let form = &of_u * of_u.adjoint() - &of_conjugate * of_conjugate.adjoint();
        let eigen = SymmetricEigen::try_new(form, f64::EPSILON, EIGEN_ITERATIONS).ok_or(
            Error::NotConverged { what: "the eigenvalue iteration", iterations: EIGEN_ITERATIONS },
        )?;
        let values = eigen.eigenvalues.map(f64::abs);
        let mut numbers: Vec<usize> = (0..values.len()).collect();
        numbers.sort_by(|&x, &y| values[y].total_cmp(&values[x]));
        let count = if is_close(values[numbers[0]], values[numbers[1]]) { 2 } else { 1 };
        let before = self.vectors.column(i).zip_map(&self.vectors.column(i + 1), entry);
        let axes = numbers.iter().take(count).map(|&k| kernel * eigen.eigenvectors.column(k));
        let axes: Vec<DVector<_>> = axes.collect();
        let mut vector = DVector::zeros(before.len());
        for axis in &axes {
            vector += axis * axis.dotc(&before);
        }
        if vector.camax() > ZERO {
            vector.normalize_mut();
        } else {
            vector.copy_from(&axes[0]);
        }
        self.vectors.set_column(i, &vector.map(|entry| entry.re));
        self.vectors.set_column(i + 1, &vector.map(|entry| entry.im));
        Ok(())
    }

    /// The directions of the eigenvectors, in the order of the spaces of the problem.
    fn directions(&self, problem: &AssignableSubspaces) -> Directions {
        let mut columns = vec![0..0; self.order.len()];
        let mut first = 0;
        for &number in &self.order {
            let next = first + problem.spaces[number].poles.count();
            columns[number] = first..next;
            first = next;
        }
        let columns: Vec<_> = columns.into_iter().flatten().collect();
        problem.directions_of(&self.vectors.select_columns(&columns))
    }
}

fn is_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= ZERO + EQUAL * b.abs()
}
