//! The certificate of a loop that depends on a scheduling variable.

use super::coordinates::{Coordinates, time_unit};
use super::definite::margin;
use super::region::MARGIN;
use super::vertices::order;
use super::{Affine, Problem};
use crate::check::as_number;
use crate::eigen::eigenvalues;
use crate::product::AccurateProduct;
use crate::{Domain, Error, check};
use nalgebra::DMatrix;

/// Factor between successive rates that [`largest_change`] tries: [`RATES`] rates, then [`BISECTIONS`] bisections.
const FACTOR: f64 = 0.25;
const RATES: i32 = 7;
const BISECTIONS: usize = 3;

/// A loop on an interval of its scheduling variable theta.
///
/// The loop is a polynomial of degree d in t = (theta - start) / length, which goes from 0 to 1:
///
/// ```text
/// A(t) = sum over j of C(d, j) t^j (1 - t)^(d - j) A_j
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// Length of the interval, above 0, in the unit of theta.
    pub length: f64,
    /// The Bernstein coefficients `A_0` to `A_d`, n x n; see [`bernstein`]. A(t) is in the convex hull of the
    /// coefficients.
    pub coefficients: Vec<DMatrix<f64>>,
}

/// A Lyapunov function x' P(theta) x, P piecewise linear over the grid.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScheduleCertificate {
    /// The largest change of theta in a sample, in the unit of theta; in continuous time the largest rate of change of
    /// theta, in the unit of theta per s.
    pub change: f64,
    /// P at each grid point, n x n: one more than intervals.
    pub p: Vec<DMatrix<f64>>,
    /// Smallest eigenvalue of all inequalities, each scaled to a diagonal of about one; larger than
    /// the rounding errors.
    pub margin: f64,
}

/// The Bernstein coefficients of a polynomial of degree d from its values at t = 0, 1/d, ..., 1.
///
/// `values`: d + 1 matrices of one shape. The values of the polynomial between 0 and 1 are in the convex hull of the
/// coefficients; the first and the last coefficient are the values at the ends. Method: the linear equations with the
/// values of the Bernstein polynomials; for d up to 6 the error is below 1e3 units of rounding of the largest value.
///
/// # Errors
///
/// [`Error::Empty`] without values or entries; [`Error::Shape`] for values of different shapes;
/// [`Error::NotFinite`]; [`Error::Overflow`] for a degree that double precision cannot handle.
pub fn bernstein(values: &[DMatrix<f64>]) -> Result<Vec<DMatrix<f64>>, Error> {
    let Some(first) = values.first() else {
        return Err(Error::Empty { matrix: "values", actual: (0, 0) });
    };
    for value in values {
        check::shape("value", value, first.shape())?;
    }
    let degree = values.len() - 1;
    if degree == 0 {
        return Ok(values.to_vec());
    }
    let basis = DMatrix::from_fn(degree + 1, degree + 1, |at, j| {
        let t = as_number(at) / as_number(degree);
        let choose = (0..j).fold(1.0, |all, k| all * as_number(degree - k) / as_number(k + 1));
        let power = |base: f64, exponent: usize| (0..exponent).fold(1.0, |all, _| all * base);
        choose * power(t, j) * power(1.0 - t, degree - j)
    });
    let singular = Error::Overflow { what: "the basis of Bernstein polynomials" };
    let inverse = basis.try_inverse().ok_or(singular)?;
    let coefficient = |j: usize| {
        if j == 0 || j == degree {
            return values[j].clone();
        }
        (0..=degree).fold(first * 0.0, |sum, at| sum + &values[at] * inverse[(j, at)])
    };
    Ok((0..=degree).map(coefficient).collect())
}

