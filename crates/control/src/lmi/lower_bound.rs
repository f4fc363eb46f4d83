//! Lower bounds of the H-infinity norm that hold for every gain and every filter.

use super::affine::Affine;
use super::coordinates::{time_unit, unit_near};
use super::definite::margin;
use super::noiseless::check_observer;
use super::region::MARGIN;
use super::{Performance, Problem};
use crate::blocks::{beside, symmetric_part};
use crate::rank::controllable_part;
use crate::riccati::kalman;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, SymmetricEigen};

/// A lower bound of the H-infinity norm of the estimation error of every linear filter, with proof.
///
/// ```text
/// x' = A x + B w,  y = C x + D w,  z = E x          (sampled: x[k+1] = A x[k] + B w[k])
/// gamma_low^2 = tr(E H_xx E') / tr(H_ww)  for a H = [H_xx, H_xw; H_wx, H_ww] >= 0 with
/// [C, D] H = 0  and  A H_xx + H_xx A' + B H_wx + H_xw B' >= 0
/// (sampled: gamma_low^2 = tr(E H_+ E') / tr(H_ww),  H_+ = [A, B] H [A, B]',  H_+ - H_xx >= 0)
/// ```
///
/// Such an H is the covariance of growing disturbances that the measurement does not show, for which every filter
/// estimates z = 0. So no filter from y to an estimate of z, of any order, has an error with a smaller norm. For error
/// dynamics A - L C the traces of H with the inequality of the norm (see [`super::certify_gain`]) give the bound for
/// every L. In sampled time `z[k]` is estimated from `y[0]` to `y[k-1]`, as by A - L C. The largest bound is computed;
/// it equals the least norm of any filter (strong duality). Constant gains in general only approach this norm.
///
/// `a`: n x n; `c`: p x n; `performance`: B = `disturbance`, E = `output`, D = `feedthrough`; its norm and bound are
/// not used. None if D does not have full row rank (a measurement without noise), if there is no Kalman filter, if no
/// hidden disturbance reaches a state or E = 0, or if the inequalities could not be verified in double precision.
///
/// Method: w = -D' (D D')^-1 C x + N d, N a basis of the null space of D, meets [C, D] H = 0. The
/// semidefinite program for the covariance of (x, d) is solved for the part of the states that d
/// reaches, in coordinates in which the covariance of the Kalman filter is the identity. The result is verified by
/// eigenvalues in the coordinates of that part.
///
/// Source: dual of the inequality of the H-infinity filter; V. Balakrishnan and L. Vandenberghe, Semidefinite
/// programming duality and linear time-invariant systems, IEEE Trans. Autom. Control 48 (2003), section IV.
///
/// # Example
///
/// No filter for x' = w, y = x + v keeps the energy of the error of x below the energy of [w; v]:
///
/// ```
/// use control::Domain;
/// use control::lmi::{Norm, Performance, observer_norm_lower_bound};
/// use nalgebra::DMatrix;
/// let row = |entries: &[f64]| DMatrix::from_row_slice(1, entries.len(), entries);
/// let performance = Performance {
///     disturbance: row(&[1.0, 0.0]),
///     output: row(&[1.0]),
///     feedthrough: row(&[0.0, 1.0]),
///     norm: Norm::HInfinity,
///     gamma: None,
/// };
/// let (a, c) = (row(&[0.0]), row(&[1.0]));
/// let bound = observer_norm_lower_bound(&a, &c, &performance, Domain::Continuous)?.unwrap();
/// assert!(bound < 1.0 && bound > 0.999);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`] for a bound of
/// `performance` that is not above 0; [`Error::NotConverged`].
pub fn observer_norm_lower_bound(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    performance: &Performance,
    domain: Domain,
) -> Result<Option<f64>, Error> {
    check_observer(a, c, performance)?;
    let Some(hidden) = HiddenDisturbance::new(a, c, performance, domain)? else { return Ok(None) };
    hidden.largest_ratio()
}

/// A lower bound of the H-infinity norm that holds for every state feedback, with proof: the result of
/// [`observer_norm_lower_bound`] for the transposed system.
///
/// `a`, `b`, `performance`: as for [`super::state_feedback`]. None in the cases of [`observer_norm_lower_bound`],
/// whose D is the transposed `feedthrough`: every command must have a weight.
///
/// # Errors
///
/// Same as [`observer_norm_lower_bound`].
pub fn feedback_norm_lower_bound(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    performance: &Performance,
    domain: Domain,
) -> Result<Option<f64>, Error> {
    let n = check::with_inputs(a, b)?;
    performance.check(n, (performance.output.nrows(), b.ncols()))?;
    observer_norm_lower_bound(&a.transpose(), &b.transpose(), &performance.transposed(), domain)
}

