//! A co-simulation instance that is stepped again and again from the operating point.

use std::cell::RefCell;
use std::rc::Rc;

use nalgebra::DMatrix;

use super::differences::{Side, extrapolate, reach};
use super::parts::{Part, Parts};
use super::point::{initialised, read};
use super::{Linearise, LineariseError};
use fmu_import::Fmu;
use fmu_import::{Component, Interface};

/// The response of a state to a pulse as a part of its typical size: what is aimed at.
const RESPONSE: f64 = 1e-2;
/// A pulse as a part of the input's typical size: the first trial, and the limits.
const TRIAL: f64 = 1e-2;
const SMALLEST: f64 = 1e-6;
const LARGEST: f64 = 0.1;
/// The drift over a record, in typical sizes, that a fit must know of.
const DRIFT: f64 = 1e-6;
/// Heights of the pulses whose responses are extrapolated to the height zero, each half of the last.
const HEIGHTS: usize = 3;

/// The instance, which is at its saved state before each run, and what is set and read.
pub(super) struct Bench<'p> {
    /// Shared by the benches of all step sizes: an FMU may allow one instance only.
    component: Rc<RefCell<Component>>,
    parts: &'p Parts<'p>,
    states: &'p [Part],
    inputs: Vec<u32>,
    /// States, then outputs.
    readings: Vec<u32>,
    pub(super) x: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    start: f64,
    pub(super) step: f64,
    /// The course of the readings with the inputs of the operating point.
    rest: DMatrix<f64>,
}

/// A pulse of an input: to which side, how high.
pub(super) type Pulse = (Side, f64);

impl<'p> Bench<'p> {
    pub(super) fn new(
        fmu: &Fmu,
        parts: &'p Parts<'p>,
        states: &'p [Part],
        request: &Linearise,
        step: f64,
    ) -> Result<Self, LineariseError> {
        let mut component = initialised(fmu, Interface::CoSimulation, parts, request)?;
        component.save_state(0)?;
        let x = read(&mut component, states.iter())?;
        let u = read(&mut component, parts.inputs.iter())?;
        let y = read(&mut component, parts.outputs.iter())?;
        let inputs = parts.inputs.iter().map(|part| part.reference).collect();
        let readings = states.iter().chain(&parts.outputs).map(|part| part.reference).collect();
        let (start, rest) = (request.start_time, DMatrix::zeros(0, 0));
        let component = Rc::new(RefCell::new(component));
        Ok(Self { component, parts, states, inputs, readings, x, u, y, start, step, rest })
    }

    /// The same instance with another step.
    pub(super) fn with_step(&self, step: f64) -> Self {
        Self {
            component: Rc::clone(&self.component),
            parts: self.parts,
            states: self.states,
            inputs: self.inputs.clone(),
            readings: self.readings.clone(),
            x: self.x.clone(),
            u: self.u.clone(),
            y: self.y.clone(),
            start: self.start,
            step,
            rest: DMatrix::zeros(0, 0),
        }
    }

    /// The typical size of a change of reading `k`: states, then outputs.
    pub(super) fn scale(&self, k: usize) -> f64 {
        match k.checked_sub(self.states.len()) {
            None => self.states[k].scale(self.x[k]),
            Some(output) => self.parts.outputs[output].scale(self.y[output]),
        }
    }

    /// The readings at `count` + 1 communication points, one row each, with the inputs
    /// `deviation`(step, input) off the operating point.
    fn run(
        &mut self,
        count: usize,
        deviation: impl Fn(usize, usize) -> f64,
    ) -> Result<DMatrix<f64>, LineariseError> {
        let mut component = self.component.borrow_mut();
        component.restore_state(0)?;
        let mut course = DMatrix::zeros(count + 1, self.readings.len());
        let mut row = vec![0.0; self.readings.len()];
        for step in 0..=count {
            component.get_real(&self.readings, &mut row)?;
            for (column, &value) in row.iter().enumerate() {
                if !value.is_finite() {
                    let part = self.states.iter().chain(&self.parts.outputs).nth(column);
                    let name = part.map_or_else(String::new, |part| part.name.clone());
                    return Err(LineariseError::NotFinite { name, value });
                }
                course[(step, column)] = value;
            }
            if step < count {
                let value = |(input, u): (usize, &f64)| u + deviation(step, input);
                let values: Vec<f64> = self.u.iter().enumerate().map(value).collect();
                component.set_real(&self.inputs, &values)?;
                let time = self.start + index(step) * self.step;
                component.do_step(time, self.step, false)?;
            }
        }
        Ok(course)
    }

    /// The change of the readings for a small `shape`(step, input), per unit of the shape, as height
    /// times shape goes to zero from `height` on through `heights` halvings; and the largest error of
    /// each reading.
    pub(super) fn response(
        &mut self,
        count: usize,
        heights: usize,
        (side, height): Pulse,
        shape: impl Fn(usize, usize) -> f64,
    ) -> Result<(DMatrix<f64>, Vec<f64>), LineariseError> {
        if self.rest.nrows() != count + 1 {
            self.rest = self.run(count, |_, _| 0.0)?;
        }
        let mut levels = Vec::with_capacity(heights);
        let highest = height;
        let mut height = if side == Side::Below { -height } else { height };
        for _ in 0..heights {
            let there = self.run(count, |step, input| height * shape(step, input))?;
            levels.push(if side == Side::Both {
                let back = self.run(count, |step, input| -height * shape(step, input))?;
                (there - back) / (2.0 * height)
            } else {
                (there - &self.rest) / height
            });
            height *= 0.5;
        }
        let mut errors = vec![0.0_f64; self.readings.len()];
        let response = DMatrix::from_fn(count + 1, errors.len(), |row, column| {
            let values: Vec<f64> = levels.iter().map(|level| level[(row, column)]).collect();
            let rounding = f64::EPSILON * self.rest[(row, column)].abs();
            let noise = |level: usize| rounding / highest / 0.5_f64.powi(exponent(level));
            let order = |order| side.exponent(order);
            let (value, error) = extrapolate(&values, noise, 2.0, order);
            errors[column] = errors[column].max(error);
            value
        });
        Ok((response, errors))
    }

