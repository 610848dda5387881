//! Decides which near neighbours are worth trying: those whose move is likely to belong to a shortest ring.
//!
//! A minimum spanning tree is nearly a ring when every point has two neighbours in it. A penalty per point, added to
//! all its moves, changes no ring relative to another but the tree; raising it where the tree has too many neighbours
//! and lowering it at leaves (subgradient ascent, Held and Karp 1971) brings the tree near a ring. What a move then
//! lacks to belong to a minimum tree, its alpha value (Helsgaun 2000), ranks it far better than its cost does.
//! Works on the sparse graph of near neighbours, so each round costs O(n log n), and ranks only what is near or near to
//! that.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::neighbours::Near;

/// Rounds of the ascent.
const ROUNDS: usize = 60;

type Neighbours = Vec<Vec<(u32, i32)>>;

/// A minimum spanning tree by what each point was reached from.
struct Tree {
    /// Point and cost, penalties included; itself at the root.
    parent: Vec<(u32, i64)>,
    degree: Vec<i64>,
}

/// For each point the `keep` with the least alpha value of the points up to two near moves off, and those across a
/// bridge, nearest first. Points without near neighbours stay out; a negative cost is no move.
pub(super) fn most_promising(
    near: &[Vec<(u32, i32)>],
    bridges: &[(u32, u32, i32)],
    keep: usize,
    cost: impl Fn(u32, u32) -> i64,
) -> Near {
    let graph = both_ways(near, bridges);
    let mut penalty = vec![0; graph.len()];
    let mut tree = spanning_tree(&graph, &penalty);
    let edges = tree.parent.iter().map(|&(_, cost)| cost).sum::<i64>();
    let mean = edges as f64 / graph.len().max(1) as f64;
    let mut before = vec![0; graph.len()];
    let mut best = (i64::MIN, penalty.clone());
    for round in 0..ROUNDS {
        // The step falls from a fifth of a mean move to nearly nothing.
        let step = 0.2 * mean * (1.0 - round as f64 / ROUNDS as f64).powi(2);
        for (point, penalty) in penalty.iter_mut().enumerate() {
            let excess = tree.degree[point] - 2;
            *penalty += (step * (0.7 * excess as f64 + 0.3 * before[point] as f64)) as i64;
            before[point] = excess;
        }
        tree = spanning_tree(&graph, &penalty);
        let bound = tree.parent.iter().map(|&(_, cost)| cost).sum::<i64>()
            - 2 * penalty.iter().sum::<i64>();
        if bound > best.0 {
            best = (bound, penalty.clone());
        }
    }
    let penalty = best.1;
    let bottleneck = BottleneckTree::new(&graph, &penalty);
    let mut seen = vec![u32::MAX; graph.len()];
    let mut others = Vec::new();
    let mut bridged = vec![Vec::new(); graph.len()];
    for &(here, there, cost) in bridges {
        bridged[here as usize].push((there, cost));
        bridged[there as usize].push((here, cost));
    }
    (0..graph.len() as u32)
        .map(|here| {
            two_moves_off(&graph, here, &mut seen, &mut others);
            let mut ranked: Vec<(i64, i32, u32)> = Vec::with_capacity(keep + 1);
            for &there in &others {
                let cost = cost(here, there);
                let penalties = penalty[here as usize] + penalty[there as usize];
                let alpha = cost + penalties - bottleneck.between(here, there);
                let entry = (alpha, cost as i32, there);
                if cost >= 0 && (ranked.len() < keep || entry < ranked[keep - 1]) {
                    ranked.insert(ranked.partition_point(|kept| *kept < entry), entry);
                    ranked.truncate(keep);
                }
            }
            let kept = ranked.into_iter().map(|(_, cost, there)| (there, cost));
            let mut kept: Vec<(u32, i32)> =
                kept.chain(bridged[here as usize].iter().copied()).collect();
            kept.sort_unstable_by_key(|&(there, cost)| (cost, there));
            kept.dedup();
            kept
        })
        .collect()
}

