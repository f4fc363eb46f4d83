//! Reads chosen variables of a system as numbers.

use fmu_description::Kind;

use crate::error::SystemError;
use crate::exchange::call;
use crate::system::{Port, System};

/// A list of variables to read together. Booleans are 0 or 1; Strings are left out.
pub struct Probe {
    names: Vec<String>,
    /// One entry for each slave and type: slave, type, value references, positions among the
    /// values.
    reads: Vec<Read>,
    reals: Vec<f64>,
    integers: Vec<i32>,
}

struct Read {
    slave: usize,
    kind: ReadKind,
    references: Vec<u32>,
    positions: Vec<usize>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ReadKind {
    Real,
    Integer,
    Boolean,
}

impl Probe {
    /// Creates a probe of `ports`, in that order.
    #[must_use]
    pub fn new(system: &System, ports: &[Port]) -> Self {
        let mut probe =
            Self { names: Vec::new(), reads: Vec::new(), reals: Vec::new(), integers: Vec::new() };
        for &port in ports {
            let variable = system.variable(port);
            let kind = match &variable.kind {
                Kind::Boolean(_) => ReadKind::Boolean,
                other if other.as_real().is_some() => ReadKind::Real,
                other if other.as_integer().is_some() => ReadKind::Integer,
                _ => continue,
            };
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
            let reals = &mut self.reals[..count];
            match read.kind {
                ReadKind::Real => instance.get_real(&read.references, reals),
                ReadKind::Integer => instance.get_integer(&read.references, integers),
                ReadKind::Boolean => instance.get_boolean(&read.references, integers),
            }
            .map_err(|source| call(name, time, source))?;
            for (k, &position) in read.positions.iter().enumerate() {
                values[position] =
                    if read.kind == ReadKind::Real { reals[k] } else { f64::from(integers[k]) };
            }
        }
        Ok(())
    }
}
