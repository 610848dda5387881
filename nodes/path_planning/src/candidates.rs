//! Where the axes stand for a touch: at the start of the approach, at the end of the probing move, at the end of the
//! retract.
//!
//! A point may be touched at one of several poses: positions of the plan's rotary axes. A *candidate* is a point at one of
//! them. Poses at which the point is out of reach, or at which the stylus would hit what the plan describes of the part
//! ([`machine::access`]), are left out; the first one is prescribed by the plan and only has to be reached. An arm has
//! further candidates by the attitude of its probe ([`crate::attitudes`]). Metres, radians.

use machine::{
    Nominal, Target,
    access::{Access, TouchPose},
};
use nalgebra::{Point3, UnitQuaternion};
use probecell_msgs::InspectionPlan;
use serde::{Deserialize, Serialize};

use crate::{attitudes, error::PlanningError, rules::MotionRules};

/// Positions (rad) of the plan's rotary axes at each of which a point may be touched, the one to beat first.
pub type Poses = Vec<Vec<f64>>;

/// Where the inverse kinematics of a point starts, and the attitude of the probe there (for an arm).
#[derive(Clone, Debug)]
pub struct Seed {
    /// Axis positions in the order of the chain's axes, m and rad.
    pub positions: Vec<f64>,
    /// Part from probe mount; `None` where the rotary axes of the plan fix it.
    pub attitude: Option<UnitQuaternion<f64>>,
}

/// Axis positions of one touch (m, rad), and the ball there (m, part frame).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Targets {
    pub(crate) approach: Vec<f64>,
    pub(crate) touch: Vec<f64>,
    pub(crate) retract: Vec<f64>,
    /// Centre at approach and retract.
    pub(crate) ball: [Point3<f64>; 2],
    /// Nominal contact on the surface.
    pub(crate) contact: Point3<f64>,
    /// Axes that stand still during approach, touch and retract, and the attitude of the probe there.
    pub(crate) prescribed: Vec<Option<f64>>,
    pub(crate) attitude: Option<UnitQuaternion<f64>>,
}

/// A point at one of its poses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Candidate {
    /// Index into the points of the plan.
    pub(crate) point: usize,
    /// Positions of the plan's rotary axes, rad.
    pub(crate) pose: Vec<f64>,
    pub(crate) targets: Targets,
}

/// Inverse kinematics of one point after the other: each search starts where the last one ended.
pub(crate) struct Solver<'a> {
    pub(crate) rules: &'a MotionRules<'a>,
    pub(crate) plan: &'a InspectionPlan,
    pub(crate) part: &'a Nominal,
    /// The plan's rotary axes.
    pub(crate) rotary: Vec<usize>,
    last: Vec<f64>,
}

impl<'a> Solver<'a> {
    pub(crate) fn new(
        rules: &'a MotionRules<'a>,
        plan: &'a InspectionPlan,
        part: &'a Nominal,
    ) -> Result<Self, PlanningError> {
        let axis = |name: &String| {
            let index = rules.chain.axis_index(name);
            index.ok_or_else(|| PlanningError::Rotary(name.clone()))
        };
        Ok(Self {
            rotary: plan
                .rotary_names
                .iter()
                .map(axis)
                .collect::<Result<_, _>>()?,
            last: middle(rules),
            rules,
            plan,
            part,
        })
    }

    /// The middle of all travels.
    pub(crate) fn middle(&self) -> Vec<f64> {
        middle(self.rules)
    }

    /// Axes that stand still while a point is touched at a pose.
    pub(crate) fn prescribed(
        &self,
        point: usize,
        pose: &[f64],
    ) -> Result<Vec<Option<f64>>, PlanningError> {
        if self.plan.points[point].feature as usize >= self.plan.features.len() {
            return Err(PlanningError::Feature(point));
        }
        if pose.len() != self.rotary.len() {
            return Err(PlanningError::Rotaries {
                point,
                given: pose.len(),
                axes: self.rotary.len(),
            });
        }
        let mut prescribed = vec![None; self.last.len()];
        for (&axis, &angle) in self.rotary.iter().zip(pose) {
            prescribed[axis] = Some(angle);
        }
        Ok(prescribed)
    }

