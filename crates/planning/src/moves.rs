//! Decides the moves between and at the touches: approach, touch, retract, and clearance dog-legs in between that hit
//! neither part nor fixture.
//!
//! A touch begins at its approach start, `approach_distance` before contact against its direction, goes to contact and
//! back to its retract end. From there to the next approach start the ball goes straight if that is clear; otherwise
//! it withdraws along its stem to a common height, crosses, and comes down; otherwise it leaves to a sphere around
//! everything and follows that. The stem turns on the sphere only, where the whole probe fits in any pose.
//! Positions are ball centres in the part frame, m. What the joints do is the caller's: [`check_limits`] takes their
//! targets.

use serde::{Deserialize, Serialize};

use crate::costs::{CostError, CostMatrix};
use crate::solids::{Solid, StylusShape, Vector, along, difference, dot, norm};

/// How much a touch may seem to enter the surface it ends on, m: rounding, not deflection.
const CONTACT: f64 = 1e-9;

/// Heights tried between none and clear of everything.
const HEIGHTS: u32 = 8;

/// Largest angle between two stations on the clearance sphere, rad.
const STEP: f64 = std::f64::consts::FRAC_PI_6;

/// Why no safe moves were found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MoveError {
    /// A solid has a number that is not finite, or a direction that is no unit vector.
    #[error("solid {0} is not a valid body")]
    Solid(usize),
    /// A length of the stylus or of the clearances is negative or not finite.
    #[error("stylus and clearances must be finite and not negative")]
    Stylus,
    /// A touch has a number that is not finite, or a direction that is no unit vector.
    #[error("touch {0} needs finite positions and unit vectors")]
    Touch(usize),
    /// Approaching or touching would hit something.
    #[error("touch {touch} cannot be reached: the stylus would hit solid {solid}")]
    Blocked {
        /// Index of the touch.
        touch: usize,
        /// Index of the solid.
        solid: usize,
    },
    /// No dog-leg between two touches is clear.
    #[error("no clear way leads from touch {from} to touch {to}")]
    NoWay {
        /// Touch left.
        from: usize,
        /// Touch sought.
        to: usize,
    },
    /// The caller's cost of a way is not a cost.
    #[error(transparent)]
    Cost(#[from] CostError),
}

/// One touch: where, and with the stylus in which pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Touch {
    /// Ball centre at contact, m.
    pub contact: Vector,
    /// Unit direction of the ball's move into contact.
    pub approach: Vector,
    /// Unit direction from the ball along the stem to the probe.
    pub stem: Vector,
}

/// Distances of a measuring cycle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clearances {
    /// From approach start to contact, m.
    pub approach_distance: f64,
    /// From contact to retract end, m.
    pub retract_distance: f64,
    /// Least gap between the stylus and any solid on moves between touches, m.
    pub gap: f64,
}

/// Where the ball goes and how the stem points on the way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Station {
    /// Ball centre, m.
    pub ball: Vector,
    /// Unit direction from the ball along the stem.
    pub stem: Vector,
}

/// The bodies around, and the stylus that must not hit them.
#[derive(Debug, Clone, PartialEq)]
pub struct Workspace {
    solids: Vec<Solid>,
    stylus: StylusShape,
    clearances: Clearances,
    /// Sphere outside which the whole probe is clear in every pose: centre and radius, m.
    centre: Vector,
    radius: f64,
}

impl Workspace {
    /// Checks bodies, stylus and clearances. `extent` bounds all solids: their centre and a radius around it, m.
    ///
    /// # Errors
    /// [`MoveError::Solid`] or [`MoveError::Stylus`].
    pub fn new(
        solids: Vec<Solid>,
        stylus: StylusShape,
        clearances: Clearances,
        extent: (Vector, f64),
    ) -> Result<Self, MoveError> {
        if let Some(solid) = solids.iter().position(|solid| !solid.is_valid()) {
            return Err(MoveError::Solid(solid));
        }
        let (centre, radius) = extent;
        let lengths = [
            clearances.approach_distance,
            clearances.retract_distance,
            clearances.gap,
            radius,
        ];
        let finite = centre.iter().all(|x| x.is_finite())
            && lengths.iter().all(|x| x.is_finite() && *x >= 0.0);
        if !stylus.is_valid() || !finite {
            return Err(MoveError::Stylus);
        }
        let radius = radius + stylus.reach() + clearances.gap;
        Ok(Self {
            solids,
            stylus,
            clearances,
            centre,
            radius,
        })
    }