/// Proves that a loop is stable while its scheduling variable changes by at most `change` from one
/// sample to the next, or in continuous time by at most `change` per s.
///
/// Sampled, with V = x' P(theta) x:
///
/// ```text
/// x[k+1] = A(theta[k]) x[k],  |theta[k+1] - theta[k]| <= change
/// [P(theta), A(theta)' P+; P+ A(theta), P+] > 0,  P+ = P(theta) + D
/// for D = change P_i', change P_{i+1}', -change P_i', -change P_{i-1}'
/// ```
///
/// `P_i`' is the slope of P in interval i. `P(theta[k+1]) - P(theta[k])` is in the convex hull of the
/// four D, as `change` is at most the length of the shortest interval.
///
/// Continuous:
///
/// ```text
/// x' = A(theta) x,  |theta'| <= change
/// A(theta)' P(theta) + P(theta) A(theta) + D < 0  for D = change P_i', -change P_i'
/// ```
///
/// V is continuous at the grid points. Along every theta(t) its one-sided derivatives there are those of the
/// neighbouring intervals, so V decreases there, too.
///
/// The matrices are polynomials of t in each interval; all their Bernstein coefficients are definite, so the proof
/// holds between the grid points, too. The condition is sufficient, not necessary.
///
/// Returns None if no P could be proven. The P of the solver is verified by the eigenvalues of all
/// inequalities in the units of the data, with products that are computed in twice the precision and in
/// sampled time then rounded. Cost: that of a program with n (n + 1) / 2 unknowns for each grid point and,
/// for each interval, 4 (d + 2) inequalities of order 2 n, in continuous time 2 (d + 2) of order n.
///
/// Source: P. Apkarian, P. Gahinet, G. Becker, Self-scheduled H-infinity control of linear parameter-varying systems,
/// Automatica 31 (1995); F. Wu, X. H. Yang, A. Packard, G. Becker, Induced L2-norm control for LPV systems with bounded
/// parameter variation rates, Int. J. Robust Nonlinear Control 6 (1996); in sampled time the inequality of J. Daafouz
/// and J. Bernussou, Parameter dependent Lyapunov functions for discrete time systems, Systems & Control Letters 43
/// (2001).
///
/// # Errors
///
/// [`Error::Empty`], [`Error::Shape`], [`Error::NotFinite`] for bad or missing intervals;
/// [`Error::OutOfRange`] for a length or a change that is not above 0, a bad period, or in sampled time
/// a change beyond the shortest interval; [`Error::NotConverged`].
pub fn certify_schedule(
    intervals: &[Interval],
    change: f64,
    domain: Domain,
) -> Result<Option<ScheduleCertificate>, Error> {
    let shortest = check_intervals(intervals)?;
    domain.check()?;
    check::positive("change", change)?;
    let is_in_range = domain == Domain::Continuous || change <= shortest;
    check::that(is_in_range, "change", change, "at most the length of the shortest interval")?;
    let Some(mut coordinates) = Coordinates::of_dynamics(&intervals[0].coefficients[0])? else {
        return Ok(None);
    };
    coordinates.unit = time_unit(domain, coordinates.unit);
    let scaled = |interval: &Interval| {
        let coefficients = interval.coefficients.iter().map(|a| coordinates.dynamics(a)).collect();
        Interval { coefficients, ..*interval }
    };
    let scaled_intervals: Vec<_> = intervals.iter().map(scaled).collect();
    let n = intervals[0].coefficients[0].nrows();
    let mut problem = Problem::new();
    let p: Vec<_> = (0..=intervals.len()).map(|_| problem.symmetric(n)).collect();
    for p in &p {
        problem.constrain(p, MARGIN);
        problem.constrain(&(&Affine::identity(n, 1.0) - p), MARGIN);
    }
    // In continuous time the unit of A~ is also the unit of a rate per s.
    let scaled_change = change / coordinates.unit;
    let matrices = match domain {
        Domain::Continuous => decays(&scaled_intervals, &p, scaled_change),
        Domain::Sampled { .. } => inequalities(&scaled_intervals, &p, scaled_change, |p, a| p * a),
    };
    for matrix in matrices {
        problem.constrain(&matrix, MARGIN);
    }
    let Some(solution) = problem.solve()?.optimal() else { return Ok(None) };
    let p: Vec<_> = p.iter().map(|p| coordinates.certificate(&solution.value(p))).collect();
    verified(intervals, p, change, domain)
}

/// The largest change of the scheduling variable in a sample, or in continuous time its largest rate per s, that
/// [`certify_schedule`] proves, to 20 %; None if no change between an upper limit and 1/4096 of the limit is proven.
///
/// The limit is the length of the shortest interval; in continuous time this length times the largest
/// modulus of the eigenvalues of the coefficients: theta then passes the interval as fast as the
/// fastest mode of the loop decays. No change above the limit is tried.
///
/// # Errors
///
/// Same as [`certify_schedule`].
pub fn largest_change(
    intervals: &[Interval],
    domain: Domain,
) -> Result<Option<ScheduleCertificate>, Error> {
    let mut limit = check_intervals(intervals)?;
    if domain == Domain::Continuous {
        let mut fastest = f64::MIN_POSITIVE;
        for a in intervals.iter().flat_map(|interval| &interval.coefficients) {
            fastest = eigenvalues(a)?.iter().map(|value| value.norm()).fold(fastest, f64::max);
        }
        limit *= fastest;
    }
    let proof = |rate| certify_schedule(intervals, limit * FACTOR.powi(rate), domain).transpose();
    let Some(mut best) = (0..RATES).find_map(proof).transpose()? else { return Ok(None) };
    if best.change >= limit {
        return Ok(Some(best));
    }
    let mut bad = best.change / FACTOR;
    for _ in 0..BISECTIONS {
        let middle = (best.change * bad).sqrt();
        match certify_schedule(intervals, middle, domain)? {
            Some(better) => best = better,
            None => bad = middle,
        }
    }
    Ok(Some(best))
}

/// Checks the intervals; returns the length of the shortest one.
fn check_intervals(intervals: &[Interval]) -> Result<f64, Error> {
    let n = order(intervals.first().and_then(|interval| interval.coefficients.first()))?;
    let mut shortest = f64::INFINITY;
    for Interval { length, coefficients } in intervals {
        check::positive("length", *length)?;
        shortest = shortest.min(*length);
        order(coefficients.first())?;
        for a in coefficients {
            check::square("A", a)?;
            check::shape("A", a, (n, n))?;
        }
    }
    Ok(shortest)
}

