//! Driven variables: inputs and tunable parameters that follow a signal during the run.

use serde::{Deserialize, Serialize};

use crate::error::{SystemError, call, contradiction};
use crate::fault::FaultChain;
use crate::signal::{Cursor, Sample, Signal, earliest, near, reached, rounding};
use crate::system::{Port, System};
use fmu_description::Version;
use slave::ValueType;

/// Returns a time in s before all times that equal `time` up to rounding ([`near`]). A search from there finds the
/// jumps, kinks and starts at `time`.
pub(crate) fn just_before(time: f64) -> f64 {
    time - (10.0 * rounding(time)).max(f64::MIN_POSITIVE)
}

/// Signals and faults that act on a system during a run.
#[derive(Clone, Debug, Default)]
pub struct Scenario {
    /// Driven variables.
    pub drives: Drives,
    /// Faults on connections: the chain of each input that has faults. A fault acts on the value after the
    /// transformation of the connection.
    pub faults: Vec<(Port, FaultChain)>,
}

impl Scenario {
    /// Limits the faults of Integers to the range of their inputs.
    pub(crate) fn limit_faults(&mut self, system: &System) {
        for (input, faults) in &mut self.faults {
            let version = system.slaves[input.slave].1.description().version();
            let kind = DriveKind::of(&system.variable(*input).kind, version, false);
            if let DriveKind::Integer { least, largest } = kind {
                faults.limit_integers(least, largest);
            }
        }
    }
}

/// Type of a driven variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// Real.
    Real {
        /// Whether the variable is a continuous input of an FMU that takes input derivatives.
        derivatives: bool,
    },
    /// Integer of any width, or Enumeration.
    Integer {
        /// Smallest value of the type.
        least: i64,
        /// Largest value of the type, at most `i64::MAX`.
        largest: i64,
    },
    /// Boolean: 0 is false.
    Boolean,
    /// Triggered input clock: ticks where the signal jumps to another value than 0.
    Clock,
    /// String: the value of the signal is an index into the texts of the drive.
    String,
}

/// A variable that follows a signal.
#[derive(Clone, Debug)]
pub struct Drive {
    port: Port,
    reference: u32,
    pub(crate) kind: DriveKind,
    source: DriveSource,
    faults: Option<FaultChain>,
    cursor: Cursor,
    /// The sample that the FMU received last.
    written: Option<Sample>,
    /// The value of `written` at the last commit.
    accepted: Option<Sample>,
    /// The time in s of the last commit, the last final communication point.
    committed: Option<f64>,
}

impl Drive {
    /// Creates the drive of the variable at `port` with the value reference `reference` and the
    /// type `kind`.
    #[must_use]
    pub fn new(port: Port, reference: u32, kind: DriveKind, source: DriveSource) -> Self {
        let (cursor, faults) = (Cursor::default(), None);
        let (written, accepted, committed) = (None, None, None);
        Self { port, reference, kind, source, faults, cursor, written, accepted, committed }
    }

    /// Returns the port of the variable.
    #[must_use]
    pub fn port(&self) -> Port {
        self.port
    }

    /// Returns the value and the right-hand derivative at `time` in s; `None` before the start of
    /// the drive. `time` may go back to the last commit.
    pub fn sample(&mut self, time: f64) -> Option<Sample> {
        let undisturbed = self.undisturbed(time)?;
        let faults = self.faults.as_ref();
        Some(faults.map_or(undisturbed, |faults| faults.apply_sample(time, undisturbed)))
    }

    /// Returns the text for a value of [`Drive::sample`]; `None` if the variable is no String, or if
    /// there is no text of this index.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position")]
    pub fn text(&self, value: f64) -> Option<&String> {
        self.source.texts.get(value as usize)
    }

    fn undisturbed(&mut self, time: f64) -> Option<Sample> {
        let DriveSource { signal, start, .. } = &self.source;
        reached(time, *start).then(|| signal.at(time, &mut self.cursor))
    }

    /// Returns the faults with their memory in `saved`; `None` if the faults that had begun by then differ.
    pub(crate) fn resumed_faults(&self, saved: &DriveState) -> Option<FaultChain> {
        let time = saved.committed.unwrap_or(f64::NEG_INFINITY);
        let mut faults = self.faults.clone().unwrap_or_default();
        let saved = saved.faults.clone().unwrap_or_default();
        faults.resume(&saved, time).then_some(faults)
    }

