//! How an arm may hold the probe at each touch: directions of its stem, turns about them, and all postures that do it.
//!
//! Each feature has one or more directions of the stem, and the turn about the stem is free, so a point has a choice of
//! directions × turns × postures ([`Chain::postures`](machine::Chain::postures)) × positions of a rotary table. Of them those
//! are candidates at which the arm is far enough from a singularity, approach and retract are within reach in that attitude,
//! and neither stylus nor arm hits the part ([`machine::access`], [`machine::geometry`]).
//!
//! Thousands of candidates would make millions of transits, so each point keeps a few: the nearest in joint time to some
//! postures (`hubs`) that are chosen one after the other such that all points together are nearest to one of them. An arm
//! that can stay in one configuration does, and where a point needs another one, it has it. Metres, radians, part frame.

use std::ops::Range;

use machine::{
    Nominal,
    access::{Access, TouchPose},
    geometry::Surroundings,
    turn_onto,
};
use nalgebra::{Unit, UnitQuaternion, Vector3};
use probecell_msgs::InspectionPlan;

use crate::{
    error::PlanningError,
    rules::{Attitudes, Held, MotionRules},
    solver::{Candidate, Poses, Seed, Solver, touch_pose},
};

/// Nearer than this to a singularity no touch is planned: least speed of the probe at unit speed of the joints
/// ([`machine::Chain::dexterity`]).
const MIN_DEXTERITY: f64 = 0.01;
/// Postures that are tried as hubs.
const HUBS_TRIED: usize = 96;

/// The candidates of all points of a plan that an arm touches, by point; `poses` as in `candidates::all`.
pub(crate) fn candidates(
    rules: &MotionRules<'_>,
    attitudes: &Attitudes,
    plan: &InspectionPlan,
    part: &Nominal,
    poses: &[Poses],
) -> Result<Vec<Candidate>, PlanningError> {
    let points = 0..plan.points.len();
    let all = of_points(rules, attitudes, (plan, part), poses, points)?;
    Ok(nearest_to_hubs(rules, all, attitudes.kept))
}

/// All candidates of some points of a plan.
pub(crate) fn of_points(
    rules: &MotionRules<'_>,
    attitudes: &Attitudes,
    (plan, part): (&InspectionPlan, &Nominal),
    poses: &[Poses],
    points: Range<usize>,
) -> Result<Vec<Vec<Candidate>>, PlanningError> {
    let mut solver = Solver::new(rules, plan, part)?;
    let around = Surroundings::new(rules.chain, plan, part);
    let contacts: Vec<TouchPose> = (0..plan.points.len())
        .map(|point| TouchPose {
            positions: None,
            ..touch_pose(plan, part, point, Vec::new())
        })
        .collect();
    let access = Access::new(rules.chain, part, plan, &contacts);
    let mut all = Vec::with_capacity(points.len());
    for point in points {
        let own = vec![plan.points[point].rotary_positions.clone()];
        let poses = poses.get(point).filter(|poses| !poses.is_empty());
        let feature = plan.points[point].feature as usize;
        let held = (attitudes.features.get(feature)).ok_or(PlanningError::Feature(point))?;
        let mut found = Vec::new();
        let mut tried = Tried::default();
        for pose in poses.unwrap_or(&own) {
            of_pose(
                &mut solver,
                (&around, &access),
                (point, pose),
                held,
                &mut tried,
                &mut found,
            )?;
        }
        if found.is_empty() {
            return Err(tried.error(point));
        }
        all.push(found);
    }
    Ok(all)
}

/// How many attitudes and postures of a point were tried, and what became of them.
#[derive(Default)]
struct Tried {
    attitudes: usize,
    postures: usize,
    singular: usize,
    hitting: usize,
}

impl Tried {
    fn error(&self, point: usize) -> PlanningError {
        PlanningError::Attitudes {
            point,
            attitudes: self.attitudes,
            postures: self.postures,
            singular: self.singular,
            hitting: self.hitting,
        }
    }
}

