//! One fitted feature: its size, form, position, orientation and their uncertainties from the ball centres of its touches.
//!
//! Metres and radians, part frame. The surface that the ball centres lie on is parallel to the feature's at the ball's
//! radius, so a cylinder or sphere fitted to the centres has the feature's radius plus (a bore: minus) that of the ball,
//! and a plane is shifted by it. Fits are least squares (ISO 14405-1 modifier GG, "Gaussian") unless the cell file asks for
//! another [`Criterion`]. Too few touches for a fit with free position give a size with the nominal position and direction,
//! and a note. Outliers can be left out; they are always named.

mod associated;
mod uncertainty;

use metrology::{fit::FitError, uncertainty::UncertaintyError};
use nalgebra::{Point3, Vector3};
use probecell_msgs::{FeatureResult, InspectionFeature, geometry_msgs};
use serde::Deserialize;

use associated::{Associated, associate};
pub(crate) use uncertainty::{
    AlignmentCovariance, disturbed, shift_by_alignment, tilt_by_alignment,
};

/// Why a feature has no size.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FeatureError {
    /// Its touches do not determine it.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// Its uncertainty cannot be evaluated.
    #[error(transparent)]
    Uncertainty(#[from] UncertaintyError),
}

/// ∂(size)/∂(deviation that all touches share) of a kind of feature: a diameter changes by twice as much, that of a bore the
/// other way, that of a cone of this half angle (rad) by twice as much over its cosine.
pub fn common_sensitivity(kind: u8, half_angle: f64) -> f64 {
    match kind {
        InspectionFeature::CYLINDER | InspectionFeature::SPHERE => 2.0,
        InspectionFeature::BORE => -2.0,
        InspectionFeature::CONE => 2.0 / half_angle.cos(),
        _ => 1.0,
    }
}

/// One usable touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Ball centre in the part frame, m.
    pub centre: Point3<f64>,
    /// Nominal outward normal there, part frame.
    pub normal: Vector3<f64>,
    /// Deviation along the outward normal, m.
    pub deviation: f64,
}

/// Criterion of association (ISO 14405-1, ISO 1101).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// The sum of squared distances is least.
    #[default]
    LeastSquares,
    /// The largest distance is least (ISO 1101).
    MinimumZone,
    /// The smallest shape that holds all touches: the mating size of a shaft.
    MinimumCircumscribed,
    /// The largest shape within all touches: the mating size of a bore.
    MaximumInscribed,
}

impl Criterion {
    /// Its constant in `FeatureResult`.
    pub fn code(self) -> u8 {
        match self {
            Self::LeastSquares => FeatureResult::LEAST_SQUARES,
            Self::MinimumZone => FeatureResult::MINIMUM_ZONE,
            Self::MinimumCircumscribed => FeatureResult::MINIMUM_CIRCUMSCRIBED,
            Self::MaximumInscribed => FeatureResult::MAXIMUM_INSCRIBED,
        }
    }
}

/// How a feature is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rules {
    /// Criterion of association.
    pub criterion: Criterion,
    /// Robust standard deviations beyond which a touch is an outlier; `None`: every touch counts.
    pub outlier_limit: Option<f64>,
}

/// Result of a fit; lengths in m, angles in rad. The uncertainties are standard uncertainties by independent errors of the
/// touches alone.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Diameter, of a cone at its nominal origin; for a plane the distance of the touched middle from the part's origin along the nominal normal.
    pub size: f64,
    /// The same by the plan.
    pub nominal_size: f64,
    /// Peak to valley of the residuals.
    pub form: f64,
    /// Fitted centre or point.
    pub origin: Point3<f64>,
    /// Fitted direction.
    pub axis: Vector3<f64>,
    /// Of the size.
    pub size_uncertainty: f64,
    /// Of the form.
    pub form_uncertainty: f64,
    /// Offset from the nominal position, without the degrees of freedom that the feature leaves, and the uncertainty along
    /// it; `None`: not determined.
    pub position: Option<(Vector3<f64>, f64)>,
    /// Offset from the nominal direction, and the uncertainty along it; `None`: not determined.
    pub orientation: Option<(Vector3<f64>, f64)>,
    /// Indices of the outliers that were left out, in the list given.
    pub left_out: Vec<usize>,
    /// How it was fitted, where not as asked.
    pub note: &'static str,
}

