//! Norms computed from the covariance of the state: H2 and energy to peak.

use crate::blocks::symmetric_part;
use crate::lyapunov::{discrete_lyapunov, lyapunov};
use crate::rank::Staircase;
use crate::svd::norm_2;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// The H2 norm and the generalised H2 norms of a system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Energy {
    /// The H2 norm: the root of the trace of the covariance, see [`energy`]. The root-mean-square value of z under
    /// white noise of unit intensity; also the root of the energy of z summed over an impulse at each input.
    pub h2: f64,
    /// The generalised H2 norm: the largest Euclidean length of z that an input of unit energy can cause. It is the
    /// root of the largest eigenvalue of the covariance.
    pub peak: f64,
    /// The roots of the diagonal of the covariance: the largest |`z_i`| that an input of unit energy can cause, p.
    pub peaks: Vec<f64>,
}

/// The H2 and the generalised H2 norms.
///
/// ```text
/// A W + W A' + B B' = 0,  covariance C W C'              continuous, D = 0
/// A W A' - W + B B' = 0,  covariance C W C' + D D'       sampled
/// ```
///
/// The energy of w is the integral of w'w, in sampled time the sum over the samples without the
/// period. The norms are finite for a stable A, in continuous time with D = 0. Method, cost, tolerance: [`lyapunov`].
///
/// Source: D. A. Wilson, Convolution and Hankel operator norms for linear systems, IEEE Trans.
/// Autom. Control 34 (1989).
///
/// # Example
///
/// ```
/// use control::response::energy;
/// use control::{Domain, StateSpace};
/// use nalgebra::DMatrix;
/// let one = DMatrix::identity(1, 1);
/// let (a, d) = (-&one, DMatrix::zeros(1, 1));
/// let lag = StateSpace { a, b: one.clone(), c: one, d, domain: Domain::Continuous };
/// assert!((energy(&lag)?.h2 - 0.5_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), control::Error>(())
/// ```
///
/// # Errors
///
/// Same as [`StateSpace::check`]; [`Error::OutOfRange`] when D is not zero in continuous time; same
/// as [`lyapunov`] and [`discrete_lyapunov`].
pub fn energy(system: &StateSpace) -> Result<Energy, Error> {
    system.check()?;
    let covariance = match covariance(system) {
        // The covariance of states that w does not reach is zero; rounding alone gives it a large relative residual.
        Err(error @ Error::ResidualTooLarge { .. }) => match reachable_part(system)? {
            Some(part) => covariance(&part)?,
            None => return Err(error),
        },
        covariance => covariance?,
    };
    Ok(Energy {
        h2: covariance.trace().max(0.0).sqrt(),
        peak: norm_2(&covariance)?.sqrt(),
        peaks: covariance.diagonal().iter().map(|entry| entry.max(0.0).sqrt()).collect(),
    })
}

/// The covariance of z, C W C', in sampled time C W C' + D D', with W the covariance of the state.
fn covariance(system: &StateSpace) -> Result<DMatrix<f64>, Error> {
    let StateSpace { a, b, c, d, domain } = system;
    let noise = symmetric_part(&(b * b.transpose()));
    let covariance = match domain {
        Domain::Continuous => {
            let value = d.amax();
            check::that(value <= 0.0, "D", value, "zero: the norm is infinite otherwise")?;
            c * lyapunov(&a.transpose(), &noise)?.p * c.transpose()
        }
        Domain::Sampled { .. } => {
            let state = discrete_lyapunov(&a.transpose(), &noise)?.p;
            c * state * c.transpose() + d * d.transpose()
        }
    };
    check::in_range("the covariance of the output", symmetric_part(&covariance))
}

/// The system without the states that w does not reach; None if w reaches all states, or none.
fn reachable_part(system: &StateSpace) -> Result<Option<StateSpace>, Error> {
    let staircase = Staircase::new(&system.a, &system.b)?;
    if staircase.decision.is_full() || staircase.decision.rank == 0 {
        return Ok(None);
    }
    let (c, _) = staircase.reached_output(&system.c.transpose());
    Ok(Some(StateSpace {
        a: staircase.reached_dynamics(),
        b: staircase.reached_input(&system.b),
        c: c.transpose(),
        ..system.clone()
    }))
}