/// The points that are near a point or near those, each once.
fn two_moves_off(graph: &Neighbours, here: u32, seen: &mut [u32], others: &mut Vec<u32>) {
    others.clear();
    seen[here as usize] = here;
    let mut visit = |there: u32, others: &mut Vec<u32>| {
        if std::mem::replace(&mut seen[there as usize], here) != here {
            others.push(there);
        }
    };
    for &(near, _) in &graph[here as usize] {
        visit(near, others);
    }
    for at in 0..others.len() {
        for &(there, _) in &graph[others[at] as usize] {
            visit(there, others);
        }
    }
}

/// The largest edge cost on the path between two points of a minimum spanning tree (their bottleneck), in O(log n): the
/// tree is grown by its cheapest edges first (Kruskal 1956), and of two components that an edge joins the shallower one is
/// linked below the other by that edge.
struct BottleneckTree {
    /// Parent of each point and the cost of the link; itself at a root.
    above: Vec<(u32, i64)>,
}

impl BottleneckTree {
    fn new(graph: &Neighbours, penalty: &[i64]) -> Self {
        let points = graph.len() as u32;
        let mut edges: Vec<(i64, u32, u32)> = Vec::new();
        for (here, others) in graph.iter().enumerate() {
            for &(there, cost) in others {
                if (here as u32) < there {
                    let penalties = penalty[here] + penalty[there as usize];
                    edges.push((i64::from(cost) + penalties, here as u32, there));
                }
            }
        }
        edges.sort_unstable();
        let mut above: Vec<(u32, i64)> = (0..points).map(|point| (point, i64::MAX)).collect();
        let mut height = vec![0_u8; graph.len()];
        for (cost, here, there) in edges {
            let [mut low, mut high] = [here, there].map(|point| {
                let mut root = point;
                while above[root as usize].0 != root {
                    root = above[root as usize].0;
                }
                root
            });
            if low == high {
                continue;
            }
            if height[low as usize] > height[high as usize] {
                (low, high) = (high, low);
            }
            if height[low as usize] == height[high as usize] {
                height[high as usize] += 1;
            }
            above[low as usize] = (high, cost);
        }
        Self { above }
    }

    /// Very small where no path joins the points. Costs only rise towards the root, so the last step taken has the largest.
    fn between(&self, here: u32, there: u32) -> i64 {
        const NONE: i64 = i64::MIN / 4;
        let (mut here, mut there) = (here as usize, there as usize);
        let mut dearest = NONE;
        while here != there {
            if self.above[here].1 > self.above[there].1 {
                (here, there) = (there, here);
            }
            let (next, cost) = self.above[here];
            if next as usize == here {
                return NONE;
            }
            (here, dearest) = (next as usize, cost);
        }
        dearest
    }
}

/// The graph in which every neighbour is mutual.
fn both_ways(near: &[Vec<(u32, i32)>], bridges: &[(u32, u32, i32)]) -> Neighbours {
    let mut graph = near.to_vec();
    for &(here, there, cost) in bridges {
        graph[here as usize].push((there, cost));
        graph[there as usize].push((here, cost));
    }
    for (here, others) in near.iter().enumerate() {
        for &(there, cost) in others {
            graph[there as usize].push((here as u32, cost));
        }
    }
    for others in &mut graph {
        others.sort_unstable();
        others.dedup();
    }
    graph
}

/// Prim's tree with penalties; a part of the graph that cannot be reached begins a tree of its own.
fn spanning_tree(graph: &Neighbours, penalty: &[i64]) -> Tree {
    let points = graph.len();
    let mut tree = Tree {
        parent: (0..points as u32).map(|point| (point, 0)).collect(),
        degree: vec![0; points],
    };
    let mut done = vec![false; points];
    let mut cheapest = vec![i64::MAX; points];
    let mut heap = BinaryHeap::new();
    for root in 0..points as u32 {
        heap.push(Reverse((i64::MIN, root, root)));
        while let Some(Reverse((cost, point, from))) = heap.pop() {
            if std::mem::replace(&mut done[point as usize], true) {
                continue;
            }
            if from != point {
                tree.parent[point as usize] = (from, cost);
                tree.degree[point as usize] += 1;
                tree.degree[from as usize] += 1;
            }
            for &(next, cost) in &graph[point as usize] {
                let cost = i64::from(cost) + penalty[point as usize] + penalty[next as usize];
                if !done[next as usize] && cost < cheapest[next as usize] {
                    cheapest[next as usize] = cost;
                    heap.push(Reverse((cost, next, point)));
                }
            }
        }
    }
    tree
}
