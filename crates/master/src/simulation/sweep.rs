//! One step of all slaves, side by side or one after the other.

use super::Simulation;
use super::grid::size_between;
use super::parallel::{Parallel, run};
use crate::algorithm::Method;
use crate::error::SystemError;
use crate::exchange::call;
use crate::order::Order;
use crate::system::System;
use slave::{CallError, Failure, StepResult};

/// Most attempts of a slave to come to the end of a step that it makes in parts.
const PARTS: u32 = 1000;
/// Part of a step that may be missing at its end: the rounding of times.
const ROUNDING: f64 = 1e-9;

/// What helps where a slave does not go on after `fmi2Discard`.
const ADVICE: &str = "the step before it was discarded; with rollback all FMUs repeat it";

/// How a sweep ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swept {
    /// The slave that wants the simulation to end, and when.
    pub(super) terminated: Option<(usize, f64)>,
    /// Until when every slave could go; none: to the end of the step.
    pub(super) reached: Option<f64>,
}

/// The slaves in groups, to be stepped one after the other; within a group all inputs are taken
/// before the first step.
pub(super) struct Groups {
    pub(super) sequence: Vec<usize>,
    /// Where each group begins in `sequence`, and the end of the last.
    begins: Vec<usize>,
}

impl Groups {
    /// Jacobi: all slaves are one group, but for functions, which come after them one by one.
    /// Gauss-Seidel: neighbours in the order of stepping are one
    /// where none is connected to another, as then it makes no difference.
    pub(super) fn new(system: &System, sweep: Method, order: &Order) -> Self {
        let count = system.slaves.len();
        if sweep == Method::Jacobi {
            let is_function = |slave: &usize| system.slaves[*slave].1.is_function();
            let mut sequence: Vec<usize> = (0..count).filter(|slave| !is_function(slave)).collect();
            let first = sequence.len();
            sequence.extend(order.sequence.iter().copied().filter(is_function));
            let begins = [0].into_iter().chain(first..=count).collect();
            return Self { sequence, begins };
        }
        let mut neighbours = vec![Vec::new(); count];
        for connection in &system.connections {
            let (from, to) = (connection.from.slave, connection.to.slave);
            neighbours[from].push(to);
            neighbours[to].push(from);
        }
        let mut begins = vec![0];
        // The group that a slave cannot be in.
        let mut excluded_from = vec![usize::MAX; count];
        for (position, &slave) in order.sequence.iter().enumerate() {
            if excluded_from[slave] == begins.len() {
                begins.push(position);
            }
            for &neighbour in &neighbours[slave] {
                excluded_from[neighbour] = begins.len();
            }
        }
        begins.push(count);
        Self { sequence: order.sequence.clone(), begins }
    }

    pub(super) fn len(&self) -> usize {
        self.begins.len() - 1
    }
}

impl Simulation {
    /// Steps all slaves from `time` over `size`. With `never_back` a slave that stops on the way
    /// (`fmi2Discard`) goes on from there by itself; otherwise the step is left as it is, to be repeated.
    pub(super) fn sweep(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<Swept, SystemError> {
        if !self.drives.is_empty() {
            self.drives.write(&mut self.system, time)?;
        }
        if self.passes {
            return self.pass(time, size, never_back);
        }
        self.step_groups(time, size, never_back)
    }

    /// A sweep group by group. Apart from [`Simulation::pass`], whose loop is to stay small.
    #[inline(never)]
    fn step_groups(
        &mut self,
        time: f64,
        size: f64,
        never_back: bool,
    ) -> Result<Swept, SystemError> {
        let mut swept = Swept::default();
        for slave in 0..self.multiples.len() {
            self.sizes[slave] = match self.multiples[slave] {
                1 => size,
                _ if self.exchange.reals.is_beyond(slave, time) => 0.0,
                multiple => self.grid.size_of(multiple, time),
            };
            if self.sizes[slave] > 0.0 {
                self.exchange.shift(slave, time, self.sizes[slave]);
            }
        }
        for group in 0..self.groups.len() {
            let (begin, end) = (self.groups.begins[group], self.groups.begins[group + 1]);
            for position in begin..end {
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
            self.advance_members(begin..end, time, never_back, &mut swept)?;
        }
        Ok(swept)
    }

    /// One step of a group, in threads if that has been found to be faster.
    #[cold]
    fn side_by_side(
        &mut self,
        parallel: &mut Parallel,
        group: usize,
        (time, never_back): (f64, bool),
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let (begin, end) = (self.groups.begins[group], self.groups.begins[group + 1]);
        let in_threads = end - begin > 1 && parallel.in_threads(group);
        parallel.measure(group, |pool| {
            let members = begin..end;
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

    /// Jacobi's method with held inputs and nothing but Reals: one pass over the slaves.
    fn pass(&mut self, time: f64, size: f64, never_back: bool) -> Result<Swept, SystemError> {
        let mut swept = Swept::default();
        let parts = self.exchange.reals.pass(&mut self.system, (time, size), never_back)?;
        if !parts.is_empty() {
            for (slave, done) in std::mem::take(parts) {
                self.in_parts(slave, (time, size), done, never_back, &mut swept)?;
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
        swept: &mut Swept,
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
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let size = self.sizes[slave];
        if done != StepResult::Whole {
            self.in_parts(slave, (time, size), done, never_back, swept)?;
        }
        self.exchange.check_finite(&self.system, slave, time + size)
    }

    /// A slave made a part of its step.
    #[cold]
    fn in_parts(
        &mut self,
        slave: usize,
        (time, size): (f64, f64),
        mut done: StepResult,
        never_back: bool,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let end = time + size;
        let mut begin = time;
        for _ in 0..PARTS {
            let StepResult::Part { reached, terminated } = done else {
                return self.exchange.read(&mut self.system, slave, end);
            };
            if terminated {
                swept.terminated = Some((slave, reached));
                return Ok(());
            }
            if reached <= begin {
                break;
            }
            if reached >= end - ROUNDING * size {
                return self.exchange.read(&mut self.system, slave, end);
            }
            if !never_back {
                swept.reached = Some(swept.reached.map_or(reached, |least| least.min(reached)));
                return Ok(());
            }
            begin = reached;
            let (name, instance) = &mut self.system.slaves[slave];
            done =
                instance.do_step(begin, size_between(begin, end), true).map_err(|mut source| {
                    source.messages.push(ADVICE.to_owned());
                    call(name, begin, source)
                })?;
        }
        let what = format!(
            "returned fmi2Discard and came to {begin} s only, on the way from {time} to {end} s"
        );
        let source = CallError {
            function: "fmi2DoStep",
            failure: Failure::InvalidAnswer(what),
            messages: Vec::new(),
        };
        Err(call(&self.system.slaves[slave].0, begin, source))
    }
}
