//! Bounds of a sampled loop at all times, between the samples too.

use super::fault_loop::{loop_dynamics, outputs};
use crate::aso::{Estimator, FaultyPlant, Gains};
use crate::balance::{Balance, divide_rows, multiply_columns};
use crate::faults::ExtendedPlant;
use crate::hold::zero_order_hold;
use crate::svd::norm_2;
use crate::{Domain, Error, check, stability};
use nalgebra::DMatrix;

/// The largest power of two of samples over which the loop must contract.
const LONGEST: u32 = 24;
/// The part of the first state that is left where a sum counts as complete.
const NEGLIGIBLE: f64 = 1e-9;

/// Peak gains of a sampled loop whose faults change at any time; rows: [x; e; eps], columns: faults.
///
/// x: the plant's states at all times; e and eps: at the samples, where the estimates are made.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GainsBetweenSamples {
    /// From faults of any course.
    pub of_faults: DMatrix<f64>,
    /// From f' of faults without jumps.
    pub of_rates: DMatrix<f64>,
    /// From the part of such faults that the compensation leaves.
    pub uncancelled: DMatrix<f64>,
}

/// Computes the peak gains of a sampled loop over all times, not over the samples only.
///
/// ```text
/// x(kT + t) = Phi(t) x[k] + Gamma(t) u[k] + integral of e^(A (t - s)) F_a f(kT + s) ds over s from 0 to t
/// ```
///
/// `extended`: in continuous time; `plant`: the same sampled by [`crate::sampled::sample`]; `gains`:
/// for `plant`; `period`: T in s; `parts`: N, into how many parts each interval is divided; `width`:
/// relative error of the sums, 1e-3 for example. The fault is taken constant over each part, with
/// any sequence of values, and x is read at the start of each part; with growing N the gains
/// approach those of arbitrary faults, with an error of the order of 1/N. The gains of the
/// [`super::peak_gain`] of [`super::fault_system`] are those of N = 1: a fault that changes at the
/// samples only, seen at the samples only. Every (i, j) is the sum of |`h_ij`| over all parts and
/// samples. The sums end where the contraction of the loop bounds the rest, which is added.
///
/// Source: lifting of a sampled loop, T. Chen and B. A. Francis, Optimal Sampled-Data Control
/// Systems, Springer (1995), chapter 10.
///
/// # Errors
///
/// Same as [`Gains::check`] and [`zero_order_hold`]; [`Error::OutOfRange`] for `parts` and `width`;
/// [`Error::NotSchur`]; [`Error::NotConverged`] when the loop hardly contracts.
pub fn gains_between_samples(
    extended: &ExtendedPlant,
    plant: &FaultyPlant,
    gains: &Gains,
    period: f64,
    (parts, width): (u32, f64),
) -> Result<GainsBetweenSamples, Error> {
    gains.check(plant)?;
    check::positive("parts", f64::from(parts))?;
    check::positive("width", width)?;
    let domain = Domain::Sampled { period };
    let a = loop_dynamics(plant, gains, domain);
    stability::require_stable("A", &a, domain)?;
    let lifted = Lifted::new(extended, plant, gains, (period, parts))?;
    let sums = |inputs: &Effects| lifted.sums(&a, inputs, width);
    Ok(GainsBetweenSamples {
        of_faults: sums(&lifted.faults())?,
        of_rates: sums(&lifted.rates())?,
        uncancelled: sums(&lifted.uncancelled())?,
    })
}

/// The loop over one interval of length T, divided into parts of length h.
struct Lifted<'a> {
    plant: &'a FaultyPlant,
    gains: &'a Gains,
    /// Number of states of the plant without filter.
    states: usize,
    /// T in s.
    period: f64,
    /// h in s.
    part: f64,
    /// e^(A i h), i from 0 to N.
    phi: Vec<DMatrix<f64>>,
    /// Integral of e^(A s) B over s from 0 to i h.
    gamma: Vec<DMatrix<f64>>,
    /// Integral of e^(A s) `F_a` over s from 0 to h.
    entry: DMatrix<f64>,
}

/// How an input acts: on x at the end of the interval, on x at the start of each part, and on eps.
struct Effects {
    /// For each part of the input: its effect on x[k+1], n + filters rows.
    states_after: Vec<DMatrix<f64>>,
    /// [i][j]: the effect of part j of the input on x at the start of part i.
    outputs: Vec<Vec<DMatrix<f64>>>,
    /// The effect on eps[k+1], a factor for each part.
    next_error: Vec<f64>,
    /// The effect on eps[k], a factor for each part.
    present_error: Vec<f64>,
}

