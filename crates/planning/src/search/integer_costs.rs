//! Holds a problem in the form the search wants: integer costs, a first and a last point, near neighbours.

use super::alpha_nearness::most_promising;
use super::neighbours::{Near, select};
use crate::costs::CostMatrix;
use crate::problem::Checked;

/// The largest cost becomes this integer; rounding is 7e-9 of it.
const LARGEST: f64 = (1_u32 << 26) as f64;

/// Nearest poses among which relative neighbours are sought.
const LOOK: usize = 300;

/// Neighbours kept of those, where the search goes by how likely they belong to a shortest ring.
const PROMISING: usize = 5;

/// Near points kept, where these have alternatives.
const POINTS: usize = 8;

/// Cost of the edge that closes the path to a ring: so cheap that no exchange of a few edges removes it.
const CLOSING: i32 = -(1 << 30);

/// What is near a pose.
#[derive(Clone, Copy)]
pub(super) enum NeighbourLists<'a> {
    /// The points most likely adjacent in a shortest ring, found among these, and those across these bridges between
    /// clusters; both are in the caller's numbers: where all points are plain and moves symmetric.
    Promising(&'a Near, &'a [(u32, u32, i32)]),
    /// The nearest poses of other points.
    Poses,
    /// The nearest other points, each by the nearest of its poses.
    Points,
}

/// Integer costs between poses and, where an end is free, a dummy pose. Poses are numbered along a short path, so
/// that near poses lie near each other in memory too; alternatives not on that path come last. The rules speak of
/// points, numbered like their pose on that path.
pub(super) struct IntegerCosts {
    /// The caller's index of each pose; dummies have none.
    labels: Vec<Option<usize>>,
    points: usize,
    entries: Vec<i32>,
    symmetric: bool,
    after: Near,
    before: Option<Near>,
    /// Of promising neighbours: these and the nearest points.
    more: Near,
    pub(super) rules: Rules,
}

/// What an order must keep.
pub(super) struct Rules {
    /// Point of each pose.
    pub(super) point_of: Vec<u32>,
    /// Poses of each point.
    pub(super) poses_of: Vec<Vec<u32>>,
    /// True when some point has several poses.
    pub(super) alternatives: bool,
    /// True when there are no stages and no precedence.
    pub(super) free: bool,
    /// Stage of each point, never falling along the path.
    pub(super) stage: Vec<u32>,
    /// Points directly after and before each point.
    pub(super) later: Vec<Vec<u32>>,
    pub(super) earlier: Vec<Vec<u32>>,
}

impl Rules {
    fn new(problem: &Checked, labels: &[Option<usize>], points: usize) -> Self {
        let mut number = vec![0; problem.poses_of.len()];
        for (at, pose) in labels[..points].iter().enumerate() {
            if let Some(pose) = pose {
                number[problem.point_of[*pose]] = at as u32;
            }
        }
        let point_of: Vec<u32> = labels
            .iter()
            .enumerate()
            .map(|(at, pose)| pose.map_or(at as u32, |pose| number[problem.point_of[pose]]))
            .collect();
        let mut poses_of = vec![Vec::new(); points];
        for (pose, &point) in point_of.iter().enumerate() {
            poses_of[point as usize].push(pose as u32);
        }
        let ask = |at: usize| labels[at].map(|pose| problem.point_of[pose]);
        let renumber = |lists: &[Vec<usize>]| -> Vec<Vec<u32>> {
            (0..points)
                .map(|at| {
                    ask(at).map_or(Vec::new(), |point| {
                        lists[point].iter().map(|&p| number[p]).collect()
                    })
                })
                .collect()
        };
        let first = problem.stage.iter().copied().min().unwrap_or(0);
        let last = problem.stage.iter().copied().max().unwrap_or(0);
        let edge = |at: usize| if at == 0 { first } else { last };
        Self {
            alternatives: labels.len() > points,
            free: first == last && problem.later.iter().all(Vec::is_empty),
            stage: (0..points)
                .map(|at| ask(at).map_or(edge(at), |point| problem.stage[point]))
                .collect(),
            later: renumber(&problem.later),
            earlier: renumber(&problem.earlier),
            point_of,
            poses_of,
        }
    }
}

/// What a cost is multiplied with to make it an integer.
pub(super) fn scale(costs: &CostMatrix) -> f64 {
    let largest = costs.largest();
    if largest > 0.0 {
        LARGEST / largest
    } else {
        0.0
    }
}

