//! Whether the stylus passes the part on moves of the axes, as far as a plan tells of the part.
//!
//! A move keeps half the shortest approach or retract away from every body, or as far as its ends are, where they are
//! nearer: such a body is smaller than it seems (a shaft with flats). The stylus is the ball and a stem to the mount's
//! origin; the probe's body is not looked at.

use nalgebra::{Isometry3, Point3, Unit, Vector3};
use probecell_msgs::{InspectionPlan, InspectionPoint};

use super::{
    SAME,
    body::Body,
    part::{Contact, bodies, bounds},
    passage::{Move, Passage},
    stylus::{Stylus, StylusPose},
};
use crate::{
    chain::{Chain, JointKind},
    contact::Surface,
    deviation::Nominal,
};

/// The bodies that a plan tells of, and the stylus that must not hit them.
///
/// ```
/// # use machine::{Chain, Nominal, geometry::Surroundings};
/// # use probecell_msgs::*;
/// # fn example(chain: &Chain, plan: &InspectionPlan) -> Result<bool, machine::DeviationError> {
/// let nominal = Nominal::from_plan(plan)?;
/// let around = Surroundings::new(chain, plan, &nominal);
/// let (here, there) = (vec![0.0, 0.0, 0.1], vec![0.2, 0.0, 0.1]);
/// let clearances = [&here, &there].map(|positions| around.clearances(positions));
/// let clear = around.is_clear(&here, &[there], [&clearances[0], &clearances[1]]);
/// # Ok(clear)
/// # }
/// ```
pub struct Surroundings<'a> {
    chain: &'a Chain,
    nominal: &'a Nominal,
    stylus: Stylus,
    bodies: Vec<Body>,
    /// m; kept away from every body.
    gap: f64,
    centre: Point3<f64>,
    /// m; everything is nearer to the centre.
    size: f64,
}

impl<'a> Surroundings<'a> {
    /// From a plan and its `nominal` numbers.
    pub fn new(chain: &'a Chain, plan: &InspectionPlan, nominal: &'a Nominal) -> Self {
        let least = |distance: fn(&InspectionPoint) -> f64| {
            let least = plan
                .points
                .iter()
                .map(distance)
                .fold(f64::INFINITY, f64::min);
            if least.is_finite() {
                least.max(0.0)
            } else {
                0.0
            }
        };
        let approach = least(|point| point.approach_distance);
        let retract = least(|point| point.retract_distance);
        let (mut low, mut high) = bounds(nominal.points.iter().map(|(position, _)| *position));
        for surface in &nominal.surfaces {
            if let Surface::Sphere(centre, radius) = surface {
                low = low.inf(&(centre - Vector3::repeat(*radius)));
                high = high.sup(&(centre + Vector3::repeat(*radius)));
            }
        }
        let contacts = Contact::of_plan(plan, nominal);
        Self {
            chain,
            nominal,
            stylus: Stylus::with_stem(nominal),
            bodies: bodies(&contacts, approach, nominal.ball_radius),
            gap: 0.5 * approach.min(retract),
            centre: nalgebra::center(&low, &high),
            size: 0.5 * (high - low).norm() + approach + retract + 2.0 * nominal.ball_radius,
        }
    }

    /// Ball centre for a set of axis positions, and the unit direction from it along the stem, where the ball is off the
    /// mount's origin.
    pub fn probe(&self, positions: &[f64]) -> (Point3<f64>, Option<Unit<Vector3<f64>>>) {
        let [ball, mount] = self.stylus_at(positions);
        (ball, Unit::try_new(mount - ball, SAME))
    }

    /// The middle of the part.
    pub fn centre(&self) -> Point3<f64> {
        self.centre
    }

    /// Height of a point over the middle of the part in a direction, m.
    pub fn height(&self, point: &Point3<f64>, up: &Unit<Vector3<f64>>) -> f64 {
        up.dot(&(point - self.centre))
    }

    /// A stylus whose ball is that high in the direction of its stem is clear of everything, m.
    pub fn size(&self) -> f64 {
        self.size
    }

    fn stylus_at(&self, positions: &[f64]) -> StylusPose {
        let pose: Isometry3<f64> = (self.chain).part_from_mount(positions, &self.nominal.part_pose);
        [pose * self.nominal.ball, pose * Point3::origin()]
    }

    /// How far the stylus is from each body, m.
    pub fn clearances(&self, positions: &[f64]) -> Vec<f64> {
        let pose = self.stylus_at(positions);
        let bodies = self.bodies.iter();
        bodies
            .map(|body| self.stylus.clearance(body, &pose))
            .collect()
    }

    /// True when the stylus passes all bodies on the straight moves of the axes from a set of positions through the
    /// targets of a way. `ends` are its clearances there and at the last target.
    pub fn is_clear(&self, from: &[f64], way: &[Vec<f64>], ends: [&[f64]; 2]) -> bool {
        let least: Vec<f64> = (ends[0].iter().zip(ends[1]))
            .map(|(from, to)| self.gap.min(*from).min(*to))
            .collect();
        let passage = Passage {
            stylus: &self.stylus,
            bodies: &self.bodies,
            least: &least,
        };
        let mut at = from.to_vec();
        for target in way {
            if !passage.is_clear(self, &at, target) {
                return false;
            }
            at.clone_from(target);
        }
        true
    }
}

impl Move for Surroundings<'_> {
    type At = Vec<f64>;

    fn middle(&self, from: &Vec<f64>, to: &Vec<f64>) -> Vec<f64> {
        from.iter()
            .zip(to)
            .map(|(a, b)| f64::midpoint(*a, *b))
            .collect()
    }

    fn stylus(&self, at: &Vec<f64>) -> StylusPose {
        self.stylus_at(at)
    }

    fn turn(&self, from: &Vec<f64>, to: &Vec<f64>) -> f64 {
        (0..from.len())
            .filter(|&axis| self.chain.axis(axis).kind == JointKind::Revolute)
            .map(|axis| (to[axis] - from[axis]).abs())
            .fold(0.0, f64::max)
    }
}
