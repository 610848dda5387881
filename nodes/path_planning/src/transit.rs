//! Transits: joint targets from the retract of one touch to the approach of another, clear of what the plan describes of the
//! part ([`machine::geometry`]).
//!
//! With a clearance axis the transit is straight between points of one plane or one bore, where that is clear; otherwise
//! that axis moves to its clear position, the others cross, and it moves back. That nothing stands in the way out there is
//! declared by the cell file. Without a clearance axis the straight move is taken where it is clear; otherwise the probe
//! withdraws along its stem, the axes cross, and it comes back, at the lowest of some heights at which that is clear. A
//! station inside a body (a plan may touch a face on which a boss stands) is left along the stem as if that body did not
//! exist. Metres, radians.

use machine::{Chain, JointKind, Nominal, Target, geometry::Surroundings};
use nalgebra::Unit;
use probecell_msgs::{InspectionFeature, InspectionPlan};
use serde::{Deserialize, Serialize};

use crate::{
    rules::MotionRules,
    solver::{Candidate, Targets},
};

/// Heights to which the probe may withdraw: this many from the middle of the part to where everything is clear, and half
/// as many beyond, for axes that swing the part.
const HEIGHTS: u32 = 8;
/// Of these heights an arm, whose moves are dear to check, tries every third.
const COARSE: u32 = 3;
/// Charged where there is no transit, s: any other order is better.
pub(crate) const NO_TRANSIT: f64 = 1e5;

/// Where a transit begins or ends, and where the probe withdraws to from there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Station {
    pub(crate) positions: Vec<f64>,
    /// Of the stylus from each body, m.
    clearances: Vec<f64>,
    /// For each height: the positions where the stylus gets there clear of everything.
    lifts: Vec<Option<Vec<f64>>>,
    /// From where the clearance axis goes out: the station's own positions, or a place farther along the normal.
    pub(crate) exit: Option<Vec<f64>>,
}

impl Station {
    pub(crate) fn highest(&self) -> Option<&Vec<f64>> {
        self.lifts.iter().flatten().next_back()
    }

    pub(crate) fn exit(&self) -> &[f64] {
        self.exit.as_ref().unwrap_or(&self.positions)
    }
}

/// When the rotary axes move on the way across.
#[derive(Clone, Copy)]
enum Crossing {
    AtOnce,
    TurnFirst,
    TurnLast,
}

/// Where transits to a candidate end, and where those from it begin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ends {
    pub(crate) approach: Station,
    pub(crate) retract: Station,
}

/// The transits between the candidates of a plan.
pub(crate) struct Transits<'a> {
    rules: &'a MotionRules<'a>,
    pub(crate) plan: &'a InspectionPlan,
    nominal: &'a Nominal,
    around: Surroundings<'a>,
    pub(crate) candidates: &'a [Candidate],
    /// Of the first candidates, or of all.
    pub(crate) ends: &'a [Ends],
}

impl<'a> Transits<'a> {
    pub(crate) fn new(
        rules: &'a MotionRules<'a>,
        plan: &'a InspectionPlan,
        nominal: &'a Nominal,
        candidates: &'a [Candidate],
        ends: &'a [Ends],
    ) -> Self {
        Self {
            around: Surroundings::new(rules.chain, plan, nominal),
            rules,
            plan,
            nominal,
            candidates,
            ends,
        }
    }

    /// Where transits to and from a candidate end.
    pub(crate) fn ends_of(&self, candidate: usize) -> Ends {
        let targets = &self.candidates[candidate].targets;
        let end = |positions: &[f64]| {
            let (chain, around) = (self.rules.chain, &self.around);
            let clearances = around.clearances(positions);
            let at = (targets, positions, &clearances[..]);
            let (lifts, exit) = if let Some(clearance) = self.rules.clearance {
                let exit = exit(chain, self.nominal, around, at, clearance);
                (Vec::new(), exit)
            } else {
                let arm = self.rules.attitudes.is_some();
                let every = if arm { COARSE } else { 1 };
                (lifts(chain, self.nominal, around, at, every), None)
            };
            Station {
                positions: positions.to_vec(),
                clearances,
                lifts,
                exit,
            }
        };
        let approach = end(&targets.approach);
        let retract = if targets.retract == targets.approach {
            approach.clone()
        } else {
            end(&targets.retract)
        };
        Ends { approach, retract }
    }

    /// Seconds from the retract of one candidate to the approach of another.
    pub(crate) fn time(&self, from: usize, to: usize) -> f64 {
        let transit = self.between(from, to);
        transit.map_or(NO_TRANSIT, |path| {
            let motion = self.rules.motion();
            motion.time_along(&self.ends[from].retract.positions, &path)
        })
    }

