//! Candidate touches on the features of a plan.
//!
//! At points that were touched and midway between two of them on the same feature (so never beyond material that is known
//! to be there): repeated, at the ends of a wider range of feeds, at other positions of the prescribed axes that the session
//! visited, and with each prescribed axis turned by half a turn (for a spindle, the reversal of the stylus, ISO 230-1).
//! Metres, radians, seconds. Reach and collisions are checked by [`machine::access`].

use std::f64::consts::PI;

use machine::Surface;
use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{InspectionPlan, InspectionPoint, geometry_msgs};

use super::extended_rows::CandidateTouch;
use effects::observation::{Observations, Row};

/// The feeds of the plan are extended by this factor at both ends.
const FEEDS: f64 = 2.0;
/// Pause before the touches, s.
const PAUSE: f64 = 60.0;

/// How many touches are varied, and in how many ways.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Breadth {
    /// Touches that are varied.
    pub(crate) places: usize,
    /// Combinations of prescribed positions.
    pub(crate) positions: usize,
    /// Angles by which each prescribed axis is turned beside half a turn, rad.
    pub(crate) turns: &'static [f64],
}

/// All candidates, in a fixed order.
pub(crate) fn candidates(
    observations: &Observations,
    plan: &InspectionPlan,
    breadth: Breadth,
) -> Vec<CandidateTouch> {
    let rows = &observations.rows;
    let places = places(observations, breadth.places);
    let met = met(observations);
    let feeds = feed_range(observations);
    let time = observations.span() + PAUSE;
    let mut all = Vec::new();
    for (order, &near) in places.iter().enumerate() {
        let Some(planned) = plan.points.get(rows[near].point) else {
            continue;
        };
        let mut offer = |point: &InspectionPoint, why, rotary: &[f64], feed: f64| {
            let point = InspectionPoint {
                rotary_positions: rotary.to_vec(),
                feed,
                ..point.clone()
            };
            all.push(CandidateTouch {
                point,
                near,
                time,
                why,
            });
        };
        let feed = rows[near].feed;
        let taken = prescribed(observations, &rows[near]);
        let farther = other_feed(feed, feeds);
        offer(planned, "again", &taken, feed);
        offer(planned, "another feed", &taken, farther);
        for turned in turned(&taken, PI) {
            offer(planned, "turned by half a turn", &turned, feed);
        }
        for by in breadth.turns {
            for turned in turned(&taken, *by) {
                offer(planned, "turned", &turned, feed);
            }
        }
        // Each place sees other positions first, so that a few places together see all.
        let others = (0..met.len()).map(|step| &met[(order + step) % met.len()]);
        for other in others
            .filter(|other| **other != taken)
            .take(breadth.positions)
        {
            offer(planned, "another index", other, feed);
        }
        if let Some(point) = between(observations, plan, near) {
            offer(&point, "a place between", &taken, feed);
            offer(&point, "a place between, another feed", &taken, farther);
        }
    }
    all
}

/// Lowest and highest feed that is proposed, m/s.
pub(crate) fn feed_range(observations: &Observations) -> (f64, f64) {
    let feeds = observations.rows[..observations.touches()]
        .iter()
        .map(|row| row.feed)
        .filter(|feed| *feed > 0.0);
    let (low, high) = feeds.fold((f64::INFINITY, 0.0_f64), |(low, high), feed| {
        (low.min(feed), high.max(feed))
    });
    (low / FEEDS, high * FEEDS)
}

/// The end of the range that lies farther from a feed.
pub(crate) fn other_feed(feed: f64, (low, high): (f64, f64)) -> f64 {
    if high - feed >= feed - low { high } else { low }
}

/// Positions of the prescribed axes of a touch, rad.
pub(crate) fn prescribed(observations: &Observations, row: &Row) -> Vec<f64> {
    let positions = row.pose.as_ref().map(|pose| &pose.positions);
    let at = |&axis: &usize| positions.map_or(0.0, |positions| positions[axis]);
    observations.prescribed.iter().map(at).collect()
}

/// Combinations of prescribed positions visited in the session, by first use.
pub(crate) fn met(observations: &Observations) -> Vec<Vec<f64>> {
    let mut met: Vec<Vec<f64>> = Vec::new();
    for row in &observations.rows[..observations.touches()] {
        if row.index == met.len() {
            met.push(prescribed(observations, row));
        }
    }
    met
}

/// Each prescribed axis turned by an angle, towards zero.
pub(crate) fn turned(positions: &[f64], by: f64) -> Vec<Vec<f64>> {
    (0..positions.len())
        .map(|index| {
            let mut turned = positions.to_vec();
            turned[index] += if positions[index] > 0.0 { -by } else { by };
            turned
        })
        .collect()
}

/// Touches spread over the features, each feature's evenly over the session.
pub(crate) fn places(observations: &Observations, most: usize) -> Vec<usize> {
    let touches = observations.touches();
    let features = observations.features.len().max(1);
    let mut of: Vec<Vec<usize>> = vec![Vec::new(); features];
    for (index, row) in observations.rows[..touches].iter().enumerate() {
        if let Some(of_feature) = of.get_mut(row.feature) {
            of_feature.push(index);
        }
    }
    of.retain(|of_feature| !of_feature.is_empty());
    let each = most.div_ceil(of.len().max(1)).max(1);
    let mut places = Vec::new();
    for step in 0..each {
        for of_feature in &of {
            let count = each.min(of_feature.len());
            if step < count && places.len() < most {
                places.push(of_feature[step * of_feature.len() / count]);
            }
        }
    }
    places
}

/// A place midway to the next touch of the same feature.
pub(crate) fn between(
    observations: &Observations,
    plan: &InspectionPlan,
    near: usize,
) -> Option<InspectionPoint> {
    let rows = &observations.rows[..observations.touches()];
    let row = &rows[near];
    let next = rows.iter().skip(near + 1).chain(rows).find(|other| {
        other.feature == row.feature && (other.position - row.position).norm() > 1e-3
    })?;
    let (position, normal) = midway(row, next)?;
    let planned = plan.points.get(row.point)?;
    Some(InspectionPoint {
        position: geometry_msgs::Point {
            x: position.x,
            y: position.y,
            z: position.z,
        },
        normal: geometry_msgs::Vector3 {
            x: normal.x,
            y: normal.y,
            z: normal.z,
        },
        ..planned.clone()
    })
}

/// Midway between two points of one surface, on it; `None` where that has no direction or no closed form.
fn midway(a: &Row, b: &Row) -> Option<(Point3<f64>, Vector3<f64>)> {
    let middle = nalgebra::center(&a.position, &b.position);
    match &a.surface {
        Surface::Plane(_, normal) if b.normal.dot(normal) > 1.0 - 1e-9 => {
            let off = normal.dot(&(middle - a.position));
            (off.abs() < 1e-9).then_some((middle, normal.into_inner()))
        }
        Surface::Plane(..) => None,
        Surface::Cylinder(origin, axis, radius) | Surface::Bore(origin, axis, radius) => {
            let arm = middle - origin;
            let height = axis.into_inner() * axis.dot(&arm);
            let out = Unit::try_new(arm - height, 0.3 * radius)?.into_inner();
            let position = origin + height + out * *radius;
            Some((position, out * a.surface.normal(&middle)?.dot(&out)))
        }
        Surface::Sphere(origin, radius) | Surface::Socket(origin, radius) => {
            let out = Unit::try_new(middle - origin, 0.3 * radius)?.into_inner();
            Some((
                origin + out * *radius,
                out * a.surface.normal(&middle)?.dot(&out),
            ))
        }
    }
}
