//! An ellipsoid that contains the reachable states of a family of systems.

use super::coordinates::{Coordinates, time_unit, unit_near};
use super::definite::margin;
use super::lower_bound::product_trace;
use super::region::MARGIN;
use super::{Affine, Outcome, Problem};
use crate::blocks::symmetric_part;
use crate::check::as_number;
use crate::lyapunov::{CONTINUOUS, DISCRETE};
use crate::product::AccurateProduct;
use crate::stability::instability;
use crate::{Domain, Error, check};
use nalgebra::{DMatrix, DVector};

/// Factors by which Q is enlarged, tried in turn until the inequalities of Q hold by more than rounding errors.
const ENLARGEMENTS: [f64; 5] = [1.0, 1.0 + 1e-6, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3];
/// Weight of the trace of Q in the objective of [`common_reachable_set`].
const REGULARISATION: f64 = 1e-6;
/// If c Q c' / |c|^2 of an output row c is below this in the coordinates of the solver, [`MARGIN`] is not negligible:
/// the program is solved in coordinates in which the smallest Q of the mean matrix is the identity.
const WEAK: f64 = 1e-4;
const NOT_PROVEN: &str = "no common ellipsoid could be proven in double precision";

/// An ellipsoid that contains all states that a family of systems reaches from rest.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ReachableSet {
    /// Q, n x n: x' `Q^-1` x <= 1 at all times.
    pub shape: DMatrix<f64>,
    /// Smallest eigenvalue of Q and of the inequalities, each scaled to a diagonal of about one;
    /// larger than the rounding errors.
    pub margin: f64,
}

impl ReachableSet {
    /// The largest absolute value of `output` x in the ellipsoid: the root of c Q c'.
    ///
    /// `output`: c, n entries.
    #[must_use]
    pub fn peak(&self, output: &DVector<f64>) -> f64 {
        output.dot(&(&self.shape * output)).max(0.0).sqrt()
    }
}

/// Computes an ellipsoid, small in the directions of given outputs, that contains all states that a family of
/// systems reaches from rest under a disturbance of at most one.
///
/// ```text
/// x' = A(t) x + b w(t), |w| <= 1, A(t) in the hull of A_1, A_2, ...;  Q > 0
/// A_i Q + Q A_i' + lambda Q + b b' / lambda < 0                               continuous
/// [Q - b b' / r, A_i Q; Q A_i', (1 - r) Q] > 0,  r = 1 - exp(-lambda period)  sampled
/// V = x' Q^-1 x:  V' <= -lambda (V - w^2), so that V <= 1 at all times
/// ```
///
/// `matrices`: the vertices `A_i`, n x n; `disturbance`: b, n entries; `outputs`: C, r x n; `rate`: lambda in
/// 1/s, above zero and below twice a decay rate that [`super::certify_common`] proves, otherwise no Q exists.
/// Of all Q the one with the smallest sum of c Q c' over the rows c of C is computed, each c Q c' relative to its
/// value for the mean matrix. The returned Q is verified in the units of the data; it is enlarged by up
/// to 1e-3 of itself if rounding errors hide the inequalities.
///
/// If `rate` is too large for the mean matrix alone, the outcome is [`Outcome::Infeasible`] with the conflict "rate";
/// if no common Q could be proven, [`Outcome::Inconclusive`].
///
/// Source: Boyd et al. (1994), section 6.1.3; J. Abedor, K. Nagpal, K. Poolla, A linear matrix inequality
/// approach to peak-to-peak gain minimization, Int. J. Robust Nonlinear Control 6 (1996).
///
/// # Errors
///
/// [`Error::Shape`], [`Error::Empty`], [`Error::NotFinite`] for bad or missing `matrices`, a bad `disturbance` or bad
/// `outputs`; [`Error::OutOfRange`] for a bad `rate` or period; [`Error::NotConverged`], [`Error::Overflow`] when
/// rounding prevents the solution for the mean matrix.
pub fn common_reachable_set(
    matrices: &[DMatrix<f64>],
    disturbance: &DVector<f64>,
    outputs: &DMatrix<f64>,
    rate: f64,
    domain: Domain,
) -> Result<Outcome<ReachableSet>, Error> {
    let mean = mean(matrices)?;
    let n = mean.nrows();
    let b = DMatrix::from_column_slice(disturbance.len(), 1, disturbance.as_slice());
    check::shape("disturbance", &b, (n, 1))?;
    check::shape("outputs", outputs, (outputs.nrows(), n))?;
    check::positive("rate", rate)?;
    domain.check()?;
    let Some(mut coordinates) = Coordinates::of_dynamics(&mean)? else {
        return Ok(Outcome::Inconclusive(NOT_PROVEN));
    };
    coordinates.unit = time_unit(domain, coordinates.unit);
    let search = Search { matrices, mean, outputs, inequality: Reachability { b, rate, domain } };
    let (inequality, _) = search.scaled(&coordinates);
    let Some(q_of_mean) = inequality.smallest(&coordinates.dynamics(&search.mean))? else {
        return Ok(Outcome::Infeasible { conflict: vec!["rate"] });
    };
    let refined = if is_weak(&coordinates.output(outputs), &q_of_mean) {
        let inverse = q_of_mean.cholesky().map(|factor| symmetric_part(&factor.inverse()));
        inverse.and_then(|p| coordinates.refined(&p))
    } else {
        None
    };
    // Rounding errors may prevent the proof in coordinates that stretch the states by much.
    if let Some(refined) = refined
        && let Ok(Some(set)) = search.smallest(&refined)
    {
        return Ok(Outcome::Optimal(set));
    }
    Ok(search.smallest(&coordinates)?.map_or(Outcome::Inconclusive(NOT_PROVEN), Outcome::Optimal))
}

