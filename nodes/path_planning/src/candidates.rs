//! At which poses each point of a plan can be touched.
//!
//! A point may be touched at one of several poses: positions of the plan's rotary axes. A *candidate* is a point at one of
//! them. Poses at which the point is out of reach, or at which the stylus would hit what the plan describes of the part
//! ([`machine::access`]), are left out; the first one is prescribed by the plan and only has to be reached. An arm has
//! further candidates by the attitude of its probe ([`crate::attitudes`]). Metres, radians.

use machine::{
    Nominal,
    access::{Access, TouchPose},
};
use probecell_msgs::InspectionPlan;

use crate::{
    attitudes,
    error::PlanningError,
    rules::MotionRules,
    solver::{Candidate, Poses, Seed, Solver, touch_pose},
};

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
