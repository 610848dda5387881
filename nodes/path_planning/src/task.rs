//! An order in the making: a value between any two slices of the work, so that a node can take other inputs in between and
//! report its progress.
//!
//! First the candidates of all points are found ([`crate::candidates`]; those of an arm some points at a time), then where transits to and from each end, then
//! the time of each transit ([`crate::transit`]), then order and poses are searched together. How the work is sliced
//! changes nothing of the answer. Seconds, metres, radians.

use machine::Nominal;
use planning::{Options, Search, Solution};
use probecell_msgs::{InspectionPlan, MeasurementOrder, PlanProgress};
use serde::{Deserialize, Serialize};

use crate::{
    attitudes, candidates,
    error::{MAX_TOUCHES, MAX_TURNS, PlanningError},
    moves,
    rules::{Attitudes, MotionRules},
    solver::{Candidate, Poses, Seed},
    table::TimeTable,
    transit::{Ends, NO_TRANSIT, Transits},
};

/// Points of an arm whose attitudes are found in one slice.
const POINTS: usize = 4;
/// Candidates whose ends are found in one slice.
const ENDS: usize = 50;
/// Kicks of the search in one slice.
const KICKS: u64 = 1_000;

/// What is to be ordered.
#[derive(Clone, Copy, Debug)]
pub struct OrderRequest<'a> {
    /// The plan.
    pub plan: &'a InspectionPlan,
    /// Indices into its points, in the order that is to be beaten.
    pub points: &'a [u32],
    /// One entry for each point of the plan, or empty: points of a lower stage are touched before all of a higher one.
    pub stages: &'a [u32],
    /// One entry for each point of the plan, or empty: positions (rad) of the plan's rotary axes at each of which it may be
    /// touched, the one to beat first. Empty (all, or a point's): the plan's own.
    pub poses: &'a [Poses],
    /// One entry for each of `points`, or empty: the axes then start in the middle of their travel.
    pub seeds: &'a [Seed],
    /// Where the axes stand (m, rad, in the order of the chain's axes), as after an interrupted scan: the clearance axis
    /// first moves out from there, and the time to the first touch counts. `None`: somewhere clear.
    pub here: Option<&'a [f64]>,
}

/// A plan with the poses chosen, and its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// The plan given; the points that are touched have the rotary positions chosen.
    pub plan: InspectionPlan,
    /// The order.
    pub order: MeasurementOrder,
}

/// An order in the making.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    plan: InspectionPlan,
    points: Vec<u32>,
    /// Of each of the points.
    stages: Vec<u32>,
    here: Option<Vec<f64>>,
    /// Of an arm: poses of the points, and all candidates of the first of them, until they are known.
    poses: Vec<Poses>,
    attitudes: Vec<Vec<Candidate>>,
    candidates: Vec<Candidate>,
    /// Of the first candidates.
    ends: Vec<Ends>,
    times: TimeTable,
    search: Option<Search>,
}

/// Refuses positions (rad) of the plan's rotary axes that are many turns away.
fn check_turns(plan: &InspectionPlan, point: u32, pose: &[f64]) -> Result<(), PlanningError> {
    for (index, angle) in pose.iter().enumerate() {
        // NaN is refused with the plan's other numbers.
        if angle.abs() > MAX_TURNS * std::f64::consts::TAU * (1.0 + 1e-9) {
            return Err(PlanningError::Turns {
                point: point as usize,
                axis: plan.rotary_names.get(index).cloned().unwrap_or_default(),
                degrees: angle.to_degrees(),
            });
        }
    }
    Ok(())
}

