//! The order of what depends on each other.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The strongly connected components of a graph, each before those that need it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// The nodes, component after component; ascending within each.
    nodes: Vec<usize>,
    /// Where each component begins in `nodes`, and the end of the last.
    begins: Vec<usize>,
    /// Whether each is a loop.
    loops: Vec<bool>,
}

impl Components {
    /// Number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.loops.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.loops.is_empty()
    }

    /// The nodes of component `index`, ascending.
    #[must_use]
    pub fn nodes(&self, index: usize) -> &[usize] {
        &self.nodes[self.begins[index]..self.begins[index + 1]]
    }

    /// Whether the nodes of component `index` need each other, or one itself.
    #[must_use]
    pub fn is_loop(&self, index: usize) -> bool {
        self.loops[index]
    }

    /// All nodes: the order in which to go through them.
    #[must_use]
    pub fn sequence(&self) -> &[usize] {
        &self.nodes
    }
}

/// The strongly connected components of the graph of `count` nodes, in an order in which each
/// comes after all that it needs; of those that are free the one with the lowest node first.
///
/// `edges`: pairs (needed, needing) of numbers below `count`; others are passed over, repeated ones
/// do not matter. Components by Tarjan 1972, "Depth-first search and linear graph algorithms", without
/// recursion, `O(V + E)`; their order by Kahn 1962, "Topological sorting of large networks",
/// with a heap, `O(E + V log V)`.
#[must_use]
pub fn components(count: usize, edges: &[(usize, usize)]) -> Components {
    let successors = Lists::new(count, edges.iter().copied());
    let (component, number) = tarjan(&successors);
    let between = edges.iter().filter(|(from, to)| *from < count && *to < count);
    let between = between.map(|(from, to)| (component[*from], component[*to]));
    let mut size = vec![0; number];
    let mut lowest = vec![usize::MAX; number];
    for (node, &owner) in component.iter().enumerate() {
        size[owner] += 1;
        lowest[owner] = lowest[owner].min(node);
    }
    let mut looped: Vec<bool> = size.iter().map(|size| *size > 1).collect();
    let selves = edges.iter().filter(|(from, to)| from == to && *from < count);
    selves.for_each(|(node, _)| looped[component[*node]] = true);

    let order = kahn(&Lists::new(number, between.filter(|(from, to)| from != to)), &lowest);
    let mut begins = vec![0; number + 1];
    for (place, &owner) in order.iter().enumerate() {
        begins[place + 1] = begins[place] + size[owner];
    }
    let mut fill = vec![0; number];
    order.iter().enumerate().for_each(|(place, &owner)| fill[owner] = begins[place]);
    let mut nodes = vec![0; count];
    for (node, &owner) in component.iter().enumerate() {
        nodes[fill[owner]] = node;
        fill[owner] += 1;
    }
    Components { nodes, begins, loops: order.iter().map(|&owner| looped[owner]).collect() }
}

/// For each node a list of others, one after the other.
struct Lists {
    begins: Vec<usize>,
    entries: Vec<usize>,
}

impl Lists {
    fn new(count: usize, edges: impl Iterator<Item = (usize, usize)> + Clone) -> Self {
        let edges = edges.filter(|(from, to)| *from < count && *to < count);
        let mut begins = vec![0; count + 1];
        edges.clone().for_each(|(from, _)| begins[from + 1] += 1);
        for node in 0..count {
            begins[node + 1] += begins[node];
        }
        let mut fill = begins.clone();
        let mut entries = vec![0; begins[count]];
        for (from, to) in edges {
            entries[fill[from]] = to;
            fill[from] += 1;
        }
        Self { begins, entries }
    }

    fn len(&self) -> usize {
        self.begins.len() - 1
    }

    fn of(&self, node: usize) -> &[usize] {
        &self.entries[self.begins[node]..self.begins[node + 1]]
    }
}

/// The component of each node, and how many there are.
fn tarjan(successors: &Lists) -> (Vec<usize>, usize) {
    const NEW: usize = usize::MAX;
    let count = successors.len();
    let (mut index, mut low) = (vec![NEW; count], vec![0; count]);
    let mut component = vec![NEW; count];
    let (mut stack, mut calls) = (Vec::new(), Vec::new());
    let (mut next, mut number) = (0, 0);
    for root in 0..count {
        if index[root] != NEW {
            continue;
        }
        calls.push((root, 0));
        while let Some((node, edge)) = calls.pop() {
            if edge == 0 {
                (index[node], low[node]) = (next, next);
                next += 1;
                stack.push(node);
            }
            if let Some(&other) = successors.of(node).get(edge) {
                calls.push((node, edge + 1));
                if index[other] == NEW {
                    calls.push((other, 0));
                } else if component[other] == NEW {
                    low[node] = low[node].min(index[other]);
                }
                continue;
            }
            if low[node] == index[node] {
                while let Some(member) = stack.pop() {
                    component[member] = number;
                    if member == node {
                        break;
                    }
                }
                number += 1;
            }
            if let Some(&(caller, _)) = calls.last() {
                low[caller] = low[caller].min(low[node]);
            }
        }
    }
    (component, number)
}

/// The nodes of a graph without loops, each after all that lead to it, free ones by their `rank`.
fn kahn(successors: &Lists, rank: &[usize]) -> Vec<usize> {
    let mut waits = vec![0_usize; successors.len()];
    successors.entries.iter().for_each(|&to| waits[to] += 1);
    let free = (0..waits.len()).filter(|&node| waits[node] == 0);
    let mut heap: BinaryHeap<_> = free.map(|node| Reverse((rank[node], node))).collect();
    let mut order = Vec::with_capacity(waits.len());
    while let Some(Reverse((_, node))) = heap.pop() {
        order.push(node);
        for &to in successors.of(node) {
            waits[to] -= 1;
            if waits[to] == 0 {
                heap.push(Reverse((rank[to], to)));
            }
        }
    }
    order
}

#[cfg(test)]
#[path = "graph/tests.rs"]
mod tests;
