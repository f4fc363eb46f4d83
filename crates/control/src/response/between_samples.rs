//! Bounds of a sampled loop at all times, between the samples too.

use super::fault_loop::{error_part, loop_dynamics, outputs, require_rows, with_integrals};
use super::peak_gain;
use crate::blocks::{beside, stacked};
use crate::faults::ExtendedPlant;
use crate::faulty_plant::FaultyPlant;
use crate::gains::{Estimator, Gains};
use crate::hold::zero_order_hold;
use crate::{Domain, Error, StateSpace, check};
use nalgebra::DMatrix;

/// A plant with a sampled controller.
#[derive(Debug, Clone, Copy)]
pub struct SampledLoop<'a> {
    /// The plant in continuous time.
    pub extended: &'a ExtendedPlant,
    /// The plant of `extended`, sampled by [`crate::sampled::sample`].
    pub plant: &'a FaultyPlant,
    /// The gains, designed for `plant`.
    pub gains: &'a Gains,
    /// The sample time T in s.
    pub period: f64,
}

/// Computes upper bounds of the peak gains of a sampled loop over all times, not over the samples only: from arbitrary
/// faults, from f' of faults without jumps, and from the part of such faults that is not compensated.
///
/// ```text
/// x(kT + t) = Phi(t) x[k] + Gamma(t) u[k] + integral of e^(A (t - s)) F_a f(kT + s) ds over s from 0 to t
/// ```
///
/// `parts`: N, the number of parts of each interval, at least 1; `rows`: the positions in [x; e; eps] of the
/// outputs, at least one, where x are the states of the plant at all times, and e and eps are the errors at
/// the samples, where the estimates are computed; `width`: see [`peak_gain`]. Each result has a row for each
/// output and q columns.
///
/// The fault is constant over each part, with any sequence of values, and has any other value at the sample itself,
/// where the measurements may contain it; x is read at the start of each part. With growing N the gains approach those
/// of arbitrary faults, with an error of the order of 1/N; a mode that oscillates several times in a part needs a
/// larger N. With N = 1 they are the gains of [`super::fault_gains`], the gain from f' multiplied by T, unless a fault
/// acts on states and measurements: the fault changes only at the samples, and x is read only there. Entry (i, j) is an upper bound of the sum of |`h_ij`| over all parts and samples.
///
/// Source: lifting of a sampled loop, T. Chen and B. A. Francis, Optimal Sampled-Data Control
/// Systems, Springer (1995), chapter 10.
///
/// # Errors
///
/// Same as [`Gains::check`], [`zero_order_hold`] and [`peak_gain`]; [`Error::OutOfRange`] for `parts` and `rows`.
pub fn gains_between_samples(
    sampled: &SampledLoop<'_>,
    parts: u32,
    rows: &[usize],
    width: f64,
) -> Result<[DMatrix<f64>; 3], Error> {
    sampled.gains.check(sampled.plant)?;
    require_rows(sampled.plant, rows)?;
    check::positive("parts", f64::from(parts))?;
    Lifted::new(sampled, parts)?.gains(rows, width)
}

/// The loop over one interval of length T, divided into parts of length h.
struct Lifted<'a> {
    plant: &'a FaultyPlant,
    gains: &'a Gains,
    /// Number of states of the plant without filter.
    states: usize,
    period: f64,
    part: f64,
    /// The state transition e^(A i h) over i parts, i from 0 to N.
    phi: Vec<DMatrix<f64>>,
    /// Integral of e^(A s) B over s from 0 to i h.
    gamma: Vec<DMatrix<f64>>,
    /// Integral of e^(A s) `F_a` over s from 0 to h.
    entry: DMatrix<f64>,
}

/// The effects of an input over one sample interval: on x at the end of the interval and at the start of each part, and
/// on eps.
struct Effects {
    /// For each part of the input, the effect on x[k+1], n + filters rows.
    states_after: Vec<DMatrix<f64>>,
    /// Whether the observer knows the effect on x[k+1]; then the error e[k+1] does not contain it.
    is_known: bool,
    /// [i][j]: the effect of part j of the input on x at the start of part i.
    outputs: Vec<Vec<DMatrix<f64>>>,
    /// The effect on eps[k+1], a factor for each part.
    next_error: Vec<f64>,
    /// The effect on eps[k], a factor for each part.
    present_error: Vec<f64>,
}

