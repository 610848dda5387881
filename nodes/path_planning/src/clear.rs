//! Whether the stylus passes the part on a way of the axes, as far as the plan tells of the part.
//!
//! Bodies come from features and where they are touched: the block between the planes, where they bound a convex one, else
//! each plane as far as it is touched; cylinders and the walls of bores over the heights touched; balls; a disc at each
//! touch of any other surface. Nobody touches at the very edge, so a surface goes on beyond its outermost touches by the
//! approach distance. Bores are cut out of the block at any depth. The stylus is its ball and a stem to the mount's
//! origin. A way keeps half the shortest approach or retract away from every body, or as far as its ends are, where they
//! are nearer: such a body is less than it seems (a shaft with flats). Distances of bodies are lower bounds, and between
//! two places of the axes the way is halved until what they are clear by is more than what any point of the stylus moves.
//! Not known here: table, clamps, the probe's body, the machine, what no touch tells of. Metres, radians, part frame.

use machine::{Chain, JointKind, Nominal, Surface};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use probecell_msgs::InspectionPlan;

/// Radius of the stem over that of the ball.
const STEM: f64 = 0.7;
/// Places nearer than this to each other on a way are taken for the whole of it, m.
const RESOLUTION: f64 = 1e-4;
/// A way on which an axis turns by more is halved whatever it is clear by, rad: what turns is off its chord by 1/80 of
/// the chord at most.
const TURN: f64 = 0.1;
/// Two places within this distance are the same, m.
const SAME: f64 = 1e-6;
/// Places of the axes looked at on one way at most; a way that needs more is too near to a body all along.
const PLACES: u32 = 20_000;

type Face = (Vector3<f64>, f64);
type Line = (Point3<f64>, Unit<Vector3<f64>>);

/// A body, by a lower bound of the distance from it.
enum Body {
    /// All points below every face (outward normal, offset in m) and outside of every bore.
    Block(Vec<Face>, Vec<(Line, f64)>),
    /// Between two heights (m) along a line and two radii (m) around it.
    Round(Line, [f64; 2], [f64; 2]),
    /// Centre and radius, m.
    Ball(Point3<f64>, f64),
}

impl Body {
    fn distance(&self, at: &Point3<f64>) -> f64 {
        match self {
            Self::Block(faces, bores) => {
                let out = faces
                    .iter()
                    .map(|(normal, at_face)| normal.dot(&at.coords) - at_face);
                let inside = bores
                    .iter()
                    .map(|(line, radius)| radius - polar(line, at)[1]);
                out.chain(inside).fold(f64::NEG_INFINITY, f64::max)
            }
            Self::Round(line, [low, high], [inner, outer]) => {
                let [height, radius] = polar(line, at);
                let inside = if *inner > 0.0 {
                    inner - radius
                } else {
                    f64::NEG_INFINITY
                };
                let across = (radius - outer).max(inside);
                let along = (height - high).max(low - height);
                if across > 0.0 && along > 0.0 {
                    across.hypot(along)
                } else {
                    across.max(along)
                }
            }
            Self::Ball(centre, radius) => (at - centre).norm() - radius,
        }
    }
}

/// Height along a line and distance from it, m.
fn polar((origin, axis): &Line, at: &Point3<f64>) -> [f64; 2] {
    let arm = at - origin;
    let height = axis.dot(&arm);
    [height, (arm - axis.into_inner() * height).norm()]
}

/// Where the stylus is for a place of the axes: ball and end of the stem, m.
type Stylus = [Point3<f64>; 2];

/// The bodies that a plan tells of, and the stylus that must not hit them.
pub(crate) struct Surroundings<'a> {
    chain: &'a Chain,
    nominal: &'a Nominal,
    bodies: Vec<Body>,
    gap: f64,
    centre: Point3<f64>,
    /// m; everything is nearer to the centre.
    size: f64,
}

