//! Lower bounds of the H-infinity norm of estimation errors without measurement noise.

use super::Performance;
use crate::blocks::symmetric_part;
use crate::eigen::eigenvalues;
use crate::lyapunov::lyapunov;
use crate::svd::Svd;
use crate::zeros::{Nulling, output_nulling};
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{Complex, DMatrix, SymmetricEigen};

/// Relative distance of a zero from the stability limit below which no bound is stated.
const ON_THE_LIMIT: f64 = 1e-7;
/// Largest accepted residual of A U = U S, relative to the norm of A.
const REMAINDER: f64 = 1e-9;
/// Relative reduction of a bound that allows for rounding errors.
pub(super) const ROUNDING: f64 = 1e-6;
/// Largest number of steps of the iteration for the sign of a matrix; a relative change below [`SETTLED`] ends it
/// earlier.
const STEPS: usize = 100;
const SETTLED: f64 = 1e-13;

/// A lower bound of the H-infinity norm of the error of every causal estimate from measurements without noise.
///
/// ```text
/// x' = A x + B w,  y = C x + D w,  z = E x          (sampled: x[k+1] = A x[k] + B w[k])
/// A X + B W = X S,  C X + D W = 0,  every eigenvalue of S has a positive real part
/// gamma_low^2 = largest eigenvalue of P_w^-1 P_z,  S' P_w + P_w S = W' W,  S' P_z + P_z S = (E X)' (E X)
/// ```
///
/// The eigenvalues of S are the invariant zeros in the right half plane. w = W e^(S t) v, from t = -infinity to 0, is
/// a growing disturbance that y does not show, so that every estimate is 0. The energy of w is v' `P_w` v, the energy
/// of z is v' `P_z` v. So no estimate from y, of any order, has an error with a smaller norm. For a single zero
/// s the bound is |E x| / |w|, for several it is the condition of Nevanlinna and Pick. It is the least norm if w has as
/// many entries as y. Without such zeros the bound is 0: the norm tends to 0 as the gain grows.
///
/// In sampled time `z[k]` is estimated from `y[0]` to `y[k-1]`, as by A - L C. The zeros are those outside of the unit
/// circle. Infinite zeros count too: they are delays from w to y, during which no estimate knows w. They
/// become finite by the bilinear transform z = (1 + s) / (1 - s), which keeps the norm.
///
/// `a`: n x n; `c`: p x n; `performance`: B = `disturbance`, E = `output`, D = `feedthrough`; its norm and bound are
/// not used. None if some w has no effect on y (with noise see [`super::observer_norm_lower_bound`]), if a zero is on
/// the stability limit, if in sampled time an eigenvalue of A is -1, or if rounding errors hide the unstable zeros.
/// The bound is lowered by 1e-6 of itself for rounding errors; the relative residual of the equation for X and S is at
/// most 1e-9.
///
/// Source: the interpolation problem of Nevanlinna and Pick, as in B. A. Francis, A course in H-infinity control
/// theory (1987); the form with S and Lyapunov equations is our own.
///
/// # Example
///
/// A fault f' = w passes (1 - s) / (s + 1)^2. No estimate keeps the energy of the error of f below the energy of w:
///
/// ```
/// use control::Domain;
/// use control::lmi::{Norm, Performance, noiseless_norm_lower_bound};
/// use nalgebra::DMatrix;
/// let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, -1.0, -2.0, 1.0, 0.0, 0.0, 0.0]);
/// let c = DMatrix::from_row_slice(1, 3, &[1.0, -1.0, 0.0]);
/// let performance = Performance {
///     disturbance: DMatrix::from_row_slice(3, 1, &[0.0, 0.0, 1.0]),
///     output: DMatrix::from_row_slice(1, 3, &[0.0, 0.0, 1.0]),
///     feedthrough: DMatrix::zeros(1, 1),
///     norm: Norm::HInfinity,
///     gamma: None,
/// };
/// let bound = noiseless_norm_lower_bound(&a, &c, &performance, Domain::Continuous)?.unwrap();
/// assert!((bound - 1.0).abs() < 2e-6);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`] for a bound of
/// `performance` that is not above 0; [`Error::NotConverged`], [`Error::Overflow`], [`Error::ResidualTooLarge`],
/// [`Error::NotHurwitz`] when rounding prevents a solution.
pub fn noiseless_norm_lower_bound(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    performance: &Performance,
    domain: Domain,
) -> Result<Option<f64>, Error> {
    let (n, k, r) = check_observer(a, c, performance)?;
    let Performance { disturbance: b, output: e, feedthrough: d, .. } = performance;
    let system = StateSpace { a: a.clone(), b: b.clone(), c: c.clone(), d: d.clone(), domain };
    let (system, e, g) = match domain {
        Domain::Continuous => (system, e.clone(), DMatrix::zeros(r, k)),
        Domain::Sampled { .. } => {
            let Some(inverse) = (a + DMatrix::identity(n, n)).try_inverse() else {
                return Ok(None);
            };
            let root = std::f64::consts::SQRT_2;
            // z[k+1] = E A x[k] + E B w[k], estimated from y[0] to y[k].
            let (next, through) = (e * a, e * b);
            let from_w = &inverse * b;
            let system = StateSpace {
                a: (a - DMatrix::identity(n, n)) * &inverse,
                b: &from_w * root,
                c: c * &inverse * root,
                d: d - c * &from_w,
                domain: Domain::Continuous,
            };
            (system, &next * &inverse * root, through - next * from_w)
        }
    };
    let Some(nulling) = output_nulling(&system, &e, &g)? else { return Ok(None) };
    let Some(unstable) = unstable_part(&nulling)? else { return Ok(None) };
    if unstable.dynamics.is_empty() {
        return Ok(Some(0.0));
    }
    largest_ratio(&nulling, &unstable)
}

