//! How the machine may move between touches.

use machine::{Chain, Motion};
use nalgebra::{Unit, Vector3};

/// The machine, and what its measuring programs keep to.
#[derive(Clone, Debug)]
pub struct MotionRules<'a> {
    /// The machine.
    pub chain: &'a Chain,
    /// Axis that is moved clear of the part before the others move (index in the chain's axes), and its clear position
    /// (m); `None`: the probe withdraws along its stem.
    pub clearance: Option<(usize, f64)>,
    /// How an arm may hold the probe; `None` where the axes that are free cannot turn it, or seeds say how.
    pub attitudes: Option<&'a Attitudes>,
    /// How far a probing move continues behind the nominal contact, m.
    pub overtravel: f64,
    /// Kicks of the local search.
    pub kicks: u64,
}

impl MotionRules<'_> {
    /// The motion model by which moves are timed.
    pub(crate) fn motion(&self) -> &Motion {
        self.chain.motion()
    }
}

/// How an arm may hold the probe, by feature of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Attitudes {
    /// Of each feature.
    pub features: Vec<Held>,
    /// Candidates that each point keeps.
    pub kept: usize,
}

/// How it may be held for a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct Held {
    /// Directions from the ball along the stem, part frame.
    pub stems: Vec<Unit<Vector3<f64>>>,
    /// Turns about the stem from an attitude that is the same in the foundation for the same direction there, rad.
    pub turns: Vec<f64>,
}
