//! Decides the path a search begins with: the shortest of the given order and a few quick constructions.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::RngCore;

use super::neighbours::Near;
use crate::costs::CostMatrix;
use crate::problem::Checked;

/// Moves looked at for nearest-neighbour paths; each path looks at n² of them.
const MOVES: usize = 20_000_000;

/// How much dearer a move may seem by chance.
const BLUR: f64 = 0.3;

/// The shortest of the given order and nearest-neighbour paths from spread starts; ties go to the earlier one.
pub(super) fn by_nearest(problem: &Checked) -> Vec<usize> {
    let costs = problem.costs;
    let starts = match problem.start {
        Some(start) => vec![start],
        None => (0..costs.len())
            .filter(|&pose| Some(pose) != problem.end)
            .collect(),
    };
    let affordable = (MOVES / (costs.len() * costs.len())).clamp(1, starts.len());
    let paths = starts
        .iter()
        .step_by(starts.len().div_ceil(affordable))
        .map(|&start| {
            if problem.is_plain() {
                nearest_neighbour(costs, start, problem.end)
            } else {
                nearest_allowed(problem, start)
            }
        });
    shortest(problem, paths)
}

/// The shorter of the given order and the path that takes the cheapest moves of all first (greedy edges), as long as
/// they leave a path; what remains in pieces is joined by going to the nearest free end.
pub(super) fn by_cheapest(problem: &Checked, near: &Near) -> Vec<usize> {
    shortest(
        problem,
        std::iter::once(Pieces::new(problem, near, |cost| cost).join()),
    )
}

/// The path of [`by_cheapest`] for costs made dearer by chance, each by up to [`BLUR`] of itself.
pub(super) fn by_nearly_cheapest(problem: &Checked, near: &Near, rng: &mut Pcg32) -> Vec<usize> {
    let blurred = |cost: i32| {
        let luck = f64::from(rng.next_u32()) / 4_294_967_296.0;
        (f64::from(cost) * (1.0 + BLUR * luck)) as i32
    };
    Pieces::new(problem, near, blurred).join()
}

fn shortest(problem: &Checked, paths: impl Iterator<Item = Vec<usize>>) -> Vec<usize> {
    let mut best = problem.given.clone();
    let mut best_cost = problem.costs.path_cost(&best);
    for path in paths {
        let cost = problem.costs.path_cost(&path);
        if cost < best_cost {
            (best, best_cost) = (path, cost);
        }
    }
    best
}

/// Goes to the nearest pose that is allowed next, beginning with `start` when that is allowed.
fn nearest_allowed(problem: &Checked, start: usize) -> Vec<usize> {
    let path = problem.build(|here, allowed| {
        let cost = |pose: usize| match here {
            Some(here) => problem.costs.cost(here, pose),
            None => f64::from(u8::from(pose != start)),
        };
        let nearest = allowed.iter().map(|&pose| (pose, cost(pose)));
        nearest
            .reduce(|best, next| if next.1 < best.1 { next } else { best })
            .map_or(start, |best| best.0)
    });
    path.unwrap_or_else(|_| problem.given.clone())
}

/// Goes to the nearest unvisited point, lowest index among equals, and ends at the fixed end.
fn nearest_neighbour(costs: &CostMatrix, start: usize, end: Option<usize>) -> Vec<usize> {
    let mut path = vec![start];
    let mut rest: Vec<usize> = (0..costs.len())
        .filter(|&i| i != start && Some(i) != end)
        .collect();
    while !rest.is_empty() {
        let here = path[path.len() - 1];
        let nearest = rest
            .iter()
            .enumerate()
            .fold((0, f64::INFINITY), |best, (at, &next)| {
                let cost = costs.cost(here, next);
                if cost < best.1 { (at, cost) } else { best }
            });
        path.push(rest.remove(nearest.0));
    }
    path.extend(end);
    path
}

/// Pieces of a path, grown by cheap moves.
struct Pieces<'a> {
    problem: &'a Checked<'a>,
    /// Up to two neighbours of each point.
    links: Vec<Vec<usize>>,
}

impl<'a> Pieces<'a> {
    fn new(problem: &'a Checked<'a>, near: &Near, mut seen: impl FnMut(i32) -> i32) -> Self {
        let points = problem.costs.len();
        let mut moves: Vec<(i32, u32, u32)> = (0..points as u32)
            .flat_map(|here| {
                near.of(here)
                    .iter()
                    .map(move |&(there, cost)| (cost, here.min(there), here.max(there)))
            })
            .collect();
        moves.sort_unstable();
        moves.dedup();
        for (cost, _, _) in &mut moves {
            *cost = seen(*cost);
        }
        moves.sort_unstable();
        let mut pieces = Self {
            problem,
            links: vec![Vec::with_capacity(2); points],
        };
        // The other end of the piece that ends here; the fixed ends count as joined outside the path.
        let mut other_end: Vec<usize> = (0..points).collect();
        if let (Some(start), Some(end)) = (problem.start, problem.end) {
            (other_end[start], other_end[end]) = (end, start);
        }
        for (_, here, there) in moves {
            let [here, there] = [here as usize, there as usize];
            if pieces.room(here) && pieces.room(there) && other_end[here] != there {
                pieces.links[here].push(there);
                pieces.links[there].push(here);
                let ends = [other_end[here], other_end[there]];
                (other_end[ends[0]], other_end[ends[1]]) = (ends[1], ends[0]);
            }
        }
        pieces
    }

    /// True when the point may get another neighbour.
    fn room(&self, point: usize) -> bool {
        let fixed = [self.problem.start, self.problem.end].contains(&Some(point));
        self.links[point].len() < 2 - usize::from(fixed)
    }

    /// Walks piece by piece: from the end of one to the nearest end of another, and last the one with the fixed end.
    fn join(&self) -> Vec<usize> {
        let points = self.links.len();
        let mut path = Vec::with_capacity(points);
        let mut seen = vec![false; points];
        let mut ends: Vec<usize> = (0..points).filter(|&i| self.links[i].len() < 2).collect();
        let last = self.problem.end.map_or(usize::MAX, |end| self.far_end(end));
        let enters = |&&end: &&usize| Some(end) != self.problem.end && end != last;
        let first = ends.iter().find(enters).copied();
        let mut next = self.problem.start.or(first).or(Some(last));
        while let Some(begin) = next {
            let mut here = begin;
            loop {
                seen[here] = true;
                path.push(here);
                match self.links[here].iter().find(|&&there| !seen[there]) {
                    Some(&there) => here = there,
                    None => break,
                }
            }
            ends.retain(|&end| !seen[end]);
            let costs = self.problem.costs;
            next = ends
                .iter()
                .filter(enters)
                .min_by(|&&a, &&b| costs.cost(here, a).total_cmp(&costs.cost(here, b)))
                .copied()
                .or_else(|| (!ends.is_empty()).then_some(last));
        }
        path
    }

    /// The other end of the piece that ends here.
    fn far_end(&self, end: usize) -> usize {
        let (mut before, mut here) = (usize::MAX, end);
        while let Some(&next) = self.links[here].iter().find(|&&next| next != before) {
            (before, here) = (here, next);
        }
        here
    }
}