/// Checks the matrices of an observer and the bound of `performance`; returns the numbers of states, of w and of z.
pub(super) fn check_observer(
    a: &DMatrix<f64>,
    c: &DMatrix<f64>,
    performance: &Performance,
) -> Result<(usize, usize, usize), Error> {
    let n = check::with_outputs(a, c)?;
    let (k, r) = (performance.disturbance.ncols(), performance.output.nrows());
    performance.check(n, (c.nrows(), k))?;
    Ok((n, k, r))
}

/// The root of the largest ratio of the energies of z and w over all e^(S t) v; None if the energy of w is not positive
/// definite within rounding errors.
fn largest_ratio(nulling: &Nulling, unstable: &InvariantSubspace) -> Result<Option<f64>, Error> {
    let energy = |signal: &DMatrix<f64>| {
        let signal = signal * &unstable.basis;
        let square = symmetric_part(&signal.tr_mul(&signal));
        lyapunov(&-&unstable.dynamics, &square).map(|solution| solution.p)
    };
    let (of_z, of_w) = (energy(&nulling.output)?, energy(&nulling.input)?);
    let Some(factor) = of_w.cholesky() else { return Ok(None) };
    let lower = factor.l();
    let solve = |m: &DMatrix<f64>| lower.solve_lower_triangular(m);
    let ratios = solve(&of_z).and_then(|half| solve(&half.transpose()));
    let Some(ratios) = ratios.as_ref().map(symmetric_part) else { return Ok(None) };
    check::finite("P_w^-1 P_z", &ratios)?;
    let largest = SymmetricEigen::new(ratios).eigenvalues.max().max(0.0);
    Ok(Some(largest.sqrt() * (1.0 - ROUNDING)))
}

/// An invariant subspace of A: A U = U S.
struct InvariantSubspace {
    /// U with orthonormal columns, a basis of the subspace.
    basis: DMatrix<f64>,
    /// S, the dynamics in the subspace.
    dynamics: DMatrix<f64>,
}

