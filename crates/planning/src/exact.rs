//! Decides the shortest open path exactly: dynamic programming over subsets of points (Held and Karp 1962), O(n² 2ⁿ)
//! for n points, with precedence, stages and alternative poses as rules on what may come next.
//!
//! Of equally short paths the one with the lowest indices, read from the start, is returned.

use crate::problem::Checked;

/// Largest number of points solved exactly.
pub const EXACT_LIMIT: usize = 12;

/// The shortest order of poses. The table holds, for (points visited, pose), the cheapest completion, so that
/// walking forwards with the lowest index among equals gives the lexicographically first path.
pub(crate) fn shortest_path(problem: &Checked) -> Vec<usize> {
    let points = problem.poses_of.len();
    if points == 0 {
        return Vec::new();
    }
    let poses = problem.point_of.len();
    let full = (1_usize << points) - 1;
    let point = |pose: usize| problem.point_of[pose];
    // Points that must have been visited before a point may be.
    let needs: Vec<usize> = (0..points)
        .map(|this| {
            let staged = (0..points).filter(|&other| problem.stage[other] < problem.stage[this]);
            staged
                .chain(problem.earlier[this].iter().copied())
                .fold(0, |set, other| set | 1 << other)
        })
        .collect();
    let may_follow = |set: usize, pose: usize| {
        let this = point(pose);
        let last = set | 1 << this == full;
        set >> this & 1 == 0
            && needs[this] & !set == 0
            && problem
                .start
                .is_none_or(|start| pose == start || set != 0 && point(start) != this)
            && problem
                .end
                .is_none_or(|end| pose == end && last || point(end) != this && !last)
    };
    let mut rest = vec![f64::INFINITY; (full + 1) * poses];
    rest[full * poses..].fill(0.0);
    let onward = |rest: &[f64], set: usize, here: usize, next: usize| {
        problem.costs.cost(here, next) + rest[(set | 1 << point(next)) * poses + next]
    };
    for set in (1..full).rev() {
        let follows: Vec<usize> = (0..poses).filter(|&next| may_follow(set, next)).collect();
        for here in (0..poses).filter(|&here| set >> point(here) & 1 == 1) {
            rest[set * poses + here] = follows
                .iter()
                .map(|&next| onward(&rest, set, here, next))
                .fold(f64::INFINITY, f64::min);
        }
    }
    let mut order: Vec<usize> = Vec::with_capacity(points);
    let mut set = 0;
    while set != full {
        let costs = (0..poses)
            .filter(|&next| may_follow(set, next))
            .map(|next| match order.last() {
                Some(&here) => (next, onward(&rest, set, here, next)),
                None => (next, rest[(1 << point(next)) * poses + next]),
            });
        let best = costs.fold((0, f64::INFINITY), |best, next| {
            if next.1 < best.1 { next } else { best }
        });
        if best.1 == f64::INFINITY {
            return problem.given.clone();
        }
        order.push(best.0);
        set |= 1 << point(best.0);
    }
    order
}
