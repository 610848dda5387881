//! The part: nominal features, where they are touched and which operation cut them, from the cell file's `[part]`.
//!
//! Lengths are written in mm and angles in degrees and become m and rad here. Points, normals and axes are in the part
//! frame. A point is placed exactly on its feature: a cylinder is touched at angles and heights, a plane at the foot of
//! each point given, a sphere where the ray from its centre through the point given leaves it, a profile at equal
//! lengths along its cubic spline with the normal to the left of travel. A point may have several poses: the first is where
//! the axes stand in the plan as it is written, the others are chosen from with the order.

mod error;
mod features;
mod held;
mod numbers;
mod poses;
mod raw;

use machine::Chain;
use nalgebra::Vector3;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachiningOperation, Stylus, geometry_msgs,
};

pub use error::PartError;
pub use features::kind_code;
use numbers::{direction, finite, metres, ros_point, ros_vector};
pub use raw::{RawFeature, RawOperation, RawPart, RawStylus};

use crate::{error::MAX_TOUCHES, solver::Poses};

/// As checked: a plan without id and stamp, and what a pass may leave on it.
#[derive(Clone, Debug)]
pub struct Part {
    template: InspectionPlan,
    stages: Vec<u32>,
    poses: Vec<Poses>,
}

impl RawPart {
    /// Checks the part against the machine.
    ///
    /// # Errors
    /// [`PartError`] names the feature or key.
    pub fn check(&self, chain: &Chain) -> Result<Part, PartError> {
        for (key, value) in [
            ("approach_mm", self.approach_mm),
            ("retract_mm", self.retract_mm),
            ("feed_mm_per_min", self.feed_mm_per_min),
            ("stylus.ball_radius_mm", self.stylus.ball_radius_mm),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(PartError::Number(key.to_owned(), " above 0"));
            }
        }
        finite("position_mm", &self.position_mm)?;
        finite("clamping_mm", &self.clamping_mm)?;
        finite("clamping_axis", &self.clamping_axis)?;
        finite("stylus.ball_center_mm", &self.stylus.ball_center_mm)?;
        for raw in &self.operations {
            finite("operations.tool_radius_mm", &[raw.tool_radius_mm])?;
            finite("operations.feed_mm_per_min", &[raw.feed_mm_per_min])?;
        }
        let indexing = self.indexing(chain)?;
        self.check_rotary(chain)?;
        self.check_poses()?;
        let mut template = InspectionPlan {
            part_id: self.id.clone(),
            machined_on_this_machine: self.machined_on_this_machine,
            part_pose: geometry_msgs::Pose {
                position: ros_point(metres(self.position_mm)),
                orientation: geometry_msgs::Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: 0.0,
                    w: 1.0,
                },
            },
            stylus: Stylus {
                id: self.stylus.id.clone(),
                ball_center: ros_point(metres(self.stylus.ball_center_mm)),
                ball_radius: self.stylus.ball_radius_mm * 1e-3,
            },
            operations: self
                .operations
                .iter()
                .map(|raw| raw.message(self.turned(&raw.rotary_deg, indexing.is_some())))
                .collect(),
            rotary_names: indexing
                .iter()
                .map(|_| self.indexing_axis.clone())
                .chain(self.rotary_axes.iter().cloned())
                .collect(),
            ..InspectionPlan::default()
        };
        let (mut stages, mut poses) = (Vec::new(), Vec::new());
        for (index, raw) in self.features.iter().enumerate() {
            let feature = raw.message()?;
            let operation = self.operation_of(raw)?;
            for (position, normal) in raw.touches(&feature)? {
                stages.push(u32::from(!raw.datum));
                let of_point = self.poses_of(raw, indexing.as_ref(), &normal);
                template.points.push(InspectionPoint {
                    feature: index as u32,
                    position: ros_point(position),
                    normal: ros_vector(normal),
                    rotary_positions: of_point[0].clone(),
                    tool_height: usize::try_from(operation)
                        .map_or(0.0, |index| self.operations[index].height_of(&position)),
                    approach_distance: self.approach_mm * 1e-3,
                    retract_distance: self.retract_mm * 1e-3,
                    feed: self.feed_mm_per_min / 60e3,
                    operation,
                    overhang: self.overhang_of(&position),
                    ..InspectionPoint::default()
                });
                poses.push(of_point);
            }
            template.features.push(feature);
        }
        if template.points.len() > MAX_TOUCHES {
            return Err(PartError::TooManyTouches(template.points.len()));
        }
        Ok(Part {
            template,
            stages,
            poses,
        })
    }

    /// Distance of a point (m, part frame) from the clamping; 0 at and within it, and where its direction is unknown.
    fn overhang_of(&self, position: &Vector3<f64>) -> f64 {
        direction(self.clamping_axis).map_or(0.0, |axis| {
            axis.dot(&(position - metres(self.clamping_mm))).max(0.0)
        })
    }

    fn operation_of(&self, feature: &RawFeature) -> Result<i32, PartError> {
        if feature.operation.is_empty() {
            return Ok(-1);
        }
        self.operations
            .iter()
            .position(|raw| raw.id == feature.operation)
            .map(|index| index as i32)
            .ok_or_else(|| PartError::Operation {
                feature: feature.id.clone(),
                operation: feature.operation.clone(),
            })
    }
}

impl RawOperation {
    /// Height of a point (m, part frame) along the tool; 0 where the tool's direction is unknown.
    fn height_of(&self, position: &Vector3<f64>) -> f64 {
        direction(self.tool_axis).map_or(0.0, |axis| axis.dot(&(position - metres(self.tip_mm))))
    }

    fn message(&self, rotary_positions: Vec<f64>) -> MachiningOperation {
        MachiningOperation {
            id: self.id.clone(),
            tool_number: self.tool_number,
            tool_radius: self.tool_radius_mm * 1e-3,
            feed: self.feed_mm_per_min / 60e3,
            finish: self.finish,
            rotary_positions,
        }
    }
}

impl Part {
    /// When each point is touched: 0 those of datum features, then 1.
    pub fn stages(&self) -> &[u32] {
        &self.stages
    }

    /// Where the plan's rotary axes may stand for each point: the plan's own positions first, never empty.
    pub fn poses(&self) -> &[Poses] {
        &self.poses
    }

    /// The plan of a measurement whose surfaces still carry `allowance` (m, on sizes: half of it on each side).
    pub fn plan(&self, allowance: f64) -> InspectionPlan {
        let mut plan = self.template.clone();
        let shift = allowance / 2.0;
        for point in &mut plan.points {
            if point.operation >= 0 {
                point.position.x += shift * point.normal.x;
                point.position.y += shift * point.normal.y;
                point.position.z += shift * point.normal.z;
            }
        }
        for (index, feature) in plan.features.iter_mut().enumerate() {
            let cut = self
                .template
                .points
                .iter()
                .any(|point| point.feature as usize == index && point.operation >= 0);
            if !cut {
                continue;
            }
            match feature.kind {
                InspectionFeature::PLANE => {
                    feature.origin.x += shift * feature.axis.x;
                    feature.origin.y += shift * feature.axis.y;
                    feature.origin.z += shift * feature.axis.z;
                }
                InspectionFeature::BORE => feature.radius -= shift,
                _ => feature.radius += shift,
            }
        }
        plan
    }
}