    /// Puts faults between the signal and the variable.
    pub fn set_faults(&mut self, faults: FaultChain) {
        self.faults = Some(faults);
    }

    /// Whether `sample` is constant and was set before the last commit, and no other sample was set since.
    fn is_settled(&self, sample: Sample) -> bool {
        sample.slope == 0.0 && self.accepted == Some(sample) && self.written == self.accepted
    }

    /// Whether the drive starts at `time`, in s, or its signal or a fault on it jumps or has a kink there; for a clock,
    /// also whether this has happened since the last commit.
    pub(crate) fn breaks_at(&self, time: f64) -> bool {
        match (self.kind, self.committed) {
            (DriveKind::Clock, Some(last)) => self.break_between(last, time).is_some(),
            _ => self.next_break(just_before(time)).is_some_and(|next| near(next, time)),
        }
    }

    /// Whether a clock ticks at `time`, in s, or after the last commit within a step that could not end at the tick.
    fn ticks(&mut self, time: f64) -> bool {
        let mut after = self.committed.unwrap_or(just_before(time));
        while let Some(next) = self.break_between(after, time) {
            if self.sample(next).is_some_and(|sample| sample.value != 0.0) {
                return true;
            }
            after = next;
        }
        false
    }

    /// Returns the first jump, kink or start after `after` and not after `time`, all in s.
    fn break_between(&self, after: f64, time: f64) -> Option<f64> {
        self.next_break(after).filter(|next| reached(time, *next))
    }

    fn next_break(&self, after: f64) -> Option<f64> {
        let DriveSource { signal, start, .. } = &self.source;
        let start = earliest(after, Some(*start).filter(|start| start.is_finite()));
        let signal = signal.next_break(after);
        let faults = self.faults.as_ref().and_then(|faults| faults.next_break(after));
        [start, signal, faults].into_iter().flatten().reduce(f64::min)
    }
}

/// The signal that a variable follows, and the start time before which the variable keeps its start value.
#[derive(Clone, Debug)]
pub struct DriveSource {
    /// The signal.
    pub signal: Signal,
    /// Start time in s, before which the variable keeps its start value; minus infinity: the whole run.
    pub start: f64,
    /// The texts that the values of the signal index, if the variable is a String.
    pub texts: Vec<String>,
}

/// The state of a [`Drive`] in a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveState {
    faults: Option<FaultChain>,
    accepted: Option<Sample>,
    committed: Option<f64>,
}

/// All driven variables of a system. Only the constructor allocates.
#[derive(Clone, Debug, Default)]
pub struct Drives {
    /// The drives, sorted by slave and type.
    all: Vec<Drive>,
    /// Start and end index of the drives of each slave and type.
    groups: Vec<(usize, usize)>,
    references: Vec<u32>,
    reals: Vec<f64>,
    integers: Vec<i64>,
    booleans: Vec<i32>,
    derived: Vec<u32>,
    orders: Vec<i32>,
    slopes: Vec<f64>,
}

impl Drives {
    /// Creates the collection from `drives`, which have different ports.
    #[must_use]
    pub fn new(mut drives: Vec<Drive>) -> Self {
        let key = |drive: &Drive| (drive.port.slave, rank(drive.kind));
        drives.sort_by_key(key);
        let mut groups: Vec<(usize, usize)> = Vec::new();
        for (position, drive) in drives.iter().enumerate() {
            match groups.last_mut() {
                Some((start, end)) if key(&drives[*start]) == key(drive) => *end = position + 1,
                _ => groups.push((position, position + 1)),
            }
        }
        let longest = groups.iter().map(|(start, end)| end - start).max().unwrap_or(0);
        Self {
            all: drives,
            groups,
            references: Vec::with_capacity(longest),
            reals: Vec::with_capacity(longest),
            integers: Vec::with_capacity(longest),
            booleans: Vec::with_capacity(longest),
            derived: Vec::with_capacity(longest),
            orders: Vec::with_capacity(longest),
            slopes: Vec::with_capacity(longest),
        }
    }

    /// Iterates over the drives.
    pub fn iter(&self) -> impl Iterator<Item = &Drive> {
        self.all.iter()
    }

