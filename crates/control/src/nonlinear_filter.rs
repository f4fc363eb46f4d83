//! Kalman filters for nonlinear plants: extended and unscented.
//!
//! For a plant in sampled time with white noise w of covariance W and v of covariance V,
//!
//! ```text
//! z[k+1] = g(z[k]) + w[k],    y[k] = h(z[k]) + v[k]
//! ```
//!
//! where faults are part of z, both filters keep the mean z and the covariance P of the estimate. They differ in how
//! mean and covariance pass g and h:
//!
//! * **extended**: g and h are replaced by their tangents at the mean, with the Jacobians G and H: P becomes G P G' +
//!   W, the gain is P H' (H P H' + V)^-1 (A. H. Jazwinski, Stochastic Processes and Filtering Theory, 1970, section
//!   8.3);
//! * **unscented**: g and h are evaluated at 2 N points, z plus and minus the columns of a square root of N P; means
//!   and covariances are those of the values (S. J. Julier, J. K. Uhlmann, H. F. Durrant-Whyte, American Control
//!   Conference 1995, without a point at the mean, so that all weights are positive and no variance is negative. I.
//!   Arasaratnam and S. Haykin, IEEE Trans. Autom. Control 54 (2009), derive the same points from a cubature rule).
//!
//! For a linear plant both are the Kalman filter whose stationary form is [`crate::riccati::kalman`].

use crate::check::as_number;
use nalgebra::{Cholesky, DMatrix, DVector};

/// A pivot of a Cholesky factorisation below this, relative to the order times the diagonal entry, is a rounding error.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A plant in sampled time, z having N states and faults and y having p measurements.
#[expect(clippy::missing_errors_doc, reason = "the type says it")]
pub trait SampledPlant {
    /// Why the plant has no value, or no derivative, at some z.
    type Error;

    /// Replaces z by g(z), its value at the next sample.
    fn advance(&mut self, z: &mut [f64]) -> Result<(), Self::Error>;

    /// Replaces z by g(z), and sets `g` to the Jacobian of g, N x N, at the former z.
    fn advance_tangent(&mut self, z: &mut [f64], g: &mut DMatrix<f64>) -> Result<(), Self::Error>;

    /// Sets y to the measurements h(z).
    fn measure(&mut self, z: &[f64], y: &mut [f64]) -> Result<(), Self::Error>;

    /// Sets y to h(z), and `h` to the Jacobian of h, p x N, at z.
    fn measure_tangent(
        &mut self,
        z: &[f64],
        y: &mut [f64],
        h: &mut DMatrix<f64>,
    ) -> Result<(), Self::Error>;
}

/// The method by which the equations of the plant transform mean and covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transform {
    /// By the tangents of the equations at the mean (extended Kalman filter).
    Extended,
    /// By the values of the equations at 2 N points (unscented Kalman filter).
    Unscented,
}

/// Why a prediction or a correction failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilterError<E> {
    /// The plant cannot be evaluated.
    #[error(transparent)]
    Plant(#[from] E),
    /// P or H P H' is infinite or NaN.
    #[error(
        "the covariance of the estimate is not finite: the estimate diverges, expected measurements that show \
         each unstable state often enough"
    )]
    NotFinite,
    /// H P H' + V is not positive definite.
    #[error("the covariance of the innovation is not positive definite: V must be")]
    NotDefinite,
}

/// The estimate of a nonlinear plant, and the memory for its equations: a sample allocates nothing.
#[derive(Clone, Debug)]
pub struct NonlinearFilter {
    /// The mean z, N numbers.
    pub mean: DVector<f64>,
    /// The covariance P, N x N.
    pub covariance: DMatrix<f64>,
    /// The innovation y - h(z) of the last correction, p numbers; 0 for measurements that were not due. The
    /// unscented filter has the mean of h over its points in place of h(z).
    pub innovation: DVector<f64>,
    w: DMatrix<f64>,
    v: DMatrix<f64>,
    g: DMatrix<f64>,
    h: DMatrix<f64>,
    /// Memory for products, N x N.
    square: DMatrix<f64>,
    /// Memory for products, N x N.
    product: DMatrix<f64>,
    /// A square root of P.
    root: DMatrix<f64>,
    /// The 2 N points in z, as columns.
    points: DMatrix<f64>,
    /// The measurements at `points`, as columns.
    measured: DMatrix<f64>,
    /// S, the covariance of the innovation; a correction overwrites S with its Cholesky factor.
    s: DMatrix<f64>,
    /// The covariance of y and z, p x N; overwritten in a correction.
    cross: DMatrix<f64>,
    /// The transpose of H, overwritten by the gain K; N x p.
    gain: DMatrix<f64>,
    /// K V, N x p.
    gain_v: DMatrix<f64>,
    /// S^-1 times the innovation.
    solved: DVector<f64>,
}

