//! The associated feature: the ideal shape fitted to the touches of a feature by each criterion (ISO 14405-1, ISO 1101).
//!
//! m and rad, part frame. Cofactors are covariances for touches of variance 1.

use metrology::fit::{
    self, Cylinder, Fit, FitError, Shape,
    robust::{Rejection, reject_outliers},
    zone,
};
use nalgebra::{Matrix3, Point3, Vector3};
use probecell_msgs::InspectionFeature;

use super::{Criterion, Sample, direction, vector_of};

/// Sine of the angle between a fitted axis and the plan's beyond which it is another cylinder through the same touches.
const LARGEST_TILT: f64 = 0.1;

const CONSTRAINED: &str = "too few touches for a free fit: nominal position and direction taken";
const DIRECTION: &str =
    "touches do not determine the direction of the axis: nominal direction taken";

/// An associated shape, and how far the touches deviate from it.
pub(super) struct Associated {
    pub(super) size: f64,
    pub(super) nominal_size: f64,
    pub(super) form: f64,
    pub(super) origin: Point3<f64>,
    pub(super) axis: Vector3<f64>,
    pub(super) determines_position: bool,
    pub(super) determines_orientation: bool,
    pub(super) note: &'static str,
    /// Of a least-squares fit; `None`: extreme touches decide, and there is no closed form.
    pub(super) cofactors: Option<Cofactors>,
}

/// Covariances of a least-squares fit for touches of variance 1.
pub(super) struct Cofactors {
    /// Variance of the size.
    pub(super) size: f64,
    /// Covariance of the origin, part frame.
    pub(super) position: Matrix3<f64>,
    /// Covariance of the direction, part frame.
    pub(super) direction: Matrix3<f64>,
}

impl Cofactors {
    /// `sensitivity` is ∂(size)/∂(parameter).
    fn from_fit<S: Shape>(fit: &Fit<S>, parameter: &str, sensitivity: f64) -> Self {
        let names = S::PARAMETERS;
        let mut rotated = [Matrix3::zeros(), Matrix3::zeros()];
        for (which, letter) in ["c", "a"].into_iter().enumerate() {
            let column = |name: &str| {
                let number = name.strip_prefix(letter)?.parse::<usize>().ok()?;
                Some(fit.frame.column(number - 1).into_owned())
            };
            for (i, first) in names.iter().enumerate() {
                for (j, second) in names.iter().enumerate() {
                    if let (Some(a), Some(b)) = (column(first), column(second)) {
                        rotated[which] += a * b.transpose() * fit.cofactor[(i, j)];
                    }
                }
            }
        }
        let [position, direction] = rotated;
        Self {
            size: fit
                .uncertainty(parameter, sensitivity)
                .map_or(0.0, |u| u.powi(2)),
            position,
            direction,
        }
    }
}

/// Fits the shape of a feature. `near` is the direction of the axis of an earlier fit to nearly the same samples: a cylinder
/// is then looked for next to it only.
///
/// # Errors
/// Touches that do not determine the feature, or a criterion that is not defined for it.
pub(super) fn associate(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
    near: Option<&Vector3<f64>>,
) -> Result<Associated, FitError> {
    match feature.kind {
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            axial(feature, ball_radius, samples, criterion, near)
        }
        InspectionFeature::SPHERE => sphere(feature, ball_radius, samples, criterion),
        InspectionFeature::PLANE => plane(feature, ball_radius, samples, criterion),
        InspectionFeature::CONE => cone(feature, ball_radius, samples, criterion),
        _ if criterion == Criterion::LeastSquares => Ok(surface(feature, samples)),
        _ => Err(undefined("surface")),
    }
}

/// Indices of the outliers: samples farther from the least-squares shape of the others than `limit` robust standard
/// deviations, which are taken to be at least the uncertainty of a touch (m). None of a profile or surface, and none of too
/// few touches.
pub(super) fn outliers(
    feature: &InspectionFeature,
    samples: &[Sample],
    limit: f64,
    touch_uncertainty: f64,
) -> Result<Vec<usize>, FitError> {
    let rules = Rejection {
        limit,
        resolution: touch_uncertainty,
        ..Rejection::default()
    };
    let points = centres(samples);
    let indices =
        |rejected: Vec<(usize, f64)>| rejected.into_iter().map(|(index, _)| index).collect();
    Ok(match feature.kind {
        InspectionFeature::PLANE => {
            reject_outliers(&points, &rules, fit::plane).map(|fit| indices(fit.rejected))?
        }
        InspectionFeature::SPHERE => {
            reject_outliers(&points, &rules, fit::sphere).map(|fit| indices(fit.rejected))?
        }
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            let about = direction(feature);
            let free = reject_outliers(&points, &rules, fit::cylinder);
            match free {
                Ok(free) if is_upright(&free.fit.shape, &about) => indices(free.rejected),
                _ => reject_outliers(&flat(&points, &about), &rules, fit::circle)
                    .map(|fit| indices(fit.rejected))?,
            }
        }
        InspectionFeature::CONE => {
            reject_outliers(&points, &rules, fit::cone).map(|fit| indices(fit.rejected))?
        }
        _ => Vec::new(),
    })
}

