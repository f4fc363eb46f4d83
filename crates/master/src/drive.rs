//! Variables that follow signals while a simulation runs.

use fmu_description::Kind;
use serde::{Deserialize, Serialize};

use crate::error::SystemError;
use crate::exchange::call;
use crate::fault::FaultChain;
use crate::signal::{Cursor, Sample, Signal, earliest, reached};
use crate::system::{Port, System};

/// What is done to a system while it runs.
#[derive(Clone, Debug, Default)]
pub struct Scenario {
    /// Variables that follow signals.
    pub drives: Drives,
    /// Faults on connections, by their inputs. They act on what the connection's transformation
    /// gives.
    pub faults: Vec<(Port, FaultChain)>,
}

/// Type of a driven variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// Real.
    Real {
        /// It is a continuous input of an FMU that takes input derivatives.
        derivatives: bool,
    },
    /// Integer or Enumeration.
    Integer,
    /// Boolean: 0 is false.
    Boolean,
    /// String: its signal counts [`Drive::text`].
    String,
}

/// A variable that follows a signal.
#[derive(Clone, Debug)]
pub struct Drive {
    port: Port,
    reference: u32,
    kind: DriveKind,
    signal: Signal,
    /// Before this time it keeps its start value.
    begin: f64,
    texts: Vec<String>,
    faults: Option<FaultChain>,
    cursor: Cursor,
    /// Set last, and set last when a communication point was reached for good.
    written: Option<Sample>,
    accepted: Option<Sample>,
}

impl Drive {
    /// A variable that follows a signal: its port, value reference and type.
    #[must_use]
    pub fn new(port: Port, reference: u32, kind: DriveKind, following: Following) -> Self {
        let Following { signal, begin, texts } = following;
        let cursor = Cursor::default();
        let faults = None;
        let (written, accepted) = (None, None);
        Self { port, reference, kind, signal, begin, texts, faults, cursor, written, accepted }
    }

    /// The variable.
    #[must_use]
    pub fn port(&self) -> Port {
        self.port
    }

    /// Its value reference.
    #[must_use]
    pub fn reference(&self) -> u32 {
        self.reference
    }

    /// Its type.
    #[must_use]
    pub fn kind(&self) -> DriveKind {
        self.kind
    }

    /// Value and right-hand derivative at `time`, in s; none while it keeps its start value. Time
    /// may go back to the last commit.
    pub fn sample(&mut self, time: f64) -> Option<Sample> {
        let undisturbed = self.undisturbed(time)?;
        let faults = self.faults.as_ref();
        Some(faults.map_or(undisturbed, |faults| faults.apply_sample(time, undisturbed)))
    }

    /// The text that a value of [`Drive::sample`] stands for.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position")]
    pub fn text(&self, value: f64) -> Option<&String> {
        self.texts.get(value as usize)
    }

    fn undisturbed(&mut self, time: f64) -> Option<Sample> {
        reached(time, self.begin).then(|| self.signal.at(time, &mut self.cursor))
    }

    /// Disturbs the signal on its way to the variable.
    pub fn set_faults(&mut self, faults: FaultChain) {
        self.faults = Some(faults);
    }

    /// Whether the FMU has this value, with nothing to change it, since the last commit.
    fn is_settled(&self, sample: Sample) -> bool {
        sample.slope == 0.0 && self.accepted == Some(sample) && self.written == self.accepted
    }

    fn next_break(&self, after: f64) -> Option<f64> {
        let begin = earliest(after, [self.begin].into_iter().filter(|begin| begin.is_finite()));
        let signal = self.signal.next_break(after);
        let faults = self.faults.as_ref().and_then(|faults| faults.next_break(after));
        [begin, signal, faults].into_iter().flatten().reduce(f64::min)
    }
}

/// What a variable follows, and from when.
pub struct Following {
    /// The signal.
    pub signal: Signal,
    /// From this time on, in s; minus infinity: always.
    pub begin: f64,
    /// What the values of the signal stand for, where the variable is a String.
    pub texts: Vec<String>,
}

/// What a checkpoint holds of a [`Drive`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveState {
    faults: Option<FaultChain>,
    accepted: Option<Sample>,
}

/// A checkpoint that does not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the checkpoint is of {found} driven variables, expected {expected} as in the scenario")]
pub struct CheckpointError {
    /// Driven variables of the scenario.
    pub expected: usize,
    /// Those of the checkpoint.
    pub found: usize,
}

/// All driven variables of a system. Nothing here allocates after the construction.
#[derive(Clone, Debug, Default)]
pub struct Drives {
    /// Sorted by slave and type.
    all: Vec<Drive>,
    /// Begin and end of those of one slave and type.
    groups: Vec<(usize, usize)>,
    references: Vec<u32>,
    reals: Vec<f64>,
    integers: Vec<i32>,
    derived: Vec<u32>,
    orders: Vec<i32>,
    slopes: Vec<f64>,
}