impl Task {
    /// Finds the candidates of all points.
    ///
    /// # Errors
    /// [`PlanningError`] for a point that is listed twice or unknown, and for one that no pose reaches.
    pub fn new(rules: &MotionRules<'_>, request: &OrderRequest<'_>) -> Result<Self, PlanningError> {
        let (plan, points) = (request.plan, request.points);
        if points.len() > MAX_TOUCHES {
            return Err(PlanningError::TooManyTouches(points.len()));
        }
        let mut poses = Vec::new();
        for (position, &index) in points.iter().enumerate() {
            let new = !points[..position].contains(&index);
            if !new || plan.points.get(index as usize).is_none() {
                return Err(PlanningError::NoPoint(index));
            }
            let of_point = request.poses.get(index as usize);
            let of_point = of_point.cloned().unwrap_or_default();
            let own = &plan.points[index as usize].rotary_positions;
            for pose in of_point.iter().chain(std::iter::once(own)) {
                check_turns(plan, index, pose)?;
            }
            poses.push(of_point);
        }
        let stage = |index: &u32| request.stages.get(*index as usize).copied().unwrap_or(0);
        let mut task = Self {
            plan: plan.clone(),
            points: points.to_vec(),
            stages: points.iter().map(stage).collect(),
            here: request.here.map(<[f64]>::to_vec),
            poses: Vec::new(),
            attitudes: Vec::new(),
            candidates: Vec::new(),
            ends: Vec::new(),
            times: TimeTable::default(),
            search: None,
        };
        let part = task.part();
        let nominal = Nominal::from_plan(&part)?;
        if rules.attitudes.is_some() && request.seeds.is_empty() {
            task.poses = poses;
            return Ok(task);
        }
        let candidates = candidates::all(rules, &part, &nominal, &poses, request.seeds);
        task.candidates = candidates.map_err(|error| error.of_points(points))?;
        Ok(task)
    }

    /// The candidates of the next points of an arm.
    fn find_attitudes(
        &mut self,
        rules: &MotionRules<'_>,
        of_arm: &Attitudes,
        (part, nominal): (&InspectionPlan, &Nominal),
    ) -> Result<(), PlanningError> {
        let known = self.attitudes.len();
        let next = known..self.points.len().min(known + POINTS);
        let found = attitudes::of_points(rules, of_arm, (part, nominal), &self.poses, next);
        (self.attitudes).extend(found.map_err(|error| error.of_points(&self.points))?);
        if self.attitudes.len() == self.points.len() {
            let all = std::mem::take(&mut self.attitudes);
            self.candidates = attitudes::nearest_to_hubs(rules, all, of_arm.kept);
        }
        Ok(())
    }

    /// The plan that is ordered, as it was given.
    pub fn plan(&self) -> &InspectionPlan {
        &self.plan
    }

    /// Does one more slice of the work; the answer, when that is the last one.
    ///
    /// # Errors
    /// [`PlanningError`] for touches between which no transit was found, and for a target outside the travel of an axis.
    pub fn advance(&mut self, rules: &MotionRules<'_>) -> Result<Option<Planned>, PlanningError> {
        let part = self.part();
        let nominal = Nominal::from_plan(&part)?;
        if let Some(of_arm) = rules.attitudes
            && self.candidates.is_empty()
            && !self.points.is_empty()
        {
            self.find_attitudes(rules, of_arm, (&part, &nominal))?;
            return Ok(None);
        }
        if self.ends.len() < self.candidates.len() {
            let transits = Transits::new(rules, &part, &nominal, &self.candidates, &[]);
            let next = self.ends.len()..self.candidates.len().min(self.ends.len() + ENDS);
            let found: Vec<Ends> = next.map(|index| transits.ends_of(index)).collect();
            self.ends.extend(found);
            return Ok(None);
        }
        let transits = Transits::new(rules, &part, &nominal, &self.candidates, &self.ends);
        if self.times.len() < self.candidates.len() {
            let reversible = self.is_reversible();
            self.times
                .extend(rules, &transits, self.points.len(), reversible);
            return Ok(None);
        }
        let refused = |error: &dyn std::fmt::Display| PlanningError::Cost(error.to_string());
        let done = if let Some(search) = &mut self.search {
            search.advance(KICKS).map_err(|error| refused(&error))?
        } else {
            let options = Options {
                kicks: rules.kicks,
                ..Options::default()
            };
            let here = self.here.as_deref();
            let problem = self.times.problem(rules, &transits, &self.stages, here)?;
            let search = Search::new(problem, &options).map_err(|error| refused(&error))?;
            let done = search.is_done();
            self.search = Some(search);
            done
        };
        match &self.search {
            Some(search) if done => self.answer(rules, &transits, search.solution()).map(Some),
            _ => Ok(None),
        }
    }

