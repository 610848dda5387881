//! One fitted feature: its size, form and uncertainty from the ball centres of its touches.
//!
//! Metres, part frame. The surface that the ball centres lie on is parallel to the feature's at the ball's radius, so a
//! cylinder or sphere fitted to the centres has the feature's radius plus (a bore: minus) that of the ball, and a plane
//! is shifted by it. Fits are least squares (ISO 4351 "Gaussian"). Too few touches for a fit with free position give a
//! size with the nominal position and direction, and say so.

use metrology::fit::{self, FitError};
use nalgebra::{Point3, Vector3};
use probecell_msgs::{FeatureResult, InspectionFeature, geometry_msgs};

/// One usable touch.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Ball centre in the part frame, m.
    pub centre: Point3<f64>,
    /// Deviation along the outward normal, m.
    pub deviation: f64,
}

/// What a fit says; lengths in m.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Diameter; for a plane the distance of the touched middle from the part's origin along the nominal normal.
    pub size: f64,
    /// The same by the plan.
    pub nominal_size: f64,
    /// Peak to valley of the residuals.
    pub form: f64,
    /// Fitted centre or point.
    pub origin: Point3<f64>,
    /// Fitted direction.
    pub axis: Vector3<f64>,
    /// Standard uncertainty of the size for independent touches of standard uncertainty 1.
    pub sensitivity: f64,
    /// How much of a shift that all touches share comes through to the size: 2 for a diameter, 1 for a distance.
    pub common: f64,
    /// What the reader should know of how it was made.
    pub note: &'static str,
}

/// Sine of the angle between a fitted axis and the plan's beyond which it is another cylinder through the same touches.
const LARGEST_TILT: f64 = 0.1;

const CONSTRAINED: &str = "too few touches for a free fit: nominal position and direction taken";

/// Fits one feature.
pub fn fit(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
) -> Result<Fitted, FitError> {
    match feature.kind {
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            Ok(axial(feature, ball_radius, samples))
        }
        InspectionFeature::SPHERE => sphere(feature, ball_radius, samples),
        InspectionFeature::PLANE => Ok(plane(feature, ball_radius, samples)),
        _ => Ok(surface(feature, samples)),
    }
}

/// Fills the measured part of a result.
pub fn describe(
    result: &mut FeatureResult,
    fitted: &Fitted,
    touch_uncertainty: f64,
    common_uncertainty: f64,
) {
    result.size = fitted.size;
    result.nominal_size = fitted.nominal_size;
    result.size_deviation = fitted.size - fitted.nominal_size;
    result.form = fitted.form;
    result.origin = geometry_msgs::Point {
        x: fitted.origin.x,
        y: fitted.origin.y,
        z: fitted.origin.z,
    };
    result.axis = geometry_msgs::Vector3 {
        x: fitted.axis.x,
        y: fitted.axis.y,
        z: fitted.axis.z,
    };
    result.standard_uncertainty =
        (fitted.sensitivity * touch_uncertainty).hypot(fitted.common * common_uncertainty);
    fitted.note.clone_into(&mut result.text);
}

fn axial(feature: &InspectionFeature, ball_radius: f64, samples: &[Sample]) -> Fitted {
    let bore = feature.kind == InspectionFeature::BORE;
    let offset = if bore { -ball_radius } else { ball_radius };
    let nominal_axis = vector(&feature.axis).normalize();
    let centres = centres(samples);
    let nominal_size = 2.0 * feature.radius;
    // Few or regular touches lie on several cylinders: one that is not the plan's is no answer.
    if let Ok(fit) = fit::cylinder(&centres)
        && fit.shape.axis.cross(&nominal_axis).norm() < LARGEST_TILT
        && let Some(sensitivity) = fit.uncertainty("radius", 2.0)
    {
        return Fitted {
            size: 2.0 * (fit.shape.radius - offset),
            nominal_size,
            form: fit.form,
            origin: Point3::from(fit.shape.point),
            axis: along(fit.shape.axis, nominal_axis),
            sensitivity,
            common: 2.0,
            note: "",
        };
    }
    // A circle across the nominal axis.
    let flat: Vec<Vector3<f64>> = centres
        .iter()
        .map(|p| p - nominal_axis * nominal_axis.dot(p))
        .collect();
    if let Ok(fit) = fit::circle(&flat)
        && let Some(sensitivity) = fit.uncertainty("radius", 2.0)
    {
        let height = nominal_axis * mean(centres.iter().map(|p| nominal_axis.dot(p)));
        return Fitted {
            size: 2.0 * (fit.shape.radius - offset),
            nominal_size,
            form: fit.form,
            origin: Point3::from(fit.shape.center + height),
            axis: nominal_axis,
            sensitivity,
            common: 2.0,
            note: "touches do not determine the direction of the axis: nominal direction taken",
        };
    }
    let sign = if bore { -1.0 } else { 1.0 };
    Fitted {
        nominal_size,
        ..constrained(feature, samples, 2.0 * sign, nominal_size)
    }
}

fn sphere(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
) -> Result<Fitted, FitError> {
    let nominal_size = 2.0 * feature.radius;
    if samples.len() < 4 {
        return Ok(constrained(feature, samples, 2.0, nominal_size));
    }
    let fit = fit::sphere(&centres(samples))?;
    Ok(Fitted {
        size: 2.0 * (fit.shape.radius - ball_radius),
        nominal_size,
        form: fit.form,
        origin: Point3::from(fit.shape.center),
        axis: vector(&feature.axis),
        sensitivity: fit.uncertainty("radius", 2.0).unwrap_or(f64::INFINITY),
        common: 2.0,
        note: "",
    })
}

fn plane(feature: &InspectionFeature, ball_radius: f64, samples: &[Sample]) -> Fitted {
    let normal = vector(&feature.axis).normalize();
    let origin = vector_of(&feature.origin);
    let nominal_size = normal.dot(&origin);
    let Ok(fit) = fit::plane(&centres(samples)) else {
        return constrained(feature, samples, 1.0, nominal_size);
    };
    let shape = fit.shape.facing(&normal);
    Fitted {
        // The middle of the touches lies on the fitted plane: its height does not depend on the tilt.
        size: normal.dot(&shape.point) - ball_radius,
        nominal_size,
        form: fit.form,
        origin: Point3::from(shape.point - shape.normal * ball_radius),
        axis: shape.normal,
        sensitivity: (samples.len() as f64).sqrt().recip(),
        common: 1.0,
        note: "",
    }
}

/// A profile or surface without a closed form: mean and range of the deviations.
fn surface(feature: &InspectionFeature, samples: &[Sample]) -> Fitted {
    Fitted {
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
) -> Fitted {
    let deviations = || samples.iter().map(|sample| sample.deviation);
    let highest = deviations().fold(f64::NEG_INFINITY, f64::max);
    let lowest = deviations().fold(f64::INFINITY, f64::min);
    Fitted {
        size: nominal_size + factor * mean(deviations()),
        nominal_size,
        form: highest - lowest,
        origin: Point3::from(vector_of(&feature.origin)),
        axis: vector(&feature.axis),
        sensitivity: factor.abs() / (samples.len() as f64).sqrt(),
        common: factor.abs(),
        note: CONSTRAINED,
    }
}

fn centres(samples: &[Sample]) -> Vec<Vector3<f64>> {
    samples.iter().map(|sample| sample.centre.coords).collect()
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

fn vector(v: &geometry_msgs::Vector3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn vector_of(p: &geometry_msgs::Point) -> Vector3<f64> {
    Vector3::new(p.x, p.y, p.z)
}
