//! Bounds of the integral of |h| over intervals of dyadic length, for an impulse response h.

use crate::balance::{Balance, divide_rows, multiply_columns, power_of_two};
use crate::hold::zero_order_hold;
use crate::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector, DVectorView};
use std::rc::Rc;

/// The shortest interval of continuous time, relative to the norm of A; h is nearly linear over it.
const SHORTEST: f64 = 1.0 / 4096.0;
/// Relative rounding error of a quadratic form, for some ten states.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// A rounding error below this part of a quadratic form need not be known better.
const NEGLIGIBLE: f64 = 1e-6;
/// Largest number of doublings of the length.
const LENGTHS: usize = 120;

/// An interval: its effect on the state at its start, for one output row c and h(t) = c x(t).
pub(super) struct Length {
    /// Time, or number of samples.
    pub(super) time: f64,
    /// The state at the end, the same for all outputs.
    pub(super) phi: Rc<DMatrix<f64>>,
    /// A row: the integral of h.
    pub(super) sum: DMatrix<f64>,
    /// x' X x: the integral of h^2.
    pub(super) gram: DMatrix<f64>,
    /// The roots of the diagonal of X.
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
    fn new(time: f64, phi: Rc<DMatrix<f64>>, sum: DMatrix<f64>, gram: DMatrix<f64>) -> Self {
        let scales = gram.diagonal().map(|entry| entry.max(0.0).sqrt());
        Self { time, phi, sum, gram, scales }
    }

    /// The interval of twice the length, whose `phi` is given.
    fn doubled(&self, phi: Rc<DMatrix<f64>>) -> Self {
        let half = &*self.phi;
        // Products by blocks, which `tr_mul` does not use.
        let later = half.transpose() * (&self.gram * half);
        Self::new(2.0 * self.time, phi, &self.sum + &self.sum * half, &self.gram + later)
    }

    /// Bounds of the integral of |h| from each column of `states` on: |integral of h|, and by Cauchy and Schwarz the root
    /// of the length times the integral of h^2.
    pub(super) fn bounds(&self, states: &DMatrix<f64>) -> Vec<Bounds> {
        let (sums, grams) = (&self.sum * states, &self.gram * states);
        let root = self.time.sqrt();
        let one = |at: usize| {
            let (state, lower) = (states.column(at), sums[at].abs());
            let square = grams.column(at).dot(&state).max(0.0);
            let (upper, blurred) = (square.sqrt(), (square + self.error(&state, square)).sqrt());
            Bounds { lower, upper: (root * upper).max(lower), rounding: root * (blurred - upper) }
        };
        (0..states.ncols()).map(one).collect()
    }

    /// A bound of the rounding error of `square`, x' X x: `ROUNDING` |x|' |X| |x|, or what is above it as X is positive
    /// semidefinite, |`X_ij`|^2 <= `X_ii` `X_jj`, if that is small enough.
    fn error(&self, state: &DVectorView<'_, f64>, square: f64) -> f64 {
        let size = state.abs();
        let above = ROUNDING * self.scales.dot(&size).powi(2);
        if above <= NEGLIGIBLE * square {
            return above;
        }
        ROUNDING * (self.gram.abs() * &size).dot(&size)
    }

    /// A bound of the integral of |h| over all intervals from here on; infinite unless this one at
    /// least halves every state.
    pub(super) fn tail(&self, state: &DVector<f64>) -> f64 {
        let contraction = self.phi.norm();
        if contraction > 0.5 {
            return f64::INFINITY;
        }
        (self.time * self.gram.norm()).sqrt() * state.norm() / (1.0 - contraction)
    }
}

/// Balanced states of unit size, and the shortest interval.
pub(super) struct Intervals {
    /// Columns of B in balanced coordinates: the states after an impulse.
    pub(super) starts: DMatrix<f64>,
    outputs: DMatrix<f64>,
    shortest: Shortest,
    /// The states at the end of intervals, each of twice the length of the one before.
    powers: Vec<Rc<DMatrix<f64>>>,
}

impl Intervals {
    pub(super) fn new(system: &StateSpace) -> Result<Self, Error> {
        let Balance { matrix, scale } = Balance::of_system(&system.a, &system.b, &system.c);
        let starts = divide_rows(&system.b, &scale);
        let outputs = multiply_columns(&system.c, &scale);
        let (phi, shortest) = Shortest::new(matrix, system.domain)?;
        Ok(Self { starts, outputs, shortest, powers: vec![Rc::new(phi)] })
    }

    /// The shortest interval for one output, the first of its lengths.
    pub(super) fn first(&self, output: usize) -> Length {
        self.shortest.length(&self.powers[0], &self.outputs.rows(output, 1).into())
    }

    /// Adds lengths for one output, each twice the one before, until the tail of h for one input is
    /// below `part` of a lower bound of the integral before it; returns how many are needed.
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
            before = before.max((&longest.sum * &start)[0].abs());
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

/// What the shortest interval has for every output.
struct Shortest {
    time: f64,
    /// The integral of the state, and the state in the middle; None in sampled time.
    continuous: Option<(DMatrix<f64>, DMatrix<f64>)>,
}

impl Shortest {
    /// Returns the state at the end, too.
    fn new(a: DMatrix<f64>, domain: Domain) -> Result<(DMatrix<f64>, Self), Error> {
        if let Domain::Sampled { .. } = domain {
            return Ok((a, Self { time: 1.0, continuous: None }));
        }
        let identity = DMatrix::identity(a.nrows(), a.nrows());
        let time = power_of_two(SHORTEST / a.norm());
        let (phi, integral) = zero_order_hold(&a, &identity, time)?;
        let (half, _) = zero_order_hold(&a, &identity, 0.5 * time)?;
        Ok((phi, Self { time, continuous: Some((integral, half)) }))
    }

    fn length(&self, phi: &Rc<DMatrix<f64>>, row: &DMatrix<f64>) -> Length {
        let gram = row.tr_mul(row);
        let (time, phi) = (self.time, Rc::clone(phi));
        let Some((integral, half)) = &self.continuous else {
            return Length::new(time, phi, row.clone(), gram);
        };
        // Simpson's rule: over 1 / 4096 of a time constant its error is below the rounding.
        // The gram is c'c: over a step it stays the square of a row.
        let square = |end: &DMatrix<f64>| {
            let moved = row * end;
            moved.tr_mul(&moved)
        };
        let (middle, end) = (square(half), square(&phi));
        let gram = (gram + middle * 4.0 + end) * (time / 6.0);
        Length::new(time, phi, row * integral, gram)
    }
}
