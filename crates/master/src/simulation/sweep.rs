//! A sweep: one step of every slave, in groups (Jacobi or Gauss-Seidel).

use super::Simulation;
use super::grid::size_between;
use super::parallel::{Parallel, run};
use crate::algorithm::Method;
use crate::error::SystemError;
use crate::exchange::call;
use crate::order::Order;
use crate::system::System;
use slave::{CallError, Failure, StepResult};

/// Largest number of partial steps in which a slave may complete a step.
const PARTS: u32 = 1000;
/// Part of a step below which the missing rest is rounding.
const ROUNDING: f64 = 1e-9;

/// Advice for an FMU that fails after `fmi2Discard`.
const ADVICE: &str = "the step before it was discarded; with rollback all FMUs repeat it";

/// Result of a sweep.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SweepResult {
    /// The slave that requested the end of the simulation, and the time in s.
    pub(super) terminated: Option<(usize, f64)>,
    /// The time in s that every slave can reach; `None`: the end of the step.
    pub(super) reached: Option<f64>,
}

/// The slaves in groups. Groups step one after the other; within a group, all inputs are set before
/// the first slave steps.
pub(super) struct Groups {
    pub(super) sequence: Vec<usize>,
    /// Start of each group in `sequence`, and the end of the last group.
    starts: Vec<usize>,
}

impl Groups {
    /// Forms the groups. Jacobi: one group of all slaves, except functions, which follow one by
    /// one. Gauss-Seidel: consecutive slaves without connections between them form a group, because
    /// their order does not matter.
    pub(super) fn new(system: &System, method: Method, order: &Order) -> Self {
        let count = system.slaves.len();
        if method == Method::Jacobi {
            let is_function = |slave: &usize| system.slaves[*slave].1.is_function();
            let mut sequence: Vec<usize> = (0..count).filter(|slave| !is_function(slave)).collect();
            let first = sequence.len();
            sequence.extend(order.sequence.iter().copied().filter(is_function));
            let starts = [0].into_iter().chain(first..=count).collect();
            return Self { sequence, starts };
        }
        let mut neighbours = vec![Vec::new(); count];
        for connection in &system.connections {
            let (from, to) = (connection.from.slave, connection.to.slave);
            neighbours[from].push(to);
            neighbours[to].push(from);
        }
        let mut starts = vec![0];
        // The group that must not contain the slave.
        let mut excluded_from = vec![usize::MAX; count];
        for (position, &slave) in order.sequence.iter().enumerate() {
            if excluded_from[slave] == starts.len() {
                starts.push(position);
            }
            for &neighbour in &neighbours[slave] {
                excluded_from[neighbour] = starts.len();
            }
        }
        starts.push(count);
        Self { sequence: order.sequence.clone(), starts }
    }

    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }
}

