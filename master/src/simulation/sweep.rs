//! One step of all slaves, side by side or one after the other.

use super::Simulation;
use crate::algorithm::Sweep;
use crate::error::SystemError;
use crate::exchange::call;
use crate::slave::{CallError, Failure, Stepped};

/// Most attempts of a slave to come to the end of a step that it makes in parts.
const PARTS: u32 = 1000;

/// How a sweep ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swept {
    /// The slave that wants the simulation to end, and when.
    pub(super) terminated: Option<(usize, f64)>,
    /// Until when every slave could go; none: to the end of the step.
    pub(super) reached: Option<f64>,
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
        let mut swept = Swept::default();
        for slave in 0..self.due.len() {
            if self.due[slave] {
                self.exchange.shift(slave, time, size);
            }
        }
        if self.algorithm.sweep == Sweep::Jacobi {
            for slave in 0..self.due.len() {
                self.exchange.gather(slave, time, size);
            }
            for slave in 0..self.due.len() {
                self.advance(slave, (time, size), never_back, &mut swept)?;
            }
        } else {
            for position in 0..self.order.sequence.len() {
                let slave = self.order.sequence[position];
                self.exchange.gather(slave, time, size);
                self.advance(slave, (time, size), never_back, &mut swept)?;
            }
        }
        Ok(swept)
    }

    #[inline]
    fn advance(
        &mut self,
        slave: usize,
        (time, size): (f64, f64),
        never_back: bool,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let done = self.exchange.advance(&mut self.system, slave, (time, size), never_back)?;
        if done != Stepped::Whole {
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
        mut done: Stepped,
        never_back: bool,
        swept: &mut Swept,
    ) -> Result<(), SystemError> {
        let end = time + size;
        let mut begin = time;
        for _ in 0..PARTS {
            let Stepped::Part { reached, terminated } = done else {
                return self.exchange.read(&mut self.system, slave, end);
            };
            if terminated {
                swept.terminated = Some((slave, reached));
                return Ok(());
            }
            if !never_back {
                swept.reached = Some(swept.reached.map_or(reached, |least| least.min(reached)));
                return Ok(());
            }
            if reached <= begin {
                break;
            }
            begin = reached;
            let (name, instance) = &mut self.system.slaves[slave];
            done = instance
                .do_step(begin, end - begin, true)
                .map_err(|source| call(name, begin, source))?;
        }
        let what = format!(
            "returned fmi2Discard again and again on the way from {time} to {end} s, and came to {begin} s"
        );
        let source = CallError {
            function: "fmi2DoStep",
            failure: Failure::Nonsense(what),
            messages: Vec::new(),
        };
        Err(call(&self.system.slaves[slave].0, begin, source))
    }
}
