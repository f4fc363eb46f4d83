//! Reads chosen variables of a system as numbers.

use crate::error::{SystemError, call};
use crate::system::{Port, System};
use slave::ValueType;

/// A list of variables to read together. Booleans are 0 or 1; Strings and binaries are left out.
#[derive(Default)]
pub struct Probe {
    names: Vec<String>,
    /// One entry for each slave and type.
    reads: Vec<Read>,
    reals: Vec<f64>,
    integers: Vec<i64>,
    booleans: Vec<i32>,
}

/// Variables of one slave and one type, read by one call.
struct Read {
    slave: usize,
    kind: ValueType,
    references: Vec<u32>,
    /// The positions of the variables among the values.
    positions: Vec<usize>,
}

impl Probe {
    /// Creates a probe of `ports`, in that order.
    #[must_use]
    pub fn new(system: &System, ports: &[Port]) -> Self {
        let mut probe = Self::default();
        for &port in ports {
            let variable = system.variable(port);
            let kind = ValueType::of(&variable.kind);
            if matches!(kind, ValueType::String | ValueType::Binary) {
                continue;
            }
            let position = probe.names.len();
            probe.names.push(system.name(port));
            let same = |read: &&mut Read| read.slave == port.slave && read.kind == kind;
            match probe.reads.iter_mut().find(same) {
                Some(read) => {
                    read.references.push(variable.value_reference);
                    read.positions.push(position);
                }
                None => probe.reads.push(Read {
                    slave: port.slave,
                    kind,
                    references: vec![variable.value_reference],
                    positions: vec![position],
                }),
            }
        }
        let longest = probe.reads.iter().map(|read| read.references.len()).max().unwrap_or(0);
        probe.reals.resize(longest, 0.0);
        probe.integers.resize(longest, 0);
        probe.booleans.resize(longest, 0);
        probe
    }

    /// Returns the names `slave.variable`, in the order of the values.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Reads all values into `values`, which has the length of [`Probe::names`]. `time` in s
    /// appears in the error message.
    ///
    /// # Errors
    ///
    /// Returns an error if an FMU refuses a read.
    pub fn read(
        &mut self,
        system: &mut System,
        time: f64,
        values: &mut [f64],
    ) -> Result<(), SystemError> {
        for read in &self.reads {
            let count = read.references.len();
            let (name, instance) = &mut system.slaves[read.slave];
            let integers = &mut self.integers[..count];
            let booleans = &mut self.booleans[..count];
            let reals = &mut self.reals[..count];
            match read.kind {
                ValueType::Real => instance.get_real(&read.references, reals),
                ValueType::Integer => instance.get_integer(&read.references, integers),
                ValueType::Boolean => instance.get_boolean(&read.references, booleans),
                ValueType::String | ValueType::Binary => Ok(()),
            }
            .map_err(|source| call(name, time, source))?;
            for (k, &position) in read.positions.iter().enumerate() {
                values[position] = match read.kind {
                    ValueType::Real => reals[k],
                    ValueType::Integer => slave::to_real(integers[k]),
                    ValueType::Boolean => booleans[k].into(),
                    ValueType::String | ValueType::Binary => f64::NAN,
                };
            }
        }
        Ok(())
    }
}
