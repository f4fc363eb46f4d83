//! Values on their way from outputs to inputs, in arrays laid out once: stepping allocates nothing.

mod discrete;
mod extrapolation;
mod faulty;
mod layout;
mod multirate;
mod pass;
mod reals;
mod repeat;
mod start;
mod tasks;
mod trace;

use fmu_description::Kind;
use serde::{Deserialize, Serialize};

use crate::algorithm::Algorithm;
use crate::error::SystemError;
use crate::fault::FaultChain;
use crate::simulation::Task;
use crate::system::{Port, System};
use discrete::{BOOLEANS, Channel, INTEGERS, STRINGS};
pub(crate) use layout::Refusal;
pub(crate) use reals::{Reals, Trace};
use slave::{CallError, Slave, StepResult};

/// The connections of a system, ready to be carried out.
pub(crate) struct Exchange {
    pub(crate) reals: Reals,
    integers: Channel<i32>,
    booleans: Channel<i32>,
    strings: Channel<String>,
    /// Whether there are connections of other types than Real.
    discrete: bool,
    allow_nan: bool,
    /// Whether there are faults on connections.
    faulty: bool,
}

/// All values on their way: what is kept to repeat a step or to go on later.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Values {
    reals: Trace,
    integers: Vec<i32>,
    booleans: Vec<i32>,
    strings: Vec<String>,
    /// Values at the begins of the last steps.
    begin_integers: Vec<i32>,
    begin_booleans: Vec<i32>,
    begin_strings: Vec<String>,
}

impl Values {
    /// Whether these are values of a system with as many connected variables.
    pub(crate) fn has_shape_of(&self, other: &Self) -> bool {
        self.reals.has_shape_of(&other.reals)
            && self.integers.len() == other.integers.len()
            && self.booleans.len() == other.booleans.len()
            && self.strings.len() == other.strings.len()
    }
}

impl Exchange {
    /// The connections of `system`; slaves that are `refusing` derivatives do without them.
    pub(crate) fn new(system: &System, algorithm: &Algorithm, refusing: &[Refusal]) -> Self {
        let reals = Reals::new(system, algorithm, refusing);
        let to_reals = reals.integer_sources().iter().map(|(port, _)| *port);
        let is_integer = |kind: &Kind| matches!(kind, Kind::Integer(_) | Kind::Enumeration(_));
        let integers = Channel::new(system, INTEGERS, is_integer, to_reals);
        let is_boolean = |kind: &Kind| matches!(kind, Kind::Boolean(_));
        let booleans = Channel::new(system, BOOLEANS, is_boolean, std::iter::empty());
        let is_string = |kind: &Kind| matches!(kind, Kind::String(_));
        let strings = Channel::new(system, STRINGS, is_string, std::iter::empty());
        let discrete = !(integers.latest.is_empty()
            && booleans.latest.is_empty()
            && strings.latest.is_empty());
        let allow_nan = algorithm.allow_nan;
        Self { reals, integers, booleans, strings, discrete, allow_nan, faulty: false }
    }

    /// Puts faults on connections, by their inputs.
    pub(crate) fn set_faults(
        &mut self,
        system: &System,
        faults: &[(Port, FaultChain)],
    ) -> Result<(), SystemError> {
        for (input, fault) in faults {
            let set = self.reals.set_fault(*input, fault)
                || self.integers.set_fault(*input, fault)
                || self.booleans.set_fault(*input, fault);
            if !set {
                let what = format!(
                    "{} has a fault, expected a connected input that is no String",
                    system.name(*input)
                );
                return Err(SystemError::Algorithm { what });
            }
        }
        self.faulty = !faults.is_empty();
        Ok(())
    }

    /// The communication point `time` is reached for good.
    #[inline]
    pub(crate) fn commit(&mut self, time: f64) {
        if self.faulty {
            self.reals.commit(time);
            let ahead = |slave| self.reals.is_beyond(slave, time);
            self.integers.commit(time, ahead);
            self.booleans.commit(time, ahead);
        }
    }

