//! Reads chosen variables of a system in their own types, for results.

use std::collections::HashMap;
use std::ops::Range;

use crate::drive::{DriveKind, Drives, integer};
use crate::error::{SystemError, call};
use crate::signal::Sample;
use crate::system::{Port, System};
use slave::{CallError, Slave, Value, ValueType, to_hex};

/// Values of chosen variables, in one array for each type. Each array keeps the order of the
/// variables.
#[derive(Debug, Default)]
pub struct Readout {
    pub(crate) ports: Vec<Port>,
    reads: Vec<Read>,
    /// Values of Reals.
    pub reals: Vec<f64>,
    /// Values of Integers and Enumerations.
    pub integers: Vec<i64>,
    /// Values of Booleans; 0 is false.
    pub booleans: Vec<i32>,
    /// Values of Strings, and of binaries as hexadecimal digits.
    pub strings: Vec<String>,
    /// For each clocked variable, in the order of the variables, whether one of its clocks has ticked since the last
    /// communication point, so that the variable has a value now.
    pub present: Vec<bool>,
    /// The clocks of the clocked variables.
    clocks: Vec<ClockRead>,
    /// The inputs whose values are known without a call of an FMU, with the positions of the values.
    known: Vec<(Port, usize)>,
    /// `System::changes` when the known values were read last.
    changes: u64,
    /// Buffer for binaries.
    binaries: Vec<Vec<u8>>,
    /// Driven variables: index of the drive, and position of the value.
    driven: Vec<(usize, usize)>,
}

/// Consecutive variables of one slave and one type, read by one call.
#[derive(Debug)]
struct Read {
    slave: usize,
    kind: ValueType,
    references: Vec<u32>,
    range: Range<usize>,
}

/// The clocks that consecutive clocked variables share.
#[derive(Debug)]
struct ClockRead {
    slave: usize,
    references: Vec<u32>,
    flags: Vec<i32>,
    range: Range<usize>,
}

/// Returns the type of the array that holds values of this type: binaries are with the Strings.
pub(crate) fn array(kind: ValueType) -> ValueType {
    if kind == ValueType::Binary { ValueType::String } else { kind }
}