/// The invariant subspace of A, the dynamics of `nulling`, for the eigenvalues with positive real parts, without columns
/// if there are none; None if an eigenvalue is on the imaginary axis or the subspace is not accurate.
///
/// Method: the sign of A by Newton's iteration with norm scaling (N. J. Higham, Functions of Matrices (2008),
/// section 5.5); U is the range of I + sign A.
fn unstable_part(nulling: &Nulling) -> Result<Option<InvariantSubspace>, Error> {
    let (a, n) = (&nulling.dynamics, nulling.dynamics.nrows());
    let empty = InvariantSubspace { basis: DMatrix::zeros(n, 0), dynamics: DMatrix::zeros(0, 0) };
    if n == 0 {
        return Ok(Some(empty));
    }
    let all = eigenvalues(a)?;
    let on_the_limit = |value: &Complex<f64>| {
        value.re.abs() <= (ON_THE_LIMIT * value.norm()).max(nulling.rounding)
    };
    if all.iter().any(on_the_limit) {
        return Ok(None);
    }
    let count = all.iter().filter(|value| value.re > 0.0).count();
    if count == 0 {
        return Ok(Some(empty));
    }
    let mut sign = a.clone();
    for step in 0.. {
        let Some(inverse) = sign.clone().try_inverse() else { return Ok(None) };
        let ratio = (inverse.norm() / sign.norm()).sqrt();
        let next = (&sign * ratio + inverse / ratio) * 0.5;
        let change = (&next - &sign).norm();
        sign = next;
        if !sign.iter().all(|entry| entry.is_finite()) || step == STEPS {
            return Ok(None);
        }
        if change <= SETTLED * sign.norm() {
            break;
        }
    }
    let range = Svd::new(&(sign + DMatrix::identity(n, n)))?;
    let basis = range.left.columns(0, count).into_owned();
    let dynamics = basis.tr_mul(&(a * &basis));
    let remainder = (a * &basis - &basis * &dynamics).norm();
    let is_unstable = eigenvalues(&dynamics)?.iter().all(|value| value.re > 0.0);
    let is_accurate = remainder <= REMAINDER * a.norm() && is_unstable;
    Ok(is_accurate.then_some(InvariantSubspace { basis, dynamics }))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Norm, observer_norm_lower_bound};
    use super::*;

    pub(crate) fn matrix(rows: usize, columns: usize, entries: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(rows, columns, entries)
    }

    /// The requirement for x' = B w, z = E x with measurements without noise.
    pub(crate) fn without_noise(
        disturbance: DMatrix<f64>,
        output: DMatrix<f64>,
        measurements: usize,
    ) -> Performance {
        let feedthrough = DMatrix::zeros(measurements, disturbance.ncols());
        Performance { disturbance, output, feedthrough, norm: Norm::HInfinity, gamma: None }
    }

    /// A, C and the performance for a fault f' = w that is measured as y = (c0 + c1 s + c2 s^2) / (s + 1)^3 f.
    pub(crate) fn filtered_fault(numerator: [f64; 3]) -> (DMatrix<f64>, DMatrix<f64>, Performance) {
        let [c0, c1, c2] = numerator;
        let a = [0., 1., 0., 0., 0., 0., 1., 0., -1., -3., -3., 1., 0., 0., 0., 0.];
        let fault = |rows, columns| matrix(rows, columns, &[0., 0., 0., 1.]);
        let performance = without_noise(fault(4, 1), fault(1, 4), 1);
        (matrix(4, 4, &a), matrix(1, 4, &[c0, c1, c2, 0.0]), performance)
    }

    fn bound(numerator: [f64; 3]) -> f64 {
        let (a, c, performance) = filtered_fault(numerator);
        noiseless_norm_lower_bound(&a, &c, &performance, Domain::Continuous).unwrap().unwrap()
    }

    /// The error T has T(z) = 1 / z at each zero z of the right half plane, where y shows nothing.
    #[test]
    fn the_bound_is_that_of_the_interpolation_at_the_zeros() {
        assert!(bound([2.0, 3.0, 1.0]) <= 0.0, "zeros at -1 and -2");
        for zero in [0.2, 3.0] {
            let bound = bound([zero * 4.0, zero - 4.0, -1.0]);
            assert!((bound * zero - 1.0).abs() < 1e-5, "{zero}: {bound}");
        }
        // Two zeros: gamma^2 is the largest eigenvalue of 1 / (z_i z_j (z_i + z_j)) by 1 / (z_i + z_j).
        let (p, q) = (0.5_f64, 2.0_f64);
        let pick = matrix(2, 2, &[0.5 / p, 1.0 / (p + q), 1.0 / (p + q), 0.5 / q]);
        let values = matrix(2, 1, &[1.0 / p, 1.0 / q]);
        let of_z = pick.component_mul(&(&values * values.transpose()));
        let ratios = pick.lu().solve(&of_z).unwrap();
        let largest = eigenvalues(&ratios).unwrap().iter().map(|x| x.re).fold(0.0, f64::max);
        assert!((bound([p * q, -p - q, 1.0]) / largest.sqrt() - 1.0).abs() < 1e-5);
    }

    /// Rounding errors would make a zero at 0 one of the right half plane, with an error of 1 / z.
    #[test]
    fn a_zero_at_the_origin_has_no_bound() {
        for numerator in [[0.0, 2.0, 1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 0.0]] {
            let (a, c, performance) = filtered_fault(numerator);
            let bound = noiseless_norm_lower_bound(&a, &c, &performance, Domain::Continuous);
            assert_eq!(bound, Ok(None), "{numerator:?}");
        }
    }

    /// The bound with measurement noise is proven by linear matrix inequalities; it falls towards the bound
    /// without noise.
    #[test]
    fn it_is_the_limit_of_the_bound_for_vanishing_noise() {
        let numerator = [1.0, -2.5, 1.0];
        let (a, c, mut performance) = filtered_fault(numerator);
        let least = bound(numerator);
        performance.disturbance = performance.disturbance.insert_column(1, 0.0);
        let mut before = f64::INFINITY;
        for noise in [1.0, 0.1, 0.01] {
            performance.feedthrough = matrix(1, 2, &[0.0, noise]);
            let bound = observer_norm_lower_bound(&a, &c, &performance, Domain::Continuous);
            let bound = bound.unwrap().unwrap();
            assert!(bound > least && bound < before, "{noise}: {bound} {least}");
            before = bound;
        }
        assert!(before < 1.05 * least, "{before} {least}");
    }

    /// f[k+1] = f[k] + w[k], and y shows f `delay` samples later: the error contains the last 1 + `delay` values of w.
    fn delayed(delay: usize) -> f64 {
        let n = delay + 1;
        let mut a = DMatrix::zeros(n, n);
        a[(0, 0)] = 1.0;
        (1..n).for_each(|row| a[(row, row - 1)] = 1.0);
        let unit = |at: usize| DMatrix::from_fn(n, 1, |row, _| f64::from(u8::from(row == at)));
        let performance = without_noise(unit(0), unit(0).transpose(), 1);
        let domain = Domain::Sampled { period: 0.1 };
        let c = unit(n - 1).transpose();
        noiseless_norm_lower_bound(&a, &c, &performance, domain).unwrap().unwrap()
    }

    /// The problem of Caratheodory and Fejer: the norm of the triangular Toeplitz matrix of ones.
    #[test]
    fn in_sampled_time_no_estimate_knows_the_disturbances_of_the_delay() {
        for delay in [0, 1, 2, 4] {
            let toeplitz = DMatrix::from_fn(delay + 1, delay + 1, |row, column| {
                f64::from(u8::from(row >= column))
            });
            let least = Svd::new(&toeplitz).unwrap().values.max();
            let bound = delayed(delay);
            assert!((bound / least - 1.0).abs() < 1e-5, "{delay}: {bound} {least}");
        }
    }
}
