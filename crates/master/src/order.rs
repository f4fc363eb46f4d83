//! The order in which the slaves step in a Gauss-Seidel sweep.

use std::collections::{HashMap, HashSet};

use fmu_description::Unknown;

use crate::signal_type::SignalType;
use crate::system::{Connection, Port, System};
use solve::components;

/// An order of the slaves, with their algebraic loops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// Positions of the slaves, first to last.
    pub sequence: Vec<usize>,
    /// Positions of the slaves in algebraic loops (cycles of direct dependencies), ascending. In
    /// `sequence` the slaves of one loop keep the order in which they were added.
    pub looped: Vec<usize>,
}

/// Orders the slaves by their direct dependencies.
///
/// If a connected output of B depends directly (without a step in between) on an input that A
/// supplies, A comes before B. Otherwise slaves keep the order in which they were added.
#[must_use]
pub fn by_direct_dependencies(system: &System) -> Order {
    let feedthrough = feedthrough_inputs(system);
    let edges: Vec<(usize, usize)> = system
        .connections
        .iter()
        .filter(|connection| !is_clocked(system, connection))
        .filter(|connection| {
            let inputs = feedthrough[connection.to.slave].as_ref();
            inputs.is_none_or(|inputs| inputs.contains(&system.holder(connection.to).variable))
        })
        .map(|connection| (connection.from.slave, connection.to.slave))
        .collect();
    let components = components(system.slaves.len(), &edges);
    let loops = (0..components.len()).filter(|&k| components.is_loop(k));
    let mut looped: Vec<usize> = loops.flat_map(|k| components.nodes(k)).copied().collect();
    looped.sort_unstable();
    Order { sequence: components.sequence().to_vec(), looped }
}

/// Whether a connection passes values at ticks of clocks only, so that the order of the steps does not matter.
fn is_clocked(system: &System, connection: &Connection) -> bool {
    system.signal_type(connection.to) == SignalType::Clocked
}

/// Returns for each slave the positions of the inputs with direct feedthrough to a connected output; `None`: all.
fn feedthrough_inputs(system: &System) -> Vec<Option<HashSet<usize>>> {
    let mut feedthrough = vec![Some(HashSet::new()); system.slaves.len()];
    let rows = Rows::of(system);
    for connection in system.connections.iter().filter(|connection| !is_clocked(system, connection))
    {
        let from = connection.from;
        let rows = &rows[from.slave];
        let Some(unknown) = rows.entry(&[&rows.outputs], from.variable) else { continue };
        match (rows.dependencies(unknown), &mut feedthrough[from.slave]) {
            (None, inputs) => *inputs = None,
            (Some(list), Some(inputs)) => inputs.extend(list),
            (Some(_), None) => {}
        }
    }
    feedthrough
}

fn by_index(unknowns: &[Unknown]) -> HashMap<u32, &Unknown> {
    unknowns.iter().map(|unknown| (unknown.index, unknown)).collect()
}

/// The entries of `ModelStructure` of one model, by the index of their variable.
pub(crate) struct Rows<'a> {
    system: &'a System,
    slave: usize,
    initial: HashMap<u32, &'a Unknown>,
    outputs: HashMap<u32, &'a Unknown>,
}

impl<'a> Rows<'a> {
    /// Returns the entries of each slave.
    pub(crate) fn of(system: &'a System) -> Vec<Self> {
        let slaves = system.slaves.iter().enumerate();
        let rows = slaves.map(|(slave, (_, instance))| {
            let structure = &instance.description().structure;
            let initial = by_index(&structure.initial_unknowns);
            Self { system, slave, initial, outputs: by_index(&structure.outputs) }
        });
        rows.collect()
    }

    /// Returns the entry of the output at position `output` in the first of `lists` that has one. An alias of FMI 3.0
    /// has no entry; the entry of its [`System::holder`] is returned instead. `None` if the variable is no output.
    fn entry(&self, lists: &[&HashMap<u32, &'a Unknown>], output: usize) -> Option<&'a Unknown> {
        let entry = |position: usize| {
            let index = u32::try_from(position + 1).ok()?;
            lists.iter().find_map(|list| list.get(&index).copied())
        };
        entry(output).or_else(|| entry(self.holder(output)))
    }

    fn holder(&self, variable: usize) -> usize {
        self.system.holder(Port { slave: self.slave, variable }).variable
    }

    /// Returns the positions of the variables on which `unknown` depends, with [`System::holder`] for an alias;
    /// `None`: possibly all.
    fn dependencies(&self, unknown: &Unknown) -> Option<HashSet<usize>> {
        let list = unknown.dependencies.as_ref()?;
        Some(list.iter().map(|&index| self.holder(index as usize - 1)).collect())
    }

    /// Returns the positions of the variables on which the output at position `output` depends directly, with
    /// [`System::holder`] for an alias; `None`: possibly all, or the variable is no output.
    pub(crate) fn direct_dependencies(&self, output: usize) -> Option<HashSet<usize>> {
        self.dependencies(self.entry(&[&self.outputs], output)?)
    }

    /// Returns the positions of the variables on which the output at position `output` depends in initialization mode,
    /// with [`System::holder`] for an alias; `None`: possibly all, or the variable is no output.
    pub(crate) fn initial_dependencies(&self, output: usize) -> Option<HashSet<usize>> {
        self.dependencies(self.entry(&[&self.initial, &self.outputs], output)?)
    }
}