/// Whether Q in the direction of a row of `outputs` is not large compared with the margin of the inequalities.
fn is_weak(outputs: &DMatrix<f64>, q_of_mean: &DMatrix<f64>) -> bool {
    outputs.row_iter().any(|row| (row * q_of_mean * row.transpose())[0] < WEAK * row.norm_squared())
}

/// The search of [`common_reachable_set`].
struct Search<'a> {
    matrices: &'a [DMatrix<f64>],
    /// The mean of `matrices`.
    mean: DMatrix<f64>,
    outputs: &'a DMatrix<f64>,
    /// The inequality in the units of the data.
    inequality: Reachability,
}

impl Search<'_> {
    /// The inequality in `coordinates`, and the unit of the disturbance there.
    fn scaled(&self, coordinates: &Coordinates) -> (Reachability, f64) {
        let Reachability { b, rate, domain } = &self.inequality;
        let b = coordinates.input(b);
        let size = unit_near(b.norm());
        (Reachability { b: b / size, rate: rate / coordinates.unit, domain: *domain }, size)
    }

    /// The smallest Q, with the program solved in `coordinates`; None if no Q is proven.
    fn smallest(&self, coordinates: &Coordinates) -> Result<Option<ReachableSet>, Error> {
        let (inequality, size) = self.scaled(coordinates);
        let Some(q_of_mean) = inequality.smallest(&coordinates.dynamics(&self.mean))? else {
            return Ok(None);
        };
        let mut problem = Problem::new();
        let q = problem.symmetric(q_of_mean.nrows());
        problem.constrain(&q, MARGIN);
        for a in self.matrices {
            problem.constrain(&inequality.matrix(&q, &coordinates.dynamics(a)), MARGIN);
        }
        problem.minimise(&objective(&q, &coordinates.output(self.outputs), &q_of_mean));
        let Outcome::Optimal(solution) = problem.solve()? else { return Ok(None) };
        let shape = coordinates.shape(&solution.value(&q)) * (size * size);
        for enlargement in ENLARGEMENTS {
            let shape = &shape * enlargement;
            let mut smallest = margin(&shape)?;
            for a in self.matrices {
                smallest = smallest.min(margin(&self.inequality.value(&shape, a))?);
            }
            if smallest > 0.0 {
                return Ok(Some(ReachableSet { shape, margin: smallest }));
            }
        }
        Ok(None)
    }
}

