//! The continuous states and the inputs with derivatives of a model as vectors.

use super::Interface;
use super::typed::Native;

impl<M> Interface<M> {
    /// Copies the continuous states of the model to `to`.
    pub(crate) fn read_states(&self, model: &mut M, to: &mut [f64]) {
        for (state, value) in self.states.iter().zip(to) {
            *value = *(self.reals[state.state].field)(model);
        }
    }

    /// Sets the continuous states of the model.
    pub(crate) fn write_states(&self, model: &mut M, values: &[f64]) {
        for (state, value) in self.states.iter().zip(values) {
            *(self.reals[state.state].field)(model) = *value;
        }
    }

    /// Copies the derivatives of the continuous states to `to`.
    pub(crate) fn read_derivatives(&self, model: &mut M, to: &mut [f64]) {
        for (state, value) in self.states.iter().zip(to) {
            *value = *(self.reals[state.derivative].field)(model);
        }
    }

    /// Returns the shortest constant interval of the periodic clocks in s; infinity without one.
    pub(crate) fn shortest_interval(&self) -> f64 {
        let clocks = bool::slots(&self.typed);
        clocks.iter().filter_map(|clock| clock.interval).fold(f64::INFINITY, f64::min)
    }

    /// Returns the nominal values of the continuous states.
    pub(crate) fn nominals(&self) -> Vec<f64> {
        self.states.iter().map(|state| state.nominal).collect()
    }

    /// Whether the model offers model exchange.
    pub(crate) fn offers_exchange(&self) -> bool {
        self.event_indicators.is_some()
    }
}

/// Inputs with derivatives, which `fmi2SetRealInputDerivatives` sets.
impl<M> Interface<M> {
    /// Copies the inputs with derivatives to `to`.
    pub(crate) fn read_interpolated(&self, model: &mut M, to: &mut [f64]) {
        for (&position, value) in self.interpolated.iter().zip(to) {
            *value = *(self.reals[position].field)(model);
        }
    }

    /// Sets the inputs with derivatives.
    pub(crate) fn write_interpolated(&self, model: &mut M, values: &[f64]) {
        for (&position, value) in self.interpolated.iter().zip(values) {
            *(self.reals[position].field)(model) = *value;
        }
    }

    /// Sets the derivatives of the inputs at the start of a step of `size` s: the derivatives of the parabola through
    /// the values at start, middle and end of the step, or of the line from start to end for an input with one
    /// derivative. Returns whether a derivative is not zero.
    pub(crate) fn interpolate(
        &self,
        model: &mut M,
        [starts, middles, ends]: [&[f64]; 3],
        size: f64,
    ) -> bool {
        let mut moves = false;
        for (k, &position) in self.interpolated.iter().enumerate() {
            let (start, middle, end) = (starts[k], middles[k], ends[k]);
            let parabola = [
                (4.0 * (middle - start) - (end - start)) / size,
                4.0 * ((end - middle) - (middle - start)) / (size * size),
            ];
            let line = [(end - start) / size, 0.0];
            let fields = &self.reals[position].derivatives;
            let derivatives = if fields.len() == 1 { line } else { parabola };
            for (order, field) in fields.iter().enumerate() {
                let value = derivatives.get(order).copied().unwrap_or(0.0);
                *field(model) = value;
                moves |= value != 0.0;
            }
        }
        moves
    }

    /// Sets the inputs with derivatives to their values `elapsed` s after their values were `values`: `u + u' t + u''
    /// t^2 / 2 + ...`
    pub(crate) fn extrapolate(&self, model: &mut M, values: &[f64], elapsed: f64) {
        for (&position, value) in self.interpolated.iter().zip(values) {
            let slot = &self.reals[position];
            let (mut value, mut power, mut order) = (*value, 1.0, 0.0);
            for derivative in &slot.derivatives {
                order += 1.0;
                power *= elapsed / order;
                value += power * *derivative(model);
            }
            *(slot.field)(model) = value;
        }
    }
}
