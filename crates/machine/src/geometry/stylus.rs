//! The stylus: a ball, and what carries it.

use nalgebra::Point3;

use super::body::Body;
use crate::deviation::Nominal;

/// Radius of the stem over that of the ball: styli of 3 to 6 mm have stems of 0.6 to 0.75 of the ball.
const STEM: f64 = 0.7;
/// Share of the length from ball to mount that is stem, where the probe's body counts.
const FREE: f64 = 0.5;
/// Radius of a spindle probe's body, m: 40 mm across is the most common.
const PROBE_BODY: f64 = 0.02;
/// A piece of a shaft shorter than this share of its distance from a body is bounded from below, not halved.
const COARSE: f64 = 0.2;
/// Pieces of a shaft shorter than this are judged by their ends, m.
const PIECE: f64 = 5e-4;

/// Where a stylus is: centre of the ball and origin of the probe mount, m, part frame.
pub type StylusPose = [Point3<f64>; 2];

/// A shaft with round ends on the line from the ball to the probe mount.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shaft {
    /// Ends as shares of that line.
    ends: [f64; 2],
    /// m
    radius: f64,
}

/// A ball and the shafts that carry it, in one line.
#[derive(Clone, Debug, PartialEq)]
pub struct Stylus {
    ball_radius: f64,
    shafts: Vec<Shaft>,
}

impl Stylus {
    /// The ball of a plan, and a stem to the origin of the probe mount.
    pub fn with_stem(nominal: &Nominal) -> Self {
        Self {
            ball_radius: nominal.ball_radius,
            shafts: vec![Shaft {
                ends: [0.0, 1.0],
                radius: STEM * nominal.ball_radius,
            }],
        }
    }

    /// A shaft with round ends from end to end, m.
    pub fn capsule(radius: f64) -> Self {
        Self {
            ball_radius: radius,
            shafts: vec![Shaft {
                ends: [0.0, 1.0],
                radius,
            }],
        }
    }

    /// The ball of a plan, a stem half the way to the origin of the probe mount, and the probe's body; `None` where the
    /// ball is too near that origin to say in which direction its stem points.
    pub fn with_probe(nominal: &Nominal) -> Option<Self> {
        let length = nominal.ball.coords.norm();
        let stem = Shaft {
            ends: [0.0, FREE],
            radius: STEM * nominal.ball_radius,
        };
        let body = Shaft {
            ends: [FREE, 1.0],
            radius: PROBE_BODY,
        };
        (length > 2.0 * nominal.ball_radius && length > 0.0).then(|| Self {
            ball_radius: nominal.ball_radius,
            shafts: vec![stem, body],
        })
    }

    /// The farthest point from the ball's centre, m, for a distance of the probe mount from it (m).
    pub fn reach(&self, length: f64) -> f64 {
        let shafts = self.shafts.iter();
        shafts
            .map(|shaft| shaft.ends[1] * length + shaft.radius)
            .fold(self.ball_radius, f64::max)
    }

    /// How far the stylus is from a body, m; negative where it enters it. A lower bound, as [`Body::distance`] is, at most a tenth
    /// too small, and to what a shaft can curve in over half a millimetre.
    pub fn clearance(&self, body: &Body, pose: &StylusPose) -> f64 {
        self.clearance_up_to(f64::INFINITY, body, pose)
    }

    /// The same where only a clearance below `enough` (m) matters: what is at least that is not found more closely.
    pub(super) fn clearance_up_to(&self, enough: f64, body: &Body, pose: &StylusPose) -> f64 {
        let [near, far] = [body.distance(&pose[0]), body.distance(&pose[1])];
        let mut clear = near - self.ball_radius;
        for shaft in &self.shafts {
            let [start, end] = shaft.ends.map(|share| match share {
                0.0 => (pose[0], near),
                1.0 => (pose[1], far),
                share => {
                    let point = pose[0] + (pose[1] - pose[0]) * share;
                    (point, body.distance(&point))
                }
            });
            // What is farther than the nearest so far does not count.
            let within = Axis {
                body,
                enough: clear.min(enough) + shaft.radius,
            };
            let least = within.least((&start.0, start.1), (&end.0, end.1));
            clear = clear.min(least - shaft.radius);
        }
        clear
    }
}

/// The axis of a shaft against a body.
struct Axis<'a> {
    body: &'a Body,
    /// m; a larger distance need not be known.
    enough: f64,
}

impl Axis<'_> {
    /// Least distance along the line between two points of known distances, by halving; any that is enough where it is
    /// enough.
    fn least(&self, a: (&Point3<f64>, f64), b: (&Point3<f64>, f64)) -> f64 {
        let length = (a.0 - b.0).norm();
        let ends = a.1.min(b.1);
        let bound = 0.5 * (a.1 + b.1 - length);
        if bound >= self.enough || length <= PIECE {
            return ends;
        }
        if length <= COARSE * ends {
            return bound;
        }
        let middle = nalgebra::center(a.0, b.0);
        let half = self.body.distance(&middle);
        let near = Axis {
            enough: self.enough.min(ends),
            ..*self
        };
        let first = near.least(a, (&middle, half));
        let rest = Axis {
            enough: near.enough.min(first),
            ..*self
        };
        first.min(rest.least((&middle, half), b))
    }
}
