//! Fits that touch the points: minimum zone, minimum circumscribed and maximum inscribed.
//!
//! Lengths in m. Minimum zone (Chebyshev): the largest distance is least, as ISO 1101 defines form; minimum
//! circumscribed and maximum inscribed: the mating sizes of shafts and bores (ISO 14405-1, GN and GX). From the
//! least-squares shape a sequence of linear programs in a trust region descends to a shape with as many contacts as it
//! has parameters (Anthony, Anthony, Bittner, Butler, Cox et al., *Reference algorithms for Chebyshev and one-sided data
//! fitting*, 1996).
//!
//! Exact where the criterion is convex (circumscribed circle and sphere); otherwise the minimum nearest the
//! least-squares shape, which for points that resemble the shape is the global one. Extreme by definition: one bad
//! point decides the result.

use nalgebra::{Const, DimAdd, DimMin, DimSum, SVector, U1, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::circle_sphere::{Ball, PlaneCircle};
use super::cloud::{Cloud, frame_about, is_canonical};
use super::cylinder_cone::{Axial, Straight, Tapered};
use super::enclosing::smallest_enclosing;
use super::linear_program::{Inequality, minimise};
use super::refine::Model;
use super::{Circle, Cone, Cylinder, Fit, FitError, Plane, Point, Shape, Sphere, spread};

/// What a round shape has to touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Criterion {
    /// Smallest largest distance: all points between two shapes as close together as possible.
    MinimumZone,
    /// Smallest shape with all points inside.
    MinimumCircumscribed,
    /// Largest shape with all points outside.
    MaximumInscribed,
}

/// A shape that touches its points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneFit<S> {
    /// The shape: the middle of the zone, or the touching shape itself.
    pub shape: S,
    /// Orthogonal distance of each point in m, signed as in [`super::Fit`].
    pub residuals: Vec<f64>,
    /// Width in m of the zone that holds the points; for a line the diameter of the enclosing cylinder.
    pub zone: f64,
    /// Indices of the points in contact, within 1e-9 of the size of the points.
    pub contacts: Vec<usize>,
}

/// Programs solved before a fit is given up.
const LIMIT: usize = 500;

/// A plane by its offset and tilts, for which [`Model`] is defined.
#[derive(Clone, Copy)]
struct Flat {
    frame: nalgebra::Matrix3<f64>,
    offset: f64,
}

impl Model<3> for Flat {
    fn linearise(&self, p: &Point) -> (f64, Vector3<f64>) {
        let q = self.frame.tr_mul(p);
        (q.z - self.offset, Vector3::new(q.x, q.y, -1.0))
    }
    fn moved(&self, step: &Vector3<f64>) -> Option<Self> {
        let normal = (self.frame * Vector3::new(step.x, step.y, 1.0)).normalize();
        Some(Self {
            frame: frame_about(&normal),
            offset: self.offset + step.z,
        })
    }
}

/// Largest distance (zone), or the size at which the shape touches.
fn merit<M: Model<P>, const P: usize>(
    model: &M,
    points: &[Point],
    criterion: Criterion,
    size: usize,
) -> Option<(M, f64)> {
    let (low, high) = points
        .iter()
        .map(|p| model.linearise(p).0)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| {
            (l.min(r), h.max(r))
        });
    let mut step = SVector::<f64, P>::zeros();
    match criterion {
        Criterion::MinimumZone => Some((*model, high.max(-low))),
        // The radius enters every distance with −1, so that this makes the nearest point touch.
        Criterion::MinimumCircumscribed => {
            step[size] = high;
            model.moved(&step).map(|m| (m, high))
        }
        Criterion::MaximumInscribed => {
            step[size] = low;
            model.moved(&step).map(|m| (m, -low))
        }
    }
}