    /// Iterates mutably over the drives, so that the caller can sample them.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Drive> {
        self.all.iter_mut()
    }

    /// Whether there is no driven variable.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Sets every driven variable but clocks at `time` in s, before the step that starts there: the value and, if the
    /// FMU takes derivatives, the derivative. Skips values that the FMU already holds, and drives that have not
    /// started.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a value.
    pub fn write(&mut self, system: &mut System, time: f64) -> Result<(), SystemError> {
        self.write_to(system, time, |_| true)
    }

    /// Makes driven clocks of `slave` tick, in event mode: clocks whose signal starts with a value other than 0, or has
    /// jumped to such a value between the last commit and `time`, in s.
    pub(crate) fn tick(
        &mut self,
        system: &mut System,
        slave: usize,
        time: f64,
    ) -> Result<(), SystemError> {
        let is_clock_of_slave =
            |drive: &&mut Drive| drive.kind == DriveKind::Clock && drive.port.slave == slave;
        for drive in self.all.iter_mut().filter(is_clock_of_slave) {
            let Some(sample) = drive.sample(time) else { continue };
            let starts = drive.written.is_none() && sample.value != 0.0;
            if starts || drive.ticks(time) {
                let clock = [drive.reference];
                system.perform(slave, time, |instance| instance.set_boolean(&clock, &[1]))?;
            }
            drive.written = Some(sample);
        }
        Ok(())
    }

    /// As [`Drives::write`], for the slaves for which `is_chosen` is true.
    pub(crate) fn write_to(
        &mut self,
        system: &mut System,
        time: f64,
        is_chosen: impl Fn(usize) -> bool,
    ) -> Result<(), SystemError> {
        for group in 0..self.groups.len() {
            let (start, end) = self.groups[group];
            if self.all[start].kind == DriveKind::Clock || !is_chosen(self.all[start].port.slave) {
                continue;
            }
            self.write_group(system, start, end, time).map_err(|source| {
                call(&system.slaves[self.all[start].port.slave].0, time, source)
            })?;
        }
        Ok(())
    }

    fn write_group(
        &mut self,
        system: &mut System,
        start: usize,
        end: usize,
        time: f64,
    ) -> Result<(), slave::CallError> {
        self.clear();
        let kind = self.all[start].kind;
        let slave = &mut system.slaves[self.all[start].port.slave].1;
        for drive in &mut self.all[start..end] {
            let Some(sample) = drive.sample(time) else { continue };
            if drive.is_settled(sample) {
                continue;
            }
            drive.written = Some(sample);
            self.references.push(drive.reference);
            match drive.kind {
                DriveKind::Real { derivatives } => {
                    self.reals.push(sample.value);
                    if derivatives {
                        self.derived.push(drive.reference);
                        self.orders.push(1);
                        self.slopes.push(sample.slope);
                    }
                }
                DriveKind::Integer { least, largest } => {
                    self.integers.push(integer(sample.value, least, largest));
                }
                DriveKind::Boolean => self.booleans.push(i32::from(sample.value != 0.0)),
                DriveKind::Clock => {}
                DriveKind::String => {
                    if let Some(text) = drive.text(sample.value) {
                        slave.set_string(&[drive.reference], std::slice::from_ref(text))?;
                    }
                }
            }
        }
        if self.references.is_empty() {
            return Ok(());
        }
        match kind {
            DriveKind::Real { .. } => slave.set_real(&self.references, &self.reals)?,
            DriveKind::Integer { .. } => slave.set_integer(&self.references, &self.integers)?,
            DriveKind::Boolean => slave.set_boolean(&self.references, &self.booleans)?,
            DriveKind::Clock | DriveKind::String => {}
        }
        if !self.derived.is_empty() {
            slave.set_input_derivatives(&self.derived, &self.orders, &self.slopes)?;
        }
        Ok(())
    }

    fn clear(&mut self) {
        self.references.clear();
        self.reals.clear();
        self.integers.clear();
        self.booleans.clear();
        self.derived.clear();
        self.orders.clear();
        self.slopes.clear();
    }

    /// Records that the communication point `time`, in s, is final.
    #[inline]
    pub fn commit(&mut self, time: f64) {
        for drive in &mut self.all {
            (drive.accepted, drive.committed) = (drive.written, Some(time));
            let value = drive.undisturbed(time).map(|sample| sample.value);
            if let (Some(faults), Some(value)) = (&mut drive.faults, value) {
                faults.commit(time, value);
            }
        }
    }

    /// Returns the first time after `after`, both in s, at which a drive starts, or a signal or a fault
    /// on it jumps or has a kink; a step should end there.
    #[must_use]
    pub fn next_break(&self, after: f64) -> Option<f64> {
        self.all.iter().filter_map(|drive| drive.next_break(after)).reduce(f64::min)
    }

    /// Takes over the state of the drives of `earlier`. Returns false if a variable of `earlier` is not
    /// driven here, or if its faults in `earlier` are not its first faults here.
    pub(crate) fn inherit(&mut self, earlier: &Self) -> bool {
        earlier.all.iter().all(|old| {
            let Some(new) = self.all.iter_mut().find(|new| new.port == old.port) else {
                return false;
            };
            (new.written, new.accepted) = (old.written, old.accepted);
            new.committed = old.committed;
            match (&mut new.faults, &old.faults) {
                (_, None) => true,
                (Some(new), Some(old)) => new.inherit(old),
                (None, Some(_)) => false,
            }
        })
    }

    /// Returns the states of all drives for a checkpoint, in the order of the drives.
    #[must_use]
    pub fn state(&self) -> Vec<DriveState> {
        let state = |drive: &Drive| DriveState {
            faults: drive.faults.clone(),
            accepted: drive.accepted,
            committed: drive.committed,
        };
        self.all.iter().map(state).collect()
    }

    /// Restores the state of a checkpoint, at a communication point.
    ///
    /// # Errors
    ///
    /// Returns an error if the checkpoint has another number of driven variables, or if faults differ that had begun.
    pub fn restore(&mut self, state: Vec<DriveState>) -> Result<(), SystemError> {
        let (expected, actual) = (self.all.len(), state.len());
        if actual != expected {
            return Err(contradiction(format!(
                "the checkpoint is of {actual} driven variables, expected {expected} as in the scenario"
            )));
        }
        for (drive, saved) in self.all.iter_mut().zip(state) {
            let faults = drive.resumed_faults(&saved).ok_or_else(|| {
                contradiction("the checkpoint has other faults of a driven variable, which began")
            })?;
            let DriveState { accepted, committed, .. } = saved;
            drive.faults = Some(faults).filter(|faults| !faults.is_empty());
            drive.committed = committed;
            drive.cursor = Cursor::default();
            (drive.written, drive.accepted) = (accepted, accepted);
        }
        Ok(())
    }
}

