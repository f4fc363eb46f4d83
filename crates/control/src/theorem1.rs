//! The bound on the estimation error, theorem 1 of the paper named in [`crate::aso`].

#[cfg(feature = "lmi")]
mod decay;
#[cfg(feature = "lmi")]
mod radius;
#[cfg(feature = "lmi")]
mod ultimate_bound;

#[cfg(feature = "lmi")]
pub use decay::{DecayCertificate, largest_decay};
#[cfg(feature = "lmi")]
pub use radius::{RadiusCertificate, smallest_radius};
#[cfg(feature = "lmi")]
pub use ultimate_bound::{UltimateBound, ultimate_bound};

use crate::faulty_plant::FaultyPlant;
use crate::gains::Gains;
use crate::lyapunov::{definite_range, lyapunov};
use crate::rank::{Rank, observability, require_controllable};
use crate::stability::instability;
use crate::svd::norm_2;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// The quantities of theorem 1 for a controller.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Certificate {
    /// The design parameter alpha. The bound `delta` does not depend on alpha.
    pub alpha: f64,
    /// Bound of the fault, in its unit.
    pub beta: f64,
    /// P of (12), (n + q) x (n + q), symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest and largest eigenvalue of P.
    pub p_range: (f64, f64),
    /// Residual of (12), the largest entry relative to the sum of its absolute terms.
    pub residual: f64,
    /// Norm of the residual of (12) relative to the norm of alpha beta I. Below 1 / sqrt(n + q) the
    /// computed P, rounding included, proves that the error dynamics are stable.
    pub defect: f64,
    /// Radius (16): V = z' P z decreases wherever the norm of z = [e; `f_hat`] is larger than delta. The paper
    /// concludes that the error ends in that ball; the proof shows that it ends in the smallest ellipsoid z' P z =
    /// constant around the ball, whose longest axis is sqrt(cond P) times as long.
    pub delta: f64,
    /// Rank of (A, B), which is full.
    pub controllability: Rank,
    /// Rank of (`A_0`, `C_0`).
    pub observability: Rank,
    /// Largest real part of the eigenvalues of A + B `K_x`; if it is below zero, `x_hat` stays bounded, too.
    pub controller_abscissa: f64,
    /// Largest real part of the eigenvalues of `A_0` - L `C_0`; below zero.
    pub observer_abscissa: f64,
}

/// Computes P of (12) and the radius delta of (16) for a plant and a controller.
///
/// ```text
/// P (A_0 - L C_0) + (A_0 - L C_0)' P = -alpha beta I                 (12)
/// delta = (2 / alpha) sqrt(lambda_max(P F_0 F_0' P))                 (16)
/// ```
///
/// `alpha`: above zero; `beta`: above zero, the largest norm of the fault in its unit. P exists
/// when `A_0` - L `C_0` is Hurwitz. P is proportional to alpha: with `P_1` the solution for alpha beta = 1, delta = 2
/// beta norm(`P_1` `F_0`) for every alpha. Contrary to the paper, a larger alpha does not give a smaller region.
/// Method, cost and tolerance: see [`lyapunov`].
///
/// # Example
///
/// ```
/// use control::placement::real_poles;
/// use control::{aso, theorem1};
/// use nalgebra::DMatrix;
/// let one = |value| DMatrix::from_element(1, 1, value);
/// let plant =
///     aso::FaultyPlant::with_constant_faults(one(0.5), one(1.0), one(1.0), one(-1.0));
/// let gains = aso::design(&plant, &real_poles(&[-1.0]), &real_poles(&[-2.0, -3.0]), None)?.gains;
/// let small = theorem1::certify(&plant, &gains, 1.0, 30.0)?;
/// let large = theorem1::certify(&plant, &gains, 1000.0, 30.0)?;
/// assert!((small.delta / large.delta - 1.0).abs() < 1e-12);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`Gains::check`]; [`Error::OutOfRange`] for `alpha`, `beta` or their product;
/// [`Error::NotControllable`]; [`Error::NotHurwitz`] when the observer is unstable;
/// [`Error::NotPositiveDefinite`] when rounding errors hide that P > 0; [`Error::NotConverged`],
/// [`Error::Overflow`], [`Error::ResidualTooLarge`] as for [`lyapunov`].
pub fn certify(
    plant: &FaultyPlant,
    gains: &Gains,
    alpha: f64,
    beta: f64,
) -> Result<Certificate, Error> {
    gains.check(plant)?;
    check::positive("alpha", alpha)?;
    check::positive("beta", beta)?;
    check::positive("alpha beta", alpha * beta)?;
    let controllability = require_controllable(&plant.a, &plant.b)?;
    let error_dynamics = gains.error_dynamics(plant);
    let order = error_dynamics.nrows();
    let observer_abscissa = instability(&error_dynamics, Domain::Continuous)?;
    if observer_abscissa >= 0.0 {
        return Err(Error::NotHurwitz { matrix: "A_0 - L C_0", abscissa: observer_abscissa });
    }
    let right = DMatrix::from_diagonal_element(order, order, alpha * beta);
    let solution = lyapunov(&error_dynamics, &right)?;
    let effect = norm_2(&(&solution.p * plant.augmented_fault()))?;
    Ok(Certificate {
        alpha,
        beta,
        p_range: definite_range(&solution.p)?,
        p: solution.p,
        residual: solution.residual,
        defect: solution.defect,
        delta: 2.0 / alpha * effect,
        controllability,
        observability: observability(&plant.augmented_dynamics(), &plant.augmented_output())?,
        controller_abscissa: instability(&gains.controlled_dynamics(plant), Domain::Continuous)?,
        observer_abscissa,
    })
}

/// Fractions by which right-hand sides are enlarged, one after the other, until the inequality is proven despite
/// rounding.
#[cfg(feature = "lmi")]
const ENLARGEMENTS: [f64; 5] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

/// Checks the matrices of z' = F z + G w and the bound of |w|, which must be above zero.
#[cfg(feature = "lmi")]
fn check_system(f: &DMatrix<f64>, g: &DMatrix<f64>, bound: f64) -> Result<(), Error> {
    let n = check::square("error dynamics", f)?;
    check::shape("disturbance", g, (n, g.ncols()))?;
    check::positive("bound", bound)
}
