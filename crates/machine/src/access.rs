//! Whether the stylus gets to a touch and away again without hitting what is known of the part.
//!
//! Bodies ([`crate::geometry`]) reach as far as the part was touched, not beyond. What a measured touch would have hit is
//! not there for touches of the same feature with the stem in nearly the same direction. A touch is allowed when
//! approach, retract and the withdrawal along the stem to free space are clear, for ball, stem and the probe's body, so
//! that any order of allowed touches can be measured. Metres, part frame. Table, clamps and the machine itself are not
//! known here.

use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{InspectionPlan, InspectionPoint};

use crate::chain::Chain;
use crate::contact::Surface;
use crate::deviation::Nominal;
use crate::geometry::{self, Body, Contact, Stylus, StylusPose};

/// Approach and retract where the plan gives none, m.
pub const DEFAULT_CLEARANCE: f64 = 2e-3;
/// Stems within this angle count as the same direction, rad.
const ALIKE: f64 = 0.1;
/// How much a touch may seem to enter the surface it ends on, m: rounding.
const CONTACT: f64 = 1e-9;

/// A touch, measured or proposed, and where the axes stand for it.
#[derive(Debug, Clone)]
pub struct TouchPose {
    /// Index of the feature touched.
    pub feature: usize,
    /// Nominal contact, m, part frame.
    pub position: Point3<f64>,
    /// Outward normal there, part frame.
    pub normal: Vector3<f64>,
    /// The feature's surface, part frame.
    pub surface: Surface,
    /// Axis positions (m, rad) at the contact; `None` for what is no touch of the machine.
    pub positions: Option<Vec<f64>>,
}

/// A stylus in contact, part frame.
#[derive(Debug, Clone, Copy)]
struct InContact {
    feature: usize,
    /// Centre of the ball, origin of the probe mount.
    stylus: StylusPose,
    normal: Vector3<f64>,
    /// Unit direction from the ball along the stem.
    stem: Vector3<f64>,
}

/// What is known of the part, and of the stylus.
#[derive(Debug)]
pub struct Access<'a> {
    chain: &'a Chain,
    nominal: &'a Nominal,
    stylus: Option<Stylus>,
    bodies: Vec<Body>,
    measured: Vec<InContact>,
    approach: f64,
    retract: f64,
    /// Length of a withdrawal that clears everything, m.
    far: f64,
}

impl<'a> Access<'a> {
    /// From a plan, its `nominal` numbers, and touches that are known to be possible.
    pub fn new(
        chain: &'a Chain,
        nominal: &'a Nominal,
        plan: &InspectionPlan,
        measured: &[TouchPose],
    ) -> Self {
        let least = |distance: fn(&InspectionPoint) -> f64| {
            let given = plan.points.iter().map(distance);
            let least = given
                .filter(|distance| *distance > 0.0)
                .fold(f64::INFINITY, f64::min);
            if least.is_finite() {
                least
            } else {
                DEFAULT_CLEARANCE
            }
        };
        let contacts: Vec<Contact> = measured
            .iter()
            .map(|touch| Contact {
                feature: touch.feature,
                flat: geometry::is_plane(plan, touch.feature),
                position: touch.position,
                normal: Unit::new_unchecked(touch.normal),
                surface: touch.surface,
            })
            .collect();
        let stylus = Stylus::with_probe(nominal);
        let size = measured
            .iter()
            .map(|touch| (touch.position - measured[0].position).norm())
            .fold(0.0, f64::max);
        let reach = |stylus: &Stylus| stylus.reach(nominal.ball.coords.norm());
        Self {
            chain,
            nominal,
            far: 2.0 * (size + stylus.as_ref().map_or(0.0, reach)),
            stylus,
            bodies: geometry::bodies(&contacts, 0.0, nominal.ball_radius),
            measured: (measured.iter())
                .filter_map(|touch| in_contact(chain, nominal, touch))
                .collect(),
            approach: least(|point| point.approach_distance),
            retract: least(|point| point.retract_distance),
        }
    }

    /// True when the stylus gets to a touch and away.
    pub fn allows(&self, touch: &TouchPose) -> bool {
        let Some(touch) = in_contact(self.chain, self.nominal, touch) else {
            // Without an offset of the ball nothing is known of the stem; the plan's own attitude is as good as any.
            return self.stylus.is_none();
        };
        let Some(stylus) = &self.stylus else {
            return true;
        };
        let alike: Vec<&InContact> = self
            .measured
            .iter()
            .filter(|measured| measured.feature == touch.feature)
            .filter(|measured| measured.stem.dot(&touch.stem) > ALIKE.cos())
            .collect();
        let over = |touch: &InContact| touch.normal.dot(&touch.stem);
        let lowest = alike.iter().map(|touch| over(touch));
        let lowest = lowest.fold(-CONTACT, f64::min);
        if over(&touch) < lowest - CONTACT {
            return false;
        }
        self.bodies.iter().all(|body| {
            self.is_clear(stylus, body, &touch)
                || alike
                    .iter()
                    .any(|measured| !self.is_clear(stylus, body, measured))
        })
    }

    /// Approach, retract and withdrawal pass a body.
    fn is_clear(&self, stylus: &Stylus, body: &Body, touch: &InContact) -> bool {
        let passes = |from: &StylusPose, to: &StylusPose, least: f64| {
            geometry::passes(stylus, std::slice::from_ref(body), &[least], [from, to])
        };
        let off = |by: Vector3<f64>| touch.stylus.map(|point| point + by);
        let approach = off(touch.normal * self.approach);
        let retract = off(touch.normal * self.retract);
        let withdrawn = retract.map(|point| point + touch.stem * self.far);
        passes(&approach, &touch.stylus, -CONTACT)
            && passes(&retract, &touch.stylus, -CONTACT)
            && passes(&retract, &withdrawn, 0.0)
    }
}

fn in_contact(chain: &Chain, nominal: &Nominal, touch: &TouchPose) -> Option<InContact> {
    let mount = chain.part_from_mount(touch.positions.as_ref()?, &nominal.part_pose);
    let arm = mount.rotation * -nominal.ball.coords;
    let stem = Unit::try_new(arm, geometry::SAME)?.into_inner();
    let ball = touch.position + touch.normal * nominal.ball_radius;
    Some(InContact {
        feature: touch.feature,
        stylus: [ball, ball + arm],
        normal: touch.normal,
        stem,
    })
}
