//! Functions of the connected Reals for iteration and step control.

use super::extrapolation::OutputHistory;
use super::layout::PortMap;
use super::reals::Reals;
use crate::algorithm::Extrapolation;
use crate::system::System;
use slave::CallError;

impl Reals {
    /// Returns the order of convergence of the input extrapolation: a held mean has order 2, the
    /// value at one end of the step order 1.
    pub(crate) fn order(&self) -> u8 {
        let is_held = |port_map: &PortMap| port_map.input_order == 0 && !port_map.inputs.is_empty();
        let any_held = self.layout.port_maps.iter().any(is_held);
        match self.extrapolation {
            Extrapolation::Hold => 1,
            Extrapolation::Limited if any_held => 1,
            Extrapolation::Quadratic if !any_held => 3,
            Extrapolation::Limited | Extrapolation::Linear | Extrapolation::Quadratic => 2,
        }
    }

    /// Makes all inputs interpolate to the output values `ends` at the end of the step; `None`
    /// restores the extrapolation of the algorithm.
    pub(crate) fn assume(&mut self, ends: Option<&[f64]>) {
        self.assumes = ends.is_some();
        if let Some(ends) = ends {
            self.assumed.copy_from_slice(ends);
        }
    }

    /// Extrapolates each output over the next `size` s and writes the results to `ends`.
    pub(crate) fn predictions(&self, size: f64, ends: &mut [f64]) {
        let trace = &self.trace;
        for (output, end) in ends.iter_mut().enumerate() {
            let span = &trace.spans[self.layout.owners[output] as usize];
            let derivative = |place: Option<u32>| place.map(|k| trace.derivatives[k as usize]);
            let history = OutputHistory {
                earlier: trace.before[output],
                before: trace.start[output],
                start: trace.latest[output],
                end: trace.latest[output],
                slope: derivative(self.layout.slopes[output]),
                curvature: derivative(self.layout.curvatures[output]),
                jumps: self.layout.jumping[output],
                earlier_size: span.last_size,
                last_size: span.size,
                size,
            };
            *end = history.extrapolated(self.extrapolation).end(size);
        }
    }

    /// Adds the derivatives of all outputs with respect to the output at the index `output`, through
    /// the connected inputs, to `changes`. On failure returns the slave and its error.
    pub(crate) fn derivatives_to(
        &self,
        system: &mut System,
        output: usize,
        changes: &mut [f64],
    ) -> Result<(), (usize, CallError)> {
        let layout = &self.layout;
        for (slave, port_map) in layout.port_maps.iter().enumerate() {
            for k in port_map.input_range.clone() {
                if layout.sources[k] as usize != output || port_map.outputs.is_empty() {
                    continue;
                }
                let known = port_map.inputs[k - port_map.input_range.start];
                let mut derivatives = vec![0.0; port_map.outputs.len()];
                system.slaves[slave]
                    .1
                    .directional_derivative(
                        &port_map.outputs,
                        &[known],
                        &[layout.factors[k]],
                        &mut derivatives,
                    )
                    .map_err(|source| (slave, source))?;
                for (change, derivative) in
                    changes[port_map.output_range.clone()].iter_mut().zip(derivatives)
                {
                    *change += derivative;
                }
            }
        }
        Ok(())
    }

    /// Writes the error of the extrapolation of each output over the last step of `size` s to
    /// `errors`.
    pub(crate) fn extrapolation_errors(&self, size: f64, errors: &mut [f64]) {
        for (output, error) in errors.iter_mut().enumerate() {
            let span = &self.trace.spans[self.layout.owners[output] as usize];
            let history = OutputHistory { size, ..self.history(output, span) };
            *error = self.trace.latest[output] - history.extrapolated(self.extrapolation).end(size);
        }
    }
}
