//! The order in which Gauss-Seidel steps the slaves.

use crate::system::System;

/// An order of stepping.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// Positions of the slaves, first to last.
    pub sequence: Vec<usize>,
    /// Slaves that depend directly on each other in a circle (an algebraic loop); they stand in
    /// the order of their addition.
    pub looped: Vec<usize>,
}

/// Orders the slaves by their direct dependencies: where a connected output of B depends without a
/// step in between on an input that is connected to A, A comes before B. Slaves that this leaves
/// free keep the order of their addition.
#[must_use]
pub fn by_direct_dependencies(system: &System) -> Order {
    let count = system.slaves.len();
    let mut needs = vec![vec![false; count]; count];
    for connection in &system.connections {
        if passes_through(system, connection.to.slave, connection.to.variable) {
            needs[connection.to.slave][connection.from.slave] = true;
        }
    }
    let mut order = Order { sequence: Vec::with_capacity(count), looped: Vec::new() };
    while order.sequence.len() < count {
        let waiting = |slave: &usize| !order.sequence.contains(slave);
        let free = |slave: &usize| {
            (0..count).all(|other| other == *slave || !needs[*slave][other] || !waiting(&other))
        };
        let next = (0..count).filter(waiting).find(free);
        let Some(slave) = next.or_else(|| (0..count).find(waiting)) else { break };
        if next.is_none() {
            order.looped.push(slave);
        }
        order.sequence.push(slave);
    }
    order
}

/// Whether a connected output of the slave depends directly on its input `input`.
fn passes_through(system: &System, slave: usize, input: usize) -> bool {
    let description = system.slaves[slave].1.description();
    system
        .connections
        .iter()
        .filter(|connection| connection.from.slave == slave)
        .filter_map(|connection| {
            let index = u32::try_from(connection.from.variable + 1).ok()?;
            description.structure.outputs.iter().find(|unknown| unknown.index == index)
        })
        .any(|unknown| match &unknown.dependencies {
            None => true,
            Some(indices) => indices.iter().any(|&index| index as usize == input + 1),
        })
}