impl<'a> Surroundings<'a> {
    pub(crate) fn new(chain: &'a Chain, plan: &InspectionPlan, nominal: &'a Nominal) -> Self {
        let least = |of: fn(&probecell_msgs::InspectionPoint) -> f64| {
            plan.points.iter().map(of).fold(f64::INFINITY, f64::min)
        };
        let beyond = least(|point| point.approach_distance);
        let retract = least(|point| point.retract_distance);
        let finite = |value: f64| {
            if value.is_finite() {
                value.max(0.0)
            } else {
                0.0
            }
        };
        let (beyond, retract) = (finite(beyond), finite(retract));
        let (mut low, mut high) = bounds(nominal.points.iter().map(|(at, _)| *at));
        for surface in &nominal.surfaces {
            if let Surface::Sphere(centre, radius) = surface {
                low = low.inf(&(centre - Vector3::repeat(*radius)));
                high = high.sup(&(centre + Vector3::repeat(*radius)));
            }
        }
        Self {
            chain,
            nominal,
            bodies: bodies(plan, nominal, beyond),
            gap: 0.5 * beyond.min(retract),
            centre: nalgebra::center(&low, &high),
            size: 0.5 * (high - low).norm() + beyond + retract + 2.0 * nominal.ball_radius,
        }
    }

    /// Ball centre for a place of the axes, and the unit direction from it along the stem, where the ball is off the
    /// mount's origin.
    pub(crate) fn probe(&self, positions: &[f64]) -> (Point3<f64>, Option<Unit<Vector3<f64>>>) {
        let [ball, mount] = self.stylus(positions);
        (ball, Unit::try_new(mount - ball, SAME))
    }

    /// The middle of the part.
    pub(crate) fn middle(&self) -> Point3<f64> {
        self.centre
    }

    /// m; how high a place is over the middle of the part, by a direction.
    pub(crate) fn height(&self, at: &Point3<f64>, up: &Unit<Vector3<f64>>) -> f64 {
        up.dot(&(at - self.centre))
    }

    /// m; a stylus whose ball is so high by the direction of its stem is clear of everything.
    pub(crate) fn size(&self) -> f64 {
        self.size
    }

    fn stylus(&self, positions: &[f64]) -> Stylus {
        let pose: Isometry3<f64> = (self.chain).part_from_mount(positions, &self.nominal.part_pose);
        [pose * self.nominal.ball, pose * Point3::origin()]
    }

    /// m; how far the stylus is from each body.
    pub(crate) fn clearances(&self, positions: &[f64]) -> Vec<f64> {
        let stylus = self.stylus(positions);
        self.bodies
            .iter()
            .map(|body| self.clearance(body, &stylus))
            .collect()
    }

    fn clearance(&self, body: &Body, [ball, mount]: &Stylus) -> f64 {
        let radius = self.nominal.ball_radius;
        let (near, far) = (body.distance(ball), body.distance(mount));
        let ball_clear = near - radius;
        // What is farther than the ball's own clearance does not count.
        let stem = STEM * radius;
        let within = Segment {
            body,
            enough: ball_clear + stem,
        };
        ball_clear.min(within.least((ball, near), (mount, far)) - stem)
    }

    /// What the stylus is clear by more than it must be; negative where it is too near.
    fn spare(&self, stylus: &Stylus, needed: &[f64]) -> f64 {
        let mut spare = f64::INFINITY;
        for (body, needed) in self.bodies.iter().zip(needed) {
            spare = spare.min(self.clearance(body, stylus) - needed);
            if spare < -SAME {
                break;
            }
        }
        spare
    }

    /// True when the stylus passes all bodies on the straight moves of the axes from one end, by the targets of a way,
    /// to the other, the way's last target. `ends` are the clearances of the stylus there.
    pub(crate) fn is_clear(&self, from: &[f64], way: &[Vec<f64>], ends: [&[f64]; 2]) -> bool {
        let needed: Vec<f64> = (ends[0].iter().zip(ends[1]))
            .map(|(from, to)| self.gap.min(*from).min(*to))
            .collect();
        let mut at = from;
        for target in way {
            let mut left = PLACES;
            let place = |positions: &[f64]| {
                let stylus = self.stylus(positions);
                (stylus, self.spare(&stylus, &needed))
            };
            let (start, end) = (place(at), place(target));
            if !self.passes(at, target, [&start, &end], &needed, &mut left) {
                return false;
            }
            at = target;
        }
        true
    }

