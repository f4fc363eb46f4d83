//! A plant's FMU as functions of time, states and inputs, for an estimator that uses the equations of the plant.

use fmu_import::Fmu;
use nalgebra::DMatrix;
use slave::ModelExchange;

use super::parts::{Part, Parts, State};
use super::point::{NAME, all_settable, finite, initialise, nominals, row_name, settle};
use super::{Linearise, LineariseError, directional};

/// Relative step of two-sided differences: the cube root of the machine epsilon, which has the smallest error.
const DIFFERENCE: f64 = 6e-6;

/// The equations x' = f(t, x, u), y = h(t, x, u) of an FMU for model exchange.
///
/// They are functions of t, x and u: at the start of a trajectory ([`PlantEquations::begin`]) the discrete variables
/// return to their values after initialisation, and an event makes them consistent with t, x and u. So discrete
/// variables with a memory, such as the side of a hysteresis or the samples of a part in discrete time, do not
/// remember earlier trajectories. An FMU that cannot save its state keeps its discrete variables instead. The states x
/// have the order of the FMU; u has the inputs and then the faults of the request, y its outputs.
///
/// All functions return a [`LineariseError`] if a function of the FMU fails or returns a number that is not finite, if
/// events do not end, or if the FMU requests the end of the simulation.
pub struct PlantEquations {
    component: Box<dyn ModelExchange>,
    names: Names,
    /// The time of the next time event in s.
    next_event: Option<f64>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// The states and inputs with respect to which the rows are differentiated.
    knowns: Vec<u32>,
    /// The rows (derivatives of the states, outputs) whose variable is none of `knowns`.
    unknown_rows: Vec<usize>,
    /// The variables of `unknown_rows`.
    unknowns: Vec<u32>,
    /// The directional derivatives of `unknowns` with respect to one known.
    derivatives: Vec<f64>,
    /// The rows whose variable is one of `knowns`, with the position of the variable in `knowns`.
    known_rows: Vec<(usize, usize)>,
    /// The typical sizes of `knowns`.
    scales: Vec<f64>,
    /// The `min` and `max` of `knowns`.
    limits: Vec<[f64; 2]>,
    has_directional_derivatives: bool,
    /// Whether the FMU can save its state, so that each trajectory starts from the state after initialisation.
    can_restore: bool,
    /// The event indicators at the end of the last step, and now.
    indicators: [Vec<f64>; 2],
    /// The rows at two points, for finite differences.
    values: [Vec<f64>; 2],
    /// A column of the Jacobian.
    column: Vec<f64>,
    start_inputs: Vec<f64>,
}

/// The names of the states, and of the rows: derivatives of the states, outputs.
struct Names {
    states: Vec<String>,
    rows: Vec<String>,
}

