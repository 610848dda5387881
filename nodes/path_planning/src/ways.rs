//! The ways between touches: joint targets from the retract of one to the approach of another, clear of what the plan tells
//! of the part ([`crate::clear`]).
//!
//! With a clearance axis the way is straight between points of one plane or one bore, where that is clear; else that axis
//! goes out to its clear position, the others cross, and it comes back. That nothing is hit out there is the cell file's
//! word. Without one the straight way is taken where it is clear; else the probe withdraws along its stem, the axes cross,
//! and it comes back, from the least of some heights at which that is clear. A station that lies in a body (a plan may
//! touch a face where a boss stands) is left along the stem as if the body were not there. Metres, radians.

use machine::{Chain, JointKind, Nominal, Target};
use nalgebra::Unit;
use probecell_msgs::{InspectionFeature, InspectionPlan};
use serde::{Deserialize, Serialize};

use crate::{
    clear::Surroundings,
    route::Route,
    stations::{Place, Stations},
};

/// Heights to which the probe may withdraw: so many from the middle of the part to where everything is clear, and half as
/// many beyond, for axes that swing the part.
const HEIGHTS: u32 = 8;
/// Charged for a way that is not clear, s: any other order is better.
pub(crate) const NO_WAY: f64 = 1e5;

/// A station between touches, and where the probe goes from there along its stem.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct End {
    pub(crate) positions: Vec<f64>,
    /// Of the stylus from each body, m.
    clearances: Vec<f64>,
    /// For each height: the positions where the stylus gets there clear of everything.
    lifts: Vec<Option<Vec<f64>>>,
    /// From where the clearance axis goes out: the station's own positions, or a place farther along the normal.
    pub(crate) exit: Option<Vec<f64>>,
}

impl End {
    fn highest(&self) -> Option<&Vec<f64>> {
        self.lifts.iter().flatten().next_back()
    }

    pub(crate) fn exit(&self) -> &[f64] {
        self.exit.as_ref().unwrap_or(&self.positions)
    }
}

/// When the rotary axes move on a way above the part.
#[derive(Clone, Copy)]
enum Crossing {
    AtOnce,
    TurnFirst,
    TurnLast,
}

/// The ends of a place: where ways to it end, and where ways from it begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ends {
    pub(crate) approach: End,
    pub(crate) retract: End,
}

/// Joint targets between the retract of one touch and the approach of the next.
pub(crate) struct Ways<'a> {
    route: &'a Route<'a>,
    pub(crate) plan: &'a InspectionPlan,
    nominal: &'a Nominal,
    around: Surroundings<'a>,
    pub(crate) places: &'a [Place],
    /// Of the first places, or of all.
    pub(crate) ends: &'a [Ends],
}

impl<'a> Ways<'a> {
    pub(crate) fn new(
        route: &'a Route<'a>,
        plan: &'a InspectionPlan,
        nominal: &'a Nominal,
        places: &'a [Place],
        ends: &'a [Ends],
    ) -> Self {
        Self {
            around: Surroundings::new(route.chain, plan, nominal),
            route,
            plan,
            nominal,
            places,
            ends,
        }
    }

    /// Where ways to and from a place end.
    pub(crate) fn ends_of(&self, place: usize) -> Ends {
        let station = &self.places[place].stations;
        let end = |positions: &[f64]| {
            let (chain, around) = (self.route.chain, &self.around);
            let clearances = around.clearances(positions);
            let at = (station, positions, &clearances[..]);
            let (lifts, exit) = match self.route.clearance {
                Some(clearance) => {
                    let exit = exit(chain, self.nominal, around, at, clearance);
                    (Vec::new(), exit)
                }
                None => (lifts(chain, self.nominal, around, at), None),
            };
            End {
                positions: positions.to_vec(),
                clearances,
                lifts,
                exit,
            }
        };
        Ends {
            approach: end(&station.approach),
            retract: end(&station.retract),
        }
    }

    /// Seconds from the retract of one place to the approach of another.
    pub(crate) fn time(&self, from: usize, to: usize) -> f64 {
        let way = self.between(from, to);
        way.map_or(NO_WAY, |way| {
            (self.route).duration(&self.ends[from].retract.positions, &way)
        })
    }

    /// Joint targets from the retract of one touch to the approach of another, the approach last; `None` where no clear
    /// way was found.
    pub(crate) fn between(&self, from: usize, to: usize) -> Option<Vec<Vec<f64>>> {
        let (start, end) = (&self.ends[from].retract, &self.ends[to].approach);
        let straight = vec![end.positions.clone()];
        let direct = self.route.clearance.is_none()
            || direct(self.plan, &self.places[from], &self.places[to]);
        let ends = [&start.clearances[..], &end.clearances[..]];
        if direct && self.around.is_clear(&start.positions, &straight, ends) {
            return Some(straight);
        }
        if let Some((axis, clear)) = self.route.clearance {
            let mut out = start.exit().to_vec();
            out[axis] = clear;
            let mut over = end.exit().to_vec();
            over[axis] = clear;
            let way = start.exit.clone().into_iter().chain([out, over]);
            return Some(way.chain(end.exit.clone()).chain(straight).collect());
        }
        let lifted = || {
            let both = start.lifts.iter().zip(&end.lifts);
            let both = both.filter_map(|(out, over)| Some((out.as_ref()?, over.as_ref()?)));
            // Last of all each as high as it gets.
            both.chain(start.highest().zip(end.highest()))
        };
        // The ways out and back are clear: what is left to look at is the way across, all axes at once or the part
        // turned before or after the rest.
        let crossings = [Crossing::AtOnce, Crossing::TurnFirst, Crossing::TurnLast];
        let across = crossings.into_iter().find_map(|crossing| {
            lifted().find_map(|(out, over)| {
                let way = self.across(out, over, crossing);
                let ends = [out, over].map(|at| self.around.clearances(at));
                let clear = self.around.is_clear(out, &way, [&ends[0], &ends[1]]);
                clear.then(|| std::iter::once(out.clone()).chain(way).collect::<Vec<_>>())
            })
        });
        across.map(|mut way| {
            way.push(end.positions.clone());
            way
        })
    }

