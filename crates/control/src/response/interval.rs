//! Bounds of the integral of |h| over intervals of dyadic length, for an impulse response h.

use crate::balance::{Balance, divide_rows, multiply_columns, power_of_two};
use crate::hold::zero_order_hold;
use crate::{Domain, Error, StateSpace};
use nalgebra::{DMatrix, DVector};

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
    /// The state at the end.
    pub(super) phi: DMatrix<f64>,
    /// A row: the integral of h.
    pub(super) sum: DMatrix<f64>,
    /// x' X x: the integral of h^2.
    pub(super) gram: DMatrix<f64>,
}

impl Length {
    /// The interval of twice the length.
    fn doubled(&self) -> Self {
        Self {
            time: 2.0 * self.time,
            phi: &self.phi * &self.phi,
            sum: &self.sum + &self.sum * &self.phi,
            gram: &self.gram + self.phi.tr_mul(&self.gram) * &self.phi,
        }
    }

    /// Bounds of the integral of |h|: |integral of h|, and by Cauchy and Schwarz the root of the
    /// length times the integral of h^2. The third number bounds the rounding error of the second.
    pub(super) fn bounds(&self, state: &DVector<f64>) -> [f64; 3] {
        let lower = (&self.sum * state)[0].abs();
        let square = (&self.gram * state).dot(state).max(0.0);
        let size = state.abs();
        let error = ROUNDING * (self.gram.abs() * &size).dot(&size);
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

/// Balanced states of unit size, and the shortest interval for each output.
pub(super) struct Intervals {
    /// Columns of B in balanced coordinates: the states after an impulse.
    pub(super) starts: DMatrix<f64>,
    shortest: Vec<Length>,
}

impl Intervals {
    pub(super) fn new(system: &StateSpace) -> Result<Self, Error> {
        let Balance { matrix, scale } = Balance::new(&system.a);
        let starts = divide_rows(&system.b, &scale);
        let outputs = multiply_columns(&system.c, &scale);
        let shortest = (0..outputs.nrows())
            .map(|i| shortest(&matrix, &outputs.rows(i, 1).into(), system.domain));
        Ok(Self { starts, shortest: shortest.collect::<Result<_, _>>()? })
    }

    /// Lengths for one output, each twice the one before, until the tail of h for one input is
    /// below `part` of a lower bound of the integral before it.
    pub(super) fn lengths(
        &self,
        output: usize,
        input: usize,
        part: f64,
    ) -> Result<Vec<Length>, Error> {
        let first = &self.shortest[output];
        let mut lengths = vec![Length {
            time: first.time,
            phi: first.phi.clone(),
            sum: first.sum.clone(),
            gram: first.gram.clone(),
        }];
        let start: DVector<f64> = self.starts.column(input).into();
        let mut before = 0.0_f64;
        for _ in 0..LENGTHS {
            let longest = &lengths[lengths.len() - 1];
            before = before.max(longest.bounds(&start)[0]);
            if longest.tail(&(&longest.phi * &start)) <= part * before {
                return Ok(lengths);
            }
            lengths.push(longest.doubled());
        }
        Err(Error::NotConverged { what: "the impulse response", iterations: LENGTHS })
    }
}

fn shortest(a: &DMatrix<f64>, row: &DMatrix<f64>, domain: Domain) -> Result<Length, Error> {
    let n = a.nrows();
    let gram = row.tr_mul(row);
    if let Domain::Sampled { .. } = domain {
        return Ok(Length { time: 1.0, phi: a.clone(), sum: row.clone(), gram });
    }
    let time = power_of_two(SHORTEST / a.norm());
    let (phi, integral) = zero_order_hold(a, &DMatrix::identity(n, n), time)?;
    // Simpson's rule: over 1 / 4096 of a time constant its error is below the rounding.
    let (half, _) = zero_order_hold(a, &DMatrix::identity(n, n), 0.5 * time)?;
    let middle = half.tr_mul(&gram) * &half;
    let end = phi.tr_mul(&gram) * &phi;
    let gram = (gram + middle * 4.0 + end) * (time / 6.0);
    Ok(Length { time, phi, sum: row * integral, gram })
}
