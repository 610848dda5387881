//! Plans of other systems: features, tolerances and points, of which touches can then be imported or made.

use exchange::import::frame;
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint};

/// A feature of another system, with the nominal points that it names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planned {
    /// The feature.
    pub feature: InspectionFeature,
    /// Nominal points (m) and outward normals, part frame.
    pub points: Vec<([f64; 3], [f64; 3])>,
}

/// What a file of another system plans, and what of it cannot be represented in a plan of ours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignPlan {
    /// Its features.
    pub features: Vec<Planned>,
    /// What was left out, a sentence each.
    pub left_out: Vec<String>,
}

impl ForeignPlan {
    /// The plan in the part frame, without a machine.
    pub fn plan(&self, name: &str) -> InspectionPlan {
        let mut plan = InspectionPlan {
            plan_id: name.to_owned(),
            part_id: name.to_owned(),
            part_pose: frame::identity(),
            ..InspectionPlan::default()
        };
        for (index, planned) in self.features.iter().enumerate() {
            plan.features.push(planned.feature.clone());
            for &(position, normal) in &planned.points {
                plan.points.push(InspectionPoint {
                    feature: index as u32,
                    position: position.into(),
                    normal: normal.into(),
                    operation: -1,
                    ..InspectionPoint::default()
                });
            }
        }
        plan
    }
}