#[expect(clippy::missing_errors_doc, reason = "the type says them")]
impl PlantEquations {
    /// Creates the equations of `fmu` with the parameters of `request`. x has all states, also if `request` names some.
    ///
    /// # Errors
    ///
    /// [`LineariseError`]: a name or value of the request is wrong, a function of the FMU fails, or the FMU has no
    /// continuous states, no model exchange, or event indicators and no way to save its state.
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
        let can_restore = flags.can_get_and_set_fmu_state;
        if can_restore {
            component.save_state(0)?;
        } else if component.number_of_event_indicators()? > 0 {
            return Err(lacks("canGetAndSetFMUstate, without which its events cannot be undone"));
        }
        let has_directional_derivatives = flags.provides_directional_derivative
            && directional::jacobian(&mut *component, &parts, &states).is_ok();
        Self::of(component, &parts, &states, has_directional_derivatives, can_restore)
    }

    /// Creates the equations from an initialised FMU: reads its start values, selects the typical sizes of states and
    /// inputs, and separates the rows whose variable is itself a state or an input.
    fn of(
        mut component: Box<dyn ModelExchange>,
        parts: &Parts<'_>,
        states: &[State],
        has_directional_derivatives: bool,
        can_restore: bool,
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
        // A nominal value of 1 is the default of FMI, so it does not state the size of a state.
        let of_states = states.iter().zip(&nominals).zip(&start);
        let of_states = of_states.map(|((state, nominal), x)| match state.part.typical {
            None if *nominal > 0.0 && nominal.to_bits() != 1.0_f64.to_bits() => *nominal,
            _ => state.part.scale(*x),
        });
        let scales = of_states.chain(parts.inputs.iter().map(|part| part.scale(0.0))).collect();
        let known_parts = states.iter().map(|state| &state.part).chain(&parts.inputs);
        let limits = known_parts.map(|part| [part.min, part.max]).collect();
        let indicators = vec![0.0; component.number_of_event_indicators()?];
        let count = states.len() + parts.outputs.len();
        let names = Names {
            states: states.iter().map(|state| state.part.name.clone()).collect(),
            rows: (0..count).map(|row| row_name(states, parts, row)).collect(),
        };
        let (rows, knowns) = directional::references(parts, states);
        let known = |row: usize| knowns.iter().position(|known| *known == rows[row]);
        let unknown_rows: Vec<usize> = (0..count).filter(|&row| known(row).is_none()).collect();
        Ok(Self {
            component,
            names,
            next_event: None,
            inputs,
            outputs: references(&parts.outputs),
            unknowns: unknown_rows.iter().map(|&row| rows[row]).collect(),
            derivatives: vec![0.0; unknown_rows.len()],
            known_rows: (0..count).filter_map(|row| Some((row, known(row)?))).collect(),
            unknown_rows,
            knowns,
            scales,
            limits,
            has_directional_derivatives,
            can_restore,
            indicators: [indicators.clone(), indicators],
            values: [vec![0.0; count], vec![0.0; count]],
            column: vec![0.0; count],
            start_inputs,
        })
    }

    /// Returns the names of the states.
    #[must_use]
    pub fn states(&self) -> &[String] {
        &self.names.states
    }

    /// Returns the inputs after initialisation: the values of the request, otherwise the start values of the FMU.
    #[must_use]
    pub fn start_inputs(&self) -> &[f64] {
        &self.start_inputs
    }

    /// Begins a trajectory at `time` in s with the states `x` and the inputs `u`: an event makes the discrete variables
    /// consistent with these values, and may change `x`.
    pub fn begin(&mut self, time: f64, x: &mut [f64], u: &[f64]) -> Result<(), LineariseError> {
        if self.can_restore {
            self.component.restore_state(0)?;
        }
        self.set(time, x, u)?;
        self.event(x)?;
        self.component.get_event_indicators(&mut self.indicators[0])?;
        Ok(())
    }

    /// Whether an event indicator has another sign at `time` in s, `x` and `u` than at the end of the last step.
    pub fn crosses(&mut self, time: f64, x: &[f64], u: &[f64]) -> Result<bool, LineariseError> {
        self.set(time, x, u)?;
        let [before, now] = &mut self.indicators;
        self.component.get_event_indicators(now)?;
        Ok(before.iter().zip(&*now).any(|(before, now)| (*before > 0.0) != (*now > 0.0)))
    }

    /// Ends an integration step at `time` in s, `x` and `u`. An event during the step happens here, and may change `x`.
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

    /// Iterates an event; sets `x` to the states after it.
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

    /// Sets `rates` to the derivatives of the states, f(t, x, u).
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

    /// Sets `y` to the outputs h(t, x, u).
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

    /// Sets `jacobian` to the derivatives of [f; h], n + p rows, with respect to [x; u], n + m columns.
    pub fn jacobian(
        &mut self,
        time: f64,
        x: &[f64],
        u: &[f64],
        jacobian: &mut DMatrix<f64>,
    ) -> Result<(), LineariseError> {
        self.set(time, x, u)?;
        for at in 0..self.knowns.len() {
            if self.has_directional_derivatives {
                self.derivatives_by(at)?;
            } else {
                self.differences_by(at, x, u)?;
            }
            all_finite(&self.names.rows, &self.column)?;
            jacobian.column_mut(at).copy_from_slice(&self.column);
        }
        Ok(())
    }

    /// Sets `column` to the derivatives with respect to known number `at`. A row that is itself a known needs no call.
    fn derivatives_by(&mut self, at: usize) -> Result<(), LineariseError> {
        let Self { component, knowns, unknowns, derivatives, column, .. } = self;
        if !unknowns.is_empty() {
            component.directional_derivative(unknowns, &[knowns[at]], &[1.0], derivatives)?;
        }
        for (&row, &derivative) in self.unknown_rows.iter().zip(&*derivatives) {
            column[row] = derivative;
        }
        for &(row, known) in &self.known_rows {
            column[row] = f64::from(u8::from(known == at));
        }
        Ok(())
    }

    /// Sets `column` to difference quotients with respect to known number `at`, one-sided at its `min` or `max`.
    fn differences_by(&mut self, at: usize, x: &[f64], u: &[f64]) -> Result<(), LineariseError> {
        let n = x.len();
        let value = *x.get(at).unwrap_or_else(|| &u[at - n]);
        let step = DIFFERENCE * self.scales[at].max(value.abs());
        let [low, high] = ends(value, step, self.limits[at]);
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

    /// Sets known number `at` to `value` in the FMU, with `x` as the other states; `column` is a buffer.
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

/// Returns the two points of a difference quotient: `step` below and above `value`. A point beyond a limit that
/// `value` respects is replaced by `value`.
fn ends(value: f64, step: f64, [min, max]: [f64; 2]) -> [f64; 2] {
    let low = if value - step < min && value >= min { value } else { value - step };
    let high = if value + step > max && value <= max { value } else { value + step };
    // Without room on either side, the FMU decides whether it accepts values beyond the limits.
    if low < high { [low, high] } else { [value - step, value + step] }
}

fn all_finite(names: &[String], values: &[f64]) -> Result<(), LineariseError> {
    for (name, &value) in names.iter().zip(values) {
        finite(name, value)?;
    }
    Ok(())
}
