//! The ultimate bound of the estimation error: an invariant ellipsoid in which it ends.

use super::{ENLARGEMENTS, check_system};
use crate::blocks::symmetric_part;
use crate::lmi::Outcome;
use crate::lmi::definite::margin;
use crate::lyapunov::lyapunov;
use crate::product::AccurateProduct;
use crate::stability::instability;
use crate::svd::norm_2;
use crate::{Domain, Error};
use nalgebra::{DMatrix, DVector};

/// Steps of the golden-section search; the interval shrinks to 1e-4 of its length.
const GOLDEN_SECTION_STEPS: usize = 20;

/// An invariant ellipsoid to which the error converges.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct UltimateBound {
    /// Radius of the smallest ball around the ellipsoid.
    pub radius: f64,
    /// Largest absolute value of each state in the ellipsoid, n.
    pub peaks: DVector<f64>,
    /// lambda, in 1/s: V - `bound^2` decreases at least as fast as exp(-lambda t).
    pub rate: f64,
    /// Q, n x n: the shape of the ellipsoid z' `Q^-1` z <= `bound^2`.
    pub shape: DMatrix<f64>,
    /// Smallest eigenvalue of Q and of the inequality, each scaled to a diagonal of about one; larger
    /// than the rounding errors.
    pub margin: f64,
}

/// The invariant ellipsoid within the smallest ball in which the error ends under a bounded
/// disturbance.
///
/// ```text
/// z' = F z + G w, |w| <= bound;  Q > 0, lambda > 0
/// F Q + Q F' + lambda Q + G G' / lambda < 0
/// V = z' Q^-1 z:  V' <= -lambda (V - |w|^2), so that V ends at or below bound^2
/// radius = bound sqrt(largest eigenvalue of Q),  peak of state i = bound sqrt(Q[i,i])
/// ```
///
/// With G = [0; I] and the bound of f' - `A_f` f this is the ultimate bound of z = [e; eps] for a fault that changes;
/// with G = -`F_0` and the bound of the fault, it is the ultimate bound of z = [e; `f_hat`]. Unlike the ball of theorem
/// 1, the ellipsoid is invariant: z does not leave it. Only the meaning of `radius` depends on the units of the states.
///
/// `error_dynamics`: F, n x n, Hurwitz; `disturbance`: G, n x k; `bound`: above zero, in the unit of
/// w. Method: for each lambda below twice the decay rate the smallest Q solves the inequality as an
/// equation, a Lyapunov equation for F + lambda I / 2; lambda is found by golden section on a
/// logarithmic scale. The inequality is verified for the Q that is returned, which is larger by about
/// 1e-6 of itself, by up to 1e-2 where rounding errors hide the inequality. Cost: about 25 Lyapunov
/// equations.
///
/// A system that is not stable is [`Outcome::Infeasible`] with the conflict "stability".
///
/// Source: J. Abedor, K. Nagpal, K. Poolla, A linear matrix inequality approach to peak-to-peak gain
/// minimization, Int. J. Robust Nonlinear Control 6 (1996), section 3.
///
/// # Example
///
/// For z' = -2 z + w with |w| <= 6 the ellipsoid is the set of all z that a disturbance can reach,
/// the interval from -3 to 3:
///
/// ```
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let bound = control::theorem1::ultimate_bound(&one(-2.0), &one(1.0), 6.0)?.optimal().unwrap();
/// assert!((bound.radius - 3.0).abs() < 1e-4);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a bad bound; [`Error::NotConverged`], [`Error::Overflow`], [`Error::ResidualTooLarge`],
/// [`Error::NotHurwitz`] when rounding prevents a solution of a Lyapunov equation.
pub fn ultimate_bound(
    error_dynamics: &DMatrix<f64>,
    disturbance: &DMatrix<f64>,
    bound: f64,
) -> Result<Outcome<UltimateBound>, Error> {
    let (f, g) = (error_dynamics, disturbance);
    check_system(f, g, bound)?;
    let abscissa = instability(f, Domain::Continuous)?;
    if abscissa >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    let rate = best_rate(f, g, -2.0 * abscissa)?;
    let smallest = smallest_shape(f, g, rate, &DVector::zeros(f.nrows()))?;
    for enlargement in ENLARGEMENTS {
        let surplus = smallest.diagonal() * (rate * enlargement);
        let shape = smallest_shape(f, g, rate, &surplus)?;
        let constant = g * g.transpose() / rate + &shape * rate;
        let left = AccurateProduct::new(f, &shape).plus_transpose(&constant);
        let margin = margin(&shape)?.min(margin(&-left)?);
        if margin > 0.0 {
            let radius = bound * norm_2(&shape)?.sqrt();
            let peaks = shape.diagonal().map(|entry| bound * entry.sqrt());
            return Ok(Outcome::Optimal(UltimateBound { radius, peaks, rate, shape, margin }));
        }
    }
    Ok(Outcome::Inconclusive("no invariant ellipsoid could be proven in double precision"))
}

/// Q with F Q + Q F' + lambda Q + G G' / lambda + diag(surplus) = 0, for lambda = `rate`.
fn smallest_shape(
    f: &DMatrix<f64>,
    g: &DMatrix<f64>,
    rate: f64,
    surplus: &DVector<f64>,
) -> Result<DMatrix<f64>, Error> {
    let n = f.nrows();
    let shifted = f + DMatrix::from_diagonal_element(n, n, 0.5 * rate);
    let right = g * g.transpose() / rate + DMatrix::from_diagonal(surplus);
    Ok(lyapunov(&shifted.transpose(), &symmetric_part(&right))?.p)
}

/// The lambda below `limit` for which the largest eigenvalue of Q is smallest, by golden section.
fn best_rate(f: &DMatrix<f64>, g: &DMatrix<f64>, limit: f64) -> Result<f64, Error> {
    let no_surplus = DVector::zeros(f.nrows());
    let largest_eigenvalue =
        |logarithm: f64| norm_2(&smallest_shape(f, g, logarithm.exp(), &no_surplus)?);
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = ((limit * 1e-4).ln(), (limit * 0.9999).ln());
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (largest_eigenvalue(left)?, largest_eigenvalue(right)?);
    for _ in 0..GOLDEN_SECTION_STEPS {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = largest_eigenvalue(left)?;
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = largest_eigenvalue(right)?;
        }
    }
    Ok((0.5 * (low + high)).exp())
}
