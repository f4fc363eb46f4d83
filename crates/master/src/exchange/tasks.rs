//! Steps of several slaves at once: in the background, in threads, or one after the other.

use super::reals::Reals;
use crate::system::System;
use slave::{CallError, CommunicationStep, Slave, StepRequest, StepResult, finish};

impl Reals {
    /// Steps several slaves and returns their results in the order of `slaves`. Starts the background
    /// slaves first; then `run` steps the others.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        step: &dyn Fn(usize) -> CommunicationStep,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<Result<StepResult, CallError>> {
        let mut results = vec![None; system.slaves.len()];
        for &slave in slaves {
            results[slave] = Some(Ok(StepResult::Whole));
        }
        let (mut values, mut derivatives) =
            (self.trace.latest.as_mut_slice(), self.trace.derivatives.as_mut_slice());
        let (mut started, mut tasks) = (Vec::new(), Vec::new());
        for (slave, (_, instance)) in system.slaves.iter_mut().enumerate() {
            let port_map = &self.layout.port_maps[slave];
            let (output_values, rest) = values.split_at_mut(port_map.output_range.len());
            values = rest;
            let (output_derivatives, rest) =
                derivatives.split_at_mut(port_map.output_derivative_range.len());
            derivatives = rest;
            if results[slave].is_none() {
                continue;
            }
            let request = port_map.request(
                &self.values,
                &self.input_derivatives[port_map.input_derivative_range.clone()],
                step(slave),
                output_values,
                output_derivatives,
            );
            let instance = instance.as_mut();
            let task = Task { slave, instance, request, done: Ok(StepResult::Whole) };
            match task.instance.in_background().map(|slave| slave.begin_advance(&task.request)) {
                None => tasks.push(task),
                Some(Ok(())) => started.push(task),
                Some(Err(error)) => results[slave] = Some(Err(error)),
            }
        }
        if !tasks.is_empty() {
            run(&mut tasks);
        }
        for task in &mut started {
            task.done = finish(task.instance, &mut task.request);
        }
        for Task { slave, done, .. } in tasks.into_iter().chain(started) {
            self.trace.spans[slave].stepped |= done.is_ok();
            results[slave] = Some(done);
        }
        slaves.iter().filter_map(|&slave| results[slave].take()).collect()
    }
}

/// The step of one slave, which any thread can make.
pub(crate) struct Task<'a> {
    slave: usize,
    pub(crate) instance: &'a mut dyn Slave,
    pub(crate) request: StepRequest<'a>,
    /// The result of the step, after the step was made.
    pub(crate) done: Result<StepResult, CallError>,
}
