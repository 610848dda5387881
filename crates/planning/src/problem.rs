//! Holds what is to be ordered: costs, fixed ends, poses, precedence, and the order that has to be beaten.
//!
//! A *pose* is a row of the cost table: one attitude of probe or machine at a point. A *point* is what is measured. Without
//! alternatives they are the same; with them, every point lists its poses and exactly one is visited: the generalised
//! travelling salesman problem. Stages and precedence speak of points, ends and orders of poses.

use serde::{Deserialize, Serialize};

use crate::costs::CostMatrix;

/// Why a problem was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProblemError {
    /// A fixed end names a pose that does not exist.
    #[error("the fixed {end} is pose {pose}, but there are {poses} poses")]
    End {
        /// `start` or `end`.
        end: &'static str,
        /// Index given.
        pose: usize,
        /// Number of poses.
        poses: usize,
    },
    /// One point cannot be both ends of a path of several.
    #[error("point {0} cannot be both start and end of a path of several points")]
    SameEnds(usize),
    /// The alternatives do not divide the poses among the points.
    #[error("pose {0} does not exist, or it does not belong to exactly one point")]
    Alternatives(usize),
    /// A point without any pose cannot be visited.
    #[error("point {0} has no pose")]
    NoPose(usize),
    /// There is not one stage per point.
    #[error("{stages} stages were given for {points} points")]
    Stages {
        /// Stages given.
        stages: usize,
        /// Number of points.
        points: usize,
    },
    /// A precedence names a point that does not exist.
    #[error("a precedence names point {point}, but there are {points} points")]
    Precedence {
        /// Index given.
        point: usize,
        /// Number of points.
        points: usize,
    },
    /// No order keeps all ends, stages and precedences.
    #[error(
        "ends, stages and precedences contradict each other: nothing may be measured before point {0}"
    )]
    Contradiction(usize),
    /// The given order does not visit every point once.
    #[error("pose {0} of the given order does not exist, or its point is not visited exactly once")]
    GivenNotAPermutation(usize),
    /// The given order does not keep an end, a stage or a precedence.
    #[error("the given order has pose {0} where ends, stages or precedence do not allow it")]
    GivenForbidden(usize),
}

/// An open path through all points of a cost table, to be made short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    pub(crate) costs: CostMatrix,
    pub(crate) start: Option<usize>,
    pub(crate) end: Option<usize>,
    pub(crate) given: Option<Vec<usize>>,
    pub(crate) alternatives: Option<Vec<Vec<usize>>>,
    pub(crate) stages: Option<Vec<u32>>,
    pub(crate) precedence: Vec<(usize, usize)>,
}

impl Problem {
    /// Every pose is a point; ends are free; compared with the order 0, 1, 2, …
    pub fn new(costs: CostMatrix) -> Self {
        Self {
            costs,
            start: None,
            end: None,
            given: None,
            alternatives: None,
            stages: None,
            precedence: Vec::new(),
        }
    }

    /// Fixes the first pose of the path.
    pub fn starting_at(mut self, pose: usize) -> Self {
        self.start = Some(pose);
        self
    }

    /// Fixes the last pose of the path.
    pub fn ending_at(mut self, pose: usize) -> Self {
        self.end = Some(pose);
        self
    }

    /// The order of poses in use so far; the answer is never longer. Without it, the points by stage and index with
    /// the first pose of each, as far as ends and precedence allow.
    pub fn given(mut self, order: Vec<usize>) -> Self {
        self.given = Some(order);
        self
    }

    /// The poses of each point, of which exactly one is visited.
    pub fn alternatives(mut self, poses_of_point: Vec<Vec<usize>>) -> Self {
        self.alternatives = Some(poses_of_point);
        self
    }

    /// The stage of each point: lower stages are measured first (datum features before the rest).
    pub fn stages(mut self, stage_of_point: Vec<u32>) -> Self {
        self.stages = Some(stage_of_point);
        self
    }

    /// Pairs of points of which the first is measured before the second (a sequential ordering problem).
    pub fn precedence(mut self, before_after: Vec<(usize, usize)>) -> Self {
        self.precedence = before_after;
        self
    }

    /// The table of costs.
    pub fn costs(&self) -> &CostMatrix {
        &self.costs
    }

    /// Checks the problem: ends, alternatives, stages, precedence and the given order.
    ///
    /// # Errors
    /// The first [`ProblemError`] found.
    pub fn check(&self) -> Result<(), ProblemError> {
        Checked::new(self).map(|_| ())
    }
}

/// A problem without contradictions, with every rule in one form.
pub(crate) struct Checked<'a> {
    pub(crate) costs: &'a CostMatrix,
    pub(crate) start: Option<usize>,
    pub(crate) end: Option<usize>,
    /// The order to beat.
    pub(crate) given: Vec<usize>,
    /// Point of each pose.
    pub(crate) point_of: Vec<usize>,
    /// Poses of each point.
    pub(crate) poses_of: Vec<Vec<usize>>,
    /// Stage of each point.
    pub(crate) stage: Vec<u32>,
    /// Points to be measured after and before each point, directly.
    pub(crate) later: Vec<Vec<usize>>,
    pub(crate) earlier: Vec<Vec<usize>>,
}