/// Adds the candidates of a point at one position of the rotary axes.
fn of_pose(
    solver: &mut Solver<'_>,
    (around, access): (&Surroundings<'_>, &Access<'_>),
    (point, pose): (usize, &[f64]),
    held: &Held,
    tried: &mut Tried,
    found: &mut Vec<Candidate>,
) -> Result<(), PlanningError> {
    let (chain, plan, part) = (solver.rules.chain, solver.plan, solver.part);
    let prescribed = solver.prescribed(point, pose)?;
    let middle = solver.middle();
    let (position, normal) = part.points[point];
    let place = position + normal.into_inner() * part.ball_radius;
    for attitude in solver.attitudes(pose, held) {
        tried.attitudes += 1;
        let at = (&place, &attitude);
        for positions in chain.postures(at, &prescribed, &middle, &part.part_pose, &part.ball) {
            tried.postures += 1;
            let dexterity = chain.dexterity(&positions, &prescribed, &part.part_pose, &part.ball);
            if dexterity < MIN_DEXTERITY {
                tried.singular += 1;
                continue;
            }
            if !access.allows(&touch_pose(plan, part, point, positions.clone())) {
                tried.hitting += 1;
                continue;
            }
            let seed = Seed {
                positions,
                attitude: Some(attitude),
            };
            // A posture whose approach is out of reach, or changes the configuration on the way, is none.
            let Ok(targets) = solver.targets(point, pose, Some(&seed)) else {
                continue;
            };
            let stations = [&targets.approach, &targets.touch, &targets.retract];
            if !stations.into_iter().all(|at| around.is_carrier_clear(at)) {
                tried.hitting += 1;
                continue;
            }
            found.push(Candidate {
                point,
                pose: pose.to_vec(),
                targets,
            });
        }
    }
    Ok(())
}

impl Solver<'_> {
    /// Attitudes (part from probe mount) in which a feature is touched while the rotary axes stand at a pose.
    fn attitudes(&self, pose: &[f64], held: &Held) -> Vec<UnitQuaternion<f64>> {
        let mut positions = self.middle();
        for (&axis, &angle) in self.rotary.iter().zip(pose) {
            positions[axis] = angle;
        }
        let chain = self.rules.chain;
        let part = chain.end_pose(machine::Side::Part, &positions) * self.part.part_pose;
        let own = Unit::try_new(-self.part.ball.coords, 1e-9).unwrap_or_else(Vector3::z_axis);
        let mut attitudes = Vec::new();
        for stem in &held.stems {
            let stem = part.rotation * stem;
            let upright = turn_onto(&own, &stem);
            attitudes.extend(held.turns.iter().map(|&turn| {
                part.rotation.inverse() * UnitQuaternion::from_axis_angle(&stem, turn) * upright
            }));
        }
        attitudes
    }
}

/// Of the candidates of each point those nearest in joint time to a few postures that serve all points well; the one
/// nearest to the first of these postures comes first.
pub(crate) fn nearest_to_hubs(
    rules: &MotionRules<'_>,
    mut all: Vec<Vec<Candidate>>,
    kept: usize,
) -> Vec<Candidate> {
    let time = |from: &Candidate, to: &Candidate| {
        (rules.motion()).time(&from.targets.touch, &to.targets.touch)
    };
    let nearest = |hub: &Candidate, of: &[Candidate]| {
        let times = of.iter().enumerate().map(|(at, one)| (time(hub, one), at));
        times.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    };
    let count: usize = all.iter().map(Vec::len).sum();
    let step = count.div_ceil(HUBS_TRIED).max(1);
    let hubs: Vec<&Candidate> = all.iter().flatten().step_by(step).collect();
    // Of each hub: time to the nearest candidate of each point, and which that is.
    let tables: Vec<Vec<(f64, usize)>> = (hubs.iter())
        .map(|hub| all.iter().map(|of| nearest(hub, of)).collect())
        .collect();
    let mut best = vec![f64::INFINITY; all.len()];
    let mut keep: Vec<Vec<usize>> = vec![Vec::new(); all.len()];
    let mut left: Vec<usize> = (0..tables.len()).collect();
    for _ in 0..kept {
        let total = |table: &Vec<(f64, usize)>| -> f64 {
            table
                .iter()
                .zip(&best)
                .map(|(one, best)| one.0.min(*best))
                .sum()
        };
        let least = (left.iter().enumerate())
            .map(|(at, &table)| (total(&tables[table]), at))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, at)) = least else { break };
        let table = &tables[left.remove(at)];
        for ((best, keep), (seconds, candidate)) in best.iter_mut().zip(&mut keep).zip(table) {
            *best = best.min(*seconds);
            if !keep.contains(candidate) {
                keep.push(*candidate);
            }
        }
    }
    let points = all.iter_mut().zip(keep);
    points
        .flat_map(|(of, keep)| {
            keep.into_iter()
                .map(|at| of[at].clone())
                .collect::<Vec<_>>()
        })
        .collect()
}