    /// Joint targets from the retract of one touch to the approach of another, the approach last; `None` where none was found
    /// that is clear.
    pub(crate) fn between(&self, from: usize, to: usize) -> Option<Vec<Vec<f64>>> {
        let (start, end) = (&self.ends[from].retract, &self.ends[to].approach);
        let straight = vec![end.positions.clone()];
        let direct = self.rules.clearance.is_none()
            || direct(self.plan, &self.candidates[from], &self.candidates[to]);
        let ends = [&start.clearances[..], &end.clearances[..]];
        if direct && self.around.is_clear(&start.positions, &straight, ends) {
            return Some(straight);
        }
        if let Some((axis, clear)) = self.rules.clearance {
            let mut out = start.exit().to_vec();
            out[axis] = clear;
            let mut over = end.exit().to_vec();
            over[axis] = clear;
            let path = start.exit.clone().into_iter().chain([out, over]);
            return Some(path.chain(end.exit.clone()).chain(straight).collect());
        }
        let lifted = || {
            let both = start.lifts.iter().zip(&end.lifts);
            let both = both.filter_map(|(out, over)| Some((out.as_ref()?, over.as_ref()?)));
            // Finally each as high as it gets.
            both.chain(start.highest().zip(end.highest()))
        };
        // Out and back are known to be clear: what remains to be checked is the way across, with all axes at once or with
        // the rotary axes before or after the others.
        let crossings = match self.rules.attitudes {
            // All axes of an arm turn.
            Some(_) => &[Crossing::AtOnce][..],
            None => &[Crossing::AtOnce, Crossing::TurnFirst, Crossing::TurnLast],
        };
        let across = crossings.iter().copied().find_map(|crossing| {
            lifted().find_map(|(out, over)| {
                let path = self.across(out, over, crossing);
                let ends = [out, over].map(|at| self.around.clearances(at));
                let clear = self.around.is_clear(out, &path, [&ends[0], &ends[1]]);
                clear.then(|| std::iter::once(out.clone()).chain(path).collect::<Vec<_>>())
            })
        });
        across.map(|mut path| {
            path.push(end.positions.clone());
            path
        })
    }

    fn across(&self, out: &[f64], over: &[f64], crossing: Crossing) -> Vec<Vec<f64>> {
        let (turned, moved) = match crossing {
            Crossing::AtOnce => return vec![over.to_vec()],
            Crossing::TurnFirst => (over, out),
            Crossing::TurnLast => (out, over),
        };
        let middle = (0..out.len()).map(|axis| {
            let turns = self.rules.chain.axis(axis).kind == JointKind::Revolute;
            if turns { turned[axis] } else { moved[axis] }
        });
        vec![middle.collect(), over.to_vec()]
    }
}

/// From where the clearance axis can go out clear of the part, where it cannot from the station: farther along the normal.
/// `None`: from the station, or nowhere near. That nothing stands out there is declared by the cell file.
fn exit(
    chain: &Chain,
    nominal: &Nominal,
    around: &Surroundings<'_>,
    (targets, positions, clearances): (&Targets, &[f64], &[f64]),
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
    let away = (ball - targets.contact) / f64::from(HEIGHTS / 2);
    (1..=2 * HEIGHTS).find_map(|step| {
        let target = Target {
            ball: ball + away * f64::from(step),
            orientation: targets.attitude,
        };
        let (pose, ball) = (&nominal.part_pose, &nominal.ball);
        let reached = chain.reach(&target, &targets.prescribed, positions, pose, ball);
        let path = [reached.ok()?];
        let end = around.clearances(&path[0]);
        let found = around.is_clear(positions, &path, [clearances, &end]) && leaves(&path[0]);
        let [reached] = path;
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
    (targets, positions, clearances): (&Targets, &[f64], &[f64]),
    every: u32,
) -> Vec<Option<Vec<f64>>> {
    let (ball, stem) = around.probe(positions);
    let Some(stem) = stem.or_else(|| Unit::try_new(targets.ball[0] - around.centre(), 0.0)) else {
        return Vec::new();
    };
    let height = around.height(&ball, &stem);
    let ignoring = |&clear: &f64| {
        if clear < 0.0 {
            f64::NEG_INFINITY
        } else {
            clear
        }
    };
    let start: Vec<f64> = clearances.iter().map(ignoring).collect();
    let lift = |step: u32| {
        let rise = around.size() * f64::from(step) / f64::from(HEIGHTS) - height;
        if rise <= 0.0 {
            let inside = clearances.iter().any(|clear| *clear < 0.0);
            return (!inside).then(|| positions.to_vec());
        }
        let target = Target {
            ball: ball + stem.into_inner() * rise,
            orientation: targets.attitude,
        };
        let (pose, ball) = (&nominal.part_pose, &nominal.ball);
        let reached = chain.reach(&target, &targets.prescribed, positions, pose, ball);
        let reached = reached.ok()?;
        let end = around.clearances(&reached);
        // A body that the station is in is ignored on the way out of it, but the stylus must leave it.
        let outside = (start.iter().zip(&end)).all(|(start, end)| start.is_finite() || *end > 0.0);
        let clear =
            outside && around.is_clear(positions, std::slice::from_ref(&reached), [&start, &end]);
        clear.then_some(reached)
    };
    let heights = 1..=HEIGHTS + HEIGHTS / 2;
    heights
        .filter(|height| height % every == 0)
        .map(lift)
        .collect()
}

/// The straight way from one touch to the next cannot lead through the feature: points of one plane, or of one bore,
/// at the same rotary positions. (Between retracts over a plane, and within a convex hole, straight lines stay out of
/// its material.)
fn direct(plan: &InspectionPlan, from: &Candidate, to: &Candidate) -> bool {
    let (a, b) = (&plan.points[from.point], &plan.points[to.point]);
    a.feature == b.feature
        && from.pose == to.pose
        && [InspectionFeature::PLANE, InspectionFeature::BORE]
            .contains(&plan.features[a.feature as usize].kind)
}
