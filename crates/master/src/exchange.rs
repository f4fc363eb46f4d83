//! Exchange of connected values: gathers the inputs of a slave, steps the slave, reads its outputs.
//!
//! The arrays are laid out once, so that stepping allocates nothing. For each step of a slave,
//! [`Exchange::shift`] makes the last end values the start values, [`Exchange::gather`] computes
//! the inputs (extrapolation, transformation, fault), and [`Exchange::advance`] sets them, calls
//! `fmi2DoStep` and reads the outputs.

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

use fmu_description::number::seconds;
use serde::{Deserialize, Serialize};

use crate::algorithm::Algorithm;
use crate::engine::Task;
use crate::error::SystemError;
use crate::fault::FaultChain;
use crate::system::{Port, System};
use discrete::{BINARIES, BOOLEANS, Channel, INTEGERS, STRINGS};
pub(crate) use layout::Refusal;
pub(crate) use reals::{Reals, Trace};
use slave::{CallError, Slave, StepResult, ValueType};

/// All connections of a system with the current values of their outputs.
pub(crate) struct Exchange {
    pub(crate) reals: Reals,
    integers: Channel<i64>,
    booleans: Channel<i32>,
    strings: Channel<String>,
    binaries: Channel<Vec<u8>>,
    /// Whether there are connections of types other than Real.
    discrete: bool,
    allow_nan: bool,
    /// Whether any connection has a fault.
    faulty: bool,
}

/// The values of all connected outputs, saved to repeat a step or for a checkpoint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Values {
    reals: Trace,
    integers: Vec<i64>,
    booleans: Vec<i32>,
    strings: Vec<String>,
    binaries: Vec<Vec<u8>>,
    /// Values at the start of the last steps.
    start_integers: Vec<i64>,
    start_booleans: Vec<i32>,
    start_strings: Vec<String>,
    start_binaries: Vec<Vec<u8>>,
}

impl Values {
    /// Whether both belong to systems with equal numbers of connected variables.
    pub(crate) fn has_shape_of(&self, other: &Self) -> bool {
        self.reals.has_shape_of(&other.reals)
            && self.integers.len() == other.integers.len()
            && self.booleans.len() == other.booleans.len()
            && self.strings.len() == other.strings.len()
            && self.binaries.len() == other.binaries.len()
    }
}

impl Exchange {
    /// Lays out the connections of `system`. `refusing` lists for each slave the derivatives that
    /// it refuses.
    pub(crate) fn new(system: &System, algorithm: &Algorithm, refusing: &[Refusal]) -> Self {
        let reals = Reals::new(system, algorithm, refusing);
        let to_reals = reals.integer_sources().iter().map(|(port, _)| *port);
        let none = std::iter::empty;
        let integers = Channel::new(system, INTEGERS, ValueType::Integer, to_reals);
        let booleans = Channel::new(system, BOOLEANS, ValueType::Boolean, none());
        let strings = Channel::new(system, STRINGS, ValueType::String, none());
        let binaries = Channel::new(system, BINARIES, ValueType::Binary, none());
        let discrete = !(integers.latest.is_empty()
            && booleans.latest.is_empty()
            && strings.latest.is_empty()
            && binaries.latest.is_empty());
        let allow_nan = algorithm.allow_nan;
        Self { reals, integers, booleans, strings, binaries, discrete, allow_nan, faulty: false }
    }

    /// Puts faults on connections; each fault is given with the input of its connection.
    ///
    /// # Errors
    ///
    /// Returns an error if an input has no connection or is a String.
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

    /// Returns the faults on the connection to an input.
    pub(crate) fn fault(&self, input: Port) -> Option<&FaultChain> {
        let reals = self.reals.fault(input);
        reals.or_else(|| self.integers.fault(input)).or_else(|| self.booleans.fault(input))
    }

    /// Records the undisturbed values in the faults; the communication point `time` is final.
    #[inline]
    pub(crate) fn commit(&mut self, time: f64) {
        if self.faulty {
            self.reals.commit(time);
            let ahead = |slave| self.reals.is_ahead(slave, time);
            self.integers.commit(time, ahead);
            self.booleans.commit(time, ahead);
        }
    }

    /// Returns the first time after `after`, both in s, at which a fault on a connection starts or
    /// ends.
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

    /// Iterates over all faults, for a checkpoint.
    pub(crate) fn faults(&mut self) -> impl Iterator<Item = &mut FaultChain> {
        self.reals.faults().chain(self.integers.faults()).chain(self.booleans.faults())
    }