/// The Bernstein coefficients of the inequalities in sampled time; `times` returns the product P A.
fn inequalities(
    intervals: &[Interval],
    p: &[Affine],
    change: f64,
    times: impl Fn(&Affine, &DMatrix<f64>) -> Affine,
) -> Vec<Affine> {
    let slope = |i: usize| &(&p[i + 1] - &p[i]) * (1.0 / intervals[i].length);
    let mut all = Vec::new();
    for (i, Interval { coefficients: a, .. }) in intervals.iter().enumerate() {
        let right = (i + 1 < intervals.len()).then_some((i + 1, change));
        let left = i.checked_sub(1).map(|left| (left, -change));
        let moves = [(i, change), (i, -change)].into_iter().chain(right).chain(left);
        // The degree of P A, one above the degree of A.
        let degree = a.len();
        for (interval, step) in moves {
            let difference = &slope(interval) * step;
            let ends = [&p[i] + &difference, &p[i + 1] + &difference];
            for j in 0..=degree {
                let t = as_number(j) / as_number(degree);
                let between = |[from, to]: [&Affine; 2]| &(from * (1.0 - t)) + &(to * t);
                let now = between([&p[i], &p[i + 1]]);
                let then = between([&ends[0], &ends[1]]);
                let product = product(&ends, a, j, &times);
                all.push(Affine::blocks(&[&[&now, &product.transpose()], &[&product, &then]]));
            }
        }
    }
    all
}

/// The Bernstein coefficient j of P A, whose degree is one above that of A, with P linear from `p[0]` to `p[1]`.
fn product(
    p: &[Affine],
    a: &[DMatrix<f64>],
    j: usize,
    times: &impl Fn(&Affine, &DMatrix<f64>) -> Affine,
) -> Affine {
    let (t, (rows, cols)) = (as_number(j) / as_number(a.len()), p[0].shape());
    let mut product = Affine::zeros(rows, cols);
    if j < a.len() {
        product = &product + &(&times(&p[0], &a[j]) * (1.0 - t));
    }
    if j > 0 {
        product = &product + &(&times(&p[1], &a[j - 1]) * t);
    }
    product
}

/// The Bernstein coefficients of -(A' P + P A + D) in continuous time on each interval, for
/// D = `rate` dP/dtheta and for D = -`rate` dP/dtheta.
fn decays(intervals: &[Interval], p: &[Affine], rate: f64) -> Vec<Affine> {
    let mut all = Vec::new();
    for (i, Interval { coefficients: a, length }) in intervals.iter().enumerate() {
        let slope = &(&p[i + 1] - &p[i]) * (rate / length);
        for j in 0..=a.len() {
            let sum = product(&p[i..], a, j, &|p, a| p * a).plus_transpose();
            all.extend([-&(&sum + &slope), -&(&sum - &slope)]);
        }
    }
    all
}

/// The matrices of [`decays`] for a known P, computed with products of twice the precision, which are rounded after the
/// large terms have cancelled. Each matrix is multiplied by d + 1, so that its weights are integers.
fn accurate_decays(intervals: &[Interval], p: &[DMatrix<f64>], rate: f64) -> Vec<DMatrix<f64>> {
    let mut all = Vec::new();
    for (i, Interval { coefficients: a, length }) in intervals.iter().enumerate() {
        let n = p[i].nrows();
        let degree = a.len();
        let slope = (&p[i + 1] - &p[i]) * (rate / length * as_number(degree));
        for j in 0..=degree {
            // (d + 1 - j) P_i A_j + j P_(i+1) A_(j-1) as one product with repeated terms: a factor would round.
            let pair = |k: usize| if k < degree - j { (i, j) } else { (i + 1, j - 1) };
            let left = DMatrix::from_fn(n, n * degree, |row, k| p[pair(k / n).0][(row, k % n)]);
            let right = DMatrix::from_fn(n * degree, n, |k, col| a[pair(k / n).1][(k % n, col)]);
            let product = AccurateProduct::new(&left, &right);
            all.extend([-product.plus_transpose(&slope), -product.plus_transpose(&-&slope)]);
        }
    }
    all
}

/// The certificate; None if P does not prove the inequalities in the units of the data.
fn verified(
    intervals: &[Interval],
    p: Vec<DMatrix<f64>>,
    change: f64,
    domain: Domain,
) -> Result<Option<ScheduleCertificate>, Error> {
    let matrices = match domain {
        Domain::Continuous => accurate_decays(intervals, &p, change),
        Domain::Sampled { .. } => {
            let known: Vec<_> = p.iter().map(Affine::constant).collect();
            let times = |p: &Affine, a: &DMatrix<f64>| {
                Affine::constant(&AccurateProduct::new(&p.constant, a).high)
            };
            let all = inequalities(intervals, &known, change, times).into_iter();
            all.map(|matrix| matrix.constant).collect()
        }
    };
    let mut smallest = f64::INFINITY;
    for matrix in p.iter().chain(&matrices) {
        smallest = smallest.min(margin(matrix)?);
    }
    Ok((smallest > 0.0).then_some(ScheduleCertificate { change, p, margin: smallest }))
}
