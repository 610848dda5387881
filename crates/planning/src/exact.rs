//! Decides the shortest open path exactly: dynamic programming over subsets (Held and Karp 1962), O(n² 2ⁿ).
//!
//! Of equally short paths the one with the lowest indices, read from the start, is returned.

use crate::costs::CostMatrix;

/// Largest number of points solved exactly.
pub const EXACT_LIMIT: usize = 12;

/// The shortest path with optional fixed ends. The table holds, for (last visited set, here), the cheapest completion,
/// so that walking forward with the lowest index among equals gives the lexicographically first path.
pub(crate) fn shortest_path(
    costs: &CostMatrix,
    start: Option<usize>,
    end: Option<usize>,
) -> Vec<usize> {
    let n = costs.len();
    if n == 0 {
        return Vec::new();
    }
    let full = (1_usize << n) - 1;
    // rest[set * n + here]: cheapest way to visit all points outside `set`, standing at `here`, a member of `set`.
    let mut rest = vec![f64::INFINITY; (full + 1) * n];
    for here in 0..n {
        if end.is_none_or(|end| end == here) {
            rest[full * n + here] = 0.0;
        }
    }
    for set in (1..full).rev() {
        for here in (0..n).filter(|here| set >> here & 1 == 1) {
            rest[set * n + here] = (0..n)
                .filter(|next| set >> next & 1 == 0)
                .map(|next| costs.cost(here, next) + rest[(set | 1 << next) * n + next])
                .fold(f64::INFINITY, f64::min);
        }
    }
    let lowest = |candidates: &mut dyn Iterator<Item = (usize, f64)>| {
        candidates
            .fold((usize::MAX, f64::INFINITY), |best, c| {
                if c.1 < best.1 || best.0 == usize::MAX {
                    c
                } else {
                    best
                }
            })
            .0
    };
    let first = start.unwrap_or_else(|| lowest(&mut (0..n).map(|i| (i, rest[(1 << i) * n + i]))));
    let mut order = vec![first];
    let mut set = 1_usize << first;
    while set != full {
        let here = order[order.len() - 1];
        let next = lowest(&mut (0..n).filter(|next| set >> next & 1 == 0).map(|next| {
            (
                next,
                costs.cost(here, next) + rest[(set | 1 << next) * n + next],
            )
        }));
        order.push(next);
        set |= 1 << next;
    }
    order
}