/// The system under the disturbances w that keep y = 0: x' = A x + B d, z = E x, |w|^2 = |W x|^2 + |d|^2, for the
/// states that d reaches.
struct HiddenDisturbance {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    /// W of |w|^2 = |W x|^2 + |d|^2.
    energy: DMatrix<f64>,
    /// E of z = E x.
    output: DMatrix<f64>,
    /// The lower triangular R of coordinates x~ of about one: x = R x~.
    scale: DMatrix<f64>,
    domain: Domain,
}

impl HiddenDisturbance {
    /// Computes the system; None if D does not have full row rank, d reaches no state, or there is no Kalman filter
    /// with a positive definite covariance.
    fn new(
        a: &DMatrix<f64>,
        c: &DMatrix<f64>,
        performance: &Performance,
        domain: Domain,
    ) -> Result<Option<Self>, Error> {
        let Performance { disturbance: b, output, feedthrough: d, .. } = performance;
        let noise = symmetric_part(&(d * d.transpose()));
        if margin(&noise)? <= 0.0 {
            return Ok(None);
        }
        let Some(factor) = noise.clone().cholesky() else { return Ok(None) };
        let inverse = factor.solve(d).transpose();
        let free = null_space(&(&inverse * d));
        if free.is_empty() {
            return Ok(None);
        }
        let (hidden, driven) = (a - b * &inverse * c, b * free);
        let part = controllable_part(&hidden, &driven)?;
        if part.a.is_empty() {
            return Ok(None);
        }
        let measured = c * &part.basis;
        let process = symmetric_part(&(&part.b * part.b.transpose()));
        let Ok(filter) = kalman(&part.a, &measured, &process, &noise, domain) else {
            return Ok(None);
        };
        let Some(scale) = filter.covariance.cholesky() else { return Ok(None) };
        Ok(Some(Self {
            energy: inverse * measured,
            output: output * &part.basis,
            scale: scale.unpack(),
            a: part.a,
            b: part.b,
            domain,
        }))
    }

    /// The root of the largest ratio of the energies of z and w; None if z is zero, or the ratio could not be computed
    /// or verified.
    fn largest_ratio(&self) -> Result<Option<f64>, Error> {
        let (order, free) = self.b.shape();
        let scale = &self.scale;
        let solve = |m: DMatrix<f64>| scale.solve_lower_triangular(&m);
        let Some((a, b)) = solve(&self.a * scale).zip(solve(self.b.clone())) else {
            return Ok(None);
        };
        let unit = time_unit(self.domain, unit_near(a.norm()));
        let scaled = Self {
            a: a / unit,
            b: b / unit.sqrt(),
            energy: &self.energy * scale / unit.sqrt(),
            output: &self.output * scale,
            scale: DMatrix::identity(order, order),
            domain: self.domain,
        };
        let mut problem = Problem::new();
        let covariance = problem.symmetric(order + free);
        problem.constrain(&covariance, MARGIN);
        problem.constrain(&scaled.growth(&covariance), MARGIN);
        let (of_z, of_w) = scaled.energies();
        let size = if of_z.norm() > 0.0 { of_z.norm() } else { return Ok(None) };
        problem.constrain(&(&Affine::identity(1, 1.0) - &product_trace(&covariance, &of_w)), 0.0);
        problem.minimise(&product_trace(&covariance, &(of_z * (-1.0 / size))));
        let Some((_, unknowns)) = problem.minimum() else { return Ok(None) };
        let mut map = DMatrix::identity(order + free, order + free) * unit.sqrt();
        map.view_mut((0, 0), (order, order)).copy_from(scale);
        self.verified(&symmetric_part(&(&map * covariance.evaluate(&unknowns) * map.transpose())))
    }

    /// The root of the ratio of the energies of z and w for a covariance of (x, d); None unless the inequalities of the
    /// covariance hold by more than rounding errors.
    fn verified(&self, covariance: &DMatrix<f64>) -> Result<Option<f64>, Error> {
        let growth = self.growth(&Affine::constant(covariance)).constant;
        if margin(covariance)? <= 0.0 || margin(&growth)? <= 0.0 {
            return Ok(None);
        }
        let (of_z, of_w) = self.energies();
        Ok(Some((covariance.dot(&of_z) / covariance.dot(&of_w)).sqrt()))
    }

    /// The next state or the derivative of the state, as [A, B] times [x; d].
    fn next(&self) -> DMatrix<f64> {
        beside(&self.a, &self.b)
    }