    /// Prepares a step of `slave` from `time` over `size`: the last end values become the start
    /// values.
    pub(crate) fn shift(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.shift(slave, time, size);
        if self.discrete && self.reals.multirate {
            self.integers.shift(slave);
            self.booleans.shift(slave);
            self.strings.shift(slave);
            self.binaries.shift(slave);
        }
    }

    /// Computes the inputs of `slave` for a step from `time` over `size`.
    pub(crate) fn gather(&mut self, slave: usize, time: f64, size: f64) {
        self.reals.gather(slave, time, size);
        if self.discrete {
            let ahead = |source| {
                self.reals.is_ahead(source, self.reals.source_time(slave, source, time, size))
            };
            self.integers.gather(slave, time, ahead);
            self.booleans.gather(slave, time, ahead);
            self.strings.gather(slave, time, ahead);
            self.binaries.gather(slave, time, ahead);
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

    /// Sets the inputs of a background slave and starts its step; does nothing for other slaves.
    pub(crate) fn start(
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

    /// Waits for the step of a background slave and reads its outputs; steps any other slave with
    /// [`Exchange::advance`].
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

    /// Steps several slaves at once. `run` makes the steps that may run in another thread; `span`
    /// returns time and size of the step of each slave.
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

    /// Whether [`Reals::pass`] can make a complete sweep.
    pub(crate) fn passes(&self) -> bool {
        !self.discrete && self.reals.passes()
    }

    fn set_discrete(&self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        self.integers.set(position, slave)?;
        self.booleans.set(position, slave)?;
        self.strings.set(position, slave)?;
        self.binaries.set(position, slave)
    }

    fn read_discrete(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        self.integers.read(position, slave)?;
        self.booleans.read(position, slave)?;
        self.strings.read(position, slave)?;
        self.binaries.read(position, slave)?;
        self.copy_integers_to_reals();
        Ok(())
    }

    /// Copies Integer outputs that are connected to Real inputs.
    fn copy_integers_to_reals(&mut self) {
        for k in 0..self.reals.integer_sources().len() {
            let (port, output) = self.reals.integer_sources()[k];
            if let Some(&value) = self.integers.value(port) {
                self.reals.outputs_mut()[output] = slave::to_real(value);
            }
        }
    }

    /// Reads all connected outputs, and their derivatives, of the slave at `position`.
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

    /// Checks that every connected Real output of the slave is finite; warns once about a
    /// derivative that is not.
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
        self.check_value(system, time, || self.reals.not_finite(slave))
    }

    /// Warns about outputs of the slave whose derivative is not finite, once for each output.
    #[cold]
    fn report_derivatives(&mut self, system: &System, slave: usize, time: f64) {
        while let Some((port, value)) = self.reals.report_derivative(slave) {
            let name = system.name(port);
            tracing::warn!(
                "{name}: its output derivative (fmi2GetRealOutputDerivatives) is {value} at \
                 t = {} s; connections from {name} are held while it is not finite",
                seconds(time)
            );
        }
    }

    /// Checks that the gathered inputs of the slave are finite after transformations and faults.
    #[inline]
    pub(crate) fn check_inputs(
        &self,
        system: &System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        self.check_value(system, time, || self.reals.input_not_finite(slave))
    }

    /// Returns an error for the value that `wrong` finds, unless NaN and infinity are allowed.
    #[inline]
    fn check_value(
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

    /// Saves all values in `values`.
    pub(crate) fn save(&self, values: &mut Values) {
        values.reals.copy(&self.reals.trace);
        values.integers.clone_from(&self.integers.latest);
        values.booleans.clone_from(&self.booleans.latest);
        values.strings.clone_from(&self.strings.latest);
        values.binaries.clone_from(&self.binaries.latest);
        values.start_integers.clone_from(&self.integers.start);
        values.start_booleans.clone_from(&self.booleans.start);
        values.start_strings.clone_from(&self.strings.start);
        values.start_binaries.clone_from(&self.binaries.start);
    }

    /// Restores all values from `values`.
    pub(crate) fn restore(&mut self, values: &Values) {
        self.reals.trace.copy(&values.reals);
        self.integers.latest.clone_from(&values.integers);
        self.booleans.latest.clone_from(&values.booleans);
        self.strings.latest.clone_from(&values.strings);
        self.binaries.latest.clone_from(&values.binaries);
        self.integers.start.clone_from(&values.start_integers);
        self.booleans.start.clone_from(&values.start_booleans);
        self.strings.start.clone_from(&values.start_strings);
        self.binaries.start.clone_from(&values.start_binaries);
    }
}

/// Wraps the error of an FMI call of `slave` at `time`.
#[cold]
pub(crate) fn call(slave: &str, time: f64, source: CallError) -> SystemError {
    SystemError::Call { slave: slave.to_owned(), time, source }
}
