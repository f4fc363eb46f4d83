//! The back-calculation that keeps integrals from winding up.

use super::TOLERANCE;
use crate::svd::Svd;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// The gain `L_w`, t x m, of the back-calculation that keeps integrals from winding up.
///
/// ```text
/// x_i' = r - H y + L_w (u - v),   L_w = rate K_i^+
/// x_i[k+1] = x_i[k] + T (r - H y) + L_w (u - v),   L_w = (1 - e^(-rate T)) K_i^+
/// ```
///
/// v is the command before the limits, u the limited command. `k_i`: `K_i`, m x t; `ranges`: for each command the width
/// of its limits, None without limits; `rate`: above zero, in 1/s. While commands are at their limits, the part of
/// `x_i` that acts on them approaches the value of the best fit of v to u with the rate: -`L_w` S `K_i`, S with ones
/// for the commands at a limit, has eigenvalues between -rate and 0. `K_i`^+ is the pseudoinverse of the rows of
/// commands with limits, in units of their ranges; other commands have zero columns in `L_w`. Without a command at a
/// limit u = v, and the term is zero.
///
/// Source: K. J. Åström and L. Rundqwist, Integrator windup and how to avoid it, American Control Conference
/// (1989); it is one of the schemes of M. V. Kothare, P. J. Campo, M. Morari and C. N. Nett, A unified
/// framework for the study of anti-windup designs, Automatica 30 (1994). The observer receives u and needs no
/// back-calculation.
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad `K_i`; [`Error::OutOfRange`] for a bad
/// range or rate; [`Error::NotConverged`].
pub fn windup_gain(
    k_i: &DMatrix<f64>,
    ranges: &[Option<f64>],
    rate: f64,
    domain: Domain,
) -> Result<DMatrix<f64>, Error> {
    check::shape("K_i", k_i, (ranges.len(), k_i.ncols()))?;
    check::positive("the rate of the back-calculation", rate)?;
    for range in ranges.iter().flatten() {
        check::positive("the range of a command", *range)?;
    }
    let weights = DMatrix::from_fn(ranges.len(), 1, |j, _| ranges[j].map_or(0.0, f64::recip));
    let scaled = DMatrix::from_fn(k_i.nrows(), k_i.ncols(), |i, j| weights[i] * k_i[(i, j)]);
    if scaled.amax() <= 0.0 {
        return Ok(DMatrix::zeros(k_i.ncols(), k_i.nrows()));
    }
    let factor = match domain {
        Domain::Continuous => rate,
        Domain::Sampled { period } => -(-rate * period).exp_m1(),
    };
    let svd = Svd::new(&scaled)?;
    let inverse =
        svd.least_squares(&DMatrix::identity(ranges.len(), ranges.len()), svd.rank(TOLERANCE));
    Ok(DMatrix::from_fn(k_i.ncols(), k_i.nrows(), |i, j| factor * inverse[(i, j)] * weights[j]))
}
