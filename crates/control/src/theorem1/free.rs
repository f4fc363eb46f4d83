//! What theorem 1 can say when P is free.

use crate::eigen::spectral_abscissa;
use crate::lmi::definite::{Product, margin};
use crate::lmi::{Affine, Outcome, Problem, Region, RegionCertificate, certify_region};
use crate::lyapunov::lyapunov;
use crate::singular::Singular;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

/// Parts of the decay rate that are given up until a certificate is found.
const GIVEN_UP: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.5];

/// Parts by which the right sides are enlarged until the inequality survives rounding.
const ABOVE: [f64; 5] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2];
/// What the solver may take a semidefinite matrix of about one for.
const SOLVER_ERROR: f64 = 1e-7;
/// Steps of the golden section; the interval shrinks to 1e-4 of its length.
const SECTIONS: usize = 20;

/// The largest decay rate that a quadratic function proves.
#[derive(Debug, Clone, PartialEq)]
pub struct Decay {
    /// Decay rate in 1/s.
    pub alpha: f64,
    /// P and its margin: F' P + P F + 2 alpha P < 0.
    pub certificate: RegionCertificate,
}

/// The largest alpha with a P > 0 such that F' P + P F + 2 alpha P < 0, F = `A_0` - L `C_0`.
///
/// ```text
/// V = z' P z falls at least as fast as exp(-2 alpha t) along z' = F z
/// ```
///
/// `error_dynamics`: n x n. The least upper bound of alpha is the distance of the eigenvalues from
/// the imaginary axis, attained if those next to it are not defective. Decay rates a little below it
/// are tried, from 1e-6 of it to half of it, until [`certify_region`] proves one. A system that is
/// not stable is a conflict named "stability".
///
/// # Errors
///
/// Those of [`certify_region`].
pub fn largest_decay(error_dynamics: &DMatrix<f64>) -> Result<Outcome<Decay>, Error> {
    check::square("error dynamics", error_dynamics)?;
    let abscissa = spectral_abscissa(error_dynamics)?;
    if abscissa >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    for part in GIVEN_UP {
        let alpha = -abscissa * (1.0 - part);
        let region = Region { decay: Some(alpha), ..Region::default() };
        let found = certify_region(error_dynamics, &region, Domain::Continuous)?;
        if let Outcome::Optimal(certificate) = found {
            return Ok(Outcome::Optimal(Decay { alpha, certificate }));
        }
    }
    Ok(Outcome::Trouble("no decay rate is proven in double precision"))
}

/// The radius of theorem 1 with the best P.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeRegion {
    /// Radius: V = z' P z falls wherever the norm of z is larger.
    pub delta: f64,
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest eigenvalue of P and of -(F' P + P F + I), each scaled to a diagonal of about one;
    /// above the rounding errors.
    pub margin: f64,
}

/// Theorem 1 with free P: the smallest radius outside of which the error falls.
///
/// ```text
/// z' = F z + G w, |w| <= bound;  P > 0, F' P + P F <= -I        in place of (12)
/// delta = 2 bound norm(P G)                                     as (16)
/// ```
///
/// Then V' <= -|z|^2 + 2 |z| norm(P G) |w| is negative for |z| > delta. With G = `F_0` and the bound
/// of the fault this is theorem 1 for z = [e; `f_hat`], the P of (12) being one of the P allowed;
/// with G = [0; I] and the bound of f' - `A_f` f it speaks of z = [e; eps]. As in the paper, z ends in
/// the smallest ellipsoid z' P z = constant around the ball of that radius, not in the ball.
///
/// `error_dynamics`: F, n x n, Hurwitz; `disturbance`: G, n x k; `bound` above zero, in the unit
/// of w. Method: P solves F' P + P F = -I - Y for a Y >= 0 found by an interior point method so
/// that the norm of P G is smallest; P depends linearly on Y, and each of these n (n + 1) / 2
/// dependencies is a Lyapunov equation. F' P + P F < -I is then checked for the P that is returned,
/// its products computed in twice the precision. The norm depends on the units of the states, as
/// the theorem does. Cost: about 100 `n^5` multiplications.
///
/// A system that is not stable is a conflict named "stability".
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a bad bound; those of [`lyapunov`].
pub fn smallest_region(
    error_dynamics: &DMatrix<f64>,
    disturbance: &DMatrix<f64>,
    bound: f64,
) -> Result<Outcome<FreeRegion>, Error> {
    let (f, g) = (error_dynamics, disturbance);
    check_system(f, g, bound)?;
    if spectral_abscissa(f)? >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    let n = f.nrows();
    let identity = DMatrix::identity(n, n);
    let Some(more) = extra_decay(f, g)? else {
        return Ok(Outcome::Trouble("the interior point method did not end"));
    };
    for above in ABOVE {
        let p = lyapunov(f, &(&identity * (1.0 + above) + &more))?.p;
        let product = Product::of(&p, f);
        let left = (&product.high + product.high.transpose() + &identity)
            + (&product.low + product.low.transpose());
        let smallest = margin(&p)?.min(margin(&-left)?);
        if smallest > 0.0 {
            let delta = 2.0 * bound * Singular::of(&(&p * g))?.values[0];
            return Ok(Outcome::Optimal(FreeRegion { delta, p, margin: smallest }));
        }
    }
    Ok(Outcome::Trouble("no P shows in double precision that the error falls"))
}

