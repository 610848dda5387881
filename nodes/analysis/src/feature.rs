//! One fitted feature: its size, form, position, orientation and their uncertainties from the ball centres of its touches.
//!
//! Metres and radians, part frame. The surface that the ball centres lie on is parallel to the feature's at the ball's
//! radius, so a cylinder or sphere fitted to the centres has the feature's radius plus (a bore: minus) that of the ball,
//! and a plane is shifted by it. Fits are least squares (ISO 4351 "Gaussian") unless the cell file asks for another
//! [`Criterion`]. Too few touches for a fit with free position give a size with the nominal position and direction, and
//! say so. Touches that the others contradict can be left out; they are always named.

mod associated;
mod uncertain;

use metrology::fit::FitError;
use nalgebra::{Point3, Vector3};
use probecell_msgs::{FeatureResult, InspectionFeature, geometry_msgs};
use serde::Deserialize;

use associated::{Associated, associate};
pub(crate) use uncertain::disturbed;

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

/// What a fitted shape has to be.
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
    /// As messages say it.
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
    /// What the shape has to be.
    pub criterion: Criterion,
    /// Robust deviations from the others beyond which a touch is left out; `None`: every touch counts.
    pub outlier_limit: Option<f64>,
}

/// What a fit says; lengths in m, angles in rad. The uncertainties are standard uncertainties from independent errors of
/// the touches alone.
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
    /// Of the size.
    pub size_uncertainty: f64,
    /// Of the form.
    pub form_uncertainty: f64,
    /// From the nominal place, across what the feature leaves free, and uncertainty along that; `None`: not told.
    pub position: Option<(Vector3<f64>, f64)>,
    /// From the nominal direction, and uncertainty along that; `None`: not told.
    pub orientation: Option<(Vector3<f64>, f64)>,
    /// How much of a shift that all touches share comes through to the size: 2 for a diameter, 1 for a distance.
    pub common: f64,
    /// Places of the samples that were left out, in the list given.
    pub left_out: Vec<usize>,
    /// What the reader should know of how it was made.
    pub note: &'static str,
}

/// Fits one feature to touches of standard uncertainty `touch_uncertainty` (m).
///
/// # Errors
/// Touches that do not determine the feature, or a criterion that is not defined for it.
pub fn fit(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    rules: &Rules,
    touch_uncertainty: f64,
) -> Result<Fitted, FitError> {
    let (kept, left_out) = agreeing(feature, samples, rules, touch_uncertainty)?;
    let found = associate(feature, ball_radius, &kept, rules.criterion)?;
    let moved = position(feature, &found);
    let turned = orientation(feature, &found);
    let doubt = uncertain::doubt(&found, [moved, turned], touch_uncertainty, || {
        uncertain::simulate(&kept, touch_uncertainty, |disturbed| {
            let one = associate(feature, ball_radius, disturbed, rules.criterion).ok()?;
            let along = |way: Vector3<f64>, now: Vector3<f64>| uncertain::unit(&way).dot(&now);
            Some([
                one.size,
                one.form,
                along(moved, position(feature, &one)),
                along(turned, orientation(feature, &one)),
            ])
        })
    });
    let [size_uncertainty, form_uncertainty, along, tilted] = doubt;
    Ok(Fitted {
        size: found.size,
        nominal_size: found.nominal_size,
        form: found.form,
        origin: found.origin,
        axis: found.axis,
        size_uncertainty,
        form_uncertainty,
        position: found.tells_position.then_some((moved, along)),
        orientation: found.tells_orientation.then_some((turned, tilted)),
        common: found.common,
        left_out,
        note: found.note,
    })
}

/// The samples that count, and the places of those that do not: the others contradict them.
///
/// # Errors
/// Touches that do not determine the feature.
pub(crate) fn agreeing(
    feature: &InspectionFeature,
    samples: &[Sample],
    rules: &Rules,
    touch_uncertainty: f64,
) -> Result<(Vec<Sample>, Vec<usize>), FitError> {
    let left_out = rules.outlier_limit.map_or(Ok(Vec::new()), |limit| {
        associated::contradicted(feature, samples, limit, touch_uncertainty)
    })?;
    let places = (0..samples.len()).filter(|place| !left_out.contains(place));
    Ok((places.map(|place| samples[place]).collect(), left_out))
}

/// Centre or point (m) and direction of the fitted shape; an error is a sentence.
pub(crate) fn located(
    feature: &InspectionFeature,
    ball_radius: f64,
    samples: &[Sample],
    criterion: Criterion,
) -> Result<(Point3<f64>, Vector3<f64>), String> {
    let found = associate(feature, ball_radius, samples, criterion);
    let found = found.map_err(|error| error.to_string())?;
    if found.tells_position {
        Ok((found.origin, found.axis))
    } else {
        Err(found.note.to_owned())
    }
}

/// From the nominal place, across what the feature leaves free, m.
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

/// From the nominal direction, rad: for small angles the turn about an axis across both.
fn orientation(feature: &InspectionFeature, found: &Associated) -> Vector3<f64> {
    let nominal = direction(feature);
    found.axis - nominal * nominal.dot(&found.axis)
}

/// What an aligned result owes to the alignment: 6 x 6 covariance of shift (m) and rotation (rad) about the part's origin.
pub type Placed<'a> = Option<&'a nalgebra::Matrix6<f64>>;

/// Fills the measured part of a result. `common_uncertainty` (m) is what all touches share.
pub fn describe(
    result: &mut FeatureResult,
    feature: &InspectionFeature,
    fitted: &Fitted,
    common_uncertainty: f64,
    placed: Placed<'_>,
) {
    result.size = fitted.size;
    result.nominal_size = fitted.nominal_size;
    result.size_deviation = fitted.size - fitted.nominal_size;
    result.form = fitted.form;
    result.form_uncertainty = fitted.form_uncertainty;
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
    // A shift of the part moves a distance from its origin, not a diameter.
    let moves = |way: &Vector3<f64>| uncertain::of_shift(placed, &fitted.origin, way);
    let turns = |way: &Vector3<f64>| uncertain::of_turn(placed, &fitted.axis, way);
    let diameter = [
        InspectionFeature::CYLINDER,
        InspectionFeature::BORE,
        InspectionFeature::SPHERE,
    ];
    let by_place = if diameter.contains(&feature.kind) {
        0.0
    } else {
        moves(&direction(feature))
    };
    result.standard_uncertainty = fitted
        .size_uncertainty
        .hypot(fitted.common * common_uncertainty)
        .hypot(by_place);
    if let Some((off, uncertainty)) = fitted.position {
        result.position = off.norm();
        let shared = if feature.kind == InspectionFeature::PLANE {
            common_uncertainty
        } else {
            0.0
        };
        result.position_uncertainty = uncertainty.hypot(shared).hypot(moves(&off));
    }
    if let Some((off, uncertainty)) = fitted.orientation {
        result.orientation = off.norm().min(1.0).asin();
        result.orientation_uncertainty = uncertainty.hypot(turns(&off));
    }
    fitted.note.clone_into(&mut result.text);
}

/// Nominal direction of a feature, unit; of a sphere z.
pub(crate) fn direction(feature: &InspectionFeature) -> Vector3<f64> {
    let axis = Vector3::new(feature.axis.x, feature.axis.y, feature.axis.z);
    axis.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

pub(crate) fn vector_of(p: &geometry_msgs::Point) -> Vector3<f64> {
    Vector3::new(p.x, p.y, p.z)
}
