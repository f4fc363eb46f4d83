//! The steps of several slaves at once.

use super::reals::Reals;
use crate::simulation::Task;
use crate::slave::{CallError, Stepped};
use crate::system::System;

impl Reals {
    /// [`Reals::advance`] of several slaves: those that can be stepped in another thread by `run`.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        span: &dyn Fn(usize) -> (f64, f64),
        never_back: bool,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Vec<Result<Stepped, CallError>> {
        let mut chosen = vec![false; system.slaves.len()];
        for &slave in slaves {
            chosen[slave] = true;
        }
        let mut results: Vec<Option<Result<Stepped, CallError>>> = vec![None; chosen.len()];
        let (mut values, mut derivatives) =
            (self.trace.latest.as_mut_slice(), self.trace.derivatives.as_mut_slice());
        let (mut tasks, mut own) = (Vec::with_capacity(slaves.len()), Vec::new());
        for (slave, (_, instance)) in system.slaves.iter_mut().enumerate() {
            let lane = &self.layout.lanes[slave];
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
            let mut step = lane.step(inputs, span(slave), never_back, outputs);
            if instance.in_thread().is_none() {
                own.push((slave, instance.advance(&mut step)));
            } else if let Some(instance) = instance.in_thread() {
                tasks.push(Task { slave, instance, step, done: Ok(Stepped::Whole) });
            }
        }
        run(&mut tasks);
        own.extend(tasks.into_iter().map(|task| (task.slave, task.done)));
        for (slave, done) in own {
            self.trace.spans[slave].stepped |= done.is_ok();
            results[slave] = Some(done);
        }
        slaves.iter().map(|&slave| results[slave].take().unwrap_or(Ok(Stepped::Whole))).collect()
    }
}