impl Readout {
    /// Creates a readout of `ports`, in that order.
    #[must_use]
    pub fn new(system: &System, ports: &[Port]) -> Self {
        let mut readout = Self { ports: ports.to_vec(), ..Self::default() };
        for &port in ports {
            if system.is_absent_between_ticks(port) {
                readout.add_clocks(system, port);
            }
            let variable = system.variable(port);
            let kind = ValueType::of(&variable.kind);
            let position = readout.add(kind);
            if readout.put_known(system.known_input(port).as_ref(), position) {
                readout.known.push((port, position));
                continue;
            }
            // Only the last group of this kind can be extended, so that its range stays contiguous.
            let last = readout.reads.iter_mut().rev().find(|read| array(read.kind) == array(kind));
            let next = |read: &&mut Read| {
                read.slave == port.slave && read.kind == kind && read.range.end == position
            };
            match last.filter(next) {
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

    /// Makes driven variables show the value of their signal at the time read, instead of the value
    /// that the FMU received for its last step.
    pub(crate) fn follow(&mut self, drives: &Drives, system: &System) {
        self.driven.clear();
        let numbers = drives.iter().enumerate();
        let numbers: HashMap<Port, usize> =
            numbers.map(|(number, drive)| (system.holder(drive.port()), number)).collect();
        if numbers.is_empty() {
            return;
        }
        let mut lengths = [0; 5];
        for &port in &self.ports {
            let position = &mut lengths[array(ValueType::of(&system.variable(port).kind)) as usize];
            if let Some(&number) = numbers.get(&system.holder(port)) {
                self.driven.push((number, *position));
            }
            *position += 1;
        }
    }

    /// Writes the values of driven variables at `time`, in s, except variables that still have their start values.
    pub(crate) fn apply(&mut self, drives: &mut Drives, time: f64) {
        for &(number, position) in &self.driven {
            let Some(drive) = drives.iter_mut().nth(number) else { continue };
            let Some(Sample { value, .. }) = drive.sample(time) else { continue };
            match drive.kind {
                DriveKind::Real { .. } => self.reals[position] = value,
                DriveKind::Integer { least, largest } => {
                    self.integers[position] = integer(value, least, largest);
                }
                DriveKind::Boolean | DriveKind::Clock => {
                    self.booleans[position] = i32::from(value != 0.0);
                }
                DriveKind::String => {
                    if let Some(text) = drive.text(value) {
                        self.strings[position].clone_from(text);
                    }
                }
            }
        }
    }

    /// Writes a value that is known without a call of an FMU to its position. Returns false, and does nothing, if there
    /// is no value or if it is a text.
    fn put_known(&mut self, value: Option<&Value>, position: usize) -> bool {
        match value {
            Some(Value::Real(value)) => self.reals[position] = *value,
            Some(Value::Integer(value)) => self.integers[position] = *value,
            Some(Value::Boolean(value)) => self.booleans[position] = i32::from(*value),
            _ => return false,
        }
        true
    }

    /// Adds the clocks of a clocked variable.
    fn add_clocks(&mut self, system: &System, port: Port) {
        let position = self.present.len();
        self.present.push(false);
        let description = system.slaves[port.slave].1.description();
        let clocks = system.variable(port).clocks.iter().filter_map(|index| description.at(*index));
        let references: Vec<u32> = clocks.map(|clock| clock.value_reference).collect();
        match self.clocks.last_mut() {
            Some(last) if last.slave == port.slave && last.references == references => {
                last.range.end = position + 1;
            }
            _ => self.clocks.push(ClockRead {
                slave: port.slave,
                flags: vec![0; references.len()],
                references,
                range: position..position + 1,
            }),
        }
    }

    /// Adds an element for a value and returns its position.
    fn add(&mut self, kind: ValueType) -> usize {
        fn push<T: Default>(values: &mut Vec<T>) -> usize {
            values.push(T::default());
            values.len() - 1
        }
        match kind {
            ValueType::Real => push(&mut self.reals),
            ValueType::Integer => push(&mut self.integers),
            ValueType::Boolean => push(&mut self.booleans),
            ValueType::String | ValueType::Binary => push(&mut self.strings),
        }
    }

    /// Reads all values. `time` in s appears in the error message.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
    pub fn read(&mut self, system: &mut System, time: f64) -> Result<(), SystemError> {
        for position in 0..self.reads.len() {
            let slave = self.reads[position].slave;
            system.perform(slave, time, |slave| self.read_one(position, slave))?;
        }
        if !self.known.is_empty() && self.changes != system.changes {
            self.changes = system.changes;
            for number in 0..self.known.len() {
                let (port, position) = self.known[number];
                self.put_known(system.known_input(port).as_ref(), position);
            }
        }
        for ClockRead { slave, references, flags, range } in &mut self.clocks {
            system.perform(*slave, time, |slave| slave.get_boolean(references, flags))?;
            self.present[range.clone()].fill(flags.iter().any(|flag| *flag != 0));
        }
        Ok(())
    }

    /// Returns the variables among `ports` that their FMUs refuse to read now, each with the error;
    /// the FMUs can still be used. `ports` are the ports of this readout. If the common read of a group
    /// of variables fails, reads them one by one. `time` in s appears in the error message.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU cannot be used any more; it names the variable if its read alone fails.
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
            let whole = match self.read_one(position, instance.as_mut()) {
                Ok(()) => continue,
                Err(source) if !source.leaves_the_instance_usable() => {
                    return Err(call(name, time, source));
                }
                Err(source) => source,
            };
            let Read { kind, references, .. } = &self.reads[position];
            let members = ports.iter().filter(|port| {
                let variable = system.variable(**port);
                port.slave == slave
                    && ValueType::of(&variable.kind) == *kind
                    && references.contains(&variable.value_reference)
            });
            for &port in members.collect::<Vec<_>>() {
                match system.get_value(port) {
                    Err(source) if source.ends_the_instance() => {
                        let slave = system.slaves[slave].0.as_str().into();
                        let name = system.name(port).into();
                        return Err(SystemError::Unreadable { slave, name, time, source });
                    }
                    Err(error) => refused.push((port, error)),
                    Ok(_) => {}
                }
            }
            if whole.ends_the_instance() {
                return Err(call(&system.slaves[slave].0, time, whole));
            }
        }
        Ok(refused)
    }

    fn read_one(&mut self, position: usize, slave: &mut dyn Slave) -> Result<(), CallError> {
        let read = &self.reads[position];
        let (references, range) = (&read.references, read.range.clone());
        match read.kind {
            ValueType::Real => slave.get_real(references, &mut self.reals[range]),
            ValueType::Integer => slave.get_integer(references, &mut self.integers[range]),
            ValueType::Boolean => slave.get_boolean(references, &mut self.booleans[range]),
            ValueType::String => slave.get_string(references, &mut self.strings[range]),
            ValueType::Binary => {
                self.binaries.resize(references.len(), Vec::new());
                slave.get_binary(references, &mut self.binaries)?;
                for (text, bytes) in self.strings[range].iter_mut().zip(&self.binaries) {
                    *text = to_hex(bytes);
                }
                Ok(())
            }
        }
    }
}
