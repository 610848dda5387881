//! Where the axes stand for a touch: at the start of the approach, at the end of the probing move, at the end of the retract.
//!
//! A point may be touched at one of several poses: positions of the plan's rotary axes. A *place* is one of them. Poses at
//! which the machine does not get to the point, or at which the stylus would hit what the plan tells of the part
//! ([`machine::access`]), are left out; the first one is the plan's own word and only has to be reached. Metres, radians.

use machine::{
    Nominal, Target,
    access::{Access, Aim},
};
use nalgebra::{Point3, UnitQuaternion};
use probecell_msgs::InspectionPlan;
use serde::{Deserialize, Serialize};

use crate::route::{Route, RouteError, Seed};

/// Positions (rad) of the plan's rotary axes at each of which a point may be touched, the one to beat first.
pub type Poses = Vec<Vec<f64>>;

/// Axis positions of the stations of one touch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Stations {
    pub(crate) approach: Vec<f64>,
    pub(crate) touch: Vec<f64>,
    pub(crate) retract: Vec<f64>,
    /// Of approach and retract.
    pub(crate) ball: [Point3<f64>; 2],
    /// Nominal contact on the surface.
    pub(crate) contact: Point3<f64>,
    /// Axes that stand still while the ball goes to and from the touch, and the attitude of the probe there.
    pub(crate) prescribed: Vec<Option<f64>>,
    pub(crate) attitude: Option<UnitQuaternion<f64>>,
}

/// One way to stand at a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Place {
    /// Index into the points of the plan that is walked.
    pub(crate) point: usize,
    /// Positions of the plan's rotary axes, rad.
    pub(crate) pose: Vec<f64>,
    pub(crate) stations: Stations,
}

/// Finds stations one after the other: each search begins where the last one ended.
struct Walker<'a> {
    route: &'a Route<'a>,
    plan: &'a InspectionPlan,
    part: &'a Nominal,
    rotary: Vec<usize>,
    last: Vec<f64>,
}

impl<'a> Walker<'a> {
    fn new(
        route: &'a Route<'a>,
        plan: &'a InspectionPlan,
        part: &'a Nominal,
    ) -> Result<Self, RouteError> {
        let axis = |name: &String| {
            let index = route.chain.axis_index(name);
            index.ok_or_else(|| RouteError::Rotary(name.clone()))
        };
        let middle = |index: usize| {
            let limits = route.chain.axis(index).limits;
            limits.map_or(0.0, |(lower, upper)| f64::midpoint(lower, upper))
        };
        Ok(Self {
            rotary: plan
                .rotary_names
                .iter()
                .map(axis)
                .collect::<Result<_, _>>()?,
            last: (0..route.chain.axes().len()).map(middle).collect(),
            route,
            plan,
            part,
        })
    }

    /// Stations of a point at a pose.
    fn stations(
        &mut self,
        point: usize,
        pose: &[f64],
        seed: Option<&Seed>,
    ) -> Result<Stations, RouteError> {
        let one = &self.plan.points[point];
        if one.feature as usize >= self.plan.features.len() {
            return Err(RouteError::Feature(point));
        }
        if pose.len() != self.rotary.len() {
            return Err(RouteError::Rotaries {
                point,
                given: pose.len(),
                axes: self.rotary.len(),
            });
        }
        let mut prescribed = vec![None; self.last.len()];
        for (&axis, &angle) in self.rotary.iter().zip(pose) {
            prescribed[axis] = Some(angle);
        }
        let part = self.part;
        let mut start = seed.map_or_else(|| self.last.clone(), |seed| seed.positions.clone());
        let attitude = seed.and_then(|seed| seed.attitude);
        let mut station = |height: f64| {
            let (position, normal) = part.points[point];
            let target = Target {
                ball: position + normal.into_inner() * height,
                orientation: attitude,
            };
            let chain = self.route.chain;
            let reached = chain.reach(&target, &prescribed, &start, &part.part_pose, &part.ball);
            let reached = reached.map_err(|source| RouteError::Reach { point, source })?;
            start.clone_from(&reached);
            Ok::<_, RouteError>((target.ball, reached))
        };
        let radius = part.ball_radius;
        let (approach_ball, approach) = station(radius + one.approach_distance)?;
        let (_, touch) = station(radius - self.route.overtravel)?;
        let (retract_ball, retract) = station(radius + one.retract_distance)?;
        self.last.clone_from(&approach);
        Ok(Stations {
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

/// The places of all points of a plan, by point. `poses` and `seeds` have one entry for each point, or are empty: the
/// plan's own rotary positions, and an empty list of a point means the same.
pub(crate) fn places(
    route: &Route<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    poses: &[Poses],
    seeds: &[Seed],
) -> Result<Vec<Place>, RouteError> {
    let mut walker = Walker::new(route, plan, part)?;
    let mut all: Vec<Place> = Vec::with_capacity(plan.points.len());
    for (point, nominal) in plan.points.iter().enumerate() {
        let own = std::slice::from_ref(&nominal.rotary_positions);
        let poses = poses.get(point).map_or(own, Vec::as_slice);
        let poses = if poses.is_empty() { own } else { poses };
        let found = all.len();
        let mut refused = None;
        for pose in poses {
            match walker.stations(point, pose, seeds.get(point)) {
                Ok(stations) => all.push(Place {
                    point,
                    pose: pose.clone(),
                    stations,
                }),
                // Another pose may do where this one is out of reach.
                Err(error @ RouteError::Reach { .. }) => refused = refused.or(Some(error)),
                Err(error) => return Err(error),
            }
        }
        match refused {
            Some(RouteError::Reach { point, source }) if all.len() == found && poses.len() > 1 => {
                return Err(RouteError::Poses {
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
        keep_accessible(route, plan, part, &mut all);
    }
    Ok(all)
}

/// Leaves out further poses at which the stylus would hit the part; what the first poses of points hit is not there.
fn keep_accessible(
    route: &Route<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    places: &mut Vec<Place>,
) {
    let further = |at: usize| at > 0 && places[at - 1].point == places[at].point;
    let aims: Vec<Aim> = places
        .iter()
        .map(|place| aim(plan, part, place.point, place.stations.touch.clone()))
        .collect();
    let first = aims.iter().enumerate().filter(|(at, _)| !further(*at));
    let met: Vec<Aim> = first.map(|(_, aim)| aim.clone()).collect();
    let access = Access::new(route.chain, part, plan, &met);
    let kept: Vec<bool> = (0..places.len())
        .map(|at| !further(at) || access.allows(&aims[at]))
        .collect();
    let mut kept = kept.into_iter();
    places.retain(|_| kept.next().unwrap_or(true));
}

/// Every touch of a plan once, at the first of its poses that can be had; `poses` as in [`places`].
pub(crate) fn aims(
    route: &Route<'_>,
    plan: &InspectionPlan,
    part: &Nominal,
    poses: &[Poses],
) -> Result<Vec<Aim>, RouteError> {
    let mut places = places(route, plan, part, poses, &[])?;
    places.dedup_by_key(|place| place.point);
    let aim = |place: Place| aim(plan, part, place.point, place.stations.touch);
    Ok(places.into_iter().map(aim).collect())
}

/// A touch of a plan, by the axis positions of its contact.
fn aim(plan: &InspectionPlan, part: &Nominal, point: usize, positions: Vec<f64>) -> Aim {
    Aim {
        feature: plan.points[point].feature as usize,
        position: part.points[point].0,
        normal: part.points[point].1.into_inner(),
        surface: part.surfaces[point],
        positions: Some(positions),
    }
}