    fn passes(
        &self,
        from: &[f64],
        to: &[f64],
        ends: [&(Stylus, f64); 2],
        needed: &[f64],
        left: &mut u32,
    ) -> bool {
        let spare = ends.map(|end| end.1);
        if spare[0] < -SAME || spare[1] < -SAME {
            return false;
        }
        let moved = (0..2)
            .map(|point| (ends[0].0[point] - ends[1].0[point]).norm())
            .fold(0.0, f64::max);
        let turns = (0..from.len())
            .filter(|&axis| self.chain.axis(axis).kind == JointKind::Revolute)
            .map(|axis| (to[axis] - from[axis]).abs())
            .fold(0.0, f64::max);
        if turns <= TURN && (moved <= RESOLUTION || spare[0] + spare[1] >= moved) {
            return true;
        }
        if *left == 0 {
            return false;
        }
        *left -= 1;
        let middle: Vec<f64> = from
            .iter()
            .zip(to)
            .map(|(a, b)| f64::midpoint(*a, *b))
            .collect();
        let stylus = self.stylus(&middle);
        let half = (stylus, self.spare(&stylus, needed));
        self.passes(from, &middle, [ends[0], &half], needed, left)
            && self.passes(&middle, to, [&half, ends[1]], needed, left)
    }
}

/// A straight line against a body.
struct Segment<'a> {
    body: &'a Body,
    /// m; a distance beyond this need not be told.
    enough: f64,
}

impl Segment<'_> {
    /// Least distance along the line between two points of known distances, to the resolution; any that is enough where
    /// it is enough.
    fn least(&self, a: (&Point3<f64>, f64), b: (&Point3<f64>, f64)) -> f64 {
        let length = (a.0 - b.0).norm();
        let ends = a.1.min(b.1);
        if 0.5 * (a.1 + b.1 - length) >= self.enough || length <= 5.0 * RESOLUTION {
            return ends;
        }
        let middle = nalgebra::center(a.0, b.0);
        let half = self.body.distance(&middle);
        let near = Segment {
            enough: self.enough.min(ends),
            ..*self
        };
        let first = near.least(a, (&middle, half));
        let rest = Segment {
            enough: near.enough.min(first),
            ..*self
        };
        first.min(rest.least((&middle, half), b))
    }
}

/// The bodies of a plan. `beyond`: how far a surface goes on beyond its touches, m.
fn bodies(plan: &InspectionPlan, nominal: &Nominal, beyond: f64) -> Vec<Body> {
    let mut bodies = Vec::new();
    let mut bores: Vec<(Line, f64)> = Vec::new();
    let mut flat: Vec<Vec<usize>> = Vec::new();
    for feature in 0..plan.features.len() {
        let own: Vec<usize> = (0..plan.points.len())
            .filter(|&point| plan.points[point].feature as usize == feature)
            .collect();
        let Some(&first) = own.first() else {
            continue;
        };
        let heights = |line: &Line| {
            let all = own
                .iter()
                .map(|&point| polar(line, &nominal.points[point].0)[0]);
            let (low, high) = all
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
                    (low.min(height), high.max(height))
                });
            [low - beyond, high + beyond]
        };
        match nominal.surfaces[first] {
            Surface::Plane(..)
                if plan.features[feature].kind == probecell_msgs::InspectionFeature::PLANE =>
            {
                flat.push(own);
            }
            Surface::Cylinder(origin, axis, radius) => {
                let line = (origin, axis);
                bodies.push(Body::Round(line, heights(&line), [0.0, radius]));
            }
            Surface::Bore(origin, axis, radius) => {
                let line = (origin, axis);
                bodies.push(Body::Round(line, heights(&line), [radius, radius + beyond]));
                bores.push((line, radius));
            }
            Surface::Sphere(centre, radius) => bodies.push(Body::Ball(centre, radius)),
            Surface::Plane(..) | Surface::Socket(..) => bodies.extend(discs(nominal, &own)),
        }
    }
    let others = (0..plan.points.len())
        .filter(|point| !matches!(nominal.surfaces[*point], Surface::Bore(..)));
    match block(nominal, &flat, beyond) {
        Some(faces)
            if others
                .into_iter()
                .all(|point| !within(&faces, &nominal.points[point].0)) =>
        {
            bodies.push(Body::Block(faces, bores));
        }
        _ => bodies.extend(
            flat.iter()
                .map(|own| Body::Block(sheet(nominal, own, beyond), bores.clone())),
        ),
    }
    bodies
}

