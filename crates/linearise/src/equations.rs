//! A plant's FMU as functions of time, states and inputs, for an estimator that carries the plant.

use fmu_import::Fmu;
use nalgebra::DMatrix;
use slave::ModelExchange;

use super::parts::{Part, Parts, State};
use super::point::{NAME, all_settable, finite, initialise, nominals, row_name, settle};
use super::{Linearise, LineariseError, directional};

/// Relative steps of two-sided differences: the cube root of the machine epsilon.
const DIFFERENCE: f64 = 6e-6;

/// The equations x' = f(t, x, u), y = h(t, x, u) of an FMU for model exchange.
///
/// They are functions of t, x and u: where a trajectory begins ([`PlantEquations::begin`]) the discrete variables are
/// those of the start, made consistent with t, x and u by an event. So the memory of discrete variables, such as the
/// side of a hysteresis or the samples of a part in discrete time, is that of the start. The order of x is that of the
/// FMU, that of u and y the one of the request; u has its inputs, then its faults.
pub struct PlantEquations {
    component: Box<dyn ModelExchange>,
    names: Names,
    /// The time of the next time event in s.
    next_event: Option<f64>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// The states and inputs, by which the rows are differentiated.
    knowns: Vec<u32>,
    /// Of the derivatives of the states and the outputs those that are no knowns: their rows, and these.
    asked_rows: Vec<usize>,
    asked: Vec<u32>,
    changes: Vec<f64>,
    /// Of the others: the row and the position of the known that it is.
    equal: Vec<(usize, usize)>,
    scales: Vec<f64>,
    differentiates: bool,
    /// Whether the FMU can save its state, so that a trajectory begins from that of the start.
    restores: bool,
    indicators: [Vec<f64>; 2],
    /// Rows at two points, of finite differences.
    values: [Vec<f64>; 2],
    column: Vec<f64>,
    /// The inputs after initialisation.
    start_inputs: Vec<f64>,
}

/// The names of states and outputs.
struct Names {
    states: Vec<String>,
    rows: Vec<String>,
}

impl PlantEquations {
    /// Creates the equations of `fmu` with the parameters of `request`. Its `states` do not matter: x has all states of
    /// the FMU.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a name or value of the request is wrong, a function of the FMU fails, or the FMU has no
    /// continuous states, no model exchange, or events and no way to save its state.
    pub fn new(fmu: &Fmu, request: &Linearise) -> Result<Self, LineariseError> {
        let description = &fmu.elements()?;
        let model = description.model_name.clone();
        let lacks = |what| LineariseError::Unsuited { model: model.clone(), what };
        let Some(flags) = &description.model_exchange else {
            return Err(lacks("model exchange"));
        };
        let parts = Parts::of(description, request)?;
        let states = parts.states(request)?;
        if states.is_empty() {
            return Err(LineariseError::NoStates { model });
        }
        all_settable(&parts, &states)?;
        let mut component = fmu.instantiate_equations(NAME)?;
        initialise(&mut *component, &parts, request)?;
        settle(&mut *component)?;
        let restores = flags.can_get_and_set_fmu_state;
        if restores {
            component.save_state(0)?;
        } else if component.number_of_event_indicators()? > 0 {
            return Err(lacks("canGetAndSetFMUstate, without which its events cannot be undone"));
        }
        let differentiates = flags.provides_directional_derivative
            && directional::jacobian(&mut *component, &parts, &states).is_ok();
        Self::of(component, &parts, &states, [differentiates, restores])
    }

