//! The part: nominal features, where they are touched and which operation cut them, from the cell file's `[part]`.
//!
//! Lengths are written in mm and angles in degrees and become m and rad here. Points, normals and axes are in the part
//! frame. A point is placed exactly on its feature: a cylinder is touched at angles and heights, a plane at the foot of
//! each point given, a sphere where the ray from its centre through the point given leaves it, a profile at equal
//! lengths along its cubic spline with the normal to the left of travel. A point may have several poses: the first is where
//! the axes stand in the plan as it is written, the others are chosen from with the order.

use machine::Chain;
use metrology::profile::Spline;
use nalgebra::{Rotation3, Unit, Vector2, Vector3};
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachiningOperation, Stylus, geometry_msgs,
};
use serde::Deserialize;

use crate::stations::Poses;

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPart {
    /// Name of the part.
    pub id: String,
    /// Cut in the clamping in which it is measured.
    #[serde(default)]
    pub machined_on_this_machine: bool,
    /// Part frame in `workpiece`.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// The stylus.
    pub stylus: RawStylus,
    /// Rotary axis that turns each point towards the probe; empty: the part is not turned.
    #[serde(default)]
    pub indexing_axis: String,
    /// Direction in the foundation that points are turned to face.
    #[serde(default)]
    pub facing: [f64; 3],
    /// Offsets from facing the probe at which each point may be touched as well; none: only facing.
    #[serde(default)]
    pub indexing_offsets_deg: Vec<f64>,
    /// Rotary axes whose positions operations and features give themselves, instead of one that faces the probe.
    #[serde(default)]
    pub rotary_axes: Vec<String>,
    /// Positions of `rotary_axes` at each of which every feature may be probed as well that gives no such list itself.
    #[serde(default)]
    pub rotary_alternatives_deg: Vec<Vec<f64>>,
    /// A point of the face at which the part is clamped, part frame.
    #[serde(default)]
    pub clamping_mm: [f64; 3],
    /// Direction away from that face; none: distances from the clamping are not told.
    #[serde(default)]
    pub clamping_axis: [f64; 3],
    /// Distance from the start of an approach to the nominal contact.
    pub approach_mm: f64,
    /// Distance back after the trigger.
    pub retract_mm: f64,
    /// Probing feed.
    pub feed_mm_per_min: f64,
    /// The operations that cut the features.
    #[serde(default)]
    pub operations: Vec<RawOperation>,
    /// The features.
    pub features: Vec<RawFeature>,
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawStylus {
    /// Name of the stylus.
    pub id: String,
    /// Ball centre in `probe_mount`.
    pub ball_center_mm: [f64; 3],
    /// Radius of the ball.
    pub ball_radius_mm: f64,
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawOperation {
    /// Name of the operation.
    pub id: String,
    /// Tool that cuts.
    pub tool_number: u32,
    /// Radius of that tool.
    pub tool_radius_mm: f64,
    /// Cutting feed.
    pub feed_mm_per_min: f64,
    /// It leaves the final surface.
    #[serde(default)]
    pub finish: bool,
    /// Positions of `part.rotary_axes` while cutting; none: all 0.
    #[serde(default)]
    pub rotary_deg: Vec<f64>,
    /// Tip of the tool in the part frame while it cuts: heights along the tool are counted from there.
    #[serde(default)]
    pub tip_mm: [f64; 3],
    /// Direction of the tool from its tip to its shank, part frame; none: heights along the tool are not told.
    #[serde(default)]
    pub tool_axis: [f64; 3],
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFeature {
    /// Name of the feature.
    pub id: String,
    /// `plane`, `cylinder`, `bore`, `sphere` or `profile`.
    pub kind: String,
    /// A point of the plane or axis, the centre of a sphere, the origin of a profile's control points.
    #[serde(default)]
    pub origin_mm: [f64; 3],
    /// Outward normal of a plane, direction of an axis.
    #[serde(default)]
    pub axis: [f64; 3],
    /// Radius of a cylinder, bore or sphere.
    #[serde(default)]
    pub radius_mm: f64,
    /// Limits of the deviation of size.
    pub tolerance_um: [f64; 2],
    /// Operation that leaves the surface; empty: not cut on this machine.
    #[serde(default)]
    pub operation: String,
    /// Where a cylinder or bore is touched, around its axis from the part's x (or y) direction.
    #[serde(default)]
    pub touch_angles_deg: Vec<f64>,
    /// Where a cylinder or bore is touched, along its axis from the origin.
    #[serde(default)]
    pub touch_heights_mm: Vec<f64>,
    /// Where a plane or sphere is touched: near these points.
    #[serde(default)]
    pub touch_points_mm: Vec<[f64; 3]>,
    /// Control points of a profile: a clamped uniform cubic spline in the x-y plane of the part at the origin's height.
    #[serde(default)]
    pub control_points_mm: Vec<[f64; 2]>,
    /// Touches along a profile, at equal lengths from end to end.
    #[serde(default)]
    pub touches: usize,
    /// Positions of `part.rotary_axes` while probing; none: all 0.
    #[serde(default)]
    pub rotary_deg: Vec<f64>,
    /// Positions of `part.rotary_axes` at each of which it may be probed as well; none: those of the part.
    #[serde(default)]
    pub rotary_alternatives_deg: Vec<Vec<f64>>,
    /// Touched before all features that are no datum.
    #[serde(default)]
    pub datum: bool,
}

/// Largest length (mm), angle (deg) or feed (mm/min) that is taken: far beyond any machine.
const LARGEST: f64 = 1e9;

/// Most poses at which one point may be touched.
const MOST_POSES: usize = 32;

/// Most touches along one profile.
const MOST_TOUCHES: usize = 10_000;

/// Nominal point (m) and outward normal, part frame.
type Touch = (Vector3<f64>, Vector3<f64>);

/// As checked: a plan without id and stamp, and what a pass may leave on it.
#[derive(Clone, Debug)]
pub struct Part {
    template: InspectionPlan,
    stages: Vec<u32>,
    poses: Vec<Poses>,
}

/// A part that cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// A number that is not finite or not positive.
    #[error("part.{0} must be a finite number{1}")]
    Number(String, &'static str),
    /// An unknown kind of feature.
    #[error("feature {feature:?}: kind {kind:?} is none of plane, cylinder, bore, sphere, profile")]
    Kind {
        /// The feature.
        feature: String,
        /// As written.
        kind: String,
    },
    /// A direction without length.
    #[error("feature {0:?}: axis must be a direction, not zero")]
    Axis(String),
    /// A radius that is not positive.
    #[error("feature {0:?}: radius_mm must be above 0")]
    Radius(String),
    /// Limits that exclude each other.
    #[error("feature {0:?}: tolerance_um must be [lower, upper] with lower below upper")]
    Tolerance(String),
    /// No touch.
    #[error(
        "feature {0:?} has no touches: give touch_angles_deg and touch_heights_mm, touch_points_mm, or touches of a profile"
    )]
    NoTouches(String),
    /// A touch that cannot be placed.
    #[error(
        "feature {feature:?}: touch {index} lies on the axis or in the centre, so it has no direction"
    )]
    Touch {
        /// The feature.
        feature: String,
        /// Index of the touch.
        index: usize,
    },
    /// An operation that is not listed.
    #[error("feature {feature:?}: operation {operation:?} is not in part.operations")]
    Operation {
        /// The feature.
        feature: String,
        /// As written.
        operation: String,
    },
    /// The indexing axis is not a rotary axis of the part's side.
    #[error("part.indexing_axis = {0:?} is not a rotary axis of the machine")]
    IndexingAxis(String),
    /// No facing direction.
    #[error("part.facing must be a direction that is not along the indexing axis")]
    Facing,
    /// A rotary axis that the machine lacks, or a second way to say how the part is turned.
    #[error(
        "part.rotary_axes: {0:?} is not a rotary axis of the machine, or part.indexing_axis is given as well"
    )]
    RotaryAxis(String),
    /// Another number of rotary positions than of rotary axes.
    #[error("{place}: rotary_deg has {given} positions for the {axes} axes of part.rotary_axes")]
    Rotaries {
        /// The operation or feature.
        place: String,
        /// Positions given.
        given: usize,
        /// Axes.
        axes: usize,
    },
    /// An alternative with another number of rotary positions than of rotary axes.
    #[error(
        "{place}: number {index} of rotary_alternatives_deg has {given} positions for the {axes} axes of part.rotary_axes"
    )]
    Alternative {
        /// The part or feature.
        place: String,
        /// Index in the list.
        index: usize,
        /// Positions given.
        given: usize,
        /// Axes.
        axes: usize,
    },
    /// Offsets of no axis.
    #[error("part.indexing_offsets_deg is given, but no part.indexing_axis")]
    Offsets,
    /// Too many poses.
    #[error("{place} has {given} poses beside the first, more than {MOST_POSES}")]
    Poses {
        /// The part or feature.
        place: String,
        /// Poses given.
        given: usize,
    },
    /// A profile that is no curve.
    #[error("feature {feature:?}: {reason}")]
    Profile {
        /// The feature.
        feature: String,
        /// Why not.
        reason: String,
    },
}

