//! Bounds of the integral of |h| over intervals of dyadic length, for an impulse response h.

use crate::balance::{divide_columns, multiply_columns, power_of_two, power_of_two_or_one};
use crate::blocks::stacked;
use crate::exponential::exponential;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::{DMatrix, DVector, DVectorView};
use std::rc::Rc;

/// Length of the shortest interval in continuous time, divided by the time constant 1 / |A|; the impulse response is
/// nearly linear over it.
const SHORTEST: f64 = 1.0 / 4096.0;
/// Relative rounding error of a product of a row and a state, the errors of the doublings included.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Largest number of interval lengths that are tried, each twice the one before.
const LENGTHS: usize = 120;

/// Intervals of one length for one output row c, as matrices that act on the state x at the start; h(t) = c x(t).
pub(super) struct Length {
    /// Time, or number of samples.
    pub(super) time: f64,
    /// The matrix from the state at the start to the state at the end, the same for all outputs.
    pub(super) phi: Rc<DMatrix<f64>>,
    /// [R; s], one matrix for one product: |R x|^2 is the integral of h^2, and s x the integral of h. R is r x n; over
    /// a short interval h is smooth, and r is small.
    rows: DMatrix<f64>,
    /// The lengths of the columns of R.
    scales: DVector<f64>,
}

/// Bounds of the integral of |h| over one interval.
#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// A bound of the rounding error of `upper`.
    pub(super) rounding: f64,
}

impl Length {
    fn new(time: f64, phi: Rc<DMatrix<f64>>, root: &DMatrix<f64>, sum: &DMatrix<f64>) -> Self {
        let lengths = root.column_iter().map(|column| column.norm());
        let scales = DVector::from_iterator(root.ncols(), lengths);
        Self { time, phi, rows: stacked(root, sum), scales }
    }

    /// The interval of twice the length, whose `phi` is given.
    fn doubled(&self, phi: Rc<DMatrix<f64>>) -> Self {
        let later = &self.rows * &*self.phi;
        let rank = later.nrows() - 1;
        let root = stacked(&self.rows.rows(0, rank).into(), &later.rows(0, rank).into());
        let sum = self.rows.rows(rank, 1) + later.rows(rank, 1);
        Self::new(2.0 * self.time, phi, &without_negligible_rows(&root), &sum)
    }

    /// The absolute value of the integral of h over an interval that starts at `state`.
    pub(super) fn integral(&self, state: &DVector<f64>) -> f64 {
        (self.rows.rows(self.rows.nrows() - 1, 1) * state)[0].abs()
    }

    /// Bounds of the integral of |h| over the interval that starts at each column of `states`: |integral of h|, and by
    /// Cauchy and Schwarz the root of the length times the integral of h^2.
    pub(super) fn bounds(&self, states: &DMatrix<f64>) -> Vec<Bounds> {
        let products = &self.rows * states;
        let rank = products.nrows() - 1;
        let length = self.time.sqrt();
        let one = |(state, product): (DVectorView<'_, f64>, DVectorView<'_, f64>)| {
            // The squares of small numbers would be 0.
            let (of_root, most) = (product.rows(0, rank), product.rows(0, rank).amax());
            let norm = if most > 0.0 { most * (of_root / most).norm() } else { 0.0 };
            let (lower, upper) = (product[rank].abs(), length * norm);
            let sizes = self.scales.iter().zip(state.iter());
            let size: f64 = sizes.map(|(scale, entry)| scale * entry.abs()).sum();
            Bounds { lower, upper: upper.max(lower), rounding: length * ROUNDING * size }
        };
        states.column_iter().zip(products.column_iter()).map(one).collect()
    }

    /// A bound of the integral of |h| after `state`; infinite if the Frobenius norm of `phi` is above 1/2.
    pub(super) fn tail(&self, state: &DVector<f64>) -> f64 {
        let contraction = self.phi.norm();
        if contraction > 0.5 {
            return f64::INFINITY;
        }
        self.time.sqrt() * self.scales.norm() * state.norm() / (1.0 - contraction)
    }
}

/// A system in balanced coordinates, with its shortest interval and intervals of 2, 4, 8, ... times its length.
pub(super) struct Intervals {
    /// Columns of B in balanced coordinates: the states after an impulse.
    pub(super) starts: DMatrix<f64>,
    outputs: DMatrix<f64>,
    shortest: Shortest,
    /// For each length the matrix from the state at the start of an interval to the state at its end.
    powers: Vec<Rc<DMatrix<f64>>>,
}

impl Intervals {
    pub(super) fn new(system: &StateSpace) -> Result<Self, Error> {
        let StateSpace { a, b: starts, c: outputs, domain, .. } = system.balanced();
        let (phi, shortest) = Shortest::new(a, domain)?;
        Ok(Self { starts, outputs, shortest, powers: vec![Rc::new(phi)] })
    }