    fn of(
        mut component: Box<dyn ModelExchange>,
        parts: &Parts<'_>,
        states: &[State],
        [differentiates, restores]: [bool; 2],
    ) -> Result<Self, LineariseError> {
        let references = |parts: &[Part]| parts.iter().map(|part| part.reference).collect();
        let inputs: Vec<u32> = references(&parts.inputs);
        let mut start_inputs = vec![0.0; inputs.len()];
        if !inputs.is_empty() {
            component.get_real(&inputs, &mut start_inputs)?;
        }
        let mut start = vec![0.0; states.len()];
        component.get_continuous_states(&mut start)?;
        let nominals = nominals(&mut *component, states.len());
        let of_states = states.iter().zip(&nominals).zip(&start);
        let of_states = of_states.map(|((state, nominal), x)| match state.part.typical {
            None if *nominal > 0.0 && nominal.to_bits() != 1.0_f64.to_bits() => *nominal,
            _ => state.part.scale(*x),
        });
        let scales = of_states.chain(parts.inputs.iter().map(|part| part.scale(0.0))).collect();
        let indicators = vec![0.0; component.number_of_event_indicators()?];
        let count = states.len() + parts.outputs.len();
        let names = Names {
            states: states.iter().map(|state| state.part.name.clone()).collect(),
            rows: (0..count).map(|row| row_name(states, parts, row)).collect(),
        };
        let (rows, knowns) = directional::references(parts, states);
        let is = |row: usize| knowns.iter().position(|known| *known == rows[row]);
        let asked_rows: Vec<usize> = (0..count).filter(|&row| is(row).is_none()).collect();
        Ok(Self {
            component,
            names,
            next_event: None,
            inputs,
            outputs: references(&parts.outputs),
            asked: asked_rows.iter().map(|&row| rows[row]).collect(),
            changes: vec![0.0; asked_rows.len()],
            equal: (0..count).filter_map(|row| Some((row, is(row)?))).collect(),
            asked_rows,
            knowns,
            scales,
            differentiates,
            restores,
            indicators: [indicators.clone(), indicators],
            values: [vec![0.0; count], vec![0.0; count]],
            column: vec![0.0; count],
            start_inputs,
        })
    }

    /// The names of the states.
    #[must_use]
    pub fn states(&self) -> &[String] {
        &self.names.states
    }

    /// The inputs after initialisation: those that the request states, else their start values.
    #[must_use]
    pub fn start_inputs(&self) -> &[f64] {
        &self.start_inputs
    }

    /// Begins a trajectory at `time` in s with the states `x` and the inputs `u`: an event makes the discrete variables
    /// consistent with them. It may change `x`.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails.
    pub fn begin(&mut self, time: f64, x: &mut [f64], u: &[f64]) -> Result<(), LineariseError> {
        if self.restores {
            self.component.restore_state(0)?;
        }
        self.set(time, x, u)?;
        self.event(x)?;
        self.component.get_event_indicators(&mut self.indicators[0])?;
        Ok(())
    }

    /// Whether an event indicator has another sign at `time` in s with the states `x` and the inputs `u` than where the last
    /// step ended.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails.
    pub fn crosses(&mut self, time: f64, x: &[f64], u: &[f64]) -> Result<bool, LineariseError> {
        self.set(time, x, u)?;
        let [before, now] = &mut self.indicators;
        self.component.get_event_indicators(now)?;
        Ok(before.iter().zip(&*now).any(|(before, now)| (*before > 0.0) != (*now > 0.0)))
    }

    /// Ends an integration step at `time` in s with the states `x` and the inputs `u`; an event that lies in it, and may
    /// change `x`, happens here.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails, or it asks for the end of the simulation.
    pub fn complete(&mut self, time: f64, x: &mut [f64], u: &[f64]) -> Result<(), LineariseError> {
        let mut is_event = self.crosses(time, x, u)?;
        is_event |= self.next_event.is_some_and(|next| next <= time);
        if self.component.needs_completed_integrator_step() {
            let completed = self.component.completed_integrator_step(false)?;
            if completed.terminate_simulation {
                return Err(LineariseError::Ended);
            }
            is_event |= completed.enter_event_mode;
        }
        if is_event {
            self.event(x)?;
            self.component.get_event_indicators(&mut self.indicators[1])?;
        }
        self.indicators.swap(0, 1);
        Ok(())
    }

    fn event(&mut self, x: &mut [f64]) -> Result<(), LineariseError> {
        self.component.enter_event_mode()?;
        self.next_event = settle(&mut *self.component)?;
        self.component.get_continuous_states(x)?;
        Ok(())
    }

