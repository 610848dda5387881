//! Where the axes stand for a touch: at the start of the approach, at the end of the probing move, at the end of the
//! retract. Metres, radians.

use machine::{Nominal, Target, access::TouchPose};
use nalgebra::{Point3, UnitQuaternion};
use probecell_msgs::InspectionPlan;
use serde::{Deserialize, Serialize};

use crate::{error::PlanningError, rules::MotionRules};

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

/// A touch of a plan with the axes at `positions`, m and rad.
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
