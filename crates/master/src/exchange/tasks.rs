//! Steps of several slaves at once: in the background, in threads, or one after the other.

use super::reals::Reals;
use crate::system::System;
use crate::task::Task;
use slave::{Advance, CallError, Slave, StepResult, finish};

impl Reals {
    /// Waits for the step of a background slave and reads its outputs.
    pub(super) fn finish(
        &mut self,
        slave: usize,
        instance: &mut dyn Slave,
        span: (f64, f64),
        never_back: bool,
    ) -> Result<StepResult, CallError> {
        let done = finish(instance, &mut self.step(slave, span, never_back))?;
        self.trace.spans[slave].stepped = true;
        Ok(done)
    }

    /// Steps several slaves. Starts the background slaves first; then `run` steps the others.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        span: &dyn Fn(usize) -> (f64, f64),
        never_back: bool,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<Result<StepResult, CallError>> {
        let mut chosen = vec![false; system.slaves.len()];
        for &slave in slaves {
            chosen[slave] = true;
        }
        let mut results: Vec<Option<Result<StepResult, CallError>>> = vec![None; chosen.len()];
        let (mut values, mut derivatives) =
            (self.trace.latest.as_mut_slice(), self.trace.derivatives.as_mut_slice());
        let mut sorted = StepBatch::default();
        for (slave, (_, instance)) in system.slaves.iter_mut().enumerate() {
            let port_map = &self.layout.port_maps[slave];
            let (output_values, rest) = values.split_at_mut(port_map.output_range.len());
            values = rest;
            let (output_derivatives, rest) =
                derivatives.split_at_mut(port_map.output_derivative_range.len());
            derivatives = rest;
            if !chosen[slave] {
                continue;
            }
            let inputs = (
                &self.values[..],
                &self.input_derivatives[port_map.input_derivative_range.clone()],
            );
            let outputs = (output_values, output_derivatives);
            let step = port_map.step(inputs, span(slave), never_back, outputs);
            sorted.add(slave, instance.as_mut(), step);
        }
        for (slave, done) in sorted.run(run) {
            self.trace.spans[slave].stepped |= done.is_ok();
            results[slave] = Some(done);
        }
        slaves.iter().map(|&slave| results[slave].take().unwrap_or(Ok(StepResult::Whole))).collect()
    }
}

/// The steps of a group, sorted by how they are executed.
#[derive(Default)]
struct StepBatch<'a> {
    /// Steps started in the background.
    started: Vec<Step<'a>>,
    /// Steps that any thread can make.
    tasks: Vec<Task<'a>>,
    done: Vec<(usize, Result<StepResult, CallError>)>,
}

/// A slave with the arguments of its step.
type Step<'a> = (usize, &'a mut dyn Slave, Advance<'a>);

impl<'a> StepBatch<'a> {
    /// Adds a step; starts it if the slave works in the background.
    fn add(&mut self, slave: usize, instance: &'a mut dyn Slave, step: Advance<'a>) {
        match instance.in_background().map(|instance| instance.begin_advance(&step)) {
            Some(Ok(())) => self.started.push((slave, instance, step)),
            Some(Err(error)) => self.done.push((slave, Err(error))),
            None => self.tasks.push(Task { slave, instance, step, done: Ok(StepResult::Whole) }),
        }
    }

    /// Makes all steps and returns their results.
    fn run(
        mut self,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<(usize, Result<StepResult, CallError>)> {
        if !self.tasks.is_empty() {
            run(&mut self.tasks);
        }
        self.done.extend(self.tasks.into_iter().map(|task| (task.slave, task.done)));
        for (slave, instance, mut step) in self.started {
            self.done.push((slave, finish(instance, &mut step)));
        }
        self.done
    }
}