/// Fits one feature to touches of standard uncertainty `touch_uncertainty` (m).
///
/// # Errors
/// Touches that do not determine the feature, a criterion that is not defined for it, or too many simulated touches for
/// which either is so.
pub fn fit(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    rules: &Rules,
    touch_uncertainty: f64,
) -> Result<Fitted, FeatureError> {
    let (kept, left_out) = without_outliers(feature, samples, rules, touch_uncertainty)?;
    let found = associate(feature, ball_radius, &kept, rules.criterion, None)?;
    let shift = position(feature, &found);
    let tilt = orientation(feature, &found);
    let [along_shift, along_tilt] = [shift, tilt].map(|offset| uncertainty::unit(&offset));
    let values = |disturbed: &[Sample]| {
        let near = Some(&found.axis);
        let found = associate(feature, ball_radius, disturbed, rules.criterion, near).ok()?;
        Some([
            found.size,
            found.form,
            along_shift.dot(&position(feature, &found)),
            along_tilt.dot(&orientation(feature, &found)),
        ])
    };
    let [
        size_uncertainty,
        form_uncertainty,
        shift_uncertainty,
        tilt_uncertainty,
    ] = uncertainty::by_touches(&found, &kept, [shift, tilt], touch_uncertainty, values)?;
    Ok(Fitted {
        size: found.size,
        nominal_size: found.nominal_size,
        form: found.form,
        origin: found.origin,
        axis: found.axis,
        size_uncertainty,
        form_uncertainty,
        position: (found.determines_position).then_some((shift, shift_uncertainty)),
        orientation: (found.determines_orientation).then_some((tilt, tilt_uncertainty)),
        left_out,
        note: found.note,
    })
}

/// The samples that count, and the indices of the outliers.
///
/// # Errors
/// Touches that do not determine the feature.
pub(crate) fn without_outliers(
    feature: &InspectionFeature,
    samples: &[Sample],
    rules: &Rules,
    touch_uncertainty: f64,
) -> Result<(Vec<Sample>, Vec<usize>), FitError> {
    let left_out = rules.outlier_limit.map_or(Ok(Vec::new()), |limit| {
        associated::outliers(feature, samples, limit, touch_uncertainty)
    })?;
    let kept = (0..samples.len()).filter(|index| !left_out.contains(index));
    Ok((kept.map(|index| samples[index]).collect(), left_out))
}

/// Centre or point (m) and direction of the fitted shape; `near` as the direction of an earlier fit to nearly the same
/// samples. An error is a sentence.
pub(crate) fn located(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
    near: Option<&Vector3<f64>>,
) -> Result<(Point3<f64>, Vector3<f64>), String> {
    let found = associate(feature, ball_radius, samples, criterion, near);
    let found = found.map_err(|error| error.to_string())?;
    if found.determines_position {
        Ok((found.origin, found.axis))
    } else {
        Err(found.note.to_owned())
    }
}

/// Form of a feature by a criterion, m. An error is a sentence.
pub(crate) fn form(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
) -> Result<f64, String> {
    let about = direction(feature);
    let found = associate(feature, ball_radius, samples, criterion, Some(&about));
    let found = found.map_err(|error| error.to_string())?;
    if found.determines_orientation {
        Ok(found.form)
    } else {
        Err(found.note.to_owned())
    }
}

/// Offset from the nominal position, without the degrees of freedom that the feature leaves, m.
fn position(feature: &InspectionFeature, found: &Associated) -> Vector3<f64> {
    let off = found.origin.coords - vector_of(&feature.origin);
    let axis = direction(feature);
    let along = axis * axis.dot(&off);
    match feature.kind {
        InspectionFeature::PLANE => axis * (found.size - found.nominal_size),
        InspectionFeature::SPHERE => off,
        _ => off - along,
    }
}

/// Offset from the nominal direction, rad: for small angles the rotation about an axis normal to both.
fn orientation(feature: &InspectionFeature, found: &Associated) -> Vector3<f64> {
    let nominal = direction(feature);
    found.axis - nominal * nominal.dot(&found.axis)
}

/// Nominal direction of a feature, unit; of a sphere z.
pub(crate) fn direction(feature: &InspectionFeature) -> Vector3<f64> {
    let axis = Vector3::new(feature.axis.x, feature.axis.y, feature.axis.z);
    axis.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

pub(crate) fn vector_of(p: &geometry_msgs::Point) -> Vector3<f64> {
    Vector3::new(p.x, p.y, p.z)
}
