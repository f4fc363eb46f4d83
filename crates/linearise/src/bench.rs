//! A co-simulation instance that performs many short runs from the operating point.

use std::cell::RefCell;
use std::rc::Rc;

use nalgebra::DMatrix;

use super::differences::{Side, extrapolate, reach};
use super::parts::{Part, Parts};
use super::point::{NAME, finite, initialise, read};
use super::{Linearise, LineariseError};
use fmu_import::{Fmu, Instance};
use slave::Slave as _;

/// Target for the response of a state to a pulse, relative to the state's typical size.
const RESPONSE: f64 = 1e-2;
/// Height of the first trial pulse, relative to the typical size of the input.
const TRIAL: f64 = 1e-2;
/// Smallest and largest height of a pulse, relative to the typical size of the input.
const SMALLEST: f64 = 1e-6;
const LARGEST: f64 = 0.1;
/// Drift of the states without pulses over a record, relative to the typical sizes, above which the fit includes it.
const DRIFT: f64 = 1e-6;
/// Number of pulse heights for the extrapolation to height zero; each is half of the previous one.
const HEIGHTS: usize = 3;

/// The instance, its saved state at the operating point, and the variables to set and read.
#[derive(Clone)]
pub(super) struct Bench<'p> {
    /// Shared by the benches of all step sizes, because an FMU may allow only one instance.
    component: Rc<RefCell<Instance>>,
    parts: &'p Parts<'p>,
    states: &'p [Part],
    inputs: Vec<u32>,
    /// References of the states, then of the outputs.
    readings: Vec<u32>,
    pub(super) x: Vec<f64>,
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    start: f64,
    pub(super) step: f64,
    /// The readings of an undisturbed run, with the inputs of the operating point; empty before the first response.
    rest: DMatrix<f64>,
}

#[derive(Clone, Copy)]
pub(super) struct Pulse {
    pub(super) side: Side,
    /// The absolute height in the unit of the input.
    pub(super) height: f64,
}