    /// Where the approach to a touch begins.
    pub fn approach_start(&self, touch: &Touch) -> Station {
        let ball = along(
            touch.contact,
            -self.clearances.approach_distance,
            touch.approach,
        );
        Station {
            ball,
            stem: touch.stem,
        }
    }

    /// Where the retract from a touch ends.
    pub fn retract_end(&self, touch: &Touch) -> Station {
        let ball = along(
            touch.contact,
            -self.clearances.retract_distance,
            touch.approach,
        );
        Station {
            ball,
            stem: touch.stem,
        }
    }

    /// Checks that every touch can be approached and left: on the way only the ball may come to contact, at its end.
    ///
    /// # Errors
    /// [`MoveError::Touch`] or [`MoveError::Blocked`] for the first touch that cannot.
    pub fn check_touches(&self, touches: &[Touch]) -> Result<(), MoveError> {
        let unit = |v: Vector| (norm(v) - 1.0).abs() < 1e-9;
        for (index, touch) in touches.iter().enumerate() {
            if !touch.contact.iter().all(|x| x.is_finite())
                || !unit(touch.approach)
                || !unit(touch.stem)
            {
                return Err(MoveError::Touch(index));
            }
            for outer in [
                self.approach_start(touch).ball,
                self.retract_end(touch).ball,
            ] {
                let hit = |solid: &Solid| {
                    !self
                        .stylus
                        .is_clear(solid, outer, touch.contact, touch.stem, -CONTACT)
                };
                if let Some(solid) = self.solids.iter().position(hit) {
                    return Err(MoveError::Blocked {
                        touch: index,
                        solid,
                    });
                }
            }
        }
        Ok(())
    }

    fn leg_is_clear(&self, from: Vector, to: Vector, stem: Vector) -> bool {
        // What starts or ends at a touch may begin nearer than the gap, but only to move away from there.
        self.solids.iter().all(|solid| {
            self.stylus
                .is_clear(solid, from, to, stem, self.clearances.gap)
        })
    }

    fn way_is_clear(&self, way: &[Station]) -> bool {
        way.windows(2).all(|leg| {
            leg[0].stem != leg[1].stem || self.leg_is_clear(leg[0].ball, leg[1].ball, leg[0].stem)
        })
    }

    /// Stations from one station to another, both included, clear of all solids; nothing when none was found.
    pub fn way(&self, from: Station, to: Station) -> Option<Vec<Station>> {
        let straight = vec![from, to];
        if from.stem == to.stem {
            if self.way_is_clear(&straight) {
                return Some(straight);
            }
            // Withdraw along the stem: to the height of the higher end first, then above it.
            let stem = from.stem;
            let height = |point: Vector| dot(difference(point, self.centre), stem);
            let [here, there] = [height(from.ball), height(to.ball)];
            let base = here.max(there);
            for step in 0..=HEIGHTS {
                let level =
                    base + (self.radius - base).max(0.0) * f64::from(step) / f64::from(HEIGHTS);
                let lift = |station: Station, h: f64| Station {
                    ball: along(station.ball, level - h, stem),
                    stem,
                };
                let way = vec![from, lift(from, here), lift(to, there), to];
                if self.way_is_clear(&way) {
                    return Some(way);
                }
            }
        }
        let mut way = vec![from];
        let (out, back) = (self.leave(from), self.leave(to));
        way.extend(self.around(out, back));
        way.push(to);
        self.way_is_clear(&way).then_some(way)
    }

    /// Where a stylus that withdraws along its stem reaches the clearance sphere; where it is, when outside.
    fn leave(&self, station: Station) -> Station {
        let from = difference(station.ball, self.centre);
        let (b, c) = (
            dot(from, station.stem),
            dot(from, from) - self.radius * self.radius,
        );
        let out = if c >= 0.0 {
            0.0
        } else {
            -b + (b * b - c).sqrt()
        };
        Station {
            ball: along(station.ball, out, station.stem),
            stem: station.stem,
        }
    }