/// Descends from `model` by linear programs; D is P + 1, the last variable the half width of the zone.
fn touch<M: Model<P>, const P: usize, const D: usize>(
    model: M,
    points: &[Point],
    criterion: Criterion,
    size: usize,
) -> Option<M>
where
    Const<P>: DimAdd<U1, Output = Const<D>>,
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
    DimSum<Const<P>, U1>: nalgebra::DimName,
{
    let (mut current, mut value) = merit(&model, points, criterion, size)?;
    // Sizes shift with the model; what counts is the change against the touching model itself.
    let touching = !matches!(criterion, Criterion::MinimumZone);
    if touching {
        value = 0.0;
    }
    let (low, high) = spread_of(&current, points);
    let mut reach = (4.0 * (high - low)).clamp(1e-9, 0.3);
    let mut cost = SVector::<f64, D>::zeros();
    match criterion {
        Criterion::MinimumZone => cost[P] = 1.0,
        Criterion::MinimumCircumscribed => cost[size] = 1.0,
        Criterion::MaximumInscribed => cost[size] = -1.0,
    }
    let mut inequalities: Vec<Inequality<D>> = Vec::with_capacity(2 * points.len());
    for _ in 0..LIMIT {
        inequalities.clear();
        for p in points {
            let (r, j) = current.linearise(p);
            let row = |sign: f64, width: f64| {
                SVector::<f64, D>::from_fn(|i, _| if i < P { sign * j[i] } else { width })
            };
            match criterion {
                Criterion::MinimumZone => {
                    inequalities.push((row(-1.0, 1.0), r));
                    inequalities.push((row(1.0, 1.0), -r));
                }
                Criterion::MinimumCircumscribed => inequalities.push((row(-1.0, 0.0), r)),
                Criterion::MaximumInscribed => inequalities.push((row(1.0, 0.0), -r)),
            }
        }
        // The half width needs room beyond the trust region of the displacements.
        let scale = if touching {
            1.0
        } else {
            value.max(reach) / reach
        };
        let scaled: Vec<Inequality<D>> = if scale > 1.0 {
            let widen = |(mut a, b): Inequality<D>| {
                a[P] *= scale;
                (a, b)
            };
            inequalities.iter().copied().map(widen).collect()
        } else {
            inequalities.clone()
        };
        let solution = minimise(&cost, reach, &scaled)?;
        let step = SVector::<f64, P>::from_fn(|i, _| solution[i]);
        let predicted = match criterion {
            Criterion::MinimumZone => value - solution[P] * scale.max(1.0),
            Criterion::MinimumCircumscribed => -solution[size],
            Criterion::MaximumInscribed => solution[size],
        };
        if predicted <= 2e-16 {
            return Some(current);
        }
        let trial = current.moved(&step).and_then(|m| {
            let (m, found) = merit(&m, points, criterion, size)?;
            let change = match criterion {
                Criterion::MinimumZone => value - found,
                // Size after the step and the contact: smaller by −step − found, larger by step − found.
                Criterion::MinimumCircumscribed => -step[size] - found,
                Criterion::MaximumInscribed => step[size] - found,
            };
            Some((m, found, change))
        });
        match trial {
            Some((m, found, change)) if change > 0.05 * predicted => {
                current = m;
                if !touching {
                    value = found;
                }
                if change > 0.7 * predicted {
                    reach = (2.0 * reach).min(0.5);
                }
            }
            _ => {
                reach *= 0.25;
                if reach < 1e-15 {
                    return Some(current);
                }
            }
        }
    }
    None
}

fn spread_of<M: Model<P>, const P: usize>(model: &M, points: &[Point]) -> (f64, f64) {
    points
        .iter()
        .map(|p| model.linearise(p).0)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| {
            (l.min(r), h.max(r))
        })
}

fn report<S, M: Model<P>, const P: usize>(
    shape: S,
    model: &M,
    points: &[Point],
    scale: f64,
) -> ZoneFit<S> {
    let residuals: Vec<f64> = points
        .iter()
        .map(|p| model.linearise(p).0 * scale)
        .collect();
    let (zone, _) = spread(&residuals);
    let low = residuals.iter().copied().fold(f64::INFINITY, f64::min);
    let near = |r: f64| (r - low).min(low + zone - r) <= 1e-9 * scale;
    ZoneFit {
        shape,
        contacts: (0..residuals.len())
            .filter(|i| near(residuals[*i]))
            .collect(),
        residuals,
        zone,
    }
}

fn failure<S: Shape>() -> FitError {
    FitError::NotConverged {
        shape: S::NAME,
        iterations: LIMIT,
    }
}

/// Minimum-zone plane: flatness of ISO 1101.
///
/// # Errors
/// As [`super::plane`].
pub fn plane(points: &[Point]) -> Result<ZoneFit<Plane>, FitError> {
    let start = super::plane(points)?;
    let cloud = Cloud::new::<Plane>(points, 3)?;
    let flat = Flat {
        frame: start.frame,
        offset: 0.0,
    };
    let best = touch::<_, 3, 4>(flat, &cloud.points, Criterion::MinimumZone, 2)
        .ok_or_else(failure::<Plane>)?;
    let normal: Vector3<f64> = best.frame.column(2).into();
    let turn = if is_canonical(&normal) { 1.0 } else { -1.0 };
    let best = Flat {
        frame: frame_about(&(normal * turn)),
        offset: best.offset * turn,
    };
    let shape = Plane {
        point: cloud.centroid + normal * (turn * best.offset * cloud.scale),
        normal: normal * turn,
    };
    Ok(report(shape, &best, &cloud.points, cloud.scale))
}

