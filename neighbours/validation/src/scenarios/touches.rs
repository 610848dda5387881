//! Recorded sessions from deviations: what a controller would have latched where a surface lies off its plan.
//!
//! The caller says by physics of its own how far each touch is from the plan, along its outward normal (m); the axis
//! positions follow from the nominal chain, as a controller's would. Time starts at the stamps' epoch; metres, radians,
//! part frame.

use diagnosis::Session;
use machine::{Chain, Nominal, Target};
use nalgebra::Vector3;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, Stylus, geometry_msgs, std_msgs,
};

use crate::scenarios::ScenarioError;

/// When recorded sessions begin: 2026-01-01 00:00 UTC, s.
const BEGIN: i32 = 1_767_225_600;
/// Speed of approach, m/s.
const FEED: f64 = 5e-3;

/// A touch of a planned point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Point of the plan.
    pub(crate) point: usize,
    /// d = n·(c − p) − r, m.
    pub(crate) deviation: f64,
}

/// A plan on a machine whose part frame is the workpiece's.
pub(crate) fn plan(
    id: &str,
    ball_center: [f64; 3],
    ball_radius: f64,
    features: Vec<InspectionFeature>,
    points: Vec<InspectionPoint>,
) -> InspectionPlan {
    InspectionPlan {
        header: header(0.0),
        plan_id: id.to_owned(),
        part_id: id.to_owned(),
        part_pose: geometry_msgs::Pose {
            orientation: geometry_msgs::Quaternion {
                w: 1.0,
                ..geometry_msgs::Quaternion::default()
            },
            ..geometry_msgs::Pose::default()
        },
        stylus: Stylus {
            id: "stylus".to_owned(),
            ball_center: point(ball_center),
            ball_radius,
        },
        features,
        points,
        ..InspectionPlan::default()
    }
}

/// A round feature about z.
pub(crate) fn round(id: &str, kind: u8, radius: f64) -> InspectionFeature {
    InspectionFeature {
        id: id.to_owned(),
        kind,
        axis: vector(Vector3::z()),
        radius,
        ..InspectionFeature::default()
    }
}

/// A planned point of the first feature that this machine did not cut.
pub(crate) fn planned(position: [f64; 3], normal: Vector3<f64>) -> InspectionPoint {
    InspectionPoint {
        position: point(position),
        normal: vector(normal),
        approach_distance: 2e-3,
        retract_distance: 2e-3,
        feed: FEED,
        operation: -1,
        ..InspectionPoint::default()
    }
}

pub(crate) fn point([x, y, z]: [f64; 3]) -> geometry_msgs::Point {
    geometry_msgs::Point { x, y, z }
}

pub(crate) fn vector(v: Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

/// The stamp of an instant (s from the beginning).
fn header(seconds: f64) -> std_msgs::Header {
    std_msgs::Header {
        stamp: Time {
            sec: BEGIN + seconds.floor() as i32,
            nanosec: (seconds.fract() * 1e9) as u32,
        },
        frame_id: "foundation".to_owned(),
    }
}

/// The session of these touches, one every four seconds.
pub(crate) fn session(
    name: &str,
    robot_description: &str,
    plan: InspectionPlan,
    touches: &[Touch],
) -> Result<Session, ScenarioError> {
    let chain = Chain::from_urdf(robot_description)?;
    let nominal = Nominal::from_plan(&plan)?;
    let rotary: Vec<Option<usize>> = plan
        .rotary_names
        .iter()
        .map(|axis| chain.axis_index(axis))
        .collect();
    let mut standing = vec![0.0; chain.axes().len()];
    let mut events = Vec::with_capacity(touches.len());
    for (sequence, touch) in touches.iter().enumerate() {
        let unplanned = || ScenarioError::Course(format!("no point {} is planned", touch.point));
        let planned = plan.points.get(touch.point).ok_or_else(unplanned)?;
        let (place, normal) = nominal.points.get(touch.point).ok_or_else(unplanned)?;
        let mut prescribed = vec![None; standing.len()];
        for (axis, position) in rotary.iter().zip(&planned.rotary_positions) {
            if let Some(axis) = axis {
                prescribed[*axis] = Some(*position);
            }
        }
        let ball = place + normal.into_inner() * (nominal.ball_radius + touch.deviation);
        let target = Target {
            ball,
            orientation: None,
        };
        standing = chain.reach(
            &target,
            &prescribed,
            &standing,
            &nominal.part_pose,
            &nominal.ball,
        )?;
        events.push(ProbeEvent {
            header: header(4.0 * (sequence + 1) as f64),
            sequence: sequence as u64,
            plan_id: plan.plan_id.clone(),
            point_index: touch.point as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: chain.axis_names().map(str::to_owned).collect(),
            axis_positions: standing.clone(),
            tip: point(ball.coords.into()),
            approach: vector(-normal.into_inner()),
            feed: planned.feed,
        });
    }
    Ok(Session {
        name: name.to_owned(),
        robot_description: robot_description.to_owned(),
        plan: Some(plan),
        events,
        ..Session::default()
    })
}
