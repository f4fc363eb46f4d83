//! Fast path of Jacobi's method with held Real inputs: one loop over the slaves.

use std::ops::Range;

use slave::{CallError, CommunicationStep, Slave, StepResult};

/// The ranges of one slave in the arrays of all slaves.
#[derive(Clone, Debug)]
struct PortRanges {
    inputs: Range<usize>,
    outputs: Range<usize>,
}

/// The arrays of a pass: value references, sources and values of all slaves, contiguous in memory.
#[derive(Debug, Default)]
pub(super) struct Pass {
    ranges: Vec<PortRanges>,
    /// Value references of the inputs.
    inputs: Vec<u32>,
    /// For each input, the index of the connected output.
    sources: Vec<u32>,
    /// The value of each input.
    values: Vec<f64>,
    /// Value references of the outputs.
    outputs: Vec<u32>,
    /// Outputs at the end of the step, kept apart while other slaves still read the values at its
    /// start.
    next: Vec<f64>,
    /// Slaves that did not complete their step or ended it at an event.
    parts: Vec<(usize, StepResult)>,
}

impl Pass {
    /// Adds the next slave: value references of its inputs, sources of these inputs, value
    /// references of its outputs.
    pub(super) fn add(&mut self, inputs: &[u32], sources: &[u32], outputs: &[u32]) {
        let (first_input, first_output) = (self.inputs.len(), self.outputs.len());
        self.inputs.extend(inputs);
        self.sources.extend(sources);
        self.values.resize(self.inputs.len(), 0.0);
        self.outputs.extend(outputs);
        self.next.resize(self.outputs.len(), 0.0);
        self.ranges.push(PortRanges {
            inputs: first_input..self.inputs.len(),
            outputs: first_output..self.outputs.len(),
        });
        self.parts.reserve(self.ranges.len());
    }

    /// Sets the inputs of all slaves from `latest`, makes `step` with each slave and reads their outputs. Replaces
    /// `latest` after all slaves have stepped. Returns the slaves that did not complete the step or ended it at an
    /// event, with their results. Returns the first failure with its slave; `latest` then keeps its values.
    #[inline]
    pub(super) fn run(
        &mut self,
        slaves: &mut [(String, Box<dyn Slave>)],
        latest: &mut Vec<f64>,
        step: CommunicationStep,
    ) -> Result<&mut Vec<(usize, StepResult)>, (usize, CallError)> {
        self.parts.clear();
        for (slave, ((_, instance), range)) in slaves.iter_mut().zip(&self.ranges).enumerate() {
            let values = &mut self.values[range.inputs.clone()];
            for (value, &source) in values.iter_mut().zip(&self.sources[range.inputs.clone()]) {
                *value = latest[source as usize];
            }
            let done = instance.pass(
                &self.inputs[range.inputs.clone()],
                values,
                step,
                &self.outputs[range.outputs.clone()],
                &mut self.next[range.outputs.clone()],
            );
            match done {
                Ok(StepResult::Whole) => {}
                Ok(part) => self.parts.push((slave, part)),
                Err(error) => return Err((slave, error)),
            }
        }
        std::mem::swap(latest, &mut self.next);
        Ok(&mut self.parts)
    }
}
