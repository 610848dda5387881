//! What a touch says about the part: d = n·(c − p) − r by the nominal chain.
//!
//! Metres, part frame; material in excess gives d > 0. The nominal ball centre `c` follows from the latched axis
//! positions alone, never from the tip the controller computed. A plan and its events are checked here, since this is
//! where their numbers first meet a formula.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use probecell_msgs::{InspectionFeature, InspectionPlan, ProbeEvent, geometry_msgs};

use crate::chain::Chain;
use crate::contact::Surface;
use crate::kinematics::PositionError;

/// Largest departure of a normal or quaternion from unit length: what decimal rounding leaves.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Why a plan or an event gives no deviation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeviationError {
    /// A number of the plan is NaN or infinite.
    #[error("plan `{plan}` has a {what} that is not finite")]
    PlanNumber {
        /// Identifier of the plan.
        plan: String,
        /// Which number.
        what: &'static str,
    },
    /// The part's orientation is not a rotation.
    #[error("plan `{plan}` has a part_pose whose orientation is not a unit quaternion")]
    Orientation {
        /// Identifier of the plan.
        plan: String,
    },
    /// The ball's radius is negative.
    #[error("plan `{plan}` has a ball radius of {radius} m")]
    BallRadius {
        /// Identifier of the plan.
        plan: String,
        /// As given, m.
        radius: f64,
    },
    /// A point of the plan is unusable.
    #[error("point {index} of plan `{plan}` has a {what} that is unusable")]
    Point {
        /// Identifier of the plan.
        plan: String,
        /// Which point.
        index: usize,
        /// Which of its fields.
        what: &'static str,
    },
    /// The plan prescribes an axis the machine lacks.
    #[error("plan `{plan}` prescribes axis `{axis}`, which the robot description lacks")]
    PlanAxis {
        /// Identifier of the plan.
        plan: String,
        /// The axis.
        axis: String,
    },
    /// The event names a point the plan lacks.
    #[error("event {sequence} names point {point}, but plan `{plan}` has {points} points")]
    NoPoint {
        /// Sequence of the event.
        sequence: u64,
        /// Point it names.
        point: u32,
        /// Identifier of the plan.
        plan: String,
        /// Points of the plan.
        points: usize,
    },
    /// The event belongs to another plan.
    #[error("event {sequence} belongs to plan `{found}`, not to `{expected}`")]
    OtherPlan {
        /// Sequence of the event.
        sequence: u64,
        /// Plan of the event.
        found: String,
        /// Plan in use.
        expected: String,
    },
    /// Nothing was touched, or too early.
    #[error("event {sequence} is not a touch (outcome {outcome})")]
    NoTouch {
        /// Sequence of the event.
        sequence: u64,
        /// Its outcome.
        outcome: u8,
    },
    /// The axes of the event do not fit the machine.
    #[error("event {sequence}: {source}")]
    Axes {
        /// Sequence of the event.
        sequence: u64,
        /// What does not fit.
        source: PositionError,
    },
}

/// The nominal part and probe of a plan.
#[derive(Debug, Clone)]
pub struct Nominal {
    /// Workpiece from part.
    pub part_pose: Isometry3<f64>,
    /// Ball centre in the probe mount, m.
    pub ball: Point3<f64>,
    /// Ball radius, m.
    pub ball_radius: f64,
    /// Nominal points and outward normals, part frame.
    pub points: Vec<(Point3<f64>, Unit<Vector3<f64>>)>,
    /// Surface of each point.
    pub surfaces: Vec<Surface>,
}

impl Nominal {
    /// Checks a plan and takes over its numbers.
    ///
    /// # Errors
    /// [`DeviationError`] names the number that is unusable.
    pub fn from_plan(plan: &InspectionPlan) -> Result<Self, DeviationError> {
        Self::of_points(plan, 0..plan.points.len())
    }

    /// Checks a plan's pose and stylus and one of its points, which gets index 0: the work does not grow with the plan.
    ///
    /// # Errors
    /// [`DeviationError`] names the number that is unusable.
    ///
    /// # Panics
    /// If the plan has no point of that index.
    pub fn of_point(plan: &InspectionPlan, index: usize) -> Result<Self, DeviationError> {
        Self::of_points(plan, index..index + 1)
    }

    fn of_points(plan: &InspectionPlan, range: Range<usize>) -> Result<Self, DeviationError> {
        let part_pose = part_pose(plan)?;
        let number = |what| DeviationError::PlanNumber {
            plan: plan.plan_id.clone(),
            what,
        };
        let ball = point(&plan.stylus.ball_center).ok_or_else(|| number("ball centre"))?;
        let ball_radius = plan.stylus.ball_radius;
        if !ball_radius.is_finite() || ball_radius < 0.0 {
            return Err(DeviationError::BallRadius {
                plan: plan.plan_id.clone(),
                radius: ball_radius,
            });
        }
        let mut points = Vec::with_capacity(range.len());
        let mut surfaces = Vec::with_capacity(range.len());
        for index in range {
            let planned = &plan.points[index];
            let bad = |what| DeviationError::Point {
                plan: plan.plan_id.clone(),
                index,
                what,
            };
            let position = point(&planned.position).ok_or_else(|| bad("position"))?;
            let normal = unit(&planned.normal).ok_or_else(|| bad("normal"))?;
            let feature = plan
                .features
                .get(planned.feature as usize)
                .ok_or_else(|| bad("feature"))?;
            surfaces.push(surface(feature, position, normal).ok_or_else(|| bad("feature"))?);
            points.push((position, normal));
        }
        Ok(Self {
            part_pose,
            ball,
            ball_radius,
            points,
            surfaces,
        })
    }

