//! The sequence of a sweep: groups of slaves that step one after the other.

use std::ops::Range;

use crate::algorithm::Method;
use crate::order::Order;
use crate::system::System;

/// The slaves in groups. Groups step one after the other; within a group, all inputs are computed
/// before the first slave steps.
pub(super) struct Groups {
    /// The positions of the slaves, group by group.
    pub(super) sequence: Vec<usize>,
    /// Start of each group in `sequence`, and the end of the last group.
    starts: Vec<usize>,
}

impl Groups {
    /// Forms the groups. Jacobi: one group of all slaves, except slaves without states, which follow one
    /// by one. Gauss-Seidel: consecutive slaves without connections between them form a group, because
    /// their order does not matter.
    pub(super) fn new(system: &System, method: Method, order: &Order) -> Self {
        let count = system.slaves.len();
        if method == Method::Jacobi {
            let is_function = |slave: &usize| system.slaves[*slave].1.is_function();
            let mut sequence: Vec<usize> = (0..count).filter(|slave| !is_function(slave)).collect();
            let first = sequence.len();
            sequence.extend(order.sequence.iter().copied().filter(is_function));
            let starts = [0].into_iter().chain(first..=count).collect();
            return Self { sequence, starts };
        }
        let mut neighbours = vec![Vec::new(); count];
        for connection in &system.connections {
            let (from, to) = (connection.from.slave, connection.to.slave);
            neighbours[from].push(to);
            neighbours[to].push(from);
        }
        let mut starts = vec![0];
        // For each slave, the last group that contains a slave connected to it.
        let mut excluded_from = vec![usize::MAX; count];
        for (position, &slave) in order.sequence.iter().enumerate() {
            if excluded_from[slave] == starts.len() {
                starts.push(position);
            }
            for &neighbour in &neighbours[slave] {
                excluded_from[neighbour] = starts.len();
            }
        }
        starts.push(count);
        Self { sequence: order.sequence.clone(), starts }
    }

    pub(super) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the range of a group in the sequence.
    pub(super) fn members(&self, group: usize) -> Range<usize> {
        self.starts[group]..self.starts[group + 1]
    }
}