fn is_upright(cylinder: &Cylinder, about: &Vector3<f64>) -> bool {
    is_along(&cylinder.axis, about)
}

fn is_along(axis: &Vector3<f64>, about: &Vector3<f64>) -> bool {
    axis.cross(about).norm() < LARGEST_TILT
}

/// As the library calls it; `None`: least squares.
fn touching(criterion: Criterion) -> Option<zone::Criterion> {
    match criterion {
        Criterion::LeastSquares => None,
        Criterion::MinimumZone => Some(zone::Criterion::MinimumZone),
        Criterion::MinimumCircumscribed => Some(zone::Criterion::MinimumCircumscribed),
        Criterion::MaximumInscribed => Some(zone::Criterion::MaximumInscribed),
    }
}

fn undefined(shape: &'static str) -> FitError {
    FitError::Degenerate {
        shape,
        reason: "the criterion of its fit is not defined for it",
    }
}

fn axial(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
    near: Option<&Vector3<f64>>,
) -> Result<Associated, FitError> {
    let bore = feature.kind == InspectionFeature::BORE;
    let offset = if bore { -ball_radius } else { ball_radius };
    let about = direction(feature);
    let points = centres(samples);
    let found = |radius: f64, form: f64, origin: Vector3<f64>| Associated {
        size: 2.0 * (radius - offset),
        nominal_size: 2.0 * feature.radius,
        form,
        origin: Point3::from(origin),
        axis: about,
        determines_position: true,
        determines_orientation: true,
        note: "",
        cofactors: None,
    };
    // Few or regular touches lie on several cylinders: one that is not the plan's is no answer.
    let free = near.map_or_else(
        || fit::cylinder(&points),
        |axis| fit::cylinder_about(&points, axis),
    );
    if let Ok(fit) = free
        && is_upright(&fit.shape, &about)
        && fit.uncertainty("radius", 2.0).is_some()
    {
        let (shape, form, cofactors) = match touching(criterion) {
            None => (
                fit.shape,
                fit.form,
                Some(Cofactors::from_fit(&fit, "radius", 2.0)),
            ),
            Some(criterion) => {
                let fit = zone::cylinder(&fit, &points, criterion)?;
                (fit.shape, fit.zone, None)
            }
        };
        return Ok(Associated {
            axis: along(shape.axis, about),
            cofactors,
            ..found(shape.radius, form, shape.point)
        });
    }
    // A circle across the nominal axis.
    let across = flat(&points, &about);
    if let Ok(fit) = fit::circle(&across)
        && fit.uncertainty("radius", 2.0).is_some()
    {
        let height = about * mean(points.iter().map(|p| about.dot(p)));
        let (shape, form, cofactors) = match touching(criterion) {
            None => (
                fit.shape,
                fit.form,
                Some(Cofactors::from_fit(&fit, "radius", 2.0)),
            ),
            Some(criterion) => {
                let fit = zone::circle(&across, criterion)?;
                (fit.shape, fit.zone, None)
            }
        };
        return Ok(Associated {
            determines_orientation: false,
            note: DIRECTION,
            cofactors,
            ..found(shape.radius, form, shape.center + height)
        });
    }
    let sign = if bore { -1.0 } else { 1.0 };
    Ok(constrained(
        feature,
        samples,
        2.0 * sign,
        2.0 * feature.radius,
    ))
}

fn sphere(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
) -> Result<Associated, FitError> {
    let nominal_size = 2.0 * feature.radius;
    if samples.len() < 4 {
        return Ok(constrained(feature, samples, 2.0, nominal_size));
    }
    let points = centres(samples);
    let (shape, form, cofactors) = match touching(criterion) {
        None => {
            let fit = fit::sphere(&points)?;
            (
                fit.shape,
                fit.form,
                Some(Cofactors::from_fit(&fit, "radius", 2.0)),
            )
        }
        Some(criterion) => {
            let fit = zone::sphere(&points, criterion)?;
            (fit.shape, fit.zone, None)
        }
    };
    Ok(Associated {
        size: 2.0 * (shape.radius - ball_radius),
        nominal_size,
        form,
        origin: Point3::from(shape.center),
        axis: axis_of(feature),
        determines_position: true,
        determines_orientation: false,
        note: "",
        cofactors,
    })
}