/// The inequality of [`common_reachable_set`] for one vertex, as a matrix that must be positive definite.
struct Reachability {
    b: DMatrix<f64>,
    rate: f64,
    domain: Domain,
}

impl Reachability {
    /// The smallest Q for one matrix, where the inequality is an equation; None if the rate is too large for a
    /// solution.
    fn smallest(&self, a: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>, Error> {
        let (n, part) = (a.nrows(), self.part());
        let (equation, shifted) = match self.domain {
            Domain::Continuous => {
                (&CONTINUOUS, a + DMatrix::from_diagonal_element(n, n, 0.5 * self.rate))
            }
            Domain::Sampled { .. } => (&DISCRETE, a / (1.0 - part).sqrt()),
        };
        if instability(&shifted, self.domain)? >= 0.0 {
            return Ok(None);
        }
        let spread = &self.b * self.b.transpose() / part;
        equation.solve(&shifted.transpose(), &spread).map(Some)
    }

    /// The factor r of the inequality: 1 - exp(-lambda period), in continuous time lambda.
    fn part(&self) -> f64 {
        match self.domain {
            Domain::Continuous => self.rate,
            Domain::Sampled { period } => -(-self.rate * period).exp_m1(),
        }
    }

    /// The matrix of the inequality, which must be positive definite.
    fn matrix(&self, q: &Affine, a: &DMatrix<f64>) -> Affine {
        let product = a * q;
        let part = self.part();
        let spread = Affine::constant(&(&self.b * self.b.transpose() / part));
        match self.domain {
            Domain::Continuous => -&(&(&product.plus_transpose() + &(q * part)) + &spread),
            Domain::Sampled { .. } => {
                let (rest, decayed) = (q - &spread, q * (1.0 - part));
                Affine::blocks(&[&[&rest, &product], &[&product.transpose(), &decayed]])
            }
        }
    }

    /// The matrix of the inequality for a known Q; in continuous time with the product in twice the precision.
    fn value(&self, q: &DMatrix<f64>, a: &DMatrix<f64>) -> DMatrix<f64> {
        if self.domain != Domain::Continuous {
            return self.matrix(&Affine::constant(q), a).constant;
        }
        let constant = &self.b * self.b.transpose() / self.rate + q * self.rate;
        -AccurateProduct::new(a, q).plus_transpose(&constant)
    }
}

/// The sum of c Q c' over the rows c of `outputs`, each relative to its value for `q_of_mean`. A small multiple of the
/// trace of Q is added, which bounds Q in the other directions.
fn objective(q: &Affine, outputs: &DMatrix<f64>, q_of_mean: &DMatrix<f64>) -> Affine {
    let n = q_of_mean.nrows();
    let mut weight = DMatrix::from_diagonal_element(n, n, REGULARISATION / q_of_mean.trace());
    for row in outputs.row_iter() {
        let size = (row * q_of_mean * row.transpose())[(0, 0)];
        if size > 0.0 {
            weight += row.tr_mul(&row) / size;
        }
    }
    product_trace(q, &weight)
}

/// The mean of square matrices of equal size.
fn mean(matrices: &[DMatrix<f64>]) -> Result<DMatrix<f64>, Error> {
    let Some(first) = matrices.first() else {
        return Err(Error::Empty { matrix: "the list of vertices", actual: (0, 0) });
    };
    let n = check::square("A", first)?;
    let mut sum = DMatrix::zeros(n, n);
    for a in matrices {
        check::shape("A", a, (n, n))?;
        sum += a;
    }
    Ok(sum / as_number(matrices.len()))
}