    /// The drift of the states over the first step.
    pub(super) fn drift(&self) -> Vec<f64> {
        (0..self.states.len()).map(|k| self.rest[(1, k)] - self.rest[(0, k)]).collect()
    }

    /// The largest drift of a state over the whole course, in its typical size.
    fn largest_drift(&self) -> f64 {
        let last = self.rest.nrows() - 1;
        let drift = |k: usize| (self.rest[(last, k)] - self.rest[(0, k)]).abs() / self.scale(k);
        (0..self.states.len()).map(drift).fold(0.0, f64::max)
    }

    /// A pulse of `input` over the first half of `count` steps, small enough for all states, and
    /// its response per unit with the error of each reading.
    fn pulse(
        &mut self,
        input: usize,
        count: usize,
    ) -> Result<(Pulse, DMatrix<f64>, Vec<f64>), LineariseError> {
        let (part, value) = (&self.parts.inputs[input], self.u[input]);
        let scale = part.scale(value);
        let shape =
            |step: usize, other: usize| f64::from(u8::from(other == input && step < count / 2));
        let trial = reach(part, value, TRIAL * scale)?;
        let (response, _) = self.response(count, 1, trial, shape)?;
        let largest = (0..self.states.len())
            .map(|k| response.column(k).amax() / self.scale(k))
            .fold(0.0, f64::max);
        let fitting = (RESPONSE / largest).clamp(SMALLEST * scale, LARGEST * scale);
        let pulse = reach(part, value, fitting)?;
        let (response, errors) = self.response(count, HEIGHTS, pulse, shape)?;
        Ok((pulse, response, errors))
    }

    /// The responses to a pulse of each input over `count` steps.
    pub(super) fn record(&mut self, count: usize) -> Result<Record, LineariseError> {
        let (n, m) = (self.states.len(), self.inputs.len());
        let rows = m * count;
        let mut record = Record {
            before: DMatrix::zeros(rows, n + m),
            after: DMatrix::zeros(rows, n + m),
            change: DMatrix::zeros(rows, n),
            outputs: DMatrix::zeros(rows, self.parts.outputs.len()),
            pulses: Vec::with_capacity(m),
            noise: vec![0.0; self.readings.len()],
            count,
            drifts: false,
        };
        for input in 0..m {
            let (pulse, response, errors) = self.pulse(input, count)?;
            let response = response * pulse.1;
            for (k, noise) in record.noise.iter_mut().enumerate() {
                let size = response.column(k).amax() + self.rest.column(k).amax();
                *noise = noise.max(f64::EPSILON * size + errors[k] * pulse.1);
            }
            for step in 0..count {
                let row = input * count + step;
                for k in 0..n {
                    record.before[(row, k)] = response[(step, k)];
                    record.after[(row, k)] = response[(step + 1, k)];
                    record.change[(row, k)] = response[(step + 1, k)] - response[(step, k)];
                }
                for k in 0..self.parts.outputs.len() {
                    record.outputs[(row, k)] = response[(step + 1, n + k)];
                }
                let held = if step < count / 2 { pulse.1 } else { 0.0 };
                record.before[(row, n + input)] = held;
                record.after[(row, n + input)] = held;
            }
            record.pulses.push(pulse);
        }
        record.drifts = self.largest_drift() > DRIFT;
        Ok(record)
    }
}

/// What the pulses did: one row for each step after each pulse.
pub(super) struct Record {
    /// States at the begin of the step, and inputs during it.
    pub(super) before: DMatrix<f64>,
    /// States at the end of the step, and inputs during it.
    pub(super) after: DMatrix<f64>,
    /// Change of the states over the step.
    pub(super) change: DMatrix<f64>,
    /// Outputs at the end of the step.
    pub(super) outputs: DMatrix<f64>,
    pub(super) pulses: Vec<Pulse>,
    /// The error of each reading: rounding, and what is left of the pulses' height.
    pub(super) noise: Vec<f64>,
    /// Steps after each pulse.
    count: usize,
    /// The operating point moves meanwhile.
    pub(super) drifts: bool,
}

impl Record {
    /// What the change of the states is fitted to: see `with_time`.
    pub(super) fn for_change(&self, degree: usize) -> DMatrix<f64> {
        self.with_time(&self.before, 0, degree)
    }

    /// What the outputs are fitted to.
    pub(super) fn for_outputs(&self, degree: usize) -> DMatrix<f64> {
        self.with_time(&self.after, 1, degree)
    }

    /// [X, t X, ..., t^degree X] with the part t of the record that is over: coefficients that are a
    /// polynomial of time.
    fn with_time(&self, x: &DMatrix<f64>, first: usize, degree: usize) -> DMatrix<f64> {
        let columns = x.ncols();
        DMatrix::from_fn(x.nrows(), (degree + 1) * columns, |i, j| {
            let part = index(i % self.count + first) / index(self.count);
            x[(i, j % columns)] * part.powi(exponent(j / columns))
        })
    }
}

/// A count as an exponent.
fn exponent(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX)
}

/// A count as a number.
pub(super) fn index(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}
