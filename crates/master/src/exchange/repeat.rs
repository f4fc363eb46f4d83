//! What iterations and step controls ask of the connected Reals.

use super::extrapolation::Known;
use super::layout::PortMap;
use super::reals::Reals;
use crate::algorithm::Extrapolation;
use crate::system::System;
use slave::CallError;

impl Reals {
    /// Order of convergence of the extrapolation as the slaves can follow it: a mean that is held is of order
    /// 2, the value at one end of the step of order 1.
    pub(crate) fn order(&self) -> u8 {
        let held = |lane: &PortMap| lane.input_order == 0 && !lane.inputs.is_empty();
        let held = self.layout.port_maps.iter().any(held);
        match self.extrapolation {
            Extrapolation::Hold => 1,
            Extrapolation::Limited if held => 1,
            Extrapolation::Quadratic if !held => 3,
            Extrapolation::Limited | Extrapolation::Linear | Extrapolation::Quadratic => 2,
        }
    }

    /// From now on all inputs are interpolated to these values of their outputs at the end of the
    /// step; none: as the algorithm has it.
    pub(crate) fn assume(&mut self, ends: Option<&[f64]>) {
        self.assumes = ends.is_some();
        if let Some(ends) = ends {
            self.assumed.copy_from_slice(ends);
        }
    }

    /// The extrapolation of each output over a step of `size` s from now, into `ends`.
    pub(crate) fn predictions(&self, size: f64, ends: &mut [f64]) {
        let trace = &self.trace;
        for (output, end) in ends.iter_mut().enumerate() {
            let span = &trace.spans[self.layout.owners[output] as usize];
            let derivative = |place: Option<u32>| place.map(|k| trace.derivatives[k as usize]);
            let known = Known {
                earlier: trace.before[output],
                before: trace.begin[output],
                begin: trace.latest[output],
                end: trace.latest[output],
                slope: derivative(self.layout.slopes[output]),
                curvature: derivative(self.layout.curvatures[output]),
                earlier_size: span.last_size,
                last_size: span.size,
                size,
            };
            *end = known.extrapolated(self.extrapolation).end(size);
        }
    }

    /// The change of all outputs per change of one through the inputs that it is connected to, by
    /// directional derivatives; slave and error where one has none.
    pub(crate) fn derivatives_to(
        &self,
        system: &mut System,
        output: usize,
        changes: &mut [f64],
    ) -> Result<(), (usize, CallError)> {
        let layout = &self.layout;
        for (slave, lane) in layout.port_maps.iter().enumerate() {
            for k in lane.input_range.clone() {
                if layout.sources[k] as usize != output || lane.outputs.is_empty() {
                    continue;
                }
                let known = lane.inputs[k - lane.input_range.start];
                let mut own = vec![0.0; lane.outputs.len()];
                system.slaves[slave]
                    .1
                    .directional_derivative(&lane.outputs, &[known], &[layout.factors[k]], &mut own)
                    .map_err(|source| (slave, source))?;
                for (change, own) in changes[lane.output_range.clone()].iter_mut().zip(own) {
                    *change += own;
                }
            }
        }
        Ok(())
    }

    /// Values of the outputs at the begin of the last step.
    pub(crate) fn begins(&self) -> &[f64] {
        &self.trace.begin
    }

    /// How far the extrapolation of each output over the last step of `size` s was off, into `errors`.
    pub(crate) fn extrapolation_errors(&self, size: f64, errors: &mut [f64]) {
        for (output, error) in errors.iter_mut().enumerate() {
            let span = &self.trace.spans[self.layout.owners[output] as usize];
            let mut known = self.known(output, span);
            known.size = size;
            *error = self.trace.latest[output] - known.extrapolated(self.extrapolation).end(size);
        }
    }
}