impl Drives {
    /// Driven variables, each port at most once.
    #[must_use]
    pub fn new(mut drives: Vec<Drive>) -> Self {
        let key = |drive: &Drive| (drive.port.slave, rank(drive.kind));
        drives.sort_by_key(key);
        let mut groups: Vec<(usize, usize)> = Vec::new();
        for (position, drive) in drives.iter().enumerate() {
            match groups.last_mut() {
                Some((begin, end)) if key(&drives[*begin]) == key(drive) => *end = position + 1,
                _ => groups.push((position, position + 1)),
            }
        }
        let longest = groups.iter().map(|(begin, end)| end - begin).max().unwrap_or(0);
        Self {
            all: drives,
            groups,
            references: Vec::with_capacity(longest),
            reals: Vec::with_capacity(longest),
            integers: Vec::with_capacity(longest),
            derived: Vec::with_capacity(longest),
            orders: Vec::with_capacity(longest),
            slopes: Vec::with_capacity(longest),
        }
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = &Drive> {
        self.all.iter()
    }

    /// Each of them, to be sampled by the caller.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Drive> {
        self.all.iter_mut()
    }

    /// Hands type, value and text of one at `time`, in s, to `show`, unless it keeps its start value.
    pub(crate) fn show(
        &mut self,
        number: usize,
        time: f64,
        show: impl FnOnce(DriveKind, f64, Option<&String>),
    ) {
        let drive = &mut self.all[number];
        if let Some(sample) = drive.sample(time) {
            show(drive.kind, sample.value, drive.text(sample.value));
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Sets every variable that is due at `time`, in s, before the step from there: its value and,
    /// where the FMU takes it, its derivative. A value that the FMU has already is not set again.
    ///
    /// # Errors
    ///
    /// Where an FMU refuses a value.
    pub fn write(&mut self, system: &mut System, time: f64) -> Result<(), SystemError> {
        for group in 0..self.groups.len() {
            let (begin, end) = self.groups[group];
            self.write_group(system, begin, end, time).map_err(|source| {
                call(&system.slaves[self.all[begin].port.slave].0, time, source)
            })?;
        }
        Ok(())
    }

    fn write_group(
        &mut self,
        system: &mut System,
        begin: usize,
        end: usize,
        time: f64,
    ) -> Result<(), slave::CallError> {
        self.clear();
        let kind = self.all[begin].kind;
        let slave = &mut system.slaves[self.all[begin].port.slave].1;
        for drive in &mut self.all[begin..end] {
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
                DriveKind::Integer => self.integers.push(integer(sample.value)),
                DriveKind::Boolean => self.integers.push(i32::from(sample.value != 0.0)),
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
            DriveKind::Integer => slave.set_integer(&self.references, &self.integers)?,
            DriveKind::Boolean => slave.set_boolean(&self.references, &self.integers)?,
            DriveKind::String => {}
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
        self.derived.clear();
        self.orders.clear();
        self.slopes.clear();
    }

    /// Takes note that the simulation has reached `time`, in s, for good.
    pub fn commit(&mut self, time: f64) {
        for drive in &mut self.all {
            drive.accepted = drive.written;
            let value = drive.undisturbed(time).map(|sample| sample.value);
            if let (Some(faults), Some(value)) = (&mut drive.faults, value) {
                faults.commit(time, value);
            }
        }
    }

    /// The first time past `after`, both in s, at which a step should end.
    #[must_use]
    pub fn next_break(&self, after: f64) -> Option<f64> {
        self.all.iter().filter_map(|drive| drive.next_break(after)).reduce(f64::min)
    }

    /// What a checkpoint holds of them, in their order.
    #[must_use]
    pub fn state(&self) -> Vec<DriveState> {
        let of =
            |drive: &Drive| DriveState { faults: drive.faults.clone(), accepted: drive.accepted };
        self.all.iter().map(of).collect()
    }

    /// Takes back what a checkpoint holds, at a communication point.
    ///
    /// # Errors
    ///
    /// Where it is of another scenario.
    pub fn restore(&mut self, state: Vec<DriveState>) -> Result<(), CheckpointError> {
        if state.len() != self.all.len() {
            return Err(CheckpointError { expected: self.all.len(), found: state.len() });
        }
        for (drive, DriveState { faults, accepted }) in self.all.iter_mut().zip(state) {
            drive.faults = faults;
            (drive.written, drive.accepted) = (accepted, accepted);
        }
        Ok(())
    }
}

/// Order of the types.
fn rank(kind: DriveKind) -> u8 {
    match kind {
        DriveKind::Real { .. } => 0,
        DriveKind::Integer => 1,
        DriveKind::Boolean => 2,
        DriveKind::String => 3,
    }
}

/// The Integer that a signal's value stands for.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
pub(crate) fn integer(value: f64) -> i32 {
    value.round() as i32
}

impl DriveKind {
    /// The type of a variable; `derivatives` is for Reals.
    #[must_use]
    pub fn of(kind: &Kind, derivatives: bool) -> Self {
        match kind {
            Kind::Real(_) => Self::Real { derivatives },
            Kind::Integer(_) | Kind::Enumeration(_) => Self::Integer,
            Kind::Boolean(_) => Self::Boolean,
            Kind::String(_) => Self::String,
        }
    }
}