    /// The shortest interval for one output.
    pub(super) fn first(&self, output: usize) -> Length {
        self.shortest.length(&self.powers[0], &self.outputs.rows(output, 1).into())
    }

    /// Adds lengths for one output, each twice the one before, until the bound of the integral after an interval of the
    /// last length is at most `part` times a lower bound of the integral over this interval, for one input. Returns the
    /// number of lengths that this input needs, at most the number of all lengths.
    pub(super) fn extend(
        &mut self,
        lengths: &mut Vec<Length>,
        input: usize,
        part: f64,
    ) -> Result<usize, Error> {
        let start: DVector<f64> = self.starts.column(input).into();
        let mut before = 0.0_f64;
        for count in 1..=LENGTHS {
            let longest = &lengths[count - 1];
            before = before.max(longest.integral(&start));
            if longest.tail(&(&*longest.phi * &start)) <= part * before {
                return Ok(count);
            }
            if count == lengths.len() {
                if count == self.powers.len() {
                    self.powers.push(Rc::new(&*longest.phi * &*longest.phi));
                }
                let next = longest.doubled(Rc::clone(&self.powers[count]));
                lengths.push(next);
            }
        }
        Err(Error::NotConverged { what: "the impulse response", iterations: LENGTHS })
    }
}

/// The shortest interval, the same for all outputs.
struct Shortest {
    time: f64,
    /// A times the length; None in sampled time.
    continuous: Option<DMatrix<f64>>,
}

impl Shortest {
    /// The matrix from the state at the start of the shortest interval to the state at its end, and the interval.
    fn new(a: DMatrix<f64>, domain: Domain) -> Result<(DMatrix<f64>, Self), Error> {
        if let Domain::Sampled { .. } = domain {
            return Ok((a, Self { time: 1.0, continuous: None }));
        }
        let time = power_of_two(SHORTEST / a.norm());
        check::positive("h", time)?;
        let a = a * time;
        Ok((exponential(&a)?, Self { time, continuous: Some(a) }))
    }

    /// The shortest interval for the output `row`.
    fn length(&self, phi: &Rc<DMatrix<f64>>, row: &DMatrix<f64>) -> Length {
        let (time, phi) = (self.time, Rc::clone(phi));
        let Some(a) = &self.continuous else {
            return Length::new(time, phi, row, row);
        };
        let mut sum = DMatrix::zeros(1, row.ncols());
        let mut root = DMatrix::zeros(NODES.len(), row.ncols());
        for (at, Node { part, weight }) in NODES.into_iter().enumerate() {
            let h = row_after(row, a, part);
            root.row_mut(at).copy_from(&(&h * (time * weight).sqrt()));
            sum += h * (time * weight);
        }
        Length::new(time, phi, &root, &sum)
    }
}

/// A node of a Gauss-Legendre rule over an interval of length one.
struct Node {
    part: f64,
    weight: f64,
}

/// The Gauss-Legendre rule with three nodes, exact for polynomials of degree 5; over 1 / 4096 of a time constant its
/// error is below rounding.
const NODES: [Node; 3] = [
    Node { part: 0.112_701_665_379_258_31, weight: 5.0 / 18.0 },
    Node { part: 0.5, weight: 8.0 / 18.0 },
    Node { part: 0.887_298_334_620_741_7, weight: 5.0 / 18.0 },
];

/// `row` times e^(A t), where t is the fraction `part` of the shortest interval, by the Taylor series up to degree 5;
/// later terms are below rounding. `a`: A times the length of the shortest interval.
fn row_after(row: &DMatrix<f64>, a: &DMatrix<f64>, part: f64) -> DMatrix<f64> {
    let (mut term, mut sum) = (row.clone(), row.clone());
    for degree in 1..=5 {
        term = term * a * (part / f64::from(degree));
        sum += &term;
    }
    sum
}

/// R with |R x| = |M x| for every x, up to rounding, and as many rows as the rank of M, at least one.
///
/// R is the triangle of a QR decomposition with pivots, of columns of length about one, because the effects of two
/// states on an output may differ by many orders of magnitude.
fn without_negligible_rows(m: &DMatrix<f64>) -> DMatrix<f64> {
    let unit = |column: usize, _| power_of_two_or_one(m.column(column).norm());
    let units = DVector::from_fn(m.ncols(), unit);
    let decomposition = divide_columns(m, &units).col_piv_qr();
    let mut root = decomposition.r();
    decomposition.p().inv_permute_columns(&mut root);
    let least = (f64::EPSILON * root.norm()).powi(2);
    let mut rank = root.nrows();
    let mut rest = 0.0;
    while rank > 1 {
        rest += root.row(rank - 1).norm_squared();
        if rest > least {
            break;
        }
        rank -= 1;
    }
    multiply_columns(&root.rows(0, rank).into(), &units)
}