/// Returns the sort key of a type.
fn rank(kind: DriveKind) -> u8 {
    match kind {
        DriveKind::Real { .. } => 0,
        DriveKind::Integer { .. } => 1,
        DriveKind::Boolean => 2,
        DriveKind::String => 3,
        DriveKind::Clock => 4,
    }
}

/// Rounds the value of a signal to an integer from `least` to `largest`.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(crate) fn integer(value: f64, least: i64, largest: i64) -> i64 {
    (value.round() as i64).clamp(least, largest)
}

impl DriveKind {
    /// Returns the type of a variable of an FMU of this version of FMI; a binary counts as a String.
    /// `derivatives` applies to Reals only.
    #[must_use]
    pub fn of(kind: &fmu_description::Kind, version: Version, derivatives: bool) -> Self {
        let range = kind.integer_range(version).unwrap_or(0..=0);
        let least = i64::try_from(*range.start()).unwrap_or(i64::MIN);
        let largest = i64::try_from(*range.end()).unwrap_or(i64::MAX);
        match ValueType::of(kind) {
            _ if matches!(kind, fmu_description::Kind::Clock(_)) => Self::Clock,
            ValueType::Real => Self::Real { derivatives },
            ValueType::Integer => Self::Integer { least, largest },
            ValueType::Boolean => Self::Boolean,
            ValueType::String | ValueType::Binary => Self::String,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Drive, DriveKind, DriveSource};
    use crate::signal::{Interpolation, Signal, Track};
    use crate::system::Port;

    #[test]
    fn a_tick_is_a_break_also_at_time_zero() {
        let times = [-1.0, 0.0, 1e-9, 2.0];
        let track = Track::new(times.into(), [1.0; 4].into(), Interpolation::Points).unwrap();
        let (signal, start) = (Signal::Track(track), f64::NEG_INFINITY);
        let source = DriveSource { signal, start, texts: Vec::new() };
        let drive = Drive::new(Port { slave: 0, variable: 0 }, 0, DriveKind::Clock, source);
        assert!(times.into_iter().all(|time| drive.breaks_at(time)));
        assert!([-0.5, 5e-10, 1.0].into_iter().all(|time| !drive.breaks_at(time)));
    }
}
