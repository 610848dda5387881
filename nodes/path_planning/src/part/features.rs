//! Where each feature is touched.

use metrology::profile::Spline;
use nalgebra::{Rotation3, Unit, Vector2, Vector3};
use probecell_msgs::InspectionFeature;

use super::{
    error::PartError,
    numbers::{direction, finite, metres, ros_point, ros_vector},
    raw::RawFeature,
};

/// Most touches along one profile.
const MAX_TOUCHES: usize = 10_000;

/// Nominal point (m) and outward normal, part frame.
type Touch = (Vector3<f64>, Vector3<f64>);

/// The constant of [`InspectionFeature`] for a kind of feature as a cell file names it.
pub fn kind_code(kind: &str) -> Option<u8> {
    Some(match kind {
        "plane" => InspectionFeature::PLANE,
        "cylinder" => InspectionFeature::CYLINDER,
        "bore" => InspectionFeature::BORE,
        "sphere" => InspectionFeature::SPHERE,
        "profile" => InspectionFeature::PROFILE,
        _ => return None,
    })
}

impl RawFeature {
    pub(super) fn message(&self) -> Result<InspectionFeature, PartError> {
        let kind = kind_code(&self.kind).ok_or_else(|| PartError::Kind {
            feature: self.id.clone(),
            kind: self.kind.clone(),
        })?;
        finite("features.origin_mm", &self.origin_mm)?;
        finite("features.radius_mm", &[self.radius_mm])?;
        finite("features.touch_angles_deg", &self.touch_angles_deg)?;
        finite("features.touch_heights_mm", &self.touch_heights_mm)?;
        finite(
            "features.touch_points_mm",
            self.touch_points_mm.as_flattened(),
        )?;
        let axis = match direction(self.axis) {
            Some(axis) => axis,
            None if matches!(kind, InspectionFeature::SPHERE | InspectionFeature::PROFILE) => {
                Vector3::z()
            }
            None => return Err(PartError::Axis(self.id.clone())),
        };
        let round = !matches!(kind, InspectionFeature::PLANE | InspectionFeature::PROFILE);
        if round && !(self.radius_mm.is_finite() && self.radius_mm > 0.0) {
            return Err(PartError::Radius(self.id.clone()));
        }
        let [lower, upper] = self.tolerance_um;
        if !(lower.is_finite() && upper.is_finite() && lower < upper) {
            return Err(PartError::Tolerance(self.id.clone()));
        }
        Ok(InspectionFeature {
            id: self.id.clone(),
            kind,
            origin: ros_point(metres(self.origin_mm)),
            axis: ros_vector(axis),
            radius: self.radius_mm * 1e-3,
            half_angle: 0.0,
            lower_tolerance: lower * 1e-6,
            upper_tolerance: upper * 1e-6,
        })
    }

    /// Nominal point (m) and outward normal of each touch.
    pub(super) fn touches(&self, feature: &InspectionFeature) -> Result<Vec<Touch>, PartError> {
        let origin = metres(self.origin_mm);
        let axis = Vector3::new(feature.axis.x, feature.axis.y, feature.axis.z);
        let mut touches = Vec::new();
        if feature.kind == InspectionFeature::PROFILE {
            touches = self.along_profile(&origin)?;
        }
        for &height in &self.touch_heights_mm {
            for &angle in &self.touch_angles_deg {
                let outward =
                    Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle.to_radians())
                        * across(&axis);
                let position = origin + axis * (height * 1e-3) + outward * feature.radius;
                touches.push((
                    position,
                    if feature.kind == InspectionFeature::BORE {
                        -outward
                    } else {
                        outward
                    },
                ));
            }
        }
        for (index, &near) in self.touch_points_mm.iter().enumerate() {
            let near = metres(near);
            let touch = match feature.kind {
                InspectionFeature::PLANE => (near - axis * axis.dot(&(near - origin)), axis),
                kind => {
                    let mut arm = near - origin;
                    let mut foot = origin;
                    if kind != InspectionFeature::SPHERE {
                        foot += axis * axis.dot(&arm);
                        arm -= axis * axis.dot(&arm);
                    }
                    let outward = arm.try_normalize(1e-9).ok_or_else(|| PartError::Touch {
                        feature: self.id.clone(),
                        index,
                    })?;
                    let inside = kind == InspectionFeature::BORE;
                    (
                        foot + outward * feature.radius,
                        if inside { -outward } else { outward },
                    )
                }
            };
            touches.push(touch);
        }
        if touches.is_empty() {
            return Err(PartError::NoTouches(self.id.clone()));
        }
        Ok(touches)
    }
}

impl RawFeature {
    /// Points at equal lengths along the spline, with the normal to the left of travel.
    fn along_profile(&self, origin: &Vector3<f64>) -> Result<Vec<Touch>, PartError> {
        let refused = |reason: String| PartError::Profile {
            feature: self.id.clone(),
            reason,
        };
        finite(
            "features.control_points_mm",
            self.control_points_mm.as_flattened(),
        )?;
        if self.touches > MAX_TOUCHES {
            return Err(refused(format!(
                "{} touches along a profile are more than {MAX_TOUCHES}",
                self.touches
            )));
        }
        let control: Vec<Vector2<f64>> = self
            .control_points_mm
            .iter()
            .map(|point| Vector2::from(*point) * 1e-3)
            .collect();
        let spline =
            Spline::clamped_uniform(&control).map_err(|error| refused(error.to_string()))?;
        let parameters = spline
            .equally_spaced(self.touches)
            .map_err(|error| refused(error.to_string()))?;
        Ok(parameters
            .into_iter()
            .map(|u| {
                let (point, normal) = (spline.point(u), spline.normal(u));
                (
                    origin + Vector3::new(point.x, point.y, 0.0),
                    Vector3::new(normal.x, normal.y, 0.0),
                )
            })
            .collect())
    }
}

fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let reference = if axis.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    (reference - axis * axis.dot(&reference)).normalize()
}
