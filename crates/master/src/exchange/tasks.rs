//! The steps of several slaves at once, and steps that are begun and finished.

use super::reals::Reals;
use crate::simulation::Task;
use crate::system::System;
use slave::{Advance, CallError, Slave, StepResult, finish};

impl Reals {
    /// The second half of [`Reals::advance`].
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

    /// [`Reals::advance`] of several slaves: those in the background begin first, then `run` steps
    /// the others.
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
        let mut sorted = Sorted::default();
        for (slave, (_, instance)) in system.slaves.iter_mut().enumerate() {
            let lane = &self.layout.port_maps[slave];
            let (output_values, rest) = values.split_at_mut(lane.output_range.len());
            values = rest;
            let (output_derivatives, rest) =
                derivatives.split_at_mut(lane.output_derivative_range.len());
            derivatives = rest;
            if !chosen[slave] {
                continue;
            }
            let inputs =
                (&self.values[..], &self.input_derivatives[lane.input_derivative_range.clone()]);
            let outputs = (output_values, output_derivatives);
            let step = lane.step(inputs, span(slave), never_back, outputs);
            sorted.add(slave, instance.as_mut(), step);
        }
        for (slave, done) in sorted.run(run) {
            self.trace.spans[slave].stepped |= done.is_ok();
            results[slave] = Some(done);
        }
        slaves.iter().map(|&slave| results[slave].take().unwrap_or(Ok(StepResult::Whole))).collect()
    }
}

/// Steps by the way in which they are made.
#[derive(Default)]
struct Sorted<'a> {
    /// Begun in the background.
    begun: Vec<Step<'a>>,
    /// For any thread.
    tasks: Vec<Task<'a>>,
    done: Vec<(usize, Result<StepResult, CallError>)>,
}

/// A slave and its step.
type Step<'a> = (usize, &'a mut dyn Slave, Advance<'a>);

impl<'a> Sorted<'a> {
    /// Adds a step, and begins it where that can be done.
    fn add(&mut self, slave: usize, instance: &'a mut dyn Slave, step: Advance<'a>) {
        match instance.in_background().map(|instance| instance.begin_advance(&step)) {
            Some(Ok(())) => self.begun.push((slave, instance, step)),
            Some(Err(error)) => self.done.push((slave, Err(error))),
            None => self.tasks.push(Task { slave, instance, step, done: Ok(StepResult::Whole) }),
        }
    }

    /// Makes all steps: what came of them.
    fn run(
        mut self,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<(usize, Result<StepResult, CallError>)> {
        if !self.tasks.is_empty() {
            run(&mut self.tasks);
        }
        self.done.extend(self.tasks.into_iter().map(|task| (task.slave, task.done)));
        for (slave, instance, mut step) in self.begun {
            self.done.push((slave, finish(instance, &mut step)));
        }
        self.done
    }
}