fn plane(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
) -> Result<Associated, FitError> {
    let normal = direction(feature);
    let nominal_size = normal.dot(&vector_of(&feature.origin));
    let points = centres(samples);
    let Ok(fit) = fit::plane(&points) else {
        return Ok(constrained(feature, samples, 1.0, nominal_size));
    };
    let (shape, form, cofactors) = match touching(criterion) {
        None => {
            // The middle of the touches lies on the fitted plane: its height does not depend on the tilt.
            let cofactors = Cofactors {
                size: (samples.len() as f64).recip(),
                ..Cofactors::from_fit(&fit, "c3", 1.0)
            };
            (fit.shape, fit.form, Some(cofactors))
        }
        Some(zone::Criterion::MinimumZone) => {
            let fit = zone::plane(&points)?;
            (fit.shape, fit.zone, None)
        }
        Some(_) => return Err(undefined("plane")),
    };
    let shape = shape.facing(&normal);
    // Where the line through the middle of the touches along the nominal normal meets the plane.
    let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let height = (shape.point - middle).dot(&shape.normal) / normal.dot(&shape.normal);
    let middle = middle + normal * height;
    Ok(Associated {
        size: normal.dot(&middle) - ball_radius,
        nominal_size,
        form,
        origin: Point3::from(middle - shape.normal * ball_radius),
        axis: shape.normal,
        determines_position: true,
        determines_orientation: true,
        note: "",
        cofactors,
    })
}

/// The size of a cone is its diameter in the plane through its nominal origin across the fitted axis. An inner cone is one
/// whose nominal normals point to the axis.
fn cone(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
) -> Result<Associated, FitError> {
    let (about, origin) = (direction(feature), vector_of(&feature.origin));
    let outwards = |sample: &Sample| {
        let arm = sample.centre.coords - origin;
        sample.normal.dot(&(arm - about * about.dot(&arm)))
    };
    let side = samples.iter().map(outwards).sum::<f64>().signum();
    let nominal_size = 2.0 * feature.radius;
    let points = centres(samples);
    let fitted = match criterion {
        Criterion::LeastSquares => fit::cone(&points).map(|fit| (fit.shape, fit.form)),
        Criterion::MinimumZone => zone::cone(&points).map(|fit| (fit.shape, fit.zone)),
        _ => return Err(undefined("cone")),
    };
    let Some((shape, form)) = fitted
        .ok()
        .filter(|(shape, _)| is_along(&shape.axis, &about))
    else {
        let factor = 2.0 * side / feature.half_angle.cos();
        return Ok(constrained(feature, samples, factor, nominal_size));
    };
    let height = shape.axis.dot(&(origin - shape.point));
    let (sin, cos) = shape.half_angle.sin_cos();
    // The ball centres lie on the parallel cone at the ball's radius.
    let radius = shape.radius + height * sin / cos - side * ball_radius / cos;
    Ok(Associated {
        size: 2.0 * radius,
        nominal_size,
        form,
        origin: Point3::from(shape.point + shape.axis * height),
        axis: along(shape.axis, about),
        determines_position: true,
        determines_orientation: true,
        note: "",
        cofactors: None,
    })
}

/// A profile or surface without a closed form: mean and range of the deviations.
fn surface(feature: &InspectionFeature, samples: &[Sample]) -> Associated {
    Associated {
        note: "",
        ..constrained(feature, samples, 1.0, 0.0)
    }
}

/// Size from the mean deviation, position and direction as nominal. `factor` is size per deviation.
fn constrained(
    feature: &InspectionFeature,
    samples: &[Sample],
    factor: f64,
    nominal_size: f64,
) -> Associated {
    let deviations = || samples.iter().map(|sample| sample.deviation);
    let highest = deviations().fold(f64::NEG_INFINITY, f64::max);
    let lowest = deviations().fold(f64::INFINITY, f64::min);
    let count = samples.len() as f64;
    Associated {
        size: nominal_size + factor * mean(deviations()),
        nominal_size,
        form: highest - lowest,
        origin: Point3::from(vector_of(&feature.origin)),
        axis: axis_of(feature),
        determines_position: false,
        determines_orientation: false,
        note: CONSTRAINED,
        cofactors: Some(Cofactors {
            size: factor.powi(2) / count,
            position: Matrix3::zeros(),
            direction: Matrix3::zeros(),
        }),
    }
}

/// As the plan gives it.
fn axis_of(feature: &InspectionFeature) -> Vector3<f64> {
    Vector3::new(feature.axis.x, feature.axis.y, feature.axis.z)
}

fn centres(samples: &[Sample]) -> Vec<Vector3<f64>> {
    samples.iter().map(|sample| sample.centre.coords).collect()
}

fn flat(points: &[Vector3<f64>], about: &Vector3<f64>) -> Vec<Vector3<f64>> {
    points.iter().map(|p| p - about * about.dot(p)).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

fn along(direction: Vector3<f64>, nominal: Vector3<f64>) -> Vector3<f64> {
    if direction.dot(&nominal) < 0.0 {
        -direction
    } else {
        direction
    }
}