    /// Targets of a point at a pose.
    pub(crate) fn targets(
        &mut self,
        point: usize,
        pose: &[f64],
        seed: Option<&Seed>,
    ) -> Result<Targets, PlanningError> {
        let prescribed = self.prescribed(point, pose)?;
        let planned = &self.plan.points[point];
        let distances = [planned.approach_distance, planned.retract_distance];
        let part = self.part;
        let mut start = seed.map_or_else(|| self.last.clone(), |seed| seed.positions.clone());
        let attitude = seed.and_then(|seed| seed.attitude);
        let mut target_at = |height: f64| {
            let (position, normal) = part.points[point];
            let target = Target {
                ball: position + normal.into_inner() * height,
                orientation: attitude,
            };
            let chain = self.rules.chain;
            let reached = chain.reach(&target, &prescribed, &start, &part.part_pose, &part.ball);
            let reached = reached.map_err(|source| PlanningError::Reach { point, source })?;
            start.clone_from(&reached);
            Ok::<_, PlanningError>((target.ball, reached))
        };
        let radius = part.ball_radius;
        let (approach_ball, approach) = target_at(radius + distances[0])?;
        let (_, touch) = target_at(radius - self.rules.overtravel)?;
        let (retract_ball, retract) = if attitude.is_some() && distances[0] == distances[1] {
            (approach_ball, approach.clone())
        } else {
            target_at(radius + distances[1])?
        };
        self.last.clone_from(&approach);
        Ok(Targets {
            approach,
            touch,
            retract,
            ball: [approach_ball, retract_ball],
            contact: part.points[point].0,
            prescribed,
            attitude,
        })
    }
}

fn middle(rules: &MotionRules<'_>) -> Vec<f64> {
    let middle = |index: usize| {
        let limits = rules.chain.axis(index).limits;
        limits.map_or(0.0, |(lower, upper)| f64::midpoint(lower, upper))
    };
    (0..rules.chain.axes().len()).map(middle).collect()
}

/// The candidates of all points of a plan, by point. `poses` and `seeds` have one entry for each point, or are empty: the
/// plan's own rotary positions, and an empty list of a point means the same.
pub(crate) fn all(
    rules: &MotionRules<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    poses: &[Poses],
    seeds: &[Seed],
) -> Result<Vec<Candidate>, PlanningError> {
    if let Some(attitudes) = rules.attitudes.filter(|_| seeds.is_empty()) {
        return attitudes::candidates(rules, attitudes, plan, part, poses);
    }
    let mut solver = Solver::new(rules, plan, part)?;
    let mut all: Vec<Candidate> = Vec::with_capacity(plan.points.len());
    for (point, nominal) in plan.points.iter().enumerate() {
        let own = std::slice::from_ref(&nominal.rotary_positions);
        let poses = poses.get(point).map_or(own, Vec::as_slice);
        let poses = if poses.is_empty() { own } else { poses };
        let found = all.len();
        let mut refused = None;
        for pose in poses {
            match solver.targets(point, pose, seeds.get(point)) {
                Ok(targets) => all.push(Candidate {
                    point,
                    pose: pose.clone(),
                    targets,
                }),
                // Another pose may do where this one is out of reach.
                Err(error @ PlanningError::Reach { .. }) => refused = refused.or(Some(error)),
                Err(error) => return Err(error),
            }
        }
        match refused {
            Some(PlanningError::Reach { point, source })
                if all.len() == found && poses.len() > 1 =>
            {
                return Err(PlanningError::Poses {
                    point,
                    poses: poses.len(),
                    source,
                });
            }
            Some(error) if all.len() == found => return Err(error),
            _ => {}
        }
    }
    if all.len() > plan.points.len() {
        keep_accessible(rules, plan, part, &mut all);
    }
    Ok(all)
}

/// Leaves out further poses at which the stylus would hit the part; what first poses collide with is taken not to exist.
fn keep_accessible(
    rules: &MotionRules<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    candidates: &mut Vec<Candidate>,
) {
    let further = |at: usize| at > 0 && candidates[at - 1].point == candidates[at].point;
    let touches: Vec<TouchPose> = candidates
        .iter()
        .map(|candidate| touch_pose(plan, part, candidate.point, candidate.targets.touch.clone()))
        .collect();
    let first = touches.iter().enumerate().filter(|(at, _)| !further(*at));
    let first: Vec<TouchPose> = first.map(|(_, touch)| touch.clone()).collect();
    let access = Access::new(rules.chain, part, plan, &first);
    let kept: Vec<bool> = (0..candidates.len())
        .map(|at| !further(at) || access.allows(&touches[at]))
        .collect();
    let mut kept = kept.into_iter();
    candidates.retain(|_| kept.next().unwrap_or(true));
}

/// Every touch of a plan once, at the first of its poses that is accessible; `poses` as in [`all`].
pub(crate) fn first_touches(
    rules: &MotionRules<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    poses: &[Poses],
) -> Result<Vec<TouchPose>, PlanningError> {
    let mut candidates = all(rules, plan, part, poses, &[])?;
    candidates.dedup_by_key(|candidate| candidate.point);
    let touch =
        |candidate: Candidate| touch_pose(plan, part, candidate.point, candidate.targets.touch);
    Ok(candidates.into_iter().map(touch).collect())
}

pub(crate) fn touch_pose(
    plan: &InspectionPlan,
    part: &Nominal,
    point: usize,
    positions: Vec<f64>,
) -> TouchPose {
    TouchPose {
        feature: plan.points[point].feature as usize,
        position: part.points[point].0,
        normal: part.points[point].1.into_inner(),
        surface: part.surfaces[point],
        positions: Some(positions),
    }
}
