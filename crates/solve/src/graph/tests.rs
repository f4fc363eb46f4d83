use super::*;

fn parts(found: &Components) -> Vec<(Vec<usize>, bool)> {
    (0..found.len()).map(|index| (found.nodes(index).to_vec(), found.is_loop(index))).collect()
}

#[test]
fn a_chain_is_ordered_and_free_nodes_keep_their_order() {
    let found = components(5, &[(3, 1), (1, 0)]);
    assert_eq!(found.sequence(), [2, 3, 1, 0, 4]);
    assert!((0..5).all(|index| !found.is_loop(index)));
}

#[test]
fn loops_are_those_of_tarjan_1972() {
    // Figure 3 of the paper, its nodes 1 to 8 numbered 0 to 7 here.
    let edges = [(0, 1), (1, 2), (1, 7), (2, 3), (2, 6), (3, 4), (4, 2), (4, 5), (6, 3), (6, 5)];
    let edges = [&edges[..], &[(7, 0), (7, 6)]].concat();
    let found = components(8, &edges);
    assert_eq!(parts(&found), [(vec![0, 1, 7], true), (vec![2, 3, 4, 6], true), (vec![5], false)]);
}

#[test]
fn a_node_that_needs_itself_is_a_loop() {
    let found = components(2, &[(1, 1)]);
    assert_eq!(parts(&found), [(vec![0], false), (vec![1], true)]);
}

#[test]
fn repeated_and_dangling_edges_change_nothing() {
    let found = components(3, &[(1, 0), (1, 0), (9, 0), (0, 9), (2, 1), (2, 1)]);
    assert_eq!(found.sequence(), [2, 1, 0]);
    assert!(components(0, &[(0, 0)]).is_empty());
}

/// Returns the transitive closure by Warshall's algorithm: whether a path leads from one node to another.
fn reachable(count: usize, edges: &[(usize, usize)]) -> Vec<Vec<bool>> {
    let mut matrix = vec![vec![false; count]; count];
    for &(from, to) in edges {
        matrix[from][to] = true;
    }
    for middle in 0..count {
        for from in 0..count {
            for to in 0..count {
                matrix[from][to] |= matrix[from][middle] && matrix[middle][to];
            }
        }
    }
    matrix
}

#[test]
fn components_of_scattered_graphs_are_those_of_mutual_reachability() {
    let mut state = 1_u64;
    let mut draw = |below: usize| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % below
    };
    for _ in 0..300 {
        let count = 1 + draw(12);
        let edges: Vec<_> = (0..draw(25)).map(|_| (draw(count), draw(count))).collect();
        let found = components(count, &edges);
        let reach = reachable(count, &edges);
        let mut place = vec![0; count];
        for index in 0..found.len() {
            found.nodes(index).iter().for_each(|&node| place[node] = index);
        }
        for a in 0..count {
            assert_eq!(found.is_loop(place[a]), reach[a][a]);
            for b in (0..count).filter(|b| *b != a) {
                assert_eq!(place[a] == place[b], reach[a][b] && reach[b][a], "{edges:?}");
                assert!(!reach[a][b] || place[a] <= place[b], "{edges:?}");
            }
        }
    }
}

#[test]
fn a_ring_and_a_chain_of_a_million_nodes_need_no_deep_stack() {
    let count = 1_000_000;
    let chain: Vec<_> = (1..count).map(|node| (node, node - 1)).collect();
    let found = components(count, &chain);
    assert_eq!(found.len(), count);
    assert_eq!((found.sequence()[0], found.sequence()[count - 1]), (count - 1, 0));
    let ring: Vec<_> = (0..count).map(|node| (node, (node + 1) % count)).collect();
    assert_eq!(components(count, &ring).len(), 1);
}
