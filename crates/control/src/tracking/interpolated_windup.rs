//! The back-calculation between two points of a schedule.

use crate::lyapunov::{definite_range, discrete_lyapunov, lyapunov};
use crate::stability::instability;
use crate::svd::{Svd, norm_2};
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// The largest number of commands with limits, because every set of these commands is examined.
const COMMANDS: usize = 10;
/// Largest number of successive bisections of an interval.
const BISECTIONS: usize = 12;
/// Singular values of the gains below this, relative to the largest, count as zero.
const TOLERANCE: f64 = 1e-9;
/// An eigenvalue up to this distance from the stability limit, in continuous time relative to the largest entry of the
/// coefficients, may be on the limit within rounding errors.
const NEUTRAL: f64 = 1e-9;
/// Distance of a norm from 1, or of a decay from 0, that exceeds its rounding errors.
const MARGIN: f64 = 1e-10;

/// The result of [`interpolated_windup`]: whether an interpolated back-calculation is stable.
#[derive(Debug, Clone, PartialEq)]
pub enum InterpolatedWindup {
    /// Stable for every constant value between the points and every set of commands at their limits.
    Stable,
    /// Unstable at one value for one set of commands at their limits.
    Unstable {
        /// The value s: 0 at the first point, 1 at the second.
        part: f64,
        /// The indices, from 0, of the commands at their limits.
        limited: Vec<usize>,
        /// The instability at `part`: the largest modulus of the eigenvalues less 1; in continuous time the largest
        /// real part.
        instability: f64,
    },
    /// Neither stability nor instability was shown for one set of commands at their limits.
    Undecided {
        /// The indices, from 0, of the commands at their limits.
        limited: Vec<usize>,
    },
}

/// Examines whether a back-calculation is stable when it is interpolated between two points.
///
/// ```text
/// x_i[k+1] = (I - L_w(s) S K_i(s)) x_i[k] + ...,   K_i(s) = (1 - s) K_i0 + s K_i1,   L_w(s) the same
/// x_i' = -L_w(s) S K_i(s) x_i + ...                in continuous time
/// ```
///
/// S selects commands at their limits. At the points `L_w` = (1 - e^(-rate T)) `K_i`^+, or rate `K_i`^+, by
/// [`super::windup_gain`], so that the eigenvalues are between 0 and 1, or -rate and 0, for every S; between the
/// points the product has a term `L_w0` S `K_i1` + `L_w1` S `K_i0`. [`InterpolatedWindup::Stable`] is a
/// proof up to rounding, for each constant s from 0 to 1 and each constant S: all eigenvalues are within the stability
/// limit, except those at 1, or 0, of integrals on which the commands of S do not act. It is no proof for a moving s
/// while commands are at their limits.
///
/// `k_i`: `K_i`, m x t, at the two points; `l_w`: `L_w`, t x m; `ranges`: as in [`super::windup_gain`].
///
/// Method: for each set S the matrix M(s) = I - N(s), or -N(s) in continuous time, with N = Q' `K_i` `L_w` Q, Q an
/// orthonormal basis of the columns of S `K_i0` and S `K_i1` in units of the ranges, or N = `L_w` S `K_i` if that is
/// smaller; both have the eigenvalues of `L_w` S `K_i` other than 0. M(s) is a polynomial of degree 2, a convex
/// combination of its three Bernstein coefficients. The interval is proven if, with a Lyapunov matrix P of M in its
/// middle, all three coefficients have a P norm below 1, or decrease x' P x. Otherwise it is bisected, up to 12 times.
/// With more than 10 commands with limits the result is [`InterpolatedWindup::Undecided`].
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for a bad matrix; [`Error::OutOfRange`] for a bad
/// range or period; [`Error::NotConverged`]; the errors of [`discrete_lyapunov`] and [`lyapunov`].
pub fn interpolated_windup(
    k_i: [&DMatrix<f64>; 2],
    l_w: [&DMatrix<f64>; 2],
    ranges: &[Option<f64>],
    domain: Domain,
) -> Result<InterpolatedWindup, Error> {
    domain.check()?;
    let t = k_i[0].ncols();
    for (k, l) in k_i.into_iter().zip(l_w) {
        check::shape("K_i", k, (ranges.len(), t))?;
        check::shape("L_w", l, (t, ranges.len()))?;
    }
    for range in ranges.iter().flatten() {
        check::positive("the range of a command", *range)?;
    }
    let limited: Vec<_> = (0..ranges.len()).filter(|&j| ranges[j].is_some()).collect();
    if limited.len() > COMMANDS {
        return Ok(InterpolatedWindup::Undecided { limited });
    }
    let mut undecided = None;
    for set in 1_usize..1 << limited.len() {
        let bits = (0..limited.len()).filter(|bit| set >> bit & 1 == 1);
        let at_limit: Vec<_> = bits.map(|bit| limited[bit]).collect();
        let units: Vec<_> = at_limit.iter().filter_map(|&j| ranges[j]).collect();
        let k =
            k_i.map(|k| DMatrix::from_fn(at_limit.len(), t, |i, j| k[(at_limit[i], j)] / units[i]));
        let l =
            l_w.map(|l| DMatrix::from_fn(t, at_limit.len(), |i, j| l[(i, at_limit[j])] * units[j]));
        match examine(&bernstein(&k, &l, domain)?, [0.0, 1.0], BISECTIONS, domain, &at_limit)? {
            InterpolatedWindup::Stable => {}
            unstable @ InterpolatedWindup::Unstable { .. } => return Ok(unstable),
            other @ InterpolatedWindup::Undecided { .. } => undecided = undecided.or(Some(other)),
        }
    }
    Ok(undecided.unwrap_or(InterpolatedWindup::Stable))
}