impl NonlinearFilter {
    /// Creates a filter with mean and covariance zero.
    ///
    /// `w`: W, N x N; `v`: V, p x p. Neither is checked.
    #[must_use]
    pub fn new(w: DMatrix<f64>, v: DMatrix<f64>) -> Self {
        let (n, p) = (w.nrows(), v.nrows());
        let zeros = DMatrix::zeros;
        Self {
            mean: DVector::zeros(n),
            covariance: zeros(n, n),
            innovation: DVector::zeros(p),
            w,
            v,
            g: zeros(n, n),
            h: zeros(p, n),
            square: zeros(n, n),
            product: zeros(n, n),
            root: zeros(n, n),
            points: zeros(n, 2 * n),
            measured: zeros(p, 2 * n),
            s: zeros(p, p),
            cross: zeros(p, n),
            gain: zeros(n, p),
            gain_v: zeros(n, p),
            solved: DVector::zeros(p),
        }
    }

    /// Predicts the estimate of the next sample, before its measurement.
    ///
    /// # Errors
    ///
    /// [`FilterError::Plant`]; the mean of the extended filter is then what the plant has written.
    /// [`FilterError::NotFinite`]; the estimate cannot be used any more.
    pub fn predict<M: SampledPlant>(
        &mut self,
        plant: &mut M,
        transform: Transform,
    ) -> Result<(), FilterError<M::Error>> {
        match transform {
            Transform::Extended => {
                plant.advance_tangent(self.mean.as_mut_slice(), &mut self.g)?;
                self.product.gemm(1.0, &self.g, &self.covariance, 0.0);
                self.g.transpose_to(&mut self.square);
                self.covariance.gemm(1.0, &self.product, &self.square, 0.0);
            }
            Transform::Unscented => {
                self.place_points();
                for mut point in self.points.column_iter_mut() {
                    plant.advance(point.as_mut_slice())?;
                }
                centre(&mut self.points, &mut self.mean);
                covariance_of(&self.points, &self.points, &mut self.covariance);
            }
        }
        self.covariance += &self.w;
        symmetrise(&mut self.covariance);
        check_finite(&self.covariance)
    }

    /// Corrects the estimate by the measurements `y[k]` for which `is_due(k)` is true.
    ///
    /// `y`: p numbers. Returns e' S^-1 e with the innovation e and its covariance S; if the filter is consistent, its
    /// mean is the number of measurements that are due.
    ///
    /// # Errors
    ///
    /// [`FilterError`]; mean and covariance are unchanged then.
    pub fn correct<M: SampledPlant>(
        &mut self,
        plant: &mut M,
        y: &[f64],
        is_due: impl Fn(usize) -> bool,
        transform: Transform,
    ) -> Result<f64, FilterError<M::Error>> {
        let e = self.innovation.as_mut_slice();
        match transform {
            Transform::Extended => {
                plant.measure_tangent(self.mean.as_slice(), e, &mut self.h)?;
                self.cross.gemm(1.0, &self.h, &self.covariance, 0.0);
                self.h.transpose_to(&mut self.gain);
                self.s.gemm(1.0, &self.cross, &self.gain, 0.0);
            }
            Transform::Unscented => {
                self.place_points();
                let columns = self.points.column_iter().zip(self.measured.column_iter_mut());
                for (point, mut measured) in columns {
                    plant.measure(point.as_slice(), measured.as_mut_slice())?;
                }
                centre(&mut self.measured, &mut self.innovation);
                for mut point in self.points.column_iter_mut() {
                    point -= &self.mean;
                }
                covariance_of(&self.measured, &self.measured, &mut self.s);
                covariance_of(&self.measured, &self.points, &mut self.cross);
            }
        }
        for (e, y) in self.innovation.iter_mut().zip(y) {
            *e = y - *e;
        }
        self.s += &self.v;
        symmetrise(&mut self.s);
        // A measurement without correlation and innovation changes nothing.
        for k in (0..y.len()).filter(|&k| !is_due(k)) {
            self.innovation[k] = 0.0;
            self.cross.row_mut(k).fill(0.0);
            self.s.row_mut(k).fill(0.0);
            self.s.column_mut(k).fill(0.0);
            self.s[(k, k)] = 1.0;
        }
        check_finite::<M::Error>(&self.s)?;
        let s = std::mem::replace(&mut self.s, DMatrix::zeros(0, 0));
        let size = s.nrows();
        let Some(factor) = Cholesky::new(s) else {
            self.s = DMatrix::zeros(size, size);
            return Err(FilterError::NotDefinite);
        };
        self.solved.copy_from(&self.innovation);
        factor.solve_mut(&mut self.solved);
        let squared = self.innovation.dot(&self.solved);
        self.mean.gemv_tr(1.0, &self.cross, &self.solved, 1.0);
        // The gain K = cross' S^-1.
        let mut solved = std::mem::replace(&mut self.cross, DMatrix::zeros(0, 0));
        if transform == Transform::Unscented {
            // P - cross' S^-1 cross = P - X' X with X = R^-1 cross, where S = R R'.
            factor.l_dirty().solve_lower_triangular_mut(&mut solved);
            self.covariance.gemm_tr(-1.0, &solved, &solved, 1.0);
        } else {
            factor.solve_mut(&mut solved);
            solved.transpose_to(&mut self.gain);
            // (I - K H) P (I - K H)' + K V K' (R. S. Bucy and P. D. Joseph 1968), with no difference of covariances.
            self.product.fill_with_identity();
            self.product.gemm(-1.0, &self.gain, &self.h, 1.0);
            self.square.gemm(1.0, &self.product, &self.covariance, 0.0);
            self.product.transpose_mut();
            self.covariance.gemm(1.0, &self.square, &self.product, 0.0);
            self.gain_v.gemm(1.0, &self.gain, &self.v, 0.0);
            self.covariance.gemm(1.0, &self.gain_v, &solved, 1.0);
        }
        self.cross = solved;
        self.s = factor.unpack_dirty();
        symmetrise(&mut self.covariance);
        Ok(squared)
    }

