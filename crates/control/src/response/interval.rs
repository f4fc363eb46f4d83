//! Bounds of the integral of |h| over intervals of dyadic length, for an impulse response h.

use crate::balance::{Balance, divide_rows, multiply_columns, power_of_two};
use crate::hold::zero_order_hold;
use crate::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};
use std::rc::Rc;

/// The shortest interval of continuous time, relative to the norm of A; h is nearly linear over it.
const SHORTEST: f64 = 1.0 / 4096.0;
/// Relative rounding error of a quadratic form, for some ten states.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
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
    /// |X|, entry by entry.
    gram_size: DMatrix<f64>,
}

impl Length {
    fn new(time: f64, phi: Rc<DMatrix<f64>>, sum: DMatrix<f64>, gram: DMatrix<f64>) -> Self {
        let gram_size = gram.abs();
        Self { time, phi, sum, gram, gram_size }
    }

    /// The interval of twice the length, whose `phi` is given.
    fn doubled(&self, phi: Rc<DMatrix<f64>>) -> Self {
        let half = &*self.phi;
        // Products by blocks, which `tr_mul` does not use.
        let later = half.transpose() * (&self.gram * half);
        Self::new(2.0 * self.time, phi, &self.sum + &self.sum * half, &self.gram + later)
    }

    /// Bounds of the integral of |h|: |integral of h|, and by Cauchy and Schwarz the root of the
    /// length times the integral of h^2. The third number bounds the rounding error of the second.
    pub(super) fn bounds(&self, state: &DVector<f64>) -> [f64; 3] {
        let lower = (&self.sum * state)[0].abs();
        let square = (&self.gram * state).dot(state).max(0.0);
        let size = state.abs();
        let error = ROUNDING * (&self.gram_size * &size).dot(&size);
        let (upper, blurred) = (square.sqrt(), (square + error).sqrt());
        let root = self.time.sqrt();
        [lower, (root * upper).max(lower), root * (blurred - upper)]
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
            before = before.max(longest.bounds(&start)[0]);
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
