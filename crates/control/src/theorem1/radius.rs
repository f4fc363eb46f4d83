//! Theorem 1 with a free matrix P in place of the solution of (12).

use super::{ENLARGEMENTS, check_system};
use crate::lmi::definite::margin;
use crate::lmi::{Affine, Outcome, Problem, norm_below};
use crate::lyapunov::{CONTINUOUS, lyapunov};
use crate::product::AccurateProduct;
use crate::stability::instability;
use crate::svd::norm_2;
use crate::{Domain, Error};
use nalgebra::{DMatrix, DVector};

/// Error of the solver in the eigenvalues of a matrix with a norm of about one.
const SOLVER_ERROR: f64 = 1e-7;

/// The radius of theorem 1 and its proof.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RadiusCertificate {
    /// Radius: V = z' P z decreases wherever the norm of z is larger than delta.
    pub delta: f64,
    /// P, n x n, symmetric positive definite.
    pub p: DMatrix<f64>,
    /// Smallest eigenvalue of P and of -(F' P + P F + I), each scaled to a diagonal of about one;
    /// larger than the rounding errors.
    pub margin: f64,
}

/// The smallest radius outside of which a quadratic Lyapunov function of the error decreases.
///
/// ```text
/// z' = F z + G w, |w| <= bound
/// P > 0,  F' P + P F <= -I                                 in place of (12)
/// V = z' P z:  V' <= -|z|^2 + 2 |z| norm(P G) |w|
/// V' < 0 for |z| > delta,  delta = 2 bound norm(P G)       as (16)
/// ```
///
/// With G = `F_0` and the bound of the fault this is theorem 1 for z = [e; `f_hat`]; the P of (12) satisfies the
/// inequalities. With G = [0; I] and the bound of f' - `A_f` f it holds for z = [e; eps]. As in the paper, z ends in
/// the smallest ellipsoid z' P z = constant around the ball of that radius, not in the ball.
///
/// `error_dynamics`: F, n x n, Hurwitz; `disturbance`: G, n x k; `bound`: above zero, in the unit of
/// w. The norm depends on the units of the states, as the theorem does. Method: let
/// F' P + P F = -I - Y with Y >= 0. P is linear in Y, so that the Y of the smallest norm(P G) is a
/// semidefinite program, solved by an interior point method; each of its n (n + 1) / 2 coefficients
/// is a Lyapunov equation. F' P + P F < -I is then verified for the P that is returned, with
/// products in twice the precision. Cost: about 100 `n^5` multiplications.
///
/// A system that is not stable is [`Outcome::Infeasible`] with the conflict "stability".
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`]
/// for a bad bound; [`Error::NotConverged`], [`Error::Overflow`], [`Error::ResidualTooLarge`] when
/// rounding prevents a solution of a Lyapunov equation.
pub fn smallest_radius(
    error_dynamics: &DMatrix<f64>,
    disturbance: &DMatrix<f64>,
    bound: f64,
) -> Result<Outcome<RadiusCertificate>, Error> {
    let (f, g) = (error_dynamics, disturbance);
    check_system(f, g, bound)?;
    if instability(f, Domain::Continuous)? >= 0.0 {
        return Ok(Outcome::Infeasible { conflict: vec!["stability"] });
    }
    let identity = DMatrix::identity(f.nrows(), f.nrows());
    let Some(y) = best_surplus(f, g)? else {
        return Ok(Outcome::Inconclusive("the interior point method did not converge"));
    };
    for enlargement in ENLARGEMENTS {
        let p = lyapunov(f, &(&identity * (1.0 + enlargement) + &y))?.p;
        let left = AccurateProduct::new(&p, f).plus_transpose(&identity);
        let margin = margin(&p)?.min(margin(&-left)?);
        if margin > 0.0 {
            let delta = 2.0 * bound * norm_2(&(&p * g))?;
            return Ok(Outcome::Optimal(RadiusCertificate { delta, p, margin }));
        }
    }
    Ok(Outcome::Inconclusive("F' P + P F < -I could not be proven in double precision"))
}

/// The Y >= 0 for which norm(P G) is smallest, where F' P + P F = -I - Y; None if the solver fails.
///
/// With `P(Q)` the solution of F' P + P F = -Q and `E_ij` the symmetric unit matrices,
///
/// ```text
/// P G = P(I) G + sum over i <= j of y_ij P(E_ij) G
/// minimise t subject to [t I, P G; (P G)', t I] >= 0,  Y >= 0
/// ```
///
/// For the solver P G is divided by norm(P(I) G) = s, and Y = D Y~ D with D diagonal such that
/// norm(P(D `E_ii` D) G) = s for every i that w moves, otherwise `d_i` = 1.
fn best_surplus(f: &DMatrix<f64>, g: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, Error> {
    let n = f.nrows();
    // Not refused for its residual: entries of P(E_ij) may be zero but for rounding. The caller verifies the result.
    let p_times_g = |q: &DMatrix<f64>| Ok::<_, Error>(CONTINUOUS.solve(f, q)? * g);
    let unit = |row: usize, col: usize| {
        let mut unit = DMatrix::zeros(n, n);
        (unit[(row, col)], unit[(col, row)]) = (1.0, 1.0);
        unit
    };
    let of_identity = p_times_g(&DMatrix::identity(n, n))?;
    let size = of_identity.norm().max(f64::MIN_POSITIVE);
    let mut d = DVector::from_element(n, 1.0);
    for state in 0..n {
        let ratio = size / p_times_g(&unit(state, state))?.norm();
        d[state] = if ratio.is_finite() { ratio.sqrt() } else { 1.0 };
    }
    let mut problem = Problem::new();
    let mut scaled_p_g = Affine::constant(&(&of_identity / size));
    let mut scaled_y = Affine::zeros(n, n);
    for col in 0..n {
        for row in 0..=col {
            let y = problem.scalar();
            let direction = p_times_g(&(unit(row, col) * (d[row] * d[col])))?;
            scaled_p_g = &scaled_p_g + &y.times(&(direction / size));
            scaled_y = &scaled_y + &y.times(&unit(row, col));
        }
    }
    problem.constrain(&scaled_y, 0.0);
    let t = problem.level(None);
    problem.constrain(&norm_below(&scaled_p_g, &t), 0.0);
    let Some((_, unknowns)) = problem.minimum() else { return Ok(None) };
    let scaled_y = scaled_y.evaluate(&unknowns);
    Ok(Some(DMatrix::from_fn(n, n, |i, j| {
        let reserve = if i == j { SOLVER_ERROR } else { 0.0 };
        // The factors are multiplied first, so that the result is exactly symmetric.
        (scaled_y[(i, j)] + reserve) * (d[i] * d[j])
    })))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [`lyapunov`] refuses a right-hand side that is not symmetric.
    #[test]
    fn the_surplus_is_symmetric_to_the_last_digit() {
        let f = DMatrix::from_row_slice(3, 3, &[-1., 3., 0.2, -0.7, -2., 11., 0.3, -5., -0.9]);
        let g = DMatrix::from_row_slice(3, 1, &[0.3, 1.7, 0.9]);
        let surplus = best_surplus(&f, &g).unwrap().unwrap();
        assert_eq!(surplus, surplus.transpose());
    }
}