    /// The first time past `after`, both in s, at which a fault on a connection begins or ends.
    pub(crate) fn next_break(&self, after: f64) -> Option<f64> {
        if !self.faulty {
            return None;
        }
        let breaks = [
            self.reals.next_break(after),
            self.integers.next_break(after),
            self.booleans.next_break(after),
        ];
        breaks.into_iter().flatten().reduce(f64::min)
    }

    /// The faults, for a checkpoint.
    pub(crate) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.reals.faults().chain(self.integers.faults()).chain(self.booleans.faults())
    }

    /// Before a step of `slave` from `time` over `size`: what it reached is where it begins.
    pub(crate) fn shift(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.shift(slave, time, size);
        if self.discrete && self.reals.several {
            self.integers.shift(slave);
            self.booleans.shift(slave);
            self.strings.shift(slave);
        }
    }

    /// The inputs of `slave` for a step from `time` over `size`.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.gather(slave, time, size);
        if self.discrete {
            let ahead = |source| {
                self.reals.is_beyond(source, self.reals.seen_at(slave, source, time, size))
            };
            self.integers.gather(slave, time, ahead);
            self.booleans.gather(slave, time, ahead);
            self.strings.gather(slave, time, ahead);
        }
    }

    /// Sets the gathered inputs of the slave at `position`, steps it and reads its outputs.
    #[inline]
    pub(crate) fn advance(
        &mut self,
        system: &mut System,
        position: usize,
        (time, size): (f64, f64),
        never_back: bool,
    ) -> Result<StepResult, SystemError> {
        let (name, slave) = &mut system.slaves[position];
        let slave = slave.as_mut();
        if self.discrete {
            self.set_discrete(position, slave).map_err(|source| call(name, time, source))?;
        }
        let done = self.reals.advance(position, slave, (time, size), never_back);
        let done = done.map_err(|source| call(name, time, source))?;
        if self.discrete {
            self.read_discrete(position, slave).map_err(|source| call(name, time, source))?;
        }
        Ok(done)
    }

    /// The first half of [`Exchange::advance`] of a slave in the background; nothing for another.
    pub(crate) fn begin(
        &mut self,
        system: &mut System,
        position: usize,
        (time, size): (f64, f64),
        never_back: bool,
    ) -> Result<(), SystemError> {
        let (name, slave) = &mut system.slaves[position];
        if slave.in_background().is_none() {
            return Ok(());
        }
        let set = self.set_discrete(position, slave.as_mut());
        set.and_then(|()| match slave.in_background() {
            Some(slave) => {
                slave.begin_advance(&self.reals.step(position, (time, size), never_back))
            }
            None => Ok(()),
        })
        .map_err(|source| call(name, time, source))
    }

    /// The second half of [`Exchange::advance`] of a slave in the background; all of it for another.
    pub(crate) fn finish(
        &mut self,
        system: &mut System,
        position: usize,
        (time, size): (f64, f64),
        never_back: bool,
    ) -> Result<StepResult, SystemError> {
        let (name, slave) = &mut system.slaves[position];
        if slave.in_background().is_none() {
            return self.advance(system, position, (time, size), never_back);
        }
        let done = self.reals.finish(position, slave.as_mut(), (time, size), never_back);
        done.and_then(|done| self.read_discrete(position, slave.as_mut()).map(|()| done))
            .map_err(|source| call(name, time, source))
    }

    /// As [`Exchange::advance`] for several slaves at once: `run` makes the steps of those that can
    /// be stepped in another thread. Each slave's step is the time and the size that `span` gives.
    pub(crate) fn advance_all(
        &mut self,
        system: &mut System,
        slaves: &[usize],
        span: &dyn Fn(usize) -> (f64, f64),
        never_back: bool,
        run: impl FnOnce(&mut [Task<'_>]),
    ) -> Result<Vec<StepResult>, SystemError> {
        for &position in slaves {
            let (name, slave) = &mut system.slaves[position];
            self.set_discrete(position, slave.as_mut())
                .map_err(|source| call(name, span(position).0, source))?;
        }
        let results = self.reals.advance_all(system, slaves, span, never_back, run);
        let mut done = Vec::with_capacity(slaves.len());
        for (&position, result) in slaves.iter().zip(results) {
            let (name, slave) = &mut system.slaves[position];
            let at = |source| call(name, span(position).0, source);
            done.push(result.map_err(at)?);
            self.read_discrete(position, slave.as_mut()).map_err(at)?;
        }
        Ok(done)
    }

    /// Whether [`Exchange::pass`] does all that a sweep takes.
    pub(crate) fn passes(&self) -> bool {
        !self.discrete && self.reals.passes()
    }

    fn set_discrete(&self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        self.integers.set(position, slave)?;
        self.booleans.set(position, slave)?;
        self.strings.set(position, slave)
    }

    fn read_discrete(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        self.integers.read(position, slave)?;
        self.booleans.read(position, slave)?;
        self.strings.read(position, slave)?;
        self.take_over_integers();
        Ok(())
    }

    /// Integers that go to Reals.
    fn take_over_integers(&mut self) {
        for k in 0..self.reals.integer_sources().len() {
            let (port, output) = self.reals.integer_sources()[k];
            if let Some(&value) = self.integers.value(port) {
                self.reals.outputs_mut()[output] = f64::from(value);
            }
        }
    }

    /// Reads all connected outputs of the slave at `position`, with derivatives.
    pub(crate) fn read(
        &mut self,
        system: &mut System,
        position: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        let (name, slave) = &mut system.slaves[position];
        let done = self.reals.read(position, slave.as_mut());
        done.and_then(|()| self.read_discrete(position, slave.as_mut()))
            .map_err(|source| call(name, time, source))?;
        self.check_finite(system, position, time)
    }

    /// Every connected Real output of the slave is a finite number; a derivative that is not is
    /// reported once.
    #[inline]
    pub(crate) fn check_finite(
        &mut self,
        system: &System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        if !self.reals.derivatives_are_finite(slave) {
            self.report_derivatives(system, slave, time);
        }
        self.refuse(system, time, || self.reals.not_finite(slave))
    }

    /// Names the outputs of the slave whose derivatives are not finite for the first time.
    #[cold]
    fn report_derivatives(&mut self, system: &System, slave: usize, time: f64) {
        while let Some((port, value)) = self.reals.report_derivative(slave) {
            let name = system.name(port);
            tracing::warn!(
                "{name}: its output derivative (fmi2GetRealOutputDerivatives) is {value} at \
                 t = {time} s; connections from {name} are held while it is not finite"
            );
        }
    }

    /// What connections and faults make of outputs for the gathered inputs of the slave is finite.
    #[inline]
    pub(crate) fn check_inputs(
        &self,
        system: &System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        self.refuse(system, time, || self.reals.input_not_finite(slave))
    }

    /// The error of the value that `wrong` finds, unless any value will do.
    #[inline]
    fn refuse(
        &self,
        system: &System,
        time: f64,
        wrong: impl FnOnce() -> Option<(Port, f64)>,
    ) -> Result<(), SystemError> {
        if self.allow_nan {
            return Ok(());
        }
        match wrong() {
            None => Ok(()),
            Some((port, value)) => {
                Err(SystemError::NotFinite { name: system.name(port), value, time })
            }
        }
    }

    /// Keeps all values in `values`.
    pub(crate) fn save(&self, values: &mut Values) {
        values.reals.copy(&self.reals.trace);
        values.integers.clone_from(&self.integers.latest);
        values.booleans.clone_from(&self.booleans.latest);
        values.strings.clone_from(&self.strings.latest);
        values.begin_integers.clone_from(&self.integers.begin);
        values.begin_booleans.clone_from(&self.booleans.begin);
        values.begin_strings.clone_from(&self.strings.begin);
    }

    /// Back to the values kept.
    pub(crate) fn restore(&mut self, values: &Values) {
        self.reals.trace.copy(&values.reals);
        self.integers.latest.clone_from(&values.integers);
        self.booleans.latest.clone_from(&values.booleans);
        self.strings.latest.clone_from(&values.strings);
        self.integers.begin.clone_from(&values.begin_integers);
        self.booleans.begin.clone_from(&values.begin_booleans);
        self.strings.begin.clone_from(&values.begin_strings);
    }
}

/// The error of a call of `slave` at `time`.
#[cold]
pub(crate) fn call(slave: &str, time: f64, source: CallError) -> SystemError {
    SystemError::Call { slave: slave.to_owned(), time, source }
}