/// The costs between poses as integers, row by row; moves from and to dummies, which stand at either end of the points,
/// cost nothing.
fn integers(problem: &Checked, labels: &[Option<usize>], points: usize, scale: f64) -> Vec<i32> {
    let poses = labels.len();
    let first = usize::from(problem.start.is_none());
    let plain = points - first - usize::from(problem.end.is_none());
    let known: Vec<u32> = labels.iter().flatten().map(|&label| label as u32).collect();
    let (on_path, others) = known.split_at(plain);
    let mut entries = vec![0; poses * poses];
    for (row, from) in entries.chunks_exact_mut(poses.max(1)).zip(labels) {
        let Some(from) = from else { continue };
        let costs = problem.costs.row(*from);
        for (begin, labels) in [(first, on_path), (points, others)] {
            for (entry, &to) in row[begin..].iter_mut().zip(labels) {
                *entry = (costs[to as usize] * scale + 0.5) as i32;
            }
        }
    }
    entries
}

/// Both lists of near points in one, nearest first.
fn joined(mut near: Vec<(u32, i32)>, others: &[(u32, i32)]) -> Vec<(u32, i32)> {
    near.extend_from_slice(others);
    near.sort_unstable_by_key(|&(there, cost)| (cost, there));
    near.dedup();
    near
}

impl IntegerCosts {
    /// `beginning` is the order of poses by which the points are numbered; it becomes 0, 1, 2, …
    pub(super) fn new(problem: &Checked, beginning: &[usize], lists: NeighbourLists) -> Self {
        let costs = problem.costs;
        let head = problem.start.is_none().then_some(None);
        let tail = problem.end.is_none().then_some(None);
        let mut labels: Vec<Option<usize>> = head
            .into_iter()
            .chain(beginning.iter().copied().map(Some))
            .chain(tail)
            .collect();
        let points = labels.len();
        let fixed = [problem.start, problem.end].map(|end| end.map(|pose| problem.point_of[pose]));
        for (point, poses) in problem.poses_of.iter().enumerate() {
            if poses.len() > 1 && !fixed.contains(&Some(point)) {
                labels.extend(
                    poses
                        .iter()
                        .filter(|&pose| !beginning.contains(pose))
                        .map(|&pose| Some(pose)),
                );
            }
        }
        let poses = labels.len();
        let scale = scale(costs);
        let mut entries = integers(problem, &labels, points, scale);
        entries[points - 1] = CLOSING;
        entries[(points - 1) * poses] = CLOSING;
        let rules = Rules::new(problem, &labels, points);
        let mut grid = Self {
            labels,
            points,
            entries,
            symmetric: costs.is_symmetric(),
            after: Near::from_iter([]),
            before: None,
            more: Near::from_iter([]),
            rules,
        };
        match lists {
            NeighbourLists::Promising(near, bridges) => {
                let number = grid.numbers();
                let near = grid.renumber(near, &number);
                let bridges = grid.renumber_bridges(bridges, &number);
                let cost = |a, b| grid.cost(a, b);
                let promising = most_promising(&near, &bridges, PROMISING, cost);
                grid.more = near
                    .into_iter()
                    .zip(0..)
                    .map(|(near, here)| joined(near, promising.of(here)))
                    .collect();
                grid.after = promising;
            }
            NeighbourLists::Poses => {
                grid.after = grid.nearest(Self::cost);
                if !grid.symmetric {
                    grid.before = Some(grid.nearest(|grid, here, there| grid.cost(there, here)));
                }
            }
            NeighbourLists::Points => grid.after = grid.nearest_points(),
        }
        grid
    }

    /// The pose of each label.
    fn numbers(&self) -> Vec<u32> {
        let mut number = vec![0; self.labels.len()];
        for (at, label) in self.labels.iter().enumerate() {
            if let Some(label) = label {
                number[*label] = at as u32;
            }
        }
        number
    }

    /// Near poses of each pose in the numbers of the grid; dummies have none, and the ends are not near each other.
    fn renumber(&self, near: &Near, number: &[u32]) -> Vec<Vec<(u32, i32)>> {
        let others = |here: usize, label: usize| {
            near.of(label as u32)
                .iter()
                .map(|&(there, cost)| (number[there as usize], cost))
                .filter(|&(there, _)| self.cost(here as u32, there) >= 0)
                .collect()
        };
        self.labels
            .iter()
            .enumerate()
            .map(|(here, label)| label.map_or(Vec::new(), |label| others(here, label)))
            .collect()
    }

    /// Moves in the numbers of the grid, but for that between the ends.
    fn renumber_bridges(
        &self,
        bridges: &[(u32, u32, i32)],
        number: &[u32],
    ) -> Vec<(u32, u32, i32)> {
        bridges
            .iter()
            .map(|&(here, there, cost)| (number[here as usize], number[there as usize], cost))
            .filter(|&(here, there, _)| self.cost(here, there) >= 0)
            .collect()
    }