impl<'p> Bench<'p> {
    pub(super) fn new(
        fmu: &Fmu,
        parts: &'p Parts<'p>,
        states: &'p [Part],
        request: &Linearise,
        step: f64,
    ) -> Result<Self, LineariseError> {
        let mut component = fmu.instantiate(NAME)?;
        initialise(&mut component, parts, request)?;
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

    /// Returns a bench for the same instance with another step.
    pub(super) fn with_step(&self, step: f64) -> Self {
        Self { step, rest: DMatrix::zeros(0, 0), ..self.clone() }
    }

    /// Returns the typical size of reading `k`: states first, then outputs.
    pub(super) fn scale(&self, k: usize) -> f64 {
        match k.checked_sub(self.states.len()) {
            None => self.states[k].scale(self.x[k]),
            Some(output) => self.parts.outputs[output].scale(self.y[output]),
        }
    }

    /// Runs `count` steps with the inputs of the operating point plus `deviation`(step, input).
    /// Returns the readings at the `count` + 1 communication points, one row each.
    fn run(
        &mut self,
        count: usize,
        deviation: impl Fn(usize, usize) -> f64,
    ) -> Result<DMatrix<f64>, LineariseError> {
        let mut component = self.component.borrow_mut();
        component.restore_state(0)?;
        let mut readings = DMatrix::zeros(count + 1, self.readings.len());
        let mut row = vec![0.0; self.readings.len()];
        for step in 0..=count {
            component.get_real(&self.readings, &mut row)?;
            let parts = self.states.iter().chain(&self.parts.outputs);
            for (column, (part, &value)) in parts.zip(&row).enumerate() {
                readings[(step, column)] = finite(&part.name, value)?;
            }
            if step < count {
                let value = |(input, u): (usize, &f64)| u + deviation(step, input);
                let values: Vec<f64> = self.u.iter().enumerate().map(value).collect();
                component.set_real(&self.inputs, &values)?;
                let time = self.start + index(step) * self.step;
                component.do_step(time, self.step, false)?;
            }
        }
        Ok(readings)
    }

    /// Returns the linear response of the readings to `shape`(step, input), per unit of the shape,
    /// and the largest error of each reading.
    ///
    /// The limit of small pulses is extrapolated from `heights` heights: the height of `pulse` and its halves. With one
    /// height the errors are infinite.
    pub(super) fn response(
        &mut self,
        count: usize,
        heights: usize,
        pulse: Pulse,
        shape: impl Fn(usize, usize) -> f64,
    ) -> Result<(DMatrix<f64>, Vec<f64>), LineariseError> {
        if self.rest.nrows() != count + 1 {
            self.rest = self.run(count, |_, _| 0.0)?;
        }
        let mut levels = Vec::with_capacity(heights);
        let mut height = if pulse.side == Side::Below { -pulse.height } else { pulse.height };
        for _ in 0..heights {
            let plus = self.run(count, |step, input| height * shape(step, input))?;
            levels.push(if pulse.side == Side::Both {
                let minus = self.run(count, |step, input| -height * shape(step, input))?;
                (plus - minus) / (2.0 * height)
            } else {
                (plus - &self.rest) / height
            });
            height *= 0.5;
        }
        let mut errors = vec![0.0_f64; self.readings.len()];
        let response = DMatrix::from_fn(count + 1, errors.len(), |row, column| {
            let values: Vec<f64> = levels.iter().map(|level| level[(row, column)]).collect();
            let rounding = f64::EPSILON * self.rest[(row, column)].abs();
            let noise = |level: usize| rounding / pulse.height / 0.5_f64.powi(exponent(level));
            let power = |order| pulse.side.exponent(order);
            let (value, error) = extrapolate(&values, noise, 2.0, power);
            errors[column] = errors[column].max(error);
            value
        });
        Ok((response, errors))
    }

    /// Returns the drift of the states over the first step. [`Bench::response`] must have run before.
    pub(super) fn drift(&self) -> Vec<f64> {
        (0..self.states.len()).map(|k| self.rest[(1, k)] - self.rest[(0, k)]).collect()
    }

    /// Returns the largest drift of a state over the whole undisturbed run, relative to its typical size.
    fn largest_drift(&self) -> f64 {
        let last = self.rest.nrows() - 1;
        let drift = |k: usize| (self.rest[(last, k)] - self.rest[(0, k)]).abs() / self.scale(k);
        (0..self.states.len()).map(drift).fold(0.0, f64::max)
    }

    /// Returns a pulse of `input` over the first half of `count` steps that is small enough for all
    /// states, its response per unit and the error of each reading.
    fn pulse(
        &mut self,
        input: usize,
        count: usize,
    ) -> Result<(Pulse, DMatrix<f64>, Vec<f64>), LineariseError> {
        let (part, value) = (&self.parts.inputs[input], self.u[input]);
        let scale = part.scale(value);
        let shape =
            |step: usize, other: usize| f64::from(u8::from(other == input && step < count / 2));
        let (side, height) = reach(part, value, TRIAL * scale)?;
        let (response, _) = self.response(count, 1, Pulse { side, height }, shape)?;
        let largest = (0..self.states.len())
            .map(|k| response.column(k).amax() / self.scale(k))
            .fold(0.0, f64::max);
        let target = (RESPONSE / largest).clamp(SMALLEST * scale, LARGEST * scale);
        let (side, height) = reach(part, value, target)?;
        let pulse = Pulse { side, height };
        let (response, errors) = self.response(count, HEIGHTS, pulse, shape)?;
        Ok((pulse, response, errors))
    }

    /// Records the responses to a pulse of each input over `count` steps.
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
            is_drifting: false,
        };
        for input in 0..m {
            let (pulse, response, errors) = self.pulse(input, count)?;
            let response = response * pulse.height;
            for (k, noise) in record.noise.iter_mut().enumerate() {
                let size = response.column(k).amax() + self.rest.column(k).amax();
                *noise = noise.max(f64::EPSILON * size + errors[k] * pulse.height);
            }
            let (first, p) = (input * count, self.parts.outputs.len());
            let (start, end) = (response.view((0, 0), (count, n)), response.rows(1, count));
            record.change.rows_mut(first, count).copy_from(&(end.columns(0, n) - start));
            record.outputs.rows_mut(first, count).copy_from(&end.columns(n, p));
            for (matrix, states) in
                [(&mut record.before, start), (&mut record.after, end.columns(0, n))]
            {
                matrix.view_mut((first, 0), (count, n)).copy_from(&states);
                matrix.view_mut((first, n + input), (count / 2, 1)).fill(pulse.height);
            }
            record.pulses.push(pulse);
        }
        record.is_drifting = self.largest_drift() > DRIFT;
        Ok(record)
    }
}

/// The recorded responses: one row for each step after each pulse.
pub(super) struct Record {
    /// States at the start of the step, and inputs during the step.
    pub(super) before: DMatrix<f64>,
    /// States at the end of the step, and inputs during the step.
    pub(super) after: DMatrix<f64>,
    /// Change of the states over the step.
    pub(super) change: DMatrix<f64>,
    /// Outputs at the end of the step.
    pub(super) outputs: DMatrix<f64>,
    pub(super) pulses: Vec<Pulse>,
    /// The error of each reading: rounding, and the remainder of the extrapolation.
    pub(super) noise: Vec<f64>,
    /// Number of steps after each pulse.
    count: usize,
    pub(super) is_drifting: bool,
}

impl Record {
    /// Returns the regressors [X, t X, ..., t^degree X]: the fitted coefficients are polynomials of time. t is the
    /// elapsed fraction of the record; the rows of each pulse begin `first` steps after its start.
    pub(super) fn regressors(&self, x: &DMatrix<f64>, first: usize, degree: usize) -> DMatrix<f64> {
        let columns = x.ncols();
        DMatrix::from_fn(x.nrows(), (degree + 1) * columns, |i, j| {
            let part = index(i % self.count + first) / index(self.count);
            x[(i, j % columns)] * part.powi(exponent(j / columns))
        })
    }
}

/// Converts a count to an exponent; a larger one becomes `i32::MAX`.
fn exponent(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX)
}

/// Converts a count to a floating-point number; beyond 32 bits it becomes `u32::MAX`.
pub(super) fn index(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}