impl<'a> Lifted<'a> {
    fn new(
        extended: &ExtendedPlant,
        plant: &'a FaultyPlant,
        gains: &'a Gains,
        (period, parts): (f64, u32),
    ) -> Result<Self, Error> {
        let n = extended.states;
        let a: DMatrix<f64> = extended.plant.a.view((0, 0), (n, n)).into();
        let b = extended.plant.b.rows(0, n).into_owned();
        let f_a = extended.plant.f_a.rows(0, n).into_owned();
        let part = period / f64::from(parts);
        let (step, entry) = zero_order_hold(&a, &f_a, part)?;
        let (_, held) = zero_order_hold(&a, &b, part)?;
        let mut phi = vec![DMatrix::identity(n, n)];
        let mut gamma = vec![DMatrix::zeros(n, b.ncols())];
        for i in 0..parts as usize {
            gamma.push(&step * &gamma[i] + &held);
            phi.push(&step * &phi[i]);
        }
        Ok(Self { plant, gains, states: n, period, part, phi, gamma, entry })
    }

    fn parts(&self) -> usize {
        self.phi.len() - 1
    }

    /// The effect at time i h of a fault of one during part j.
    fn effect(&self, i: usize, j: usize) -> DMatrix<f64> {
        if j < i { &self.phi[i - 1 - j] * &self.entry } else { &self.entry * 0.0 }
    }

    /// Completes a matrix of the plant's states by the rows of the filter.
    fn with_filter(&self, states: &DMatrix<f64>, filter: &DMatrix<f64>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.plant.a.nrows(), states.ncols());
        all.rows_mut(0, self.states).copy_from(states);
        all.rows_mut(self.states, filter.nrows()).copy_from(filter);
        all
    }

    /// The rows of the sampled `F_a` of the filter, which sees the fault at the samples.
    fn at_samples(&self) -> DMatrix<f64> {
        let all = self.plant.a.nrows();
        self.plant.f_a.rows(self.states, all - self.states).into_owned()
    }

    /// The input f, one value for each part.
    fn faults(&self) -> Effects {
        let count = self.parts();
        let filter = |j| self.at_samples() * f64::from(u8::from(j == 0));
        let states_after = |j| self.with_filter(&self.effect(count, j), &filter(j));
        Effects {
            states_after: (0..count).map(states_after).collect(),
            outputs: (0..count).map(|i| (0..count).map(|j| self.effect(i, j)).collect()).collect(),
            next_error: vec![0.0; count],
            present_error: (0..count).map(|j| if j == 0 { -1.0 } else { 0.0 }).collect(),
        }
    }

    /// The input f', one value for each part: f in part j is f[k] + h times the sum of those before.
    fn rates(&self) -> Effects {
        let count = self.parts();
        let sum = |i: usize, r: usize| {
            let zero = &self.entry * 0.0;
            (r + 1..i).fold(zero, |sum, j| sum + self.effect(i, j)) * self.part
        };
        let nothing = self.at_samples() * 0.0;
        let states_after = |r| self.with_filter(&sum(count, r), &nothing);
        Effects {
            states_after: (0..count).map(states_after).collect(),
            outputs: (0..count).map(|i| (0..count).map(|r| sum(i, r)).collect()).collect(),
            next_error: vec![-self.part; count],
            present_error: vec![0.0; count],
        }
    }

    /// The input f[k] of a fault without jumps: `F_a` + B `K_f` of the sampled plant.
    fn uncancelled(&self) -> Effects {
        let Gains { k_f, .. } = self.gains;
        let until = |i: usize| (0..i).fold(&self.gamma[i] * k_f, |sum, j| sum + self.effect(i, j));
        Effects {
            states_after: vec![self.with_filter(&until(self.parts()), &self.at_samples())],
            outputs: (0..self.parts()).map(|i| vec![until(i)]).collect(),
            next_error: vec![0.0],
            present_error: vec![0.0],
        }
    }

    /// The rows of [x; e; `f_hat` or eps; `x_i`] from which x at the start of part i follows.
    fn output(&self, i: usize) -> DMatrix<f64> {
        let (n, q) = self.plant.f_a.shape();
        let Gains { k_x, k_f, integral, .. } = self.gains;
        let t = self.gains.integrals();
        let mut rows = DMatrix::zeros(self.states, 2 * n + q + t);
        let own = self.states;
        rows.view_mut((0, 0), (own, own)).copy_from(&self.phi[i]);
        let command = &self.gamma[i] * k_x;
        let mut plant = rows.view_mut((0, 0), (own, n));
        plant += &command;
        rows.view_mut((0, n), (own, n)).copy_from(&-command);
        if let Some(direct) = self.gains.direct(self.plant) {
            let mut of_error = rows.view_mut((0, n), (own, n));
            of_error += &self.gamma[i] * k_f * direct;
        }
        rows.view_mut((0, 2 * n), (own, q)).copy_from(&(&self.gamma[i] * k_f));
        if let Some(integral) = integral {
            rows.columns_mut(2 * n + q, t).copy_from(&(&self.gamma[i] * &integral.gain));
        }
        rows
    }

    /// The effect of part j on the state of the loop.
    fn input(&self, inputs: &Effects, j: usize) -> DMatrix<f64> {
        let (n, q) = self.plant.f_a.shape();
        let states_after = &inputs.states_after[j];
        let mut seen = states_after.clone().resize_vertically(n + q, 0.0);
        seen.rows_mut(n, q).fill_diagonal(inputs.next_error[j]);
        if self.gains.estimator == Estimator::Current {
            seen -= self.gains.observer_gain() * &self.plant.c * states_after;
        }
        let t = self.gains.integrals();
        let mut column = DMatrix::zeros(2 * n + q + t, q);
        column.view_mut((0, 0), (n, q)).copy_from(states_after);
        column.view_mut((n, 0), (n + q, q)).copy_from(&seen);
        if let Some(integral) = &self.gains.integral {
            let sensed = &integral.faults * (self.period * inputs.present_error[j]);
            column.rows_mut(2 * n + q, t).copy_from(&sensed);
        }
        column
    }

    /// The sum of |h| over all parts and samples; of x the largest over the parts of an interval.
    fn sums(&self, a: &DMatrix<f64>, inputs: &Effects, width: f64) -> Result<DMatrix<f64>, Error> {
        let (n, q) = self.plant.f_a.shape();
        let (own, rows, count) = (self.states, 2 * n + q, inputs.states_after.len());
        let order = a.nrows();
        let reads = inputs.outputs.len();
        // All columns at once, and all rows: x at the start of each part, then [x; e; eps].
        let mut b = DMatrix::zeros(order, count * q);
        let mut c = DMatrix::zeros(reads * own + rows, order);
        let mut sums = DMatrix::zeros(reads * own + rows, q);
        for j in 0..count {
            b.columns_mut(j * q, q).copy_from(&self.input(inputs, j));
            for (i, effects) in inputs.outputs.iter().enumerate() {
                let mut at_part = sums.rows_mut(i * own, own);
                at_part += effects[j].abs();
            }
            let present = inputs.present_error[j].abs();
            for fault in 0..q {
                sums[(reads * own + 2 * n + fault, fault)] += present;
            }
        }
        for i in 0..reads {
            c.rows_mut(i * own, own).copy_from(&self.output(i));
        }
        c.rows_mut(reads * own, rows).copy_from(&outputs(self.plant, self.gains));
        add_impulses(a, &b, &c, (&mut sums, width))?;
        let mut found = sums.rows(reads * own, rows).into_owned();
        for i in 0..reads {
            let largest = found.rows(0, own).sup(&sums.rows(i * own, own));
            found.rows_mut(0, own).copy_from(&largest);
        }
        Ok(found)
    }
}