/// Y >= 0 for which the norm of P G is smallest, F' P + P F = -I - Y.
fn extra_decay(f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, Error> {
    let n = f.nrows();
    let effect = |q: &DMatrix<f64>| Ok::<_, Error>(lyapunov(f, q)?.p * g);
    let unit = |row: usize, col: usize| {
        let mut unit = DMatrix::zeros(n, n);
        (unit[(row, col)], unit[(col, row)]) = (1.0, 1.0);
        unit
    };
    let printed = effect(&DMatrix::identity(n, n))?;
    let size = printed.norm();
    let mut scale = DVector::from_element(n, 1.0);
    for state in 0..n {
        let own = effect(&unit(state, state))?.norm();
        scale[state] = (size / own).sqrt();
    }
    let (mut problem, mut effects) = (Problem::new(), Affine::constant(&(&printed / size)));
    let mut y = Affine::zeros(n, n);
    for col in 0..n {
        for row in 0..=col {
            let (number, scaled) = (problem.scalar(), unit(row, col) * (scale[row] * scale[col]));
            effects = &effects + &number.times(&(effect(&scaled)? / size));
            y = &y + &number.times(&unit(row, col));
        }
    }
    let norm = problem.scalar();
    let square = |order: usize| norm.times(&DMatrix::identity(order, order));
    let (rows, cols) = printed.shape();
    problem.always(&y, 0.0);
    let turned = effects.transpose();
    problem.always(&Affine::blocks(&[&[&square(rows), &effects], &[&turned, &square(cols)]]), 0.0);
    problem.minimise(&norm);
    let Some((_, found)) = problem.smallest() else { return Ok(None) };
    let values = y.at(&found);
    Ok(Some(DMatrix::from_fn(n, n, |i, j| {
        let rounding = if i == j { SOLVER_ERROR } else { 0.0 };
        (values[(i, j)] + rounding) * scale[i] * scale[j]
    })))
}

fn check_system(f: &DMatrix<f64>, g: &DMatrix<f64>, bound: f64) -> Result<(), Error> {
    let n = check::square("error dynamics", f)?;
    check::shape("disturbance", g, (n, g.ncols()))?;
    check::positive("bound", bound)
}

/// An ellipsoid in which the error ends and which it does not leave.
#[derive(Debug, Clone, PartialEq)]
pub struct UltimateBound {
    /// Radius of the ball around the ellipsoid.
    pub radius: f64,
    /// Largest value of each state in the ellipsoid.
    pub peaks: DVector<f64>,
    /// The lambda of the inequality, in 1/s: V - `bound^2` falls at least as fast as
    /// exp(-lambda t).
    pub rate: f64,
    /// Q, n x n: the ellipsoid is z' `Q^-1` z <= `bound^2`.
    pub shape: DMatrix<f64>,
    /// Smallest eigenvalue of Q and of the inequality, each scaled to a diagonal of about one; above
    /// the rounding errors.
    pub margin: f64,
}

/// The smallest ball with an ellipsoid inside in which the error ends, for a bounded disturbance.
///
/// ```text
/// z' = F z + G w, |w| <= bound;  Q > 0, lambda > 0
/// F Q + Q F' + lambda Q + G G' / lambda < 0
/// V = z' Q^-1 z:  V' <= -lambda (V - |w|^2), so V ends at or below bound^2
/// radius = bound sqrt(largest eigenvalue of Q), peak of state i = bound sqrt(Q[i,i])
/// ```
///
/// With G = [0; I] and the bound of f' - `A_f` f this is the ultimate bound of z = [e; eps] for a
/// fault that changes; with G = -`F_0` and the bound of the fault that of z = [e; `f_hat`]. Other than
/// the radius of theorem 1 it is one that z does not leave, and it depends on the units of
/// the states only through what `radius` means.
///
/// `error_dynamics`: F, n x n, Hurwitz; `disturbance`: G, n x k. For each lambda below twice the
/// decay rate the smallest Q solves the equation (Lyapunov), so that lambda alone is searched for,
/// by golden section in its logarithm. The inequality is checked for the Q that is returned, which
/// is larger by a part of about 1e-6. Cost: about 100 Lyapunov equations.
///
/// A system that is not stable is a conflict named "stability".
///
/// Source: J. Abedor, K. Nagpal, K. Poolla, A linear matrix inequality approach to peak-to-peak gain
/// minimization, Int. J. Robust Nonlinear Control 6 (1996), section 3.
///
/// # Example
///
/// For z' = -2 z + w the ellipsoid is the interval that z really fills:
///
/// ```
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let found = control::theorem1::ultimate_bound(&one(-2.0), &one(1.0), 6.0)?.optimal().unwrap();
/// assert!((found.radius - 3.0).abs() < 1e-4);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Those of [`smallest_region`].
pub fn ultimate_bound(
    error_dynamics: &DMatrix<f64>,
    disturbance: &DMatrix<f64>,
    bound: f64,
) -> Result<Outcome<UltimateBound>, Error> {
    let (f, g) = (error_dynamics, disturbance);
    check_system(f, g, bound)?;
    let abscissa = spectral_abscissa(f)?;
    if abscissa >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    let rate = best_rate(f, g, -2.0 * abscissa)?;
    let smallest = smallest_shape(f, g, rate, &DVector::zeros(f.nrows()))?;
    for above in ABOVE {
        let extra = smallest.diagonal() * (rate * above);
        let shape = smallest_shape(f, g, rate, &extra)?;
        let product = Product::of(f, &shape);
        let right = g * g.transpose() / rate + &shape * rate;
        let left = (&product.high + product.high.transpose() + right)
            + (&product.low + product.low.transpose());
        let margin = margin(&shape)?.min(margin(&-left)?);
        if margin > 0.0 {
            let radius = bound * Singular::of(&shape)?.values[0].sqrt();
            let peaks = shape.diagonal().map(|entry| bound * entry.sqrt());
            return Ok(Outcome::Optimal(UltimateBound { radius, peaks, rate, shape, margin }));
        }
    }
    Ok(Outcome::Trouble("no ellipsoid is proven in double precision"))
}

/// Q with F Q + Q F' + lambda Q + G G' / lambda + diag(extra) = 0.
fn smallest_shape(
    f: &DMatrix<f64>,
    g: &DMatrix<f64>,
    rate: f64,
    extra: &DVector<f64>,
) -> Result<DMatrix<f64>, Error> {
    let n = f.nrows();
    let shifted = f + DMatrix::from_diagonal_element(n, n, 0.5 * rate);
    let right = g * g.transpose() / rate + DMatrix::from_diagonal(extra);
    Ok(lyapunov(&shifted.transpose(), &((&right + right.transpose()) * 0.5))?.p)
}

/// The lambda for which the largest eigenvalue of Q is smallest.
fn best_rate(f: &DMatrix<f64>, g: &DMatrix<f64>, largest: f64) -> Result<f64, Error> {
    let none = DVector::zeros(f.nrows());
    let size = |logarithm: f64| {
        let shape = smallest_shape(f, g, logarithm.exp(), &none)?;
        Ok::<_, Error>(Singular::of(&shape)?.values[0])
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = ((largest * 1e-4).ln(), (largest * 0.9999).ln());
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (size(left)?, size(right)?);
    for _ in 0..SECTIONS {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = size(left)?;
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = size(right)?;
        }
    }
    Ok((0.5 * (low + high)).exp())
}