    /// For each pose the nearest poses of other points; dummies stay out.
    fn nearest(&self, cost: impl Fn(&Self, u32, u32) -> i64) -> Near {
        let poses = self.labels.len() as u32;
        let point = |pose: u32| self.rules.point_of[pose as usize];
        let wanted = |pose: u32| self.labels[pose as usize].is_some();
        (0..poses)
            .map(|here| {
                if !wanted(here) {
                    return Vec::new();
                }
                let others = (0..poses)
                    .filter(|&there| {
                        point(there) != point(here) && wanted(there) && self.cost(here, there) >= 0
                    })
                    .map(|there| (there, cost(self, here, there) as i32))
                    .collect();
                select(others, LOOK, |near, there| cost(self, near, there))
            })
            .collect()
    }

    /// For each pose the nearest other points, by the nearest of their poses; dummies stay out.
    fn nearest_points(&self) -> Near {
        let poses = self.labels.len() as u32;
        let mut nearest = vec![(i32::MAX, 0); self.points];
        (0..poses)
            .map(|here| {
                if self.labels[here as usize].is_none() {
                    return Vec::new();
                }
                nearest.fill((i32::MAX, 0));
                for there in (0..poses).filter(|&there| self.labels[there as usize].is_some()) {
                    let point = self.rules.point_of[there as usize] as usize;
                    let cost = self.cost(here, there);
                    if cost >= 0 && (cost as i32) < nearest[point].0 {
                        nearest[point] = (cost as i32, there);
                    }
                }
                nearest[self.rules.point_of[here as usize] as usize].0 = i32::MAX;
                let others = nearest.iter().filter(|&&(cost, _)| cost < i32::MAX);
                let others = others.map(|&(cost, there)| (there, cost)).collect();
                let mut kept = select(others, LOOK, |near, there| self.cost(near, there));
                kept.truncate(POINTS);
                for (there, _) in &mut kept {
                    *there = self.rules.point_of[*there as usize];
                }
                kept
            })
            .collect()
    }

    #[inline]
    pub(super) fn cost(&self, from: u32, to: u32) -> i64 {
        i64::from(self.entries[from as usize * self.labels.len() + to as usize])
    }

    /// Points of a path, with its dummies.
    pub(super) fn points(&self) -> usize {
        self.points
    }

    pub(super) fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// Near points, to which a move is cheap, with its cost.
    #[inline]
    pub(super) fn near(&self, here: u32) -> &[(u32, i32)] {
        self.after.of(here)
    }

    /// Near points of all points: the most promising ones.
    pub(super) fn candidates(&self) -> &Near {
        &self.after
    }

    /// The same with the nearest points, where the search goes by promise; else none.
    pub(super) fn more_candidates(&self) -> &Near {
        &self.more
    }

    /// Points to which a move from here is cheap.
    pub(super) fn after(&self, here: u32) -> impl Iterator<Item = u32> {
        self.after.of(here).iter().map(|&(point, _)| point)
    }

    /// Points from which a move to here is cheap.
    pub(super) fn before(&self, here: u32) -> impl Iterator<Item = u32> {
        let before = self.before.as_ref().unwrap_or(&self.after);
        before.of(here).iter().map(|&(point, _)| point)
    }

    pub(super) fn length(&self, path: &[u32]) -> i64 {
        path.windows(2)
            .map(|move_| self.cost(move_[0], move_[1]))
            .sum()
    }

    /// The path of a caller's order of poses, with its dummies.
    pub(super) fn path(&self, order: &[usize]) -> Vec<u32> {
        let number = self.numbers();
        let head = self.labels[0].is_none().then_some(0);
        let last = self.points - 1;
        let tail = self.labels[last].is_none().then_some(last as u32);
        head.into_iter()
            .chain(order.iter().map(|&pose| number[pose]))
            .chain(tail)
            .collect()
    }

    /// The caller's order of a path, or of a ring that holds the path in either direction.
    pub(super) fn strip(&self, ring: &[u32]) -> Vec<usize> {
        let size = ring.len();
        let start = ring.iter().position(|&point| point == 0).unwrap_or(0);
        let backwards = size > 2 && ring[(start + 1) % size] as usize == size - 1;
        (0..size)
            .map(|step| {
                ring[if backwards {
                    start + size - step
                } else {
                    start + step
                } % size]
            })
            .filter_map(|point| self.labels[point as usize])
            .collect()
    }
}