    fn across(&self, out: &[f64], over: &[f64], crossing: Crossing) -> Vec<Vec<f64>> {
        let (turned, moved) = match crossing {
            Crossing::AtOnce => return vec![over.to_vec()],
            Crossing::TurnFirst => (over, out),
            Crossing::TurnLast => (out, over),
        };
        let middle = (0..out.len()).map(|axis| {
            let turns = self.route.chain.axis(axis).kind == JointKind::Revolute;
            if turns { turned[axis] } else { moved[axis] }
        });
        vec![middle.collect(), over.to_vec()]
    }
}

/// From where the clearance axis can go out clear of the part, where it cannot from the station: farther along the normal.
/// `None`: from the station, or nowhere near. What is said to be clear out there is the cell file's word.
fn exit(
    chain: &Chain,
    nominal: &Nominal,
    around: &Surroundings<'_>,
    (station, positions, clearances): (&Stations, &[f64], &[f64]),
    (axis, clear): (usize, f64),
) -> Option<Vec<f64>> {
    let leaves = |from: &[f64]| {
        let mut out = from.to_vec();
        out[axis] = clear;
        let [start, end] = [from, &out].map(|at| around.clearances(at));
        around.is_clear(from, &[out], [&start, &end])
    };
    if leaves(positions) {
        return None;
    }
    let (ball, _) = around.probe(positions);
    let away = (ball - station.contact) / f64::from(HEIGHTS / 2);
    (1..=2 * HEIGHTS).find_map(|step| {
        let target = Target {
            ball: ball + away * f64::from(step),
            orientation: station.attitude,
        };
        let (pose, ball) = (&nominal.part_pose, &nominal.ball);
        let reached = chain.reach(&target, &station.prescribed, positions, pose, ball);
        let way = [reached.ok()?];
        let end = around.clearances(&way[0]);
        let found = around.is_clear(positions, &way, [clearances, &end]) && leaves(&way[0]);
        let [reached] = way;
        found.then_some(reached)
    })
}

/// Where the probe gets along its stem from a station, clear of everything: for each height over the middle of the part
/// the positions of the axes, or the station's own where it is as high. A ball in the mount's origin has no stem; it
/// leaves away from that middle.
fn lifts(
    chain: &Chain,
    nominal: &Nominal,
    around: &Surroundings<'_>,
    (station, positions, clearances): (&Stations, &[f64], &[f64]),
) -> Vec<Option<Vec<f64>>> {
    let (ball, stem) = around.probe(positions);
    let Some(stem) = stem.or_else(|| Unit::try_new(station.ball[0] - around.middle(), 0.0)) else {
        return Vec::new();
    };
    let height = around.height(&ball, &stem);
    let outside = |&clear: &f64| {
        if clear < 0.0 {
            f64::NEG_INFINITY
        } else {
            clear
        }
    };
    let start: Vec<f64> = clearances.iter().map(outside).collect();
    let lift = |step: u32| {
        let rise = around.size() * f64::from(step) / f64::from(HEIGHTS) - height;
        if rise <= 0.0 {
            let inside = clearances.iter().any(|clear| *clear < 0.0);
            return (!inside).then(|| positions.to_vec());
        }
        let target = Target {
            ball: ball + stem.into_inner() * rise,
            orientation: station.attitude,
        };
        let (pose, ball) = (&nominal.part_pose, &nominal.ball);
        let reached = chain.reach(&target, &station.prescribed, positions, pose, ball);
        let reached = reached.ok()?;
        let end = around.clearances(&reached);
        // A body that the station is in is no body on the way out of it, but the stylus must leave it.
        let left = (start.iter().zip(&end)).all(|(start, end)| start.is_finite() || *end > 0.0);
        let clear =
            left && around.is_clear(positions, std::slice::from_ref(&reached), [&start, &end]);
        clear.then_some(reached)
    };
    (1..=HEIGHTS + HEIGHTS / 2).map(lift).collect()
}

/// The straight way from one touch to the next cannot lead through the feature: points of one plane, or of one bore,
/// at the same rotary positions. (Between retracts over a plane, and within a convex hole, straight lines stay out of
/// its material.)
fn direct(plan: &InspectionPlan, from: &Place, to: &Place) -> bool {
    let (a, b) = (&plan.points[from.point], &plan.points[to.point]);
    a.feature == b.feature
        && from.pose == to.pose
        && [InspectionFeature::PLANE, InspectionFeature::BORE]
            .contains(&plan.features[a.feature as usize].kind)
}