impl Simulation {
    /// Steps all slaves from `time` over `size`. With `never_back`, a slave that completes only a
    /// part of its step (`fmi2Discard`) continues until the end. Otherwise the sweep returns the
    /// time reached, so that the caller can repeat the step.
    pub(super) fn sweep(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<SweepResult, SystemError> {
        if !self.drives.is_empty() {
            self.drives.write(&mut self.system, time)?;
        }
        if self.passes {
            return self.pass(time, size, never_back);
        }
        self.step_groups(time, size, never_back)
    }

    /// Makes a sweep group by group. A separate function keeps the loop of [`Simulation::pass`]
    /// small.
    #[inline(never)]
    fn step_groups(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<SweepResult, SystemError> {
        let mut swept = SweepResult::default();
        for slave in 0..self.multiples.len() {
            self.sizes[slave] = match self.multiples[slave] {
                1 => size,
                _ if self.exchange.reals.is_ahead(slave, time) => 0.0,
                multiple => self.grid.size_of(multiple, time),
            };
            if self.sizes[slave] > 0.0 {
                self.exchange.shift(slave, time, self.sizes[slave]);
            }
        }
        for group in 0..self.groups.len() {
            let (start, end) = (self.groups.starts[group], self.groups.starts[group + 1]);
            for position in start..end {
                let slave = self.groups.sequence[position];
                self.exchange.gather(slave, time, self.sizes[slave]);
                self.exchange.check_inputs(&self.system, slave, time)?;
            }
            if let Some(mut parallel) = self.parallel.take() {
                let done = self.side_by_side(&mut parallel, group, (time, never_back), &mut swept);
                self.parallel = Some(parallel);
                done?;
                continue;
            }
            self.advance_members(start..end, time, never_back, &mut swept)?;
        }
        Ok(swept)
    }

    /// Makes one step of a group, in threads if measurements show that this is faster.
    #[cold]
    fn side_by_side(
        &mut self,
        parallel: &mut Parallel,
        group: usize,
        (time, never_back): (f64, bool),
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        let (start, end) = (self.groups.starts[group], self.groups.starts[group + 1]);
        let in_threads = end - start > 1 && parallel.in_threads(group);
        parallel.measure(group, |pool| {
            let members = start..end;
            if !in_threads {
                return self.advance_members(members, time, never_back, swept);
            }
            let due: Vec<usize> = self.groups.sequence[members]
                .iter()
                .copied()
                .filter(|&slave| self.sizes[slave] > 0.0)
                .collect();
            let sizes = &self.sizes;
            let done = self.exchange.advance_all(
                &mut self.system,
                &due,
                &|slave| (time, sizes[slave]),
                never_back,
                |tasks| run(pool, tasks),
            )?;
            for (slave, done) in due.into_iter().zip(done) {
                self.finish(slave, time, done, never_back, swept)?;
            }
            Ok(())
        })
    }

    /// Makes a sweep of Jacobi's method with held Real inputs as a single pass over the slaves.
    fn pass(&mut self, time: f64, size: f64, never_back: bool) -> Result<SweepResult, SystemError> {
        let mut swept = SweepResult::default();
        let parts = self.exchange.reals.pass(&mut self.system, (time, size), never_back)?;
        if !parts.is_empty() {
            for (slave, done) in std::mem::take(parts) {
                self.finish_in_parts(slave, (time, size), done, never_back, &mut swept)?;
            }
        }
        if !self.exchange.reals.is_finite() {
            for slave in 0..self.system.slaves.len() {
                self.exchange.check_finite(&self.system, slave, time + size)?;
            }
        }
        Ok(swept)
    }

    #[inline]
    pub(super) fn advance(
        &mut self,
        slave: usize,
        time: f64,
        never_back: bool,
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        let size = self.sizes[slave];
        if size == 0.0 {
            return Ok(());
        }
        let done = self.exchange.advance(&mut self.system, slave, (time, size), never_back)?;
        self.finish(slave, time, done, never_back, swept)
    }

    #[inline]
    pub(super) fn finish(
        &mut self,
        slave: usize,
        time: f64,
        done: StepResult,
        never_back: bool,
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        let size = self.sizes[slave];
        if done != StepResult::Whole {
            self.finish_in_parts(slave, (time, size), done, never_back, swept)?;
        }
        self.exchange.check_finite(&self.system, slave, time + size)
    }

    /// Handles a slave that completed only a part of its step.
    #[cold]
    fn finish_in_parts(
        &mut self,
        slave: usize,
        (time, size): (f64, f64),
        mut done: StepResult,
        never_back: bool,
        swept: &mut SweepResult,
    ) -> Result<(), SystemError> {
        let end = time + size;
        let mut start = time;
        for _ in 0..PARTS {
            let StepResult::Part { reached, terminated } = done else {
                return self.exchange.read(&mut self.system, slave, end);
            };
            if terminated {
                swept.terminated = Some((slave, reached));
                return Ok(());
            }
            if reached <= start {
                break;
            }
            if reached >= end - ROUNDING * size {
                return self.exchange.read(&mut self.system, slave, end);
            }
            if !never_back {
                swept.reached = Some(swept.reached.map_or(reached, |least| least.min(reached)));
                return Ok(());
            }
            start = reached;
            let (name, instance) = &mut self.system.slaves[slave];
            done =
                instance.do_step(start, size_between(start, end), true).map_err(|mut source| {
                    source.messages.push(ADVICE.to_owned());
                    call(name, start, source)
                })?;
        }
        let what = format!(
            "returned fmi2Discard and came to {start} s only, on the way from {time} to {end} s"
        );
        let source = CallError {
            function: "fmi2DoStep",
            failure: Failure::InvalidAnswer(what),
            messages: Vec::new(),
        };
        Err(call(&self.system.slaves[slave].0, start, source))
    }
}