    /// Deviation (m) of a touch at axis positions in the order of [`Chain::axes`], against nominal point `index`.
    pub fn deviation(&self, chain: &Chain, index: usize, positions: &[f64]) -> f64 {
        self.touch(chain, index, positions).1
    }

    /// Centre c of the ball (m, part frame) and deviation d = n·(c − p) − r (m) of a touch, as [`Self::deviation`].
    pub fn touch(&self, chain: &Chain, index: usize, positions: &[f64]) -> (Point3<f64>, f64) {
        let (point, normal) = &self.points[index];
        let centre = chain.ball_in_part(positions, &self.part_pose, &self.ball);
        (centre, normal.dot(&(centre - point)) - self.ball_radius)
    }
}

/// Latched positions of a touch in the order of [`Chain::axes`], once it is clear that it belongs to the plan.
///
/// # Errors
/// [`DeviationError`] names what does not fit.
pub fn touch_positions(
    chain: &Chain,
    plan: &InspectionPlan,
    event: &ProbeEvent,
) -> Result<Vec<f64>, DeviationError> {
    let sequence = event.sequence;
    if event.plan_id != plan.plan_id {
        return Err(DeviationError::OtherPlan {
            sequence,
            found: event.plan_id.clone(),
            expected: plan.plan_id.clone(),
        });
    }
    if event.outcome != ProbeEvent::OUTCOME_TOUCHED {
        return Err(DeviationError::NoTouch {
            sequence,
            outcome: event.outcome,
        });
    }
    if event.point_index as usize >= plan.points.len() {
        return Err(DeviationError::NoPoint {
            sequence,
            point: event.point_index,
            plan: plan.plan_id.clone(),
            points: plan.points.len(),
        });
    }
    chain
        .positions(&event.axis_names, &event.axis_positions)
        .map_err(|source| DeviationError::Axes { sequence, source })
}

fn part_pose(plan: &InspectionPlan) -> Result<Isometry3<f64>, DeviationError> {
    let place = point(&plan.part_pose.position).ok_or_else(|| DeviationError::PlanNumber {
        plan: plan.plan_id.clone(),
        what: "part pose",
    })?;
    let turn = &plan.part_pose.orientation;
    let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    if !((turn.norm() - 1.0).abs() <= UNIT_TOLERANCE) {
        return Err(DeviationError::Orientation {
            plan: plan.plan_id.clone(),
        });
    }
    Ok(Isometry3::from_parts(
        Translation3::from(place.coords),
        UnitQuaternion::from_quaternion(turn),
    ))
}

/// The exact surface where the plan describes it, the tangent plane elsewhere; `None` for a degenerate feature.
fn surface(
    feature: &InspectionFeature,
    position: Point3<f64>,
    normal: Unit<Vector3<f64>>,
) -> Option<Surface> {
    let origin = point(&feature.origin)?;
    let plane = Surface::Plane(position, normal);
    Some(match feature.kind {
        InspectionFeature::CYLINDER | InspectionFeature::BORE => {
            let axis = unit(&feature.axis)?;
            let arm = position - origin;
            let arm = arm - axis.into_inner() * axis.dot(&arm);
            match normal.dot(&arm) / arm.norm() {
                side if side > 0.99 => Surface::Cylinder(origin, axis, arm.norm()),
                side if side < -0.99 => Surface::Bore(origin, axis, arm.norm()),
                _ => plane,
            }
        }
        InspectionFeature::SPHERE => {
            let arm = position - origin;
            match normal.dot(&arm) / arm.norm() {
                side if side > 0.99 => Surface::Sphere(origin, arm.norm()),
                side if side < -0.99 => Surface::Socket(origin, arm.norm()),
                _ => plane,
            }
        }
        _ => plane,
    })
}

fn point(point: &geometry_msgs::Point) -> Option<Point3<f64>> {
    let point = Point3::new(point.x, point.y, point.z);
    point.iter().all(|value| value.is_finite()).then_some(point)
}

fn unit(vector: &geometry_msgs::Vector3) -> Option<Unit<Vector3<f64>>> {
    let vector = Vector3::new(vector.x, vector.y, vector.z);
    ((vector.norm() - 1.0).abs() <= UNIT_TOLERANCE).then(|| Unit::new_normalize(vector))
}
