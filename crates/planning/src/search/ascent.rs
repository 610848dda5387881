//! Decides which near neighbours are worth trying: those whose move is likely to belong to a shortest ring.
//!
//! A minimum spanning tree is nearly a ring when every point has two neighbours in it. A penalty per point, added to
//! all its moves, changes no ring relative to another but the tree; raising it where the tree has too many neighbours
//! and lowering it at leaves (subgradient ascent, Held and Karp 1971) brings the tree near a ring. What a move then
//! lacks to belong to a minimum tree, its alpha value (Helsgaun 2000), ranks it far better than its cost does.
//! Works on the sparse graph of near neighbours, so each round costs O(n log n).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Rounds of the ascent.
const ROUNDS: usize = 60;

use super::near::Near;

type Neighbours = Vec<Vec<(u32, i32)>>;

/// A minimum spanning tree by what each point was reached from.
struct Tree {
    /// Point and cost, penalties included; itself at the root.
    parent: Vec<(u32, i64)>,
    depth: Vec<u32>,
    degree: Vec<i64>,
}

/// Of all points the `keep` with the least alpha value for each point, nearest first. Points without near neighbours
/// stay out; a negative cost is no move.
pub(super) fn most_promising(
    near: &[Vec<(u32, i32)>],
    keep: usize,
    cost: impl Fn(u32, u32) -> i64,
) -> Near {
    let graph = both_ways(near);
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
    let tree = spanning_tree(&graph, &penalty);
    let outwards: Vec<u32> = tree
        .outwards()
        .into_iter()
        .filter(|&point| !graph[point as usize].is_empty())
        .collect();
    let mut longest = vec![0; graph.len()];
    (0..graph.len() as u32)
        .map(|here| {
            if graph[here as usize].is_empty() {
                return Vec::new();
            }
            tree.longest_to_all(here, &outwards, &mut longest);
            let mut ranked: Vec<(i64, i32, u32)> = Vec::with_capacity(keep + 1);
            for &there in outwards.iter().filter(|&&there| there != here) {
                let cost = cost(here, there);
                let penalties = penalty[here as usize] + penalty[there as usize];
                let alpha = cost + penalties - longest[there as usize];
                let entry = (alpha, cost as i32, there);
                if cost >= 0 && (ranked.len() < keep || entry < ranked[keep - 1]) {
                    ranked.insert(ranked.partition_point(|kept| *kept < entry), entry);
                    ranked.truncate(keep);
                }
            }
            let kept = ranked.into_iter().map(|(_, cost, there)| (there, cost));
            let mut kept: Vec<(u32, i32)> = kept.collect();
            kept.sort_unstable_by_key(|&(there, cost)| (cost, there));
            kept
        })
        .collect()
}

/// The graph in which every neighbour is mutual.
fn both_ways(near: &[Vec<(u32, i32)>]) -> Neighbours {
    let mut graph = near.to_vec();
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
        depth: vec![0; points],
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
                tree.depth[point as usize] = tree.depth[from as usize] + 1;
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

impl Tree {
    /// The points, each behind its parent.
    fn outwards(&self) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.parent.len() as u32).collect();
        order.sort_by_key(|&point| self.depth[point as usize]);
        order
    }

    /// The dearest edge on the tree's path from `here` to each point; very little to points of other trees.
    fn longest_to_all(&self, here: u32, outwards: &[u32], longest: &mut [i64]) {
        const NONE: i64 = i64::MIN / 4;
        const UNKNOWN: i64 = i64::MIN;
        longest.fill(UNKNOWN);
        longest[here as usize] = NONE;
        let mut at = here as usize;
        while self.parent[at].0 as usize != at {
            let (parent, cost) = self.parent[at];
            longest[parent as usize] = longest[at].max(cost);
            at = parent as usize;
        }
        for &point in outwards {
            let (parent, cost) = self.parent[point as usize];
            if longest[point as usize] == UNKNOWN {
                longest[point as usize] = if parent == point {
                    NONE
                } else {
                    longest[parent as usize].max(cost)
                };
            }
        }
    }
}