impl<'a> Lifted<'a> {
    fn new(sampled: &SampledLoop<'a>, parts: u32) -> Result<Self, Error> {
        let SampledLoop { extended, plant, gains, period } = *sampled;
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

    /// The effect on x at time i h of a fault of one during part j, n x q; zero if part j is not before i h.
    fn effect(&self, i: usize, j: usize) -> DMatrix<f64> {
        if j < i { &self.phi[i - 1 - j] * &self.entry } else { &self.entry * 0.0 }
    }

    /// The rows of the sampled `F_a` for the states of the filter, on which the fault acts at the samples.
    fn filter_entry(&self) -> DMatrix<f64> {
        let all = self.plant.a.nrows();
        self.plant.f_a.rows(self.states, all - self.states).into_owned()
    }

    /// The effects of f, with one value for each part, and then the value at the sample, which the measurements see.
    fn faults(&self) -> Effects {
        let count = self.parts();
        let at_sample = |j| f64::from(u8::from(j == count));
        let filter = |j| self.filter_entry() * at_sample(j);
        let states_after = |j| stacked(&self.effect(count, j), &filter(j));
        Effects {
            states_after: (0..=count).map(states_after).collect(),
            is_known: false,
            outputs: (0..count).map(|i| (0..=count).map(|j| self.effect(i, j)).collect()).collect(),
            next_error: vec![0.0; count + 1],
            present_error: (0..=count).map(|j| -at_sample(j)).collect(),
        }
    }

    /// The effects of f', constant in each part: in part j, f is f[k] + h times the sum of f' in earlier parts.
    fn rates(&self) -> Effects {
        let count = self.parts();
        let sum = |i: usize, r: usize| {
            let zero = &self.entry * 0.0;
            (r + 1..i).fold(zero, |sum, j| sum + self.effect(i, j)) * self.part
        };
        let filter = self.filter_entry() * 0.0;
        let states_after = |r| stacked(&sum(count, r), &filter);
        Effects {
            states_after: (0..count).map(states_after).collect(),
            is_known: false,
            outputs: (0..count).map(|i| (0..count).map(|r| sum(i, r)).collect()).collect(),
            next_error: vec![-self.part; count],
            present_error: vec![0.0; count],
        }
    }

    /// The effects of the part of a fault without jumps that is not compensated: `F_a` + B `K_f` of the sampled plant.
    fn uncancelled(&self) -> Effects {
        let Gains { k_f, .. } = self.gains;
        let until = |i: usize| (0..i).fold(&self.gamma[i] * k_f, |sum, j| sum + self.effect(i, j));
        Effects {
            states_after: vec![stacked(&until(self.parts()), &self.filter_entry())],
            is_known: true,
            outputs: (0..self.parts()).map(|i| vec![until(i)]).collect(),
            next_error: vec![0.0],
            present_error: vec![0.0],
        }
    }

    /// The matrix from the state [x; e; `f_hat` or eps; `x_i`] of the loop to x at the start of part i.
    fn output(&self, i: usize) -> DMatrix<f64> {
        let Gains { k_x, k_f, integral, .. } = self.gains;
        let (from_states, from_faults) = (&self.gamma[i] * k_x, &self.gamma[i] * k_f);
        let mut from_errors = -&from_states;
        if let Some(direct) = self.gains.direct(self.plant) {
            from_errors += &from_faults * direct;
        }
        let phi = self.phi[i].clone().resize_horizontally(self.plant.a.nrows(), 0.0);
        let rows = beside(&beside(&(phi + from_states), &from_errors), &from_faults);
        match integral {
            Some(integral) => beside(&rows, &(&self.gamma[i] * &integral.gain)),
            None => rows,
        }
    }

    /// The effect of part j of an input on the state of the loop at the next sample.
    fn input(&self, inputs: &Effects, j: usize) -> DMatrix<f64> {
        let (n, q) = self.plant.f_a.shape();
        let states_after = &inputs.states_after[j];
        let unknown = states_after * if inputs.is_known { 0.0 } else { 1.0 };
        let mut errors = unknown.clone().resize_vertically(n + q, 0.0);
        errors.rows_mut(n, q).fill_diagonal(inputs.next_error[j]);
        if self.gains.estimator == Estimator::Current {
            errors -= self.gains.observer_gain() * &self.plant.c * unknown;
        }
        let factor = self.period * inputs.present_error[j];
        with_integrals(self.gains, &stacked(states_after, &errors), factor)
    }

    fn gains(&self, rows: &[usize], width: f64) -> Result<[DMatrix<f64>; 3], Error> {
        let (n, q) = self.plant.f_a.shape();
        let inputs = [self.faults(), self.rates(), self.uncancelled()];
        let columns = inputs.iter().map(|inputs| inputs.states_after.len() * q).sum();
        // A state is read at the start of each part, e and eps once.
        let reads = |row: usize| if row < self.states { 0..self.parts() } else { 0..1 };
        let all: Vec<_> = rows.iter().flat_map(|&row| reads(row).map(move |i| (row, i))).collect();
        let domain = Domain::Sampled { period: self.period };
        let a = loop_dynamics(self.plant, self.gains, domain);
        let mut system = StateSpace {
            b: DMatrix::zeros(a.nrows(), columns),
            c: DMatrix::zeros(all.len(), a.nrows()),
            d: DMatrix::zeros(all.len(), columns),
            a,
            domain,
        };
        let errors = outputs(self.plant, self.gains);
        let states: Vec<_> = (0..self.parts()).map(|i| self.output(i)).collect();
        for (at, &(row, i)) in all.iter().enumerate() {
            let source = if row < self.states { &states[i] } else { &errors };
            system.c.row_mut(at).copy_from(&source.row(row));
        }
        let mut column = 0;
        for inputs in &inputs {
            for j in 0..inputs.states_after.len() {
                system.b.columns_mut(column, q).copy_from(&self.input(inputs, j));
                for (at, &(row, i)) in all.iter().enumerate() {
                    if row < self.states {
                        let effect = inputs.outputs[i][j].row(row);
                        system.d.view_mut((at, column), (1, q)).copy_from(&effect);
                    } else if row >= 2 * n {
                        system.d[(at, column + row - 2 * n)] = inputs.present_error[j];
                    }
                }
                column += q;
            }
        }
        if rows.iter().all(|row| *row >= n) {
            system = error_part(self.plant, &system);
        }
        let sums = peak_gain(&system, width)?.upper;
        let mut first = 0;
        Ok(inputs.map(|inputs| {
            let count = inputs.states_after.len();
            let mut largest = DMatrix::zeros(rows.len(), q);
            let mut at = 0;
            for (mut gains, &row) in largest.row_iter_mut().zip(rows) {
                for read in at..at + reads(row).len() {
                    for fault in 0..q {
                        // The effects of all parts of a fault add up; the largest value of x counts.
                        let parts = (0..count).map(|j| sums[(read, first + j * q + fault)]);
                        gains[fault] = parts.sum::<f64>().max(gains[fault]);
                    }
                }
                at += reads(row).len();
            }
            first += count * q;
            largest
        }))
    }
}
