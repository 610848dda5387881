//! Whether the stylus gets to a touch and away again without hitting what is known of the part.
//!
//! Bodies are made from touches that a plan holds: the convex block between its planes, as far as they were touched, with each bore cut
//! out of it for touches of that bore; cylinders over the heights touched; balls from inside. What a measured touch
//! would have hit is not there for touches of the same feature with the stem in nearly the same direction. A touch is
//! allowed when approach, retract and the withdrawal along the stem to free space are clear, so that any order of
//! allowed touches can be measured. Metres, part frame. Table, clamps and the machine itself are not known here.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point3, Unit, Vector3};
use planning::{Solid, StylusShape};
use probecell_msgs::InspectionPlan;

use crate::chain::Chain;
use crate::contact::Surface;
use crate::deviation::Nominal;

/// Radius of the stem over that of the ball.
const STEM: f64 = 0.7;
/// Share of the stylus's length that is stem; the rest is the probe's body.
const FREE: f64 = 0.5;
/// Radius of a spindle probe's body, m: 40 mm across is the most common.
const BODY: f64 = 0.02;
/// Approach and retract where the plan gives none, m.
pub const CLEAR: f64 = 2e-3;
/// Sectors that stand for the material around a bore.
const SECTORS: usize = 16;
/// Faces of the body inside a ball.
const FACES: usize = 60;
/// Stems within this angle count as the same direction, rad.
const ALIKE: f64 = 0.1;
/// How much a touch may seem to enter the surface it ends on, m.
const CONTACT: f64 = 1e-9;

/// A touch, measured or imagined.
#[derive(Debug, Clone)]
pub struct Aim {
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

/// A stylus in place: contact, direction of the normal and of the stem, part frame.
#[derive(Debug, Clone, Copy)]
struct Placed {
    feature: usize,
    ball: Point3<f64>,
    normal: Vector3<f64>,
    stem: Vector3<f64>,
}

/// What is known of the part, and of the stylus.
#[derive(Debug)]
pub struct Access<'a> {
    chain: &'a Chain,
    nominal: &'a Nominal,
    stylus: Option<StylusShape>,
    /// Bodies that touches of each feature may hit.
    bodies: Vec<Vec<Solid>>,
    /// Touches that were measured.
    met: Vec<Placed>,
    approach: f64,
    retract: f64,
    /// Length of a withdrawal that clears everything, m.
    far: f64,
}

impl<'a> Access<'a> {
    /// From a plan and touches that are known to be possible: `nominal` is the plan's, `met` the touches.
    pub fn new(chain: &'a Chain, nominal: &'a Nominal, plan: &InspectionPlan, met: &[Aim]) -> Self {
        let least = |of: fn(&probecell_msgs::InspectionPoint) -> f64| {
            let given = plan.points.iter().map(of).filter(|value| *value > 0.0);
            let least = given.fold(f64::INFINITY, f64::min);
            if least.is_finite() { least } else { CLEAR }
        };
        let stylus = stylus(nominal);
        let bodies = bodies(met, plan.features.len());
        let size = met
            .iter()
            .map(|aim| (aim.position - met[0].position).norm())
            .fold(0.0, f64::max);
        Self {
            chain,
            nominal,
            far: 2.0 * (size + stylus.map_or(0.0, |stylus| stylus.reach())),
            stylus,
            bodies,
            met: (met.iter())
                .filter_map(|aim| placed(chain, nominal, aim))
                .collect(),
            approach: least(|point| point.approach_distance),
            retract: least(|point| point.retract_distance),
        }
    }

    /// True when the stylus gets to a touch and away.
    pub fn allows(&self, aim: &Aim) -> bool {
        let Some(placed) = placed(self.chain, self.nominal, aim) else {
            // Without an offset of the ball nothing is known of the stem; the plan's own attitude is as good as any.
            return self.stylus.is_none();
        };
        let Some(stylus) = &self.stylus else {
            return true;
        };
        let alike: Vec<&Placed> = self
            .met
            .iter()
            .filter(|met| met.feature == placed.feature)
            .filter(|met| met.stem.dot(&placed.stem) > ALIKE.cos())
            .collect();
        let over = |touch: &Placed| touch.normal.dot(&touch.stem);
        let lowest = alike.iter().map(|met| over(met)).fold(-CONTACT, f64::min);
        if over(&placed) < lowest - CONTACT {
            return false;
        }
        self.bodies.get(placed.feature).is_none_or(|bodies| {
            bodies.iter().all(|body| {
                self.clear(stylus, body, &placed)
                    || alike.iter().any(|met| !self.clear(stylus, body, met))
            })
        })
    }

    fn clear(&self, stylus: &StylusShape, body: &Solid, touch: &Placed) -> bool {
        let stem = [touch.stem.x, touch.stem.y, touch.stem.z];
        let at = |point: Point3<f64>| [point.x, point.y, point.z];
        let contact = at(touch.ball);
        let retract = touch.ball + touch.normal * self.retract;
        [touch.ball + touch.normal * self.approach, retract]
            .iter()
            .all(|&outer| stylus.is_clear(body, at(outer), contact, stem, -CONTACT))
            && stylus.is_clear(
                body,
                at(retract),
                at(retract + touch.stem * self.far),
                stem,
                0.0,
            )
    }
}

/// Ball, stem and body along the line from the ball to the probe mount; `None` where the ball is in the mount's origin.
fn stylus(nominal: &Nominal) -> Option<StylusShape> {
    let length = nominal.ball.coords.norm();
    (length > 2.0 * nominal.ball_radius && length > 0.0).then_some(StylusShape {
        ball_radius: nominal.ball_radius,
        stem_radius: STEM * nominal.ball_radius,
        stem_length: FREE * length,
        body_radius: BODY,
        body_length: (1.0 - FREE) * length,
    })
}

