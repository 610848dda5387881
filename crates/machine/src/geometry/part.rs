//! The part as far as its touches determine it.

use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{InspectionFeature, InspectionPlan};

use super::{
    SAME,
    body::{Body, Face, Line, cylindrical},
};
use crate::{contact::Surface, deviation::Nominal};

/// A point at which the part is touched, part frame.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Index of the feature.
    pub feature: usize,
    /// It belongs to a plane, not to the tangent plane of a free-form surface.
    pub flat: bool,
    /// m
    pub position: Point3<f64>,
    /// Outward normal.
    pub normal: Unit<Vector3<f64>>,
    /// The feature's surface.
    pub surface: Surface,
}

impl Contact {
    /// The points of a plan, in its order, with `nominal` positions and normals of the same plan.
    pub fn of_plan(plan: &InspectionPlan, nominal: &Nominal) -> Vec<Self> {
        let points = plan.points.iter().enumerate();
        points
            .map(|(index, point)| Self {
                feature: point.feature as usize,
                flat: is_plane(plan, point.feature as usize),
                position: nominal.points[index].0,
                normal: nominal.points[index].1,
                surface: nominal.surfaces[index],
            })
            .collect()
    }
}

/// True for a feature that is a plane by the plan.
pub(crate) fn is_plane(plan: &InspectionPlan, feature: usize) -> bool {
    let feature = plan.features.get(feature);
    feature.is_some_and(|feature| feature.kind == InspectionFeature::PLANE)
}

/// The bodies that contacts determine, feature by feature: the block between the planes, where they bound a convex one, else each
/// plane as far as it is touched; cylinders and the walls of bores over the heights touched; balls; a disc at each
/// contact of any other surface. Bores are cut out of the block at any depth.
///
/// Nobody touches at the very edge, so a surface goes on `beyond` (m) its outermost contacts; discs are at most
/// `disc_radius` (m).
pub fn bodies(contacts: &[Contact], beyond: f64, disc_radius: f64) -> Vec<Body> {
    let mut bodies = Vec::new();
    let mut bores: Vec<(Line, f64)> = Vec::new();
    let mut planes: Vec<Vec<&Contact>> = Vec::new();
    let features = contacts.iter().map(|contact| contact.feature + 1).max();
    for feature in 0..features.unwrap_or(0) {
        let of_feature = contacts.iter().filter(|contact| contact.feature == feature);
        let of_feature: Vec<&Contact> = of_feature.collect();
        let Some(first) = of_feature.first() else {
            continue;
        };
        let heights = |line: &Line| {
            let all = of_feature
                .iter()
                .map(|contact| cylindrical(line, &contact.position)[0]);
            let (low, high) = all
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
                    (low.min(height), high.max(height))
                });
            [low - beyond, high + beyond]
        };
        match first.surface {
            Surface::Plane(..) if first.flat => planes.push(of_feature),
            Surface::Cylinder(origin, axis, radius) => {
                let axis = (origin, axis);
                bodies.push(Body::Round {
                    axis,
                    heights: heights(&axis),
                    radii: [0.0, radius],
                });
            }
            Surface::Bore(origin, axis, radius) => {
                let axis = (origin, axis);
                bodies.push(Body::Round {
                    axis,
                    heights: heights(&axis),
                    radii: [radius, radius + beyond],
                });
                bores.push((axis, radius));
            }
            Surface::Sphere(centre, radius) => bodies.push(Body::Ball { centre, radius }),
            Surface::Plane(..) | Surface::Socket(..) => {
                bodies.extend(discs(&of_feature, disc_radius));
            }
        }
    }
    let others = || {
        let others = contacts.iter();
        others.filter(|contact| !matches!(contact.surface, Surface::Bore(..)))
    };
    match block(&planes, beyond) {
        Some(faces) if !others().any(|contact| is_within(&faces, &contact.position)) => {
            bodies.push(Body::Block { faces, bores });
        }
        _ => bodies.extend(planes.iter().map(|plane| Body::Block {
            faces: sheet(plane, beyond),
            bores: bores.clone(),
        })),
    }
    bodies
}

fn face(normal: &Vector3<f64>, through: &Point3<f64>) -> Face {
    (*normal, normal.dot(&through.coords))
}

/// A point is deeper than the surface.
fn is_within(faces: &[Face], point: &Point3<f64>) -> bool {
    faces
        .iter()
        .all(|(normal, offset)| normal.dot(&point.coords) < offset - SAME)
}

/// Corners with the least and the largest coordinates.
pub(super) fn bounds(mut points: impl Iterator<Item = Point3<f64>>) -> (Point3<f64>, Point3<f64>) {
    let first = points.next().unwrap_or_else(Point3::origin);
    points.fold((first, first), |(low, high), point| {
        (low.inf(&point), high.sup(&point))
    })
}

/// The block between all planes, as far as they are touched; `None` where the planes bound nothing convex.
fn block(planes: &[Vec<&Contact>], beyond: f64) -> Option<Vec<Face>> {
    let touched = || planes.iter().flatten().map(|contact| contact.position);
    touched().next()?;
    let (low, high) = bounds(touched());
    let out = Vector3::repeat(beyond);
    let mut faces = Vec::new();
    for axis in 0..3 {
        let mut normal = Vector3::zeros();
        normal[axis] = 1.0;
        faces.push(face(&normal, &(high + out)));
        faces.push(face(&-normal, &(low - out)));
    }
    for plane in planes {
        faces.push(face(&plane[0].normal, &plane[0].position));
    }
    // A plane that others stand out of is a step of a part that is not convex: then no block is sure.
    let stands_out = |point: Point3<f64>| {
        faces
            .iter()
            .any(|(normal, offset)| normal.dot(&point.coords) > offset + SAME)
    };
    (!touched().any(stands_out)).then_some(faces)
}

/// A plane, as far as it is touched: a body without thickness.
fn sheet(plane: &[&Contact], beyond: f64) -> Vec<Face> {
    let (first, normal) = (plane[0].position, plane[0].normal);
    let across = crosswise(&normal);
    let mut faces = vec![face(&normal, &first), face(&-normal.into_inner(), &first)];
    for side in [across, normal.cross(&across)] {
        for side in [side, -side] {
            let farthest = plane
                .iter()
                .map(|contact| side.dot(&contact.position.coords));
            faces.push((side, farthest.fold(f64::NEG_INFINITY, f64::max) + beyond));
        }
    }
    faces
}

/// A disc at each contact with a free-form surface: as wide as half the way to the next, at most `radius` (m).
fn discs(contacts: &[&Contact], radius: f64) -> Vec<Body> {
    let disc = |(index, contact): (usize, &&Contact)| {
        let others = contacts.iter().enumerate();
        let nearest = others
            .filter(|(other, _)| *other != index)
            .map(|(_, other)| 0.5 * (other.position - contact.position).norm())
            .fold(radius, f64::min);
        Body::Round {
            axis: (contact.position, contact.normal),
            heights: [0.0, 0.0],
            radii: [0.0, nearest],
        }
    };
    contacts.iter().enumerate().map(disc).collect()
}

fn crosswise(axis: &Unit<Vector3<f64>>) -> Vector3<f64> {
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    axis.cross(&other).normalize()
}
