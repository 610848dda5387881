//! Points of the part: where they are touched, and in which pose they are cut.

use std::collections::BTreeMap;

use machine::Nominal;
use nalgebra::{Point3, Vector3};
use probecell_msgs::InspectionPlan;

/// Position (m) and outward normal of a touch, part frame.
pub(crate) type SurfacePoint = (Point3<f64>, Vector3<f64>);

/// Position and normal of every point, by feature, in the order of the plan.
pub(crate) fn positions_by_feature(plan: &InspectionPlan) -> BTreeMap<String, Vec<SurfacePoint>> {
    let mut places: BTreeMap<String, Vec<SurfacePoint>> = BTreeMap::new();
    for point in &plan.points {
        if let Some(feature) = plan.features.get(point.feature as usize) {
            let (at, out) = (&point.position, &point.normal);
            let place = (
                Point3::new(at.x, at.y, at.z),
                Vector3::new(out.x, out.y, out.z),
            );
            places.entry(feature.id.clone()).or_default().push(place);
        }
    }
    places
}

/// Index in the plan of every point of a feature.
pub(crate) fn points_of<'a>(
    plan: &'a InspectionPlan,
    feature: &'a str,
) -> impl Iterator<Item = usize> + 'a {
    let owner = plan.features.iter().position(|known| known.id == feature);
    (0..plan.points.len()).filter(move |&point| Some(plan.points[point].feature as usize) == owner)
}

/// How a feature is cut point by point.
#[derive(Clone, Debug)]
pub struct Cut {
    pub(crate) part: Nominal,
    /// The volumetric table of the controller is enabled.
    pub(crate) volumetric: bool,
    /// An inner size: more wear offset makes it larger.
    pub(crate) inner: bool,
    pub(crate) points: Vec<CutPoint>,
}

/// One point of it.
#[derive(Clone, Debug)]
pub(crate) struct CutPoint {
    pub(crate) place: SurfacePoint,
    /// Programme positions of the axes, m and rad.
    pub(crate) positions: Vec<f64>,
    /// m; increase of the effective tool radius by run-out.
    pub(crate) runout: f64,
}

impl Cut {
    /// Points that are cut.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }
}
