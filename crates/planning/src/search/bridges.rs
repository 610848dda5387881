//! Decides which moves between clusters are worth trying: where all nearest points of every point of a cluster lie in
//! that cluster, lists of them cannot say in which order clusters are visited.
//!
//! Clusters are the connected parts of the graph of nearest points; a plate without gaps is one, and nothing is added.
//! Which clusters are near each other is decided as for points ([`neighbours::select`]), by the shortest move between them.

use super::neighbours::{self, Near};
use crate::costs::CostMatrix;

/// Shortest moves kept from one cluster to a near one, each from another point.
const MOVES: usize = 5;

/// Near clusters of each among which relative neighbours are sought.
const LOOK: usize = 100;

/// Moves between near clusters as (from, to, cost), with costs as `scale` makes them integers.
pub(super) fn between_clusters(
    costs: &CostMatrix,
    scale: f64,
    near: &Near,
) -> Vec<(u32, u32, i32)> {
    let (cluster, clusters) = clusters(near);
    if clusters < 2 {
        return Vec::new();
    }
    // The nearest point of each cluster to each point, and of each cluster to each.
    let mut nearest = vec![(i32::MAX, 0); costs.len() * clusters];
    let mut shortest = vec![i32::MAX; clusters * clusters];
    for (here, nearest) in nearest.chunks_exact_mut(clusters).enumerate() {
        for (there, &cost) in costs.row(here).iter().enumerate() {
            let best = &mut nearest[cluster[there] as usize];
            let cost = (cost * scale + 0.5) as i32;
            if cost < best.0 {
                *best = (cost, there as u32);
            }
        }
        let here_in = cluster[here] as usize;
        for (shortest, nearest) in shortest[here_in * clusters..].iter_mut().zip(nearest) {
            *shortest = nearest.0.min(*shortest);
        }
    }
    let mut members = vec![Vec::new(); clusters];
    for (point, &cluster) in cluster.iter().enumerate() {
        members[cluster as usize].push(point);
    }
    let distance = |a: u32, b: u32| i64::from(shortest[a as usize * clusters + b as usize]);
    let mut bridges = Vec::new();
    for (cluster, members) in members.iter().enumerate() {
        let others = (0..clusters as u32)
            .filter(|&other| other as usize != cluster)
            .map(|other| (other, distance(cluster as u32, other) as i32))
            .collect();
        for (other, _) in neighbours::select(others, LOOK, distance) {
            let mut moves: Vec<(i32, u32, u32)> = members
                .iter()
                .map(|&here| {
                    let (cost, there) = nearest[here * clusters + other as usize];
                    (cost, here as u32, there)
                })
                .collect();
            if moves.len() > MOVES {
                moves.select_nth_unstable(MOVES);
                moves.truncate(MOVES);
            }
            bridges.extend(
                moves
                    .into_iter()
                    .map(|(cost, here, there)| (here, there, cost)),
            );
        }
    }
    bridges
}

/// The cluster of each point, numbered from zero, and how many there are.
fn clusters(near: &Near) -> (Vec<u32>, usize) {
    const NONE: u32 = u32::MAX;
    let mut mutual = vec![Vec::new(); near.len()];
    for here in 0..near.len() as u32 {
        for &(there, _) in near.of(here).iter().take(neighbours::NEAREST) {
            mutual[here as usize].push(there);
            mutual[there as usize].push(here);
        }
    }
    let mut cluster = vec![NONE; near.len()];
    let mut clusters = 0;
    let mut reached = Vec::new();
    for point in 0..near.len() as u32 {
        reached.push(point);
        let mut new = false;
        while let Some(here) = reached.pop() {
            if cluster[here as usize] == NONE {
                cluster[here as usize] = clusters;
                reached.extend(&mutual[here as usize]);
                new = true;
            }
        }
        clusters += u32::from(new);
    }
    (cluster, clusters as usize)
}