    fn set(&mut self, time: f64, x: &[f64], u: &[f64]) -> Result<(), LineariseError> {
        self.component.set_time(time)?;
        self.component.set_continuous_states(x)?;
        if !u.is_empty() {
            self.component.set_real(&self.inputs, u)?;
        }
        Ok(())
    }

    /// Sets `rates` to f(t, x, u).
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails, or a derivative is no number.
    pub fn rates(
        &mut self,
        time: f64,
        x: &[f64],
        u: &[f64],
        rates: &mut [f64],
    ) -> Result<(), LineariseError> {
        self.set(time, x, u)?;
        self.component.get_derivatives(rates)?;
        all_finite(&self.names.rows, rates)
    }

    /// Sets `y` to h(t, x, u).
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails, or an output is no number.
    pub fn outputs(
        &mut self,
        time: f64,
        x: &[f64],
        u: &[f64],
        y: &mut [f64],
    ) -> Result<(), LineariseError> {
        self.set(time, x, u)?;
        self.component.get_real(&self.outputs, y)?;
        all_finite(&self.names.rows[x.len()..], y)
    }

    /// Sets `jacobian` to the derivatives of [f; h], n + p rows, by [x; u], n + m columns.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a function of the FMU fails, or a derivative is no number.
    pub fn jacobian(
        &mut self,
        time: f64,
        x: &[f64],
        u: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), LineariseError> {
        self.set(time, x, u)?;
        for at in 0..self.knowns.len() {
            if self.differentiates {
                self.derivatives_by(at)?;
            } else {
                self.differences_by(at, x, u)?;
            }
            all_finite(&self.names.rows, &self.column)?;
            jacobian.column_mut(at).copy_from_slice(&self.column);
        }
        Ok(())
    }

    /// Sets `column` to the directional derivatives by the known at `at`. A row that is a known itself is not asked for.
    fn derivatives_by(&mut self, at: usize) -> Result<(), LineariseError> {
        let Self { component, knowns, asked, changes, column, .. } = self;
        if !asked.is_empty() {
            component.directional_derivative(asked, &[knowns[at]], &[1.0], changes)?;
        }
        for (&row, &change) in self.asked_rows.iter().zip(&*changes) {
            column[row] = change;
        }
        for &(row, known) in &self.equal {
            column[row] = f64::from(u8::from(known == at));
        }
        Ok(())
    }

    /// Sets `column` to two-sided differences by the known at `at`.
    fn differences_by(&mut self, at: usize, x: &[f64], u: &[f64]) -> Result<(), LineariseError> {
        let n = x.len();
        let value = *x.get(at).unwrap_or_else(|| &u[at - n]);
        let step = DIFFERENCE * self.scales[at].max(value.abs());
        let [low, high] = [value - step, value + step];
        for (side, value) in [low, high].into_iter().enumerate() {
            self.change(at, n, value, x)?;
            let (rates, y) = self.values[side].split_at_mut(n);
            self.component.get_real(&self.outputs, y)?;
            self.component.get_derivatives(rates)?;
        }
        self.change(at, n, value, x)?;
        let [before, after] = &self.values;
        for (entry, (before, after)) in self.column.iter_mut().zip(before.iter().zip(after)) {
            *entry = (after - before) / (high - low);
        }
        Ok(())
    }

    /// Sets the known at `at` to `value`, the other states being `x`.
    fn change(&mut self, at: usize, n: usize, value: f64, x: &[f64]) -> Result<(), LineariseError> {
        if at >= n {
            self.component.set_real(&[self.inputs[at - n]], &[value])?;
            return Ok(());
        }
        let states = &mut self.column[..n];
        states.copy_from_slice(x);
        states[at] = value;
        self.component.set_continuous_states(states)?;
        Ok(())
    }
}

fn all_finite(names: &[String], values: &[f64]) -> Result<(), LineariseError> {
    for (name, &value) in names.iter().zip(values) {
        finite(name, value)?;
    }
    Ok(())
}