impl RawPart {
    /// Checks the part against the machine.
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
        Ok(Part {
            template,
            stages,
            poses,
        })
    }

    /// Where the rotary axes may stand (rad) for a touch: as the feature says first, never empty.
    fn poses_of(
        &self,
        feature: &RawFeature,
        indexing: Option<&Indexing>,
        normal: &Vector3<f64>,
    ) -> Poses {
        let all: Poses = if let Some(turn) = indexing {
            let facing = turn.facing_angle(normal);
            let offsets = self.indexing_offsets_deg.iter();
            let turned = offsets.map(|offset| vec![facing + offset.to_radians()]);
            std::iter::once(vec![facing]).chain(turned).collect()
        } else {
            let own = &feature.rotary_alternatives_deg;
            let others = if own.is_empty() {
                &self.rotary_alternatives_deg
            } else {
                own
            };
            let first = self.turned(&feature.rotary_deg, false);
            let others = others.iter().map(|one| self.turned(one, false));
            std::iter::once(first).chain(others).collect()
        };
        let mut poses = Poses::new();
        for pose in all {
            if !poses.contains(&pose) {
                poses.push(pose);
            }
        }
        poses
    }

    fn indexing(&self, chain: &Chain) -> Result<Option<Indexing>, PartError> {
        if self.indexing_axis.is_empty() {
            return Ok(None);
        }
        let unknown = || PartError::IndexingAxis(self.indexing_axis.clone());
        let axis = chain.axis(chain.axis_index(&self.indexing_axis).ok_or_else(unknown)?);
        if axis.kind != machine::JointKind::Revolute {
            return Err(unknown());
        }
        let about = axis.axis;
        let across = |v: &Vector3<f64>| v - about.into_inner() * about.dot(v);
        finite("facing", &self.facing)?;
        let facing =
            Unit::try_new(across(&Vector3::from(self.facing)), 1e-9).ok_or(PartError::Facing)?;
        Ok(Some(Indexing { about, facing }))
    }

    /// Rotary axes exist, and every operation and feature has a position for each, or none at all.
    fn check_rotary(&self, chain: &Chain) -> Result<(), PartError> {
        for name in &self.rotary_axes {
            let rotary = chain
                .axis_index(name)
                .is_some_and(|axis| chain.axis(axis).kind == machine::JointKind::Revolute);
            if !rotary || !self.indexing_axis.is_empty() {
                return Err(PartError::RotaryAxis(name.clone()));
            }
        }
        let operations = self
            .operations
            .iter()
            .map(|raw| ("operation", &raw.id, &raw.rotary_deg));
        let features = self
            .features
            .iter()
            .map(|raw| ("feature", &raw.id, &raw.rotary_deg));
        for (what, id, positions) in operations.chain(features) {
            finite("rotary_deg", positions)?;
            if !positions.is_empty() && positions.len() != self.rotary_axes.len() {
                return Err(PartError::Rotaries {
                    place: format!("{what} {id:?}"),
                    given: positions.len(),
                    axes: self.rotary_axes.len(),
                });
            }
        }
        Ok(())
    }

    /// Further poses have a position for each rotary axis, and are not too many.
    fn check_poses(&self) -> Result<(), PartError> {
        let few = |place: &str, given: usize| {
            let place = place.to_owned();
            let few = given <= MOST_POSES;
            few.then_some(()).ok_or(PartError::Poses { place, given })
        };
        finite("indexing_offsets_deg", &self.indexing_offsets_deg)?;
        few("part.indexing_offsets_deg", self.indexing_offsets_deg.len())?;
        if self.indexing_axis.is_empty() && !self.indexing_offsets_deg.is_empty() {
            return Err(PartError::Offsets);
        }
        let features = self.features.iter().map(|raw| {
            let place = format!("feature {:?}", raw.id);
            (place, &raw.rotary_alternatives_deg)
        });
        let part = ("part".to_owned(), &self.rotary_alternatives_deg);
        for (place, alternatives) in std::iter::once(part).chain(features) {
            few(&place, alternatives.len())?;
            for (index, positions) in alternatives.iter().enumerate() {
                finite("rotary_alternatives_deg", positions)?;
                let (given, axes) = (positions.len(), self.rotary_axes.len());
                if given != axes || axes == 0 {
                    return Err(PartError::Alternative {
                        place,
                        index,
                        given,
                        axes,
                    });
                }
            }
        }
        Ok(())
    }

    /// Positions (rad) of the plan's rotary axes: as written, all 0 where nothing is.
    fn turned(&self, rotary_deg: &[f64], indexed: bool) -> Vec<f64> {
        if indexed {
            vec![0.0]
        } else if rotary_deg.is_empty() {
            vec![0.0; self.rotary_axes.len()]
        } else {
            rotary_deg.iter().map(|angle| angle.to_radians()).collect()
        }
    }

    /// Distance of a point (m, part frame) from the clamping; 0 at and within it, and where its direction is not told.
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
    /// Height of a point (m, part frame) along the tool; 0 where the tool's direction is not told.
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