    /// Stations outside the sphere from one outer station to another; the stem turns at the first.
    fn around(&self, from: Station, to: Station) -> Vec<Station> {
        let [a, b] = [from, to].map(|station| difference(station.ball, self.centre));
        let [ra, rb] = [norm(a), norm(b)];
        let cosine = (dot(a, b) / (ra * rb)).clamp(-1.0, 1.0);
        let angle = cosine.acos();
        let u = [a[0] / ra, a[1] / ra, a[2] / ra];
        let mut across = along([b[0] / rb, b[1] / rb, b[2] / rb], -cosine, u);
        if norm(across) < 1e-6 {
            // Opposite ends: any great circle will do.
            let least = (0..3)
                .min_by(|&i, &j| u[i].abs().total_cmp(&u[j].abs()))
                .unwrap_or(0);
            let mut other = [0.0; 3];
            other[least] = 1.0;
            across = along(other, -dot(other, u), u);
        }
        let length = norm(across);
        let v = [across[0] / length, across[1] / length, across[2] / length];
        let steps = (angle / STEP).ceil().max(1.0) as u32;
        // Chords of a circle this large stay outside the sphere.
        let radius = ra.max(rb).max(self.radius) / (0.5 * angle / f64::from(steps)).cos();
        let turned = |ball: Vector| Station {
            ball,
            stem: to.stem,
        };
        let mut stations = vec![from, turned(from.ball)];
        for step in 0..=steps {
            let part = angle * f64::from(step) / f64::from(steps);
            let out = along(along([0.0; 3], part.cos(), u), part.sin(), v);
            stations.push(turned(along(self.centre, radius, out)));
        }
        stations.push(to);
        stations
    }

    /// Table of what the way from each touch to each other costs, by the caller's measure of stations: their length
    /// ([`path_length`]) or the time of the axes.
    ///
    /// # Errors
    /// Those of [`Workspace::check_touches`]; [`MoveError::NoWay`] for the first pair without a clear way;
    /// [`MoveError::Cost`] when the measure is negative or not finite.
    pub fn costs(
        &self,
        touches: &[Touch],
        measure: impl Fn(&[Station]) -> f64,
    ) -> Result<CostMatrix, MoveError> {
        self.check_touches(touches)?;
        let mut missing = None;
        let costs = CostMatrix::from_fn(touches.len(), |from, to| {
            if missing.is_some() {
                return 0.0;
            }
            let way = self.way(
                self.retract_end(&touches[from]),
                self.approach_start(&touches[to]),
            );
            if way.is_none() {
                missing = Some(MoveError::NoWay { from, to });
            }
            way.map_or(0.0, |way| measure(&way))
        })?;
        missing.map_or(Ok(costs), Err)
    }

    /// All stations of a scan in the given order: per touch approach start, contact, retract end, and the dog-legs
    /// between. Indices into `touches`.
    ///
    /// # Errors
    /// Those of [`Workspace::check_touches`]; [`MoveError::Touch`] for an index that does not exist;
    /// [`MoveError::NoWay`].
    pub fn scan(&self, touches: &[Touch], order: &[usize]) -> Result<Vec<Station>, MoveError> {
        self.check_touches(touches)?;
        let mut stations: Vec<Station> = Vec::new();
        let mut before = None;
        for &index in order {
            let touch = touches.get(index).ok_or(MoveError::Touch(index))?;
            let start = self.approach_start(touch);
            match (before, stations.last()) {
                (Some(from), Some(&here)) => {
                    let way = self
                        .way(here, start)
                        .ok_or(MoveError::NoWay { from, to: index })?;
                    stations.extend(&way[1..]);
                }
                _ => stations.push(start),
            }
            stations.push(Station {
                ball: touch.contact,
                stem: touch.stem,
            });
            stations.push(self.retract_end(touch));
            before = Some(index);
        }
        Ok(stations)
    }
}

/// Length of the ball's path along stations, m.
pub fn path_length(stations: &[Station]) -> f64 {
    stations
        .windows(2)
        .map(|leg| norm(difference(leg[1].ball, leg[0].ball)))
        .sum()
}

/// An axis target beyond its soft limits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "move {index} takes axis {axis} to {target}, outside its limits {least} to {most} (m or rad)"
)]
pub struct LimitError {
    /// Index of the target.
    pub index: usize,
    /// Index of the axis.
    pub axis: usize,
    /// Position asked for, m or rad.
    pub target: f64,
    /// Lower limit, m or rad.
    pub least: f64,
    /// Upper limit, m or rad.
    pub most: f64,
}

/// Checks the joint targets of all moves against (least, most) per axis, m or rad, before the first is made. Joints go
/// straight from target to target, so targets within limits keep every move within. A missing or undefined number
/// counts as outside.
///
/// # Errors
/// [`LimitError`] for the first target outside.
pub fn check_limits(targets: &[Vec<f64>], limits: &[(f64, f64)]) -> Result<(), LimitError> {
    for (index, target) in targets.iter().enumerate() {
        for (axis, &(least, most)) in limits.iter().enumerate() {
            let target = target.get(axis).copied().unwrap_or(f64::NAN);
            if !(least..=most).contains(&target) {
                return Err(LimitError {
                    index,
                    axis,
                    target,
                    least,
                    most,
                });
            }
        }
    }
    Ok(())
}