fn face(normal: &Vector3<f64>, through: &Point3<f64>) -> Face {
    (*normal, normal.dot(&through.coords))
}

/// A point is deeper than the surface.
fn within(faces: &[Face], at: &Point3<f64>) -> bool {
    faces
        .iter()
        .all(|(normal, offset)| normal.dot(&at.coords) < offset - SAME)
}

fn bounds(mut points: impl Iterator<Item = Point3<f64>>) -> (Point3<f64>, Point3<f64>) {
    let first = points.next().unwrap_or_else(Point3::origin);
    points.fold((first, first), |(low, high), at| {
        (low.inf(&at), high.sup(&at))
    })
}

/// The block between all planes, as far as they are touched; `None` where the planes bound nothing convex.
fn block(nominal: &Nominal, flat: &[Vec<usize>], beyond: f64) -> Option<Vec<Face>> {
    let touched = || flat.iter().flatten().map(|&point| nominal.points[point]);
    touched().next()?;
    let (low, high) = bounds(touched().map(|(at, _)| at));
    let out = Vector3::repeat(beyond);
    let mut faces = Vec::new();
    for axis in 0..3 {
        let mut normal = Vector3::zeros();
        normal[axis] = 1.0;
        faces.push(face(&normal, &(high + out)));
        faces.push(face(&-normal, &(low - out)));
    }
    for own in flat {
        let (at, normal) = nominal.points[own[0]];
        faces.push(face(&normal, &at));
    }
    // A plane that others stand out of is a step of a part that is not convex: then no block is sure.
    let stands_out = |at: &Point3<f64>| {
        faces
            .iter()
            .any(|(normal, offset)| normal.dot(&at.coords) > offset + SAME)
    };
    (!touched().any(|(at, _)| stands_out(&at))).then_some(faces)
}

/// A plane, as far as it is touched: a body without thickness.
fn sheet(nominal: &Nominal, own: &[usize], beyond: f64) -> Vec<Face> {
    let (first, normal) = nominal.points[own[0]];
    let across = crosswise(&normal);
    let mut faces = vec![face(&normal, &first), face(&-normal.into_inner(), &first)];
    for side in [across, normal.cross(&across)] {
        for side in [side, -side] {
            let farthest = own
                .iter()
                .map(|&point| side.dot(&nominal.points[point].0.coords));
            faces.push((side, farthest.fold(f64::NEG_INFINITY, f64::max) + beyond));
        }
    }
    faces
}

/// A disc at each touch of a free surface: as wide as half the way to the next, at most the ball.
fn discs(nominal: &Nominal, own: &[usize]) -> Vec<Body> {
    let disc = |&point: &usize| {
        let (at, normal) = nominal.points[point];
        let others = own.iter().filter(|&&other| other != point);
        let nearest = others
            .map(|&other| 0.5 * (nominal.points[other].0 - at).norm())
            .fold(nominal.ball_radius, f64::min);
        Body::Round((at, normal), [0.0, 0.0], [0.0, nearest])
    };
    own.iter().map(disc).collect()
}

fn crosswise(axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    axis.cross(&other).normalize()
}