    /// How far the work has come: all fields but header, `plan_id` of another plan and the last phases.
    pub fn progress(&self) -> PlanProgress {
        let mut progress = PlanProgress {
            plan_id: self.plan.plan_id.clone(),
            touches: self.points.len() as u32,
            phase: PlanProgress::TRANSITS,
            ..PlanProgress::default()
        };
        if let Some(search) = &self.search {
            let solution = search.solution();
            progress.phase = PlanProgress::SEARCHING;
            progress.share = search.share();
            progress.air_time = self.seconds(&solution.order);
            progress.given_air_time = self.seconds(&solution.given);
        } else {
            let count = self.candidates.len().max(1) as f64;
            let found = self.times.len() as f64 / count;
            // Of a triangular table the first rows are the shortest.
            let found = if self.is_reversible() {
                found * found
            } else {
                found
            };
            progress.share = 0.5 * (self.ends.len() as f64 / count + found);
        }
        progress
    }

    /// The plan with no other points than those that are touched.
    fn part(&self) -> InspectionPlan {
        let points = self.points.iter();
        InspectionPlan {
            points: points
                .filter_map(|&index| self.plan.points.get(index as usize).cloned())
                .collect(),
            ..self.plan.clone()
        }
    }

    /// Where approach and retract are the same, a transit takes the same time both ways.
    fn is_reversible(&self) -> bool {
        let same = |candidate: &Candidate| {
            let index = self.points[candidate.point] as usize;
            let point = self.plan.points.get(index);
            point.is_none_or(|point| point.approach_distance == point.retract_distance)
        };
        self.candidates.iter().all(same)
    }

    /// Nodes of the search before all candidates: where the axes stand, where that is known.
    fn before(&self) -> usize {
        usize::from(self.here.is_some())
    }

    /// Seconds of one of the search's two orders, from where the axes stand; a transit that was not found is not counted.
    fn seconds(&self, order: &[usize]) -> f64 {
        let Some(search) = &self.search else {
            return 0.0;
        };
        let solution = search.solution();
        let cost = if order == solution.order {
            solution.cost
        } else {
            solution.given_cost
        };
        let before = self.before();
        let missing = order.windows(2).filter(|pair| {
            pair[0] >= before && self.times.time(pair[0] - before, pair[1] - before) >= NO_TRANSIT
        });
        cost - NO_TRANSIT * missing.count() as f64
    }

    /// Seconds of transits of an order that were not computed before: the search took them for missing.
    fn not_computed(&self, transits: &Transits<'_>, order: &[usize]) -> f64 {
        let pairs = order.windows(2);
        let missing = pairs.filter(|pair| self.times.time(pair[0], pair[1]) >= NO_TRANSIT);
        missing.map(|pair| transits.time(pair[0], pair[1])).sum()
    }

    /// Path of the ball between the touches of an order, m.
    fn length(&self, order: &[usize]) -> f64 {
        let ball = |candidate: usize| self.candidates[candidate].targets.ball;
        let pairs = order.windows(2);
        pairs
            .map(|pair| (ball(pair[0])[1] - ball(pair[1])[0]).norm())
            .sum()
    }

    fn answer(
        &self,
        rules: &MotionRules<'_>,
        transits: &Transits<'_>,
        solution: &Solution,
    ) -> Result<Planned, PlanningError> {
        let candidates = |order: &[usize]| -> Vec<usize> {
            let nodes = order.iter();
            nodes
                .filter_map(|node| node.checked_sub(self.before()))
                .collect()
        };
        let (order, given) = (candidates(&solution.order), candidates(&solution.given));
        let moves = moves::of_order(rules, transits, &order, self.here.as_deref());
        let mut moves = moves.map_err(|error| error.of_points(&self.points))?;
        for step in &mut moves {
            step.point_index = self.points[step.point_index as usize];
        }
        let mut plan = self.plan.clone();
        for &candidate in &order {
            let Candidate { point, pose, .. } = &self.candidates[candidate];
            let point = self.points[*point] as usize;
            if let Some(point) = plan.points.get_mut(point) {
                point.rotary_positions.clone_from(pose);
            }
        }
        let points = order.iter().map(|&index| self.candidates[index].point);
        let order = MeasurementOrder {
            plan_id: plan.plan_id.clone(),
            order: points.map(|point| self.points[point]).collect(),
            air_time: self.seconds(&solution.order) + self.not_computed(transits, &order),
            given_air_time: self.seconds(&solution.given),
            air_length: self.length(&order),
            given_air_length: self.length(&given),
            optimal: solution.optimal,
            axis_names: rules.chain.axis_names().map(str::to_owned).collect(),
            moves,
            ..MeasurementOrder::default()
        };
        moves::check(rules, &order)?;
        Ok(Planned { plan, order })
    }
}