/// Circle by `criterion`, in the least-squares plane of the points.
///
/// # Errors
/// As [`super::circle`].
pub fn circle(points: &[Point], criterion: Criterion) -> Result<ZoneFit<Circle>, FitError> {
    let start = super::circle(points)?;
    let cloud = Cloud::new::<Circle>(points, 3)?;
    let frame = start.frame;
    let flat: Vec<Point> = cloud.points.iter().map(|p| frame.tr_mul(p)).collect();
    let centre = frame.tr_mul(&(start.shape.center - cloud.centroid)) / cloud.scale;
    let model = PlaneCircle {
        center: centre.xy(),
        radius: start.shape.radius / cloud.scale,
    };
    let best = if criterion == Criterion::MinimumCircumscribed {
        let plane: Vec<Vector2<f64>> = flat.iter().map(Point::xy).collect();
        smallest_enclosing(&plane).map(|(center, radius)| PlaneCircle { center, radius })
    } else {
        touch::<_, 3, 4>(model, &flat, criterion, 2)
    }
    .ok_or_else(failure::<Circle>)?;
    let shape = Circle {
        center: cloud.centroid + frame * best.center.push(0.0) * cloud.scale,
        normal: start.shape.normal,
        radius: best.radius * cloud.scale,
    };
    Ok(report(shape, &best, &flat, cloud.scale))
}

/// Sphere by `criterion`.
///
/// # Errors
/// As [`super::sphere`].
pub fn sphere(points: &[Point], criterion: Criterion) -> Result<ZoneFit<Sphere>, FitError> {
    let start = super::sphere(points)?;
    let cloud = Cloud::new::<Sphere>(points, 4)?;
    let model = Ball {
        center: (start.shape.center - cloud.centroid) / cloud.scale,
        radius: start.shape.radius / cloud.scale,
    };
    let best = if criterion == Criterion::MinimumCircumscribed {
        smallest_enclosing(&cloud.points).map(|(center, radius)| Ball { center, radius })
    } else {
        touch::<_, 4, 5>(model, &cloud.points, criterion, 3)
    }
    .ok_or_else(failure::<Sphere>)?;
    let shape = Sphere {
        center: cloud.centroid + best.center * cloud.scale,
        radius: best.radius * cloud.scale,
    };
    Ok(report(shape, &best, &cloud.points, cloud.scale))
}

/// Cylinder by `criterion`, beginning with the least-squares one of the same points.
///
/// # Errors
/// Points that do not determine it.
pub fn cylinder(
    start: &Fit<Cylinder>,
    points: &[Point],
    criterion: Criterion,
) -> Result<ZoneFit<Cylinder>, FitError> {
    let cloud = Cloud::new::<Cylinder>(points, 5)?;
    let model = Straight(Axial::new(
        start.frame,
        (start.shape.point - cloud.centroid) / cloud.scale,
        start.shape.radius / cloud.scale,
        0.0,
    ));
    let best =
        touch::<_, 5, 6>(model, &cloud.points, criterion, 4).ok_or_else(failure::<Cylinder>)?;
    let axis = best.0.axis();
    let shape = Cylinder {
        point: cloud.centroid + best.0.foot * cloud.scale,
        axis: if is_canonical(&axis) { axis } else { -axis },
        radius: best.0.radius * cloud.scale,
    };
    Ok(report(shape, &best, &cloud.points, cloud.scale))
}

/// Minimum-zone cone. Circumscribed and inscribed cones have no size to extremise and are not defined.
///
/// # Errors
/// As [`super::cone`].
pub fn cone(points: &[Point]) -> Result<ZoneFit<Cone>, FitError> {
    let start = super::cone(points)?;
    let cloud = Cloud::new::<Cone>(points, 6)?;
    let model = Tapered(Axial::new(
        start.frame,
        (start.shape.point - cloud.centroid) / cloud.scale,
        start.shape.radius / cloud.scale,
        start.shape.half_angle,
    ));
    let best = touch::<_, 6, 7>(model, &cloud.points, Criterion::MinimumZone, 4)
        .ok_or_else(failure::<Cone>)?;
    let opening = if best.0.half_angle < 0.0 { -1.0 } else { 1.0 };
    let shape = Cone {
        point: cloud.centroid + best.0.foot * cloud.scale,
        axis: best.0.axis() * opening,
        radius: best.0.radius * cloud.scale,
        half_angle: best.0.half_angle.abs(),
    };
    Ok(report(shape, &best, &cloud.points, cloud.scale))
}