impl<'a> Checked<'a> {
    pub(crate) fn new(problem: &'a Problem) -> Result<Self, ProblemError> {
        let poses = problem.costs.len();
        let poses_of = problem
            .alternatives
            .clone()
            .unwrap_or_else(|| (0..poses).map(|pose| vec![pose]).collect());
        let point_of = divide(poses, &poses_of)?;
        let points = poses_of.len();
        for (end, fixed) in [("start", problem.start), ("end", problem.end)] {
            if let Some(pose) = fixed.filter(|&pose| pose >= poses) {
                return Err(ProblemError::End { end, pose, poses });
            }
        }
        if let (Some(start), Some(end)) = (problem.start, problem.end)
            && (point_of[start] == point_of[end] && points > 1 || start != end && points == 1)
        {
            return Err(ProblemError::SameEnds(point_of[start]));
        }
        let stage = problem.stages.clone().unwrap_or_else(|| vec![0; points]);
        if stage.len() != points {
            return Err(ProblemError::Stages {
                stages: stage.len(),
                points,
            });
        }
        let (mut later, mut earlier) = (vec![Vec::new(); points], vec![Vec::new(); points]);
        for &(before, after) in &problem.precedence {
            if let Some(&point) = [before, after].iter().find(|&&point| point >= points) {
                return Err(ProblemError::Precedence { point, points });
            }
            later[before].push(after);
            earlier[after].push(before);
        }
        let mut checked = Self {
            costs: &problem.costs,
            start: problem.start,
            end: problem.end,
            given: Vec::new(),
            point_of,
            poses_of,
            stage,
            later,
            earlier,
        };
        checked.given = if checked.is_plain() && problem.precedence.is_empty() {
            let ends = [problem.start, problem.end];
            let inner = (0..poses).filter(|&pose| !ends.contains(&Some(pose)));
            let last = problem.end.filter(|_| problem.start != problem.end);
            problem.start.into_iter().chain(inner).chain(last).collect()
        } else {
            checked.build(|_, allowed| allowed[0])?
        };
        if let Some(given) = &problem.given {
            checked.accept(given)?;
            checked.given.clone_from(given);
        }
        Ok(checked)
    }

    /// True when points may be exchanged freely and each has one pose.
    pub(crate) fn is_plain(&self) -> bool {
        self.point_of.len() == self.poses_of.len() && self.is_free()
    }

    /// True when points may be exchanged freely.
    pub(crate) fn is_free(&self) -> bool {
        self.later.iter().all(Vec::is_empty) && self.stage.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// Grows an order from the front: `choose` picks among the poses allowed next (never none), given the last one.
    ///
    /// # Errors
    /// [`ProblemError::Contradiction`] when no pose is allowed next.
    pub(crate) fn build(
        &self,
        mut choose: impl FnMut(Option<usize>, &[usize]) -> usize,
    ) -> Result<Vec<usize>, ProblemError> {
        let points = self.poses_of.len();
        let mut waits: Vec<usize> = self.earlier.iter().map(Vec::len).collect();
        let mut rest: Vec<usize> = (0..points).collect();
        let mut order: Vec<usize> = Vec::with_capacity(points);
        let fixed =
            |end: Option<usize>, point: usize| end.filter(|&pose| self.point_of[pose] == point);
        while let Some(stage) = rest.iter().map(|&point| self.stage[point]).min() {
            let mut allowed = Vec::new();
            for &point in &rest {
                let first_ok = !order.is_empty()
                    || self.start.is_none_or(|start| self.point_of[start] == point);
                let last_ok = rest.len() == 1 || fixed(self.end, point).is_none();
                if waits[point] == 0 && self.stage[point] == stage && first_ok && last_ok {
                    match fixed(self.start, point).or(fixed(self.end, point)) {
                        Some(pose) => allowed.push(pose),
                        None => allowed.extend(&self.poses_of[point]),
                    }
                }
            }
            if allowed.is_empty() {
                return Err(ProblemError::Contradiction(rest[0]));
            }
            let pose = choose(order.last().copied(), &allowed);
            order.push(pose);
            rest.retain(|&point| point != self.point_of[pose]);
            for &after in &self.later[self.point_of[pose]] {
                waits[after] -= 1;
            }
        }
        Ok(order)
    }

    /// Checks that an order visits every point once and keeps every rule.
    pub(crate) fn accept(&self, order: &[usize]) -> Result<(), ProblemError> {
        let points = self.poses_of.len();
        let mut seen = vec![false; points];
        let mut stage = 0;
        for (at, &pose) in order.iter().enumerate() {
            let point = *self
                .point_of
                .get(pose)
                .ok_or(ProblemError::GivenNotAPermutation(pose))?;
            if std::mem::replace(&mut seen[point], true) {
                return Err(ProblemError::GivenNotAPermutation(pose));
            }
            let start_ok = at > 0 || self.start.is_none_or(|start| start == pose);
            let end_ok = at + 1 < points || self.end.is_none_or(|end| end == pose);
            let after_ok = self.earlier[point].iter().all(|&before| seen[before]);
            if !start_ok || !end_ok || !after_ok || self.stage[point] < stage {
                return Err(ProblemError::GivenForbidden(pose));
            }
            stage = self.stage[point];
        }
        match seen.iter().position(|&seen| !seen) {
            Some(point) => Err(ProblemError::GivenNotAPermutation(self.poses_of[point][0])),
            None => Ok(()),
        }
    }
}

/// Point of each pose; every pose must belong to exactly one.
fn divide(poses: usize, poses_of: &[Vec<usize>]) -> Result<Vec<usize>, ProblemError> {
    let mut point_of = vec![usize::MAX; poses];
    for (point, poses) in poses_of.iter().enumerate() {
        if poses.is_empty() {
            return Err(ProblemError::NoPose(point));
        }
        for &pose in poses {
            match point_of.get_mut(pose) {
                Some(owner) if *owner == usize::MAX => *owner = point,
                _ => return Err(ProblemError::Alternatives(pose)),
            }
        }
    }
    match point_of.iter().position(|&owner| owner == usize::MAX) {
        Some(pose) => Err(ProblemError::Alternatives(pose)),
        None => Ok(point_of),
    }
}