fn placed(chain: &Chain, nominal: &Nominal, aim: &Aim) -> Option<Placed> {
    let mount = chain.part_from_mount(aim.positions.as_ref()?, &nominal.part_pose);
    let stem = Unit::try_new(mount.rotation * -nominal.ball.coords, 1e-6)?;
    Some(Placed {
        feature: aim.feature,
        ball: aim.position + aim.normal * nominal.ball_radius,
        normal: aim.normal,
        stem: stem.into_inner(),
    })
}

/// Bodies of the part that touches of each feature may hit.
fn bodies(aims: &[Aim], features: usize) -> Vec<Vec<Solid>> {
    let mut common: Vec<Solid> = Vec::new();
    let mut seen: Vec<usize> = Vec::new();
    for aim in aims {
        if seen.contains(&aim.feature) {
            continue;
        }
        seen.push(aim.feature);
        let own: Vec<&Aim> = aims.iter().filter(|it| it.feature == aim.feature).collect();
        match &aim.surface {
            Surface::Cylinder(origin, axis, radius) => {
                common.extend(round(&own, origin, axis, *radius));
            }
            Surface::Sphere(origin, radius) => common.push(ball(origin, *radius)),
            _ => {}
        }
    }
    let block = block(aims);
    (0..features)
        .map(|feature| {
            let mut bodies = common.clone();
            let surface = aims
                .iter()
                .find(|aim| aim.feature == feature)
                .map(|aim| &aim.surface);
            if let Some(faces) = &block {
                match surface {
                    Some(Surface::Bore(origin, axis, radius)) => {
                        bodies.extend(around(faces, origin, axis, *radius));
                    }
                    _ => bodies.push(Solid::Convex(faces.clone())),
                }
            }
            bodies
        })
        .collect()
}

type Face = ([f64; 3], f64);

fn face(normal: &Vector3<f64>, through: &Point3<f64>) -> Face {
    ([normal.x, normal.y, normal.z], normal.dot(&through.coords))
}

/// The block between all planes, as far as they were touched; `None` where the planes bound nothing convex.
fn block(aims: &[Aim]) -> Option<Vec<Face>> {
    let flat: Vec<&Aim> = aims
        .iter()
        .filter(|aim| matches!(aim.surface, Surface::Plane(..)))
        .collect();
    let first = flat.first()?;
    let (mut low, mut high) = (first.position, first.position);
    for aim in &flat {
        low = low.inf(&aim.position);
        high = high.sup(&aim.position);
    }
    let mut faces: Vec<Face> = Vec::new();
    for axis in 0..3 {
        let mut out = Vector3::zeros();
        out[axis] = 1.0;
        faces.push(face(&out, &high));
        faces.push(face(&-out, &low));
    }
    for aim in &flat {
        let own = face(&aim.normal, &aim.position);
        let known = |other: &Face| (0..3).all(|k| (other.0[k] - own.0[k]).abs() < 1e-9);
        if !faces
            .iter()
            .any(|other| known(other) && (other.1 - own.1).abs() < 1e-9)
        {
            faces.push(own);
        }
    }
    // Planes that others stand out of are steps of a part that is not convex: then no block is sure.
    let outside = |aim: &&&Aim| {
        let at = aim.position.coords;
        faces
            .iter()
            .any(|(normal, offset)| Vector3::from(*normal).dot(&at) > offset + 1e-6)
    };
    (flat.iter().filter(outside).count() == 0).then_some(faces)
}

/// The material of a block around a bore, in sectors.
fn around(
    faces: &[Face],
    origin: &Point3<f64>,
    axis: &Unit<Vector3<f64>>,
    radius: f64,
) -> Vec<Solid> {
    let across = across(axis);
    let other = axis.cross(&across);
    let direction = |angle: f64| across * angle.cos() + other * angle.sin();
    let half = PI / SECTORS as f64;
    (0..SECTORS)
        .map(|sector| {
            let angle = TAU * sector as f64 / SECTORS as f64;
            let out = direction(angle);
            let mut own = faces.to_vec();
            own.push(face(&-out, &(origin + out * radius)));
            own.push(face(&direction(angle + half + 0.5 * PI), origin));
            own.push(face(&direction(angle - half - 0.5 * PI), origin));
            Solid::Convex(own)
        })
        .collect()
}

/// A cylinder over the heights that were touched.
fn round(
    aims: &[&Aim],
    origin: &Point3<f64>,
    axis: &Unit<Vector3<f64>>,
    radius: f64,
) -> Option<Solid> {
    let heights = aims.iter().map(|aim| axis.dot(&(aim.position - origin)));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
        (low.min(at), high.max(at))
    });
    let base = origin + axis.into_inner() * low;
    (high >= low).then(|| Solid::Cylinder {
        base: [base.x, base.y, base.z],
        axis: [axis.x, axis.y, axis.z],
        length: high - low,
        radius,
    })
}

/// A body just inside a ball: faces all round, their corners still inside.
fn ball(origin: &Point3<f64>, radius: f64) -> Solid {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let faces = (0..FACES)
        .map(|place| {
            let z = 1.0 - (2.0 * place as f64 + 1.0) / FACES as f64;
            let (flat, angle) = ((1.0 - z * z).sqrt(), golden * place as f64);
            let out = Unit::new_normalize(Vector3::new(flat * angle.cos(), flat * angle.sin(), z));
            face(&out, &(origin + out.into_inner() * (0.93 * radius)))
        })
        .collect();
    Solid::Convex(faces)
}

fn across(axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let least = axis.iamin();
    let mut other = Vector3::zeros();
    other[least] = 1.0;
    axis.cross(&other).normalize()
}
