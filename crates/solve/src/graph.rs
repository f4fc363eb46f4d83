//! Dependency graphs: strongly connected components and their topological order.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The strongly connected components of a graph in topological order: each before its dependents.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// The nodes, component after component; ascending within each.
    nodes: Vec<usize>,
    /// Start of each component in `nodes`, and the end of the last.
    starts: Vec<usize>,
    /// Whether each component is a loop.
    loops: Vec<bool>,
}

impl Components {
    /// Returns the number of components.
    #[must_use]
    pub fn len(&self) -> usize {
        self.loops.len()
    }

    /// Whether there are no components.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.loops.is_empty()
    }

    /// Returns the nodes of component `index`, ascending.
    #[must_use]
    pub fn nodes(&self, index: usize) -> &[usize] {
        &self.nodes[self.starts[index]..self.starts[index + 1]]
    }

    /// Whether component `index` is a loop: several nodes, or one that depends on itself.
    #[must_use]
    pub fn is_loop(&self, index: usize) -> bool {
        self.loops[index]
    }

    /// Returns all nodes, component by component in topological order.
    #[must_use]
    pub fn sequence(&self) -> &[usize] {
        &self.nodes
    }
}

/// Returns the strongly connected components of a graph of `count` nodes in topological order: each
/// component follows all components on which it depends. Among several possible next components the
/// one with the lowest node comes first.
///
/// `edges` are pairs (from, to): node `to` depends on node `from`. Edges with a node not below `count`
/// are ignored, repeated edges have no effect. Components by Tarjan 1972, "Depth-first search and
/// linear graph algorithms", without recursion, `O(V + E)`; their order by Kahn 1962, "Topological
/// sorting of large networks", with a heap, `O(E + V log V)`.
#[must_use]
pub fn components(count: usize, edges: &[(usize, usize)]) -> Components {
    let successors = AdjacencyLists::new(count, edges.iter().copied());
    let (component, number) = tarjan(&successors);
    let between = edges.iter().filter(|(from, to)| *from < count && *to < count);
    let between = between.map(|(from, to)| (component[*from], component[*to]));
    let mut size = vec![0; number];
    let mut lowest = vec![usize::MAX; number];
    for (node, &owner) in component.iter().enumerate() {
        size[owner] += 1;
        lowest[owner] = lowest[owner].min(node);
    }
    let mut is_loop: Vec<bool> = size.iter().map(|size| *size > 1).collect();
    let self_edges = edges.iter().filter(|(from, to)| from == to && *from < count);
    self_edges.for_each(|(node, _)| is_loop[component[*node]] = true);

    let order =
        kahn(&AdjacencyLists::new(number, between.filter(|(from, to)| from != to)), &lowest);
    let mut starts = vec![0; number + 1];
    for (place, &owner) in order.iter().enumerate() {
        starts[place + 1] = starts[place] + size[owner];
    }
    let mut fill = vec![0; number];
    order.iter().enumerate().for_each(|(place, &owner)| fill[owner] = starts[place]);
    let mut nodes = vec![0; count];
    for (node, &owner) in component.iter().enumerate() {
        nodes[fill[owner]] = node;
        fill[owner] += 1;
    }
    Components { nodes, starts, loops: order.iter().map(|&owner| is_loop[owner]).collect() }
}

/// Adjacency lists of a graph, stored consecutively.
struct AdjacencyLists {
    /// Start of the list of each node in `entries`, and the end of the last list.
    starts: Vec<usize>,
    entries: Vec<usize>,
}

impl AdjacencyLists {
    /// Creates the lists of `count` nodes; edges with a node not below `count` are left out.
    fn new(count: usize, edges: impl Iterator<Item = (usize, usize)> + Clone) -> Self {
        let edges = edges.filter(|(from, to)| *from < count && *to < count);
        let mut starts = vec![0; count + 1];
        edges.clone().for_each(|(from, _)| starts[from + 1] += 1);
        for node in 0..count {
            starts[node + 1] += starts[node];
        }
        let mut fill = starts.clone();
        let mut entries = vec![0; starts[count]];
        for (from, to) in edges {
            entries[fill[from]] = to;
            fill[from] += 1;
        }
        Self { starts, entries }
    }

    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn neighbours(&self, node: usize) -> &[usize] {
        &self.entries[self.starts[node]..self.starts[node + 1]]
    }
}

/// Returns the component of each node, from 0, and the number of components (Tarjan 1972).
fn tarjan(successors: &AdjacencyLists) -> (Vec<usize>, usize) {
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
            if let Some(&other) = successors.neighbours(node).get(edge) {
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

/// Returns the nodes of an acyclic graph in topological order; among several possible next nodes the one of
/// the lowest `rank` comes first (Kahn 1962).
fn kahn(successors: &AdjacencyLists, rank: &[usize]) -> Vec<usize> {
    let mut predecessors = vec![0_usize; successors.len()];
    successors.entries.iter().for_each(|&to| predecessors[to] += 1);
    let sources = (0..predecessors.len()).filter(|&node| predecessors[node] == 0);
    let mut heap: BinaryHeap<_> = sources.map(|node| Reverse((rank[node], node))).collect();
    let mut order = Vec::with_capacity(predecessors.len());
    while let Some(Reverse((_, node))) = heap.pop() {
        order.push(node);
        for &to in successors.neighbours(node) {
            predecessors[to] -= 1;
            if predecessors[to] == 0 {
                heap.push(Reverse((rank[to], to)));
            }
        }
    }
    order
}

#[cfg(test)]
#[path = "graph/tests.rs"]
mod tests;
