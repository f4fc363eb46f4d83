//! Reading chosen variables of a system, each as its type has it, for results.

mod slow;

use std::ops::Range;

use fmu_description::Kind;

use crate::drive::{DriveKind, Drives, integer};
use crate::error::SystemError;
use crate::exchange::call;
use crate::system::{Port, System};
use slave::{CallError, Slave};
pub use slow::{SlowState, SlowValues};

/// Values of chosen variables, in arrays by type: each in the order of the variables of that type.
#[derive(Debug, Default)]
pub struct Readout {
    ports: Vec<Port>,
    reads: Vec<Read>,
    /// Values of Reals.
    pub reals: Vec<f64>,
    /// Values of Integers and Enumerations.
    pub integers: Vec<i32>,
    /// Values of Booleans: 0 is false.
    pub booleans: Vec<i32>,
    /// Values of Strings.
    pub strings: Vec<String>,
    /// Variables that follow a signal: which of the [`Drives`], and the position of the value.
    driven: Vec<(usize, usize)>,
}

/// Variables of one slave and one type that stand side by side.
#[derive(Debug)]
struct Read {
    slave: usize,
    kind: ReadKind,
    references: Vec<u32>,
    range: Range<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ReadKind {
    Real,
    Integer,
    Boolean,
    String,
}

impl ReadKind {
    fn of(kind: &Kind) -> Self {
        match kind {
            Kind::Real(_) => ReadKind::Real,
            Kind::Integer(_) | Kind::Enumeration(_) => ReadKind::Integer,
            Kind::Boolean(_) => ReadKind::Boolean,
            Kind::String(_) => ReadKind::String,
        }
    }
}

impl Readout {
    /// A readout of `ports`, in that order.
    #[must_use]
    pub fn new(system: &System, ports: &[Port]) -> Self {
        let mut readout = Self { ports: ports.to_vec(), ..Self::default() };
        for &port in ports {
            let variable = system.variable(port);
            let kind = ReadKind::of(&variable.kind);
            let position = readout.add(kind);
            // The last read of that kind, so that the range stays one.
            let last = readout.reads.iter_mut().rev().find(|read| read.kind == kind);
            match last.filter(|read| read.slave == port.slave) {
                Some(read) => {
                    read.references.push(variable.value_reference);
                    read.range.end = position + 1;
                }
                None => readout.reads.push(Read {
                    slave: port.slave,
                    kind,
                    references: vec![variable.value_reference],
                    range: position..position + 1,
                }),
            }
        }
        readout
    }

    /// From now on the variables that follow a signal have its value at the time that is read, not
    /// the one that the FMU was given for its last step.
    pub(crate) fn follow(&mut self, drives: &Drives, system: &System, ports: &[Port]) {
        let kind = |port: Port| ReadKind::of(&system.variable(port).kind);
        for (number, drive) in drives.iter().enumerate() {
            if let Some(at) = ports.iter().position(|port| *port == drive.port()) {
                let same = |port: &&Port| kind(**port) == kind(drive.port());
                self.driven.push((number, ports[..at].iter().filter(same).count()));
            }
        }
    }

    /// Gives driven variables their values at `time`, in s.
    pub(crate) fn apply(&mut self, drives: &mut Drives, time: f64) {
        for &(number, position) in &self.driven {
            drives.show(number, time, |kind, value, text| match kind {
                DriveKind::Real { .. } => self.reals[position] = value,
                DriveKind::Integer => self.integers[position] = integer(value),
                DriveKind::Boolean => self.booleans[position] = i32::from(value != 0.0),
                DriveKind::String => {
                    if let Some(text) = text {
                        self.strings[position].clone_from(text);
                    }
                }
            });
        }
    }

    /// Makes room for a value; its position.
    fn add(&mut self, kind: ReadKind) -> usize {
        match kind {
            ReadKind::Real => self.reals.push(0.0),
            ReadKind::Integer => self.integers.push(0),
            ReadKind::Boolean => self.booleans.push(0),
            ReadKind::String => self.strings.push(String::new()),
        }
        let length = match kind {
            ReadKind::Real => self.reals.len(),
            ReadKind::Integer => self.integers.len(),
            ReadKind::Boolean => self.booleans.len(),
            ReadKind::String => self.strings.len(),
        };
        length - 1
    }

    /// Reads all values.
    ///
    /// # Errors
    ///
    /// Where an FMU refuses; `time` is for the message.
    pub fn read(&mut self, system: &mut System, time: f64) -> Result<(), SystemError> {
        for position in 0..self.reads.len() {
            let (name, slave) = &mut system.slaves[self.reads[position].slave];
            self.read_one(position, slave.as_mut()).map_err(|source| call(name, time, source))?;
        }
        Ok(())
    }

    /// The variables among `ports`, of which this is the readout, that their FMUs refuse to read now,
    /// each with the refusal. A group of variables that is read as one is taken apart only where it
    /// fails.
    ///
    /// # Errors
    ///
    /// Where an FMU ends its process or returns `fmi2Fatal`; `time` is for the message.
    pub fn unreadable(
        &mut self,
        system: &mut System,
        ports: &[Port],
        time: f64,
    ) -> Result<Vec<(Port, CallError)>, SystemError> {
        let mut refused = Vec::new();
        for position in 0..self.reads.len() {
            let slave = self.reads[position].slave;
            let (name, instance) = &mut system.slaves[slave];
            match self.read_one(position, instance.as_mut()) {
                Ok(()) => continue,
                Err(source) if !source.leaves_the_instance_usable() => {
                    return Err(call(name, time, source));
                }
                Err(_) => {}
            }
            let kind = self.reads[position].kind;
            let members = ports.iter().filter(|port| {
                port.slave == slave && ReadKind::of(&system.variable(**port).kind) == kind
            });
            for &port in members.collect::<Vec<_>>() {
                if let Err(error) = system.get_value(port) {
                    refused.push((port, error));
                }
            }
        }
        Ok(refused)
    }

    fn read_one(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        let read = &self.reads[position];
        let (references, range) = (&read.references, read.range.clone());
        match read.kind {
            ReadKind::Real => slave.get_real(references, &mut self.reals[range]),
            ReadKind::Integer => slave.get_integer(references, &mut self.integers[range]),
            ReadKind::Boolean => slave.get_boolean(references, &mut self.booleans[range]),
            ReadKind::String => slave.get_string(references, &mut self.strings[range]),
        }
    }
}