impl RawFeature {
    fn message(&self) -> Result<InspectionFeature, PartError> {
        let kind = match self.kind.as_str() {
            "plane" => InspectionFeature::PLANE,
            "cylinder" => InspectionFeature::CYLINDER,
            "bore" => InspectionFeature::BORE,
            "sphere" => InspectionFeature::SPHERE,
            "profile" => InspectionFeature::PROFILE,
            _ => {
                return Err(PartError::Kind {
                    feature: self.id.clone(),
                    kind: self.kind.clone(),
                });
            }
        };
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
    fn touches(&self, feature: &InspectionFeature) -> Result<Vec<Touch>, PartError> {
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
        if self.touches > MOST_TOUCHES {
            return Err(refused(format!(
                "{} touches along a profile are more than {MOST_TOUCHES}",
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

/// How a rotary axis turns points towards the probe.
struct Indexing {
    about: Unit<Vector3<f64>>,
    facing: Unit<Vector3<f64>>,
}

impl Indexing {
    /// Angle of the axis (rad, within ± half a turn) at which `normal` faces the probe; 0 for one along the axis.
    fn facing_angle(&self, normal: &Vector3<f64>) -> f64 {
        let across = normal - self.about.into_inner() * self.about.dot(normal);
        if across.norm() < 1e-9 {
            return 0.0;
        }
        self.about
            .dot(&across.cross(&self.facing))
            .atan2(across.dot(&self.facing))
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

fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let reference = if axis.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    (reference - axis * axis.dot(&reference)).normalize()
}

/// Refuses NaN and infinity, and what is so large that sums and squares of it would become so.
fn finite(key: &str, values: &[f64]) -> Result<(), PartError> {
    if values.iter().all(|value| value.abs() <= LARGEST) {
        Ok(())
    } else {
        Err(PartError::Number(key.to_owned(), " within ±1e9"))
    }
}

/// A vector of length 1, where there is a direction.
fn direction(vector: [f64; 3]) -> Option<Vector3<f64>> {
    let vector = Vector3::from(vector);
    let direction = Unit::try_new(vector, 1e-9)?.into_inner();
    vector.norm().is_finite().then_some(direction)
}

fn metres(mm: [f64; 3]) -> Vector3<f64> {
    Vector3::from(mm) * 1e-3
}

fn ros_point(v: Vector3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

fn ros_vector(v: Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}