    /// The growth of X in the covariance [X, Y'; Y, U] of (x, d): A X + X A' + B Y + Y' B'; in sampled time
    /// [A, B] [X, Y'; Y, U] [A, B]' - X.
    fn growth(&self, covariance: &Affine) -> Affine {
        let (order, free) = self.b.shape();
        let state = DMatrix::identity(order, order + free);
        let next = self.next();
        let product = &next * covariance;
        match self.domain {
            Domain::Continuous => (&product * &state.transpose()).plus_transpose(),
            Domain::Sampled { .. } => {
                let before = &(&state * covariance) * &state.transpose();
                &(&product * &next.transpose()) - &before
            }
        }
    }

    /// The two matrices M for which tr(M H), with H the covariance of (x, d), is the energy of z (in sampled time at
    /// the next sample) and the energy of w.
    fn energies(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let (order, free) = self.b.shape();
        let whole = order + free;
        let output = match self.domain {
            Domain::Continuous => self.output.clone().resize_horizontally(whole, 0.0),
            Domain::Sampled { .. } => &self.output * self.next(),
        };
        let of_z = output.tr_mul(&output);
        let mut of_w = self.energy.tr_mul(&self.energy).resize(whole, whole, 0.0);
        of_w.view_mut((order, order), (free, free)).fill_with_identity();
        (of_z, of_w)
    }
}

/// tr(M X) for a symmetric M.
pub(super) fn product_trace(x: &Affine, m: &DMatrix<f64>) -> Affine {
    let terms = x.terms.iter().map(|(at, unit)| (*at, DMatrix::from_element(1, 1, m.dot(unit))));
    Affine { constant: DMatrix::from_element(1, 1, m.dot(&x.constant)), terms: terms.collect() }
}

/// An orthonormal basis of the null space of an orthogonal projector.
fn null_space(projector: &DMatrix<f64>) -> DMatrix<f64> {
    let SymmetricEigen { eigenvalues, eigenvectors } = symmetric_part(projector).symmetric_eigen();
    let columns: Vec<_> = (0..eigenvalues.len()).filter(|&at| eigenvalues[at] < 0.5).collect();
    eigenvectors.select_columns(&columns)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::Norm;
    use super::*;

    pub(crate) fn row(entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(1, entries.len(), entries)
    }

    /// The error of x with x' = B w, y = x + D w.
    pub(crate) fn scalar_error(disturbance: &[f64], feedthrough: &[f64]) -> Performance {
        Performance {
            disturbance: row(disturbance),
            output: row(&[1.0]),
            feedthrough: row(feedthrough),
            norm: Norm::HInfinity,
            gamma: None,
        }
    }

    fn scalar_bound(a: f64, performance: &Performance, domain: Domain) -> Option<f64> {
        observer_norm_lower_bound(&row(&[a]), &row(&[1.0]), performance, domain).unwrap()
    }

    /// For x' = a x + w, y = x + v, z = x: 0 = 2 a X - (1 - `1/gamma^2`) X^2 + 1 has a positive stabilising
    /// solution for `gamma^2` above 1 / (1 + a^2); for an unstable mode, a > 0, X is positive for `gamma^2` above 1.
    /// X = a^2 / (1 / X + 1 - `1/gamma^2`) + 1 of x[k+1] = a x[k] + w[k] has a solution with X below `gamma^2` for
    /// `gamma^2` above a^2 + 1.
    #[test]
    fn the_bound_of_a_scalar_filter_is_that_of_the_riccati_equation() {
        let performance = scalar_error(&[1.0, 0.0], &[0.0, 1.0]);
        let stable = [-20.0_f64, -1.0, 0.0].map(|a| (a, Domain::Continuous, 1.0 / a.hypot(1.0)));
        let sampled = Domain::Sampled { period: 1.0 };
        let sampled = [0.5_f64, -1.0, 1.0, 2.0].map(|a| (a, sampled, a.hypot(1.0)));
        let unstable = (3.0, Domain::Continuous, 1.0);
        for (a, domain, least) in stable.into_iter().chain(sampled).chain([unstable]) {
            let bound = scalar_bound(a, &performance, domain).unwrap();
            assert!(bound <= least && bound > 0.9999 * least, "{a} {domain:?}: {bound}, {least}");
        }
    }

    #[test]
    fn measurements_without_noise_or_that_show_the_disturbance_completely_have_no_bound() {
        for (a, feedthrough) in [(0.0, 0.0), (-1.0, 1.0)] {
            let performance = scalar_error(&[1.0], &[feedthrough]);
            assert_eq!(scalar_bound(a, &performance, Domain::Continuous), None);
        }
    }
}