/// The Bernstein coefficients of M(s).
fn bernstein(
    k: &[DMatrix<f64>; 2],
    l: &[DMatrix<f64>; 2],
    domain: Domain,
) -> Result<[DMatrix<f64>; 3], Error> {
    let t = k[0].ncols();
    let both = DMatrix::from_fn(k[0].nrows(), 2 * t, |i, j| k[j / t][(i, j % t)]);
    let svd = Svd::new(&both)?;
    let rank = svd.rank(TOLERANCE);
    let q = svd.left.columns(0, rank);
    let product = |i: usize, j: usize| {
        if rank <= t { q.transpose() * &k[i] * &l[j] * q } else { &l[j] * &k[i] }
    };
    let order = rank.min(t);
    let last = match domain {
        Domain::Continuous => DMatrix::zeros(order, order),
        Domain::Sampled { .. } => DMatrix::identity(order, order),
    };
    Ok([
        &last - product(0, 0),
        &last - (product(0, 1) + product(1, 0)) * 0.5,
        &last - product(1, 1),
    ])
}

/// Examines M(s) for s between `ends`, from its Bernstein coefficients there; `limited`: the commands at their limits.
fn examine(
    coefficients: &[DMatrix<f64>; 3],
    ends: [f64; 2],
    bisections: usize,
    domain: Domain,
    limited: &[usize],
) -> Result<InterpolatedWindup, Error> {
    let [first, inner, last] = coefficients;
    if first.is_empty() {
        return Ok(InterpolatedWindup::Stable);
    }
    let undecided = || InterpolatedWindup::Undecided { limited: limited.to_vec() };
    let halves = [(first + inner) * 0.5, (inner + last) * 0.5];
    let middle = (&halves[0] + &halves[1]) * 0.5;
    let centre = (ends[0] + ends[1]) * 0.5;
    let neutral = match domain {
        Domain::Continuous => NEUTRAL * coefficients.iter().map(DMatrix::amax).fold(0.0, f64::max),
        Domain::Sampled { .. } => NEUTRAL,
    };
    for (part, value) in [(ends[0], first), (centre, &middle), (ends[1], last)] {
        let instability = instability(value, domain)?;
        if instability > neutral {
            return Ok(InterpolatedWindup::Unstable {
                part,
                limited: limited.to_vec(),
                instability,
            });
        }
        if instability > -neutral {
            return Ok(undecided());
        }
    }
    let proves = if domain == Domain::Continuous { decreases } else { contracts };
    if proves(&middle, coefficients)? {
        return Ok(InterpolatedWindup::Stable);
    }
    if bisections == 0 {
        return Ok(undecided());
    }
    let [left, right] = halves;
    let parts = [
        ([first.clone(), left, middle.clone()], [ends[0], centre]),
        ([middle, right, last.clone()], [centre, ends[1]]),
    ];
    let mut outcome = InterpolatedWindup::Stable;
    for (coefficients, ends) in parts {
        match examine(&coefficients, ends, bisections - 1, domain, limited)? {
            InterpolatedWindup::Stable => {}
            unstable @ InterpolatedWindup::Unstable { .. } => return Ok(unstable),
            undecided @ InterpolatedWindup::Undecided { .. } => outcome = undecided,
        }
    }
    Ok(outcome)
}

/// Whether all of `matrices` have a P norm below 1 for P with M' P M - P = -I, M = `middle`, by more than rounding
/// errors.
fn contracts(middle: &DMatrix<f64>, matrices: &[DMatrix<f64>]) -> Result<bool, Error> {
    let identity = DMatrix::identity(middle.nrows(), middle.nrows());
    let p = discrete_lyapunov(middle, &identity)?.p;
    let Some(factor) = p.cholesky().map(|factor| factor.l().transpose()) else {
        return Ok(false);
    };
    let Some(inverse) = factor.clone().try_inverse() else { return Ok(false) };
    for value in matrices {
        if norm_2(&(&factor * value * &inverse))? >= 1.0 - MARGIN {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether x' P x decreases along all of `matrices` for P with M' P + P M = -I, M = `middle`, by more than the
/// rounding errors of the products.
fn decreases(middle: &DMatrix<f64>, matrices: &[DMatrix<f64>]) -> Result<bool, Error> {
    let identity = DMatrix::identity(middle.nrows(), middle.nrows());
    let p = lyapunov(middle, &identity)?.p;
    for value in matrices {
        let product = &p * value;
        let decay = -(&product + product.transpose());
        let rounding = MARGIN * norm_2(&p)? * norm_2(value)?;
        match definite_range(&(decay - &identity * rounding)) {
            Ok(_) => {}
            Err(Error::NotPositiveDefinite { .. }) => return Ok(false),
            Err(error) => return Err(error),
        }
    }
    Ok(true)
}