    /// Sets the points to the mean plus and minus the columns of a square root of N P.
    fn place_points(&mut self) {
        let n = self.mean.len();
        square_root(&self.covariance, &mut self.root);
        let scale = as_number(n).sqrt();
        for j in 0..n {
            for (at, sign) in [(j, scale), (n + j, -scale)] {
                let mut point = self.points.column_mut(at);
                point.copy_from(&self.mean);
                point.axpy(sign, &self.root.column(j), 1.0);
            }
        }
    }
}

/// Sets `mean` to the mean of the columns of `points`, and subtracts it from each column.
fn centre(points: &mut DMatrix<f64>, mean: &mut DVector<f64>) {
    mean.fill(0.0);
    for point in points.column_iter() {
        *mean += point;
    }
    *mean /= as_number(points.ncols());
    for mut point in points.column_iter_mut() {
        point -= &*mean;
    }
}

/// Sets `covariance` to the mean of x y' over the columns x of `xs` and y of `ys`, which are centred.
fn covariance_of(xs: &DMatrix<f64>, ys: &DMatrix<f64>, covariance: &mut DMatrix<f64>) {
    covariance.fill(0.0);
    for (x, y) in xs.column_iter().zip(ys.column_iter()) {
        covariance.ger(1.0 / as_number(xs.ncols()), &x, &y, 1.0);
    }
}

fn check_finite<E>(covariance: &DMatrix<f64>) -> Result<(), FilterError<E>> {
    let is_finite = covariance.iter().all(|entry| entry.is_finite());
    if is_finite { Ok(()) } else { Err(FilterError::NotFinite) }
}

fn symmetrise(matrix: &mut DMatrix<f64>) {
    for i in 0..matrix.nrows() {
        for j in 0..i {
            let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
            (matrix[(i, j)], matrix[(j, i)]) = (mean, mean);
        }
    }
}

/// Sets `root` to the lower triangular R with R R' = `covariance`, which may be singular: a column of R is zero if
/// the columns before it explain its variance up to rounding.
fn square_root(covariance: &DMatrix<f64>, root: &mut DMatrix<f64>) {
    root.fill(0.0);
    let n = covariance.nrows();
    for j in 0..n {
        let explained: f64 = (0..j).map(|k| root[(j, k)] * root[(j, k)]).sum();
        let (variance, pivot) = (covariance[(j, j)], covariance[(j, j)] - explained);
        let rounding = ROUNDING * as_number(n) * variance;
        if pivot.is_nan() || pivot <= rounding {
            continue;
        }
        let diagonal = pivot.sqrt();
        root[(j, j)] = diagonal;
        for i in j + 1..n {
            let explained: f64 = (0..j).map(|k| root[(i, k)] * root[(j, k)]).sum();
            root[(i, j)] = (covariance[(i, j)] - explained) / diagonal;
        }
    }
}

#[cfg(all(test, feature = "design"))]
mod tests;