/// Adds the sums over k of |C A^k B|, those of the columns of each input together, from above.
fn add_impulses(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
    (sums, width): (&mut DMatrix<f64>, f64),
) -> Result<(), Error> {
    let Balance { matrix: a, scale } = Balance::new(a);
    let (mut states, c) = (divide_rows(b, &scale), multiply_columns(c, &scale));
    let q = sums.ncols();
    // After `block` samples the state has at most half of its norm.
    let (mut block, mut power, mut doublings) = (1_usize, a.clone(), 0);
    while norm_2(&power)? > 0.5 {
        (block, doublings) = (2 * block, doublings + 1);
        if doublings > LONGEST {
            return Err(Error::NotConverged {
                what: "the sum of the impulse response",
                iterations: block,
            });
        }
        power = &power * &power;
    }
    let mut rest = vec![0.0; c.nrows()];
    let mut rows = c.clone();
    for _ in 0..block {
        rest.iter_mut().zip(rows.row_iter()).for_each(|(rest, row)| *rest += 2.0 * row.norm());
        rows *= &a;
    }
    let lengths = |states: &DMatrix<f64>| -> Vec<f64> {
        let of =
            |fault| (fault..states.ncols()).step_by(q).map(|at| states.column(at).norm()).sum();
        (0..q).map(of).collect()
    };
    let begin = lengths(&states);
    loop {
        for _ in 0..block {
            for (at, column) in (&c * &states).column_iter().enumerate() {
                let mut sum = sums.column_mut(at % q);
                sum += column.abs();
            }
            states = &a * states;
        }
        let left = lengths(&states);
        // An output that an input does not reach has a sum of zero, which no remainder is small against.
        let is_short = |fault: usize| left[fault] <= NEGLIGIBLE * width * begin[fault];
        let is_small =
            |row: usize, fault: usize| rest[row] * left[fault] <= width * sums[(row, fault)];
        if (0..q).all(|fault| is_short(fault) || (0..rest.len()).all(|row| is_small(row, fault))) {
            for (row, fault) in
                (0..rest.len()).flat_map(|row| (0..q).map(move |fault| (row, fault)))
            {
                sums[(row, fault)] += rest[row] * left[fault];
            }
            return Ok(());
        }
    }
}
