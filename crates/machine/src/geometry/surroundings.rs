//! Whether the stylus passes the part on moves of the axes, as far as a plan describes the part.
//!
//! A move keeps half the shortest approach or retract away from every body, or as far as its ends are, where they are
//! nearer: such a body is smaller than it seems (a shaft with flats). The stylus is the ball and a stem to the mount's
//! origin; the probe's body is not looked at. What carries the probe (spindle, links of an arm) must not hit the part
//! either, as far as the robot description gives cylinders or spheres for it ([`crate::chain::Capsule`]).

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
    chain::{Capsule, Chain, JointKind, Side},
    contact::Surface,
    deviation::Nominal,
};

/// The bodies that a plan describes, and the stylus that must not hit them.
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
    /// m; length of an arm from its first axis to the ball, stretched out; `None` for other machines.
    lever: Option<f64>,
    /// What carries it: the joint after whose motion it stands (place in the tool branch), and its shape.
    carriers: Vec<(usize, Capsule, Stylus)>,
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
            lever: lever(chain, nominal),
            carriers: carriers(chain),
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

    /// How far each rotary axis turns, rad.
    fn turns(&self, from: &[f64], to: &[f64]) -> impl Iterator<Item = f64> {
        let rotary = move |&axis: &usize| self.chain.axis(axis).kind == JointKind::Revolute;
        let axes = (0..from.len()).filter(rotary);
        axes.map(move |axis| (to[axis] - from[axis]).abs())
    }

    /// Where one of the carriers stands.
    fn carrier_at(&self, carrier: usize, positions: &[f64]) -> StylusPose {
        let (place, capsule, _) = &self.carriers[carrier];
        let part = self.chain.end_pose(Side::Part, positions) * self.nominal.part_pose;
        let pose = part.inverse() * self.chain.pose_after(Side::Tool, *place, positions);
        capsule.ends.map(|end| pose * end)
    }

    /// Where the stylus and each of its carriers stand.
    fn movers(&self, positions: &[f64]) -> Vec<StylusPose> {
        let carriers = 0..self.carriers.len();
        std::iter::once(self.stylus_at(positions))
            .chain(carriers.map(|carrier| self.carrier_at(carrier, positions)))
            .collect()
    }

    fn shapes(&self) -> impl Iterator<Item = &Stylus> {
        std::iter::once(&self.stylus).chain(self.carriers.iter().map(|(_, _, shape)| shape))
    }

    /// How far the stylus is from each body, then each of what carries it, m.
    pub fn clearances(&self, positions: &[f64]) -> Vec<f64> {
        let movers = self.movers(positions);
        let movers = self.shapes().zip(&movers);
        movers
            .flat_map(|(shape, pose)| self.bodies.iter().map(|body| shape.clearance(body, pose)))
            .collect()
    }

    /// True when what carries the stylus (not the stylus itself) is outside all bodies.
    pub fn is_carrier_clear(&self, positions: &[f64]) -> bool {
        (self.carriers.iter().enumerate()).all(|(carrier, (_, _, shape))| {
            let pose = self.carrier_at(carrier, positions);
            self.bodies
                .iter()
                .all(|body| shape.clearance(body, &pose) > 0.0)
        })
    }

    /// True when the stylus and what carries it pass all bodies on the straight moves of the axes from a set of positions
    /// through the targets of a way. `ends` are the clearances there and at the last target.
    pub fn is_clear(&self, from: &[f64], way: &[Vec<f64>], ends: [&[f64]; 2]) -> bool {
        let least: Vec<f64> = (ends[0].iter().zip(ends[1]))
            .map(|(from, to)| self.gap.min(*from).min(*to))
            .collect();
        let count = self.bodies.len();
        (self.shapes().enumerate()).all(|(mover, shape)| {
            let passage = Passage {
                stylus: shape,
                bodies: &self.bodies,
                least: &least[mover * count..(mover + 1) * count],
            };
            let carried = Carried {
                around: self,
                mover,
            };
            let mut at = from.to_vec();
            way.iter().all(|target| {
                let clear = passage.is_clear(&carried, &at, target);
                at.clone_from(target);
                clear
            })
        })
    }
}

/// Length from the first axis of an arm (three or more rotary axes carry the probe) to the ball, and to the part's side of its
/// foundation, m.
fn lever(chain: &Chain, nominal: &Nominal) -> Option<f64> {
    let joints = chain
        .branch(Side::Tool)
        .iter()
        .map(|&index| &chain.joints()[index]);
    let turning = joints
        .clone()
        .filter(|joint| joint.kind == JointKind::Revolute);
    let carried = joints.skip_while(|joint| !joint.moves()).skip(1);
    let length: f64 = carried
        .map(|joint| joint.origin.translation.vector.norm())
        .sum();
    (turning.count() > 3).then(|| length + nominal.ball.coords.norm())
}

/// Shapes of the tool branch that the part can meet.
fn carriers(chain: &Chain) -> Vec<(usize, Capsule, Stylus)> {
    let mut carriers = Vec::new();
    let mut moved = false;
    for (place, &index) in chain.branch(Side::Tool).iter().enumerate() {
        let joint = &chain.joints()[index];
        moved |= joint.moves();
        if moved && chain.carries(index, Side::Tool) {
            let shapes = joint.capsules.iter();
            carriers.extend(shapes.map(|one| (place, *one, Stylus::capsule(one.radius))));
        }
    }
    carriers
}

/// The stylus (0) or one of its carriers on a move of the axes.
struct Carried<'a> {
    around: &'a Surroundings<'a>,
    mover: usize,
}

impl Move for Carried<'_> {
    type At = Vec<f64>;

    fn middle(&self, from: &Vec<f64>, to: &Vec<f64>) -> Vec<f64> {
        from.iter()
            .zip(to)
            .map(|(a, b)| f64::midpoint(*a, *b))
            .collect()
    }

    fn stylus(&self, at: &Vec<f64>) -> StylusPose {
        match self.mover.checked_sub(1) {
            None => self.around.stylus_at(at),
            Some(carrier) => self.around.carrier_at(carrier, at),
        }
    }

    fn turn(&self, from: &Vec<f64>, to: &Vec<f64>) -> f64 {
        let turns = self.around.turns(from, to);
        if self.around.lever.is_some() {
            turns.sum()
        } else {
            turns.fold(0.0, f64::max)
        }
    }

    /// Of an arm: an arc of all turns together at its whole length, θ²·r/8.
    fn sagitta(&self, from: &Vec<f64>, to: &Vec<f64>) -> Option<f64> {
        let all: f64 = self.around.turns(from, to).sum();
        self.around.lever.map(|lever| all * all * lever / 8.0)
    }
}
