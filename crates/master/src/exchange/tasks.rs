//! Steps of several slaves at once: in the background, in threads, or one after the other.

use super::reals::Reals;
use crate::system::System;
use slave::{CallError, CommunicationStep, Slave, StepRequest, StepResult, finish};

impl Reals {
    /// Waits for the step of a background slave and reads its outputs.
    pub(super) fn finish(
        &mut self,
        slave: usize,
        instance: &mut dyn Slave,
        step: CommunicationStep,
    ) -> Result<StepResult, CallError> {
        let done = finish(instance, &mut self.request(slave, step))?;
        self.trace.spans[slave].stepped = true;
        Ok(done)
    }

    /// Steps several slaves and returns their results in the order of `slaves`. Starts the background
    /// slaves first; then `run` steps the others.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        step: &dyn Fn(usize) -> CommunicationStep,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<Result<StepResult, CallError>> {
        let mut chosen = vec![false; system.slaves.len()];
        for &slave in slaves {
            chosen[slave] = true;
        }
        let mut results: Vec<Option<Result<StepResult, CallError>>> = vec![None; chosen.len()];
        let (mut values, mut derivatives) =
            (self.trace.latest.as_mut_slice(), self.trace.derivatives.as_mut_slice());
        let mut batch = StepBatch::default();
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
            let request = port_map.request(
                &self.values,
                &self.input_derivatives[port_map.input_derivative_range.clone()],
                step(slave),
                output_values,
                output_derivatives,
            );
            batch.add(slave, instance.as_mut(), request);
        }
        for (slave, done) in batch.run(run) {
            self.trace.spans[slave].stepped |= done.is_ok();
            results[slave] = Some(done);
        }
        slaves.iter().map(|&slave| results[slave].take().unwrap_or(Ok(StepResult::Whole))).collect()
    }
}

/// The step of one slave, which any thread can make.
pub(crate) struct Task<'a> {
    slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) request: StepRequest<'a>,
    /// The result, once the step is made.
    pub(crate) done: Result<StepResult, CallError>,
}

/// The steps of a group, sorted by how they are executed.
#[derive(Default)]
struct StepBatch<'a> {
    /// Steps started in the background.
    started: Vec<Step<'a>>,
    /// Steps that any thread can make.
    tasks: Vec<Task<'a>>,
    /// Slaves with the results of their steps.
    done: Vec<(usize, Result<StepResult, CallError>)>,
}

/// A slave with the arguments of its step.
type Step<'a> = (usize, &'a mut dyn Slave, StepRequest<'a>);

impl<'a> StepBatch<'a> {
    /// Adds a step; starts it if the slave works in the background.
    fn add(&mut self, slave: usize, instance: &'a mut dyn Slave, request: StepRequest<'a>) {
        match instance.in_background().map(|instance| instance.begin_advance(&request)) {
            Some(Ok(())) => self.started.push((slave, instance, request)),
            Some(Err(error)) => self.done.push((slave, Err(error))),
            None => {
                self.tasks.push(Task { slave, instance, request, done: Ok(StepResult::Whole) });
            }
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
        for (slave, instance, mut request) in self.started {
            self.done.push((slave, finish(instance, &mut request)));
        }
        self.done
    }
}
