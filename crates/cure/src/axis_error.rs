//! The error of one axis over its travel, as the library of effects that fitted it predicts it.
//!
//! δ = true position less reading (`docs/effects.md`), m or rad, of an axis that moves up and of one that moves down.

use diagnosis::Session;
use effects::Observations;
use effects::observation::Row;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, Stylus, geometry_msgs, std_msgs,
};

use crate::CureError;
use crate::cause::Cause;

/// Touches that a session has at least.
const TOUCHES: usize = 6;

/// Error of an axis at each place (m or rad): of a move upwards, and of one downwards. Causes of other axes add nothing.
///
/// # Errors
/// [`CureError::Declared`] for a cause that the library cannot predict from its parameters.
pub(crate) fn errors(
    causes: &[Cause],
    axis: &str,
    places: &[f64],
) -> Result<Vec<[f64; 2]>, CureError> {
    let own: Vec<&Cause> = causes.iter().filter(|cause| cause.axis() == axis).collect();
    let turns = own.iter().any(|cause| turns(cause));
    let mut observations = specimen(axis, turns)?;
    let Some(template) = observations.rows.first().cloned() else {
        return Ok(Vec::new());
    };
    let rows = places.iter().flat_map(|&at| {
        [1.0, -1.0].map(|side| {
            let mut row: Row = template.clone();
            if let Some(pose) = &mut row.pose {
                pose.positions = vec![at];
                pose.latched = vec![at];
                pose.speeds = vec![side];
                pose.arrived = vec![side];
            }
            row
        })
    });
    observations.rows = rows.collect();
    observations.deviations = vec![0.0; observations.rows.len()];
    let mut sums = vec![[0.0; 2]; places.len()];
    for cause in own {
        let acting = cause.declared().acting(&observations.chain)?;
        // The ball that has gone farther than its reading is seen before the surface: d = −n·δ with n along the axis.
        let signature = acting.signature(&observations);
        for (sum, pair) in sums.iter_mut().zip(signature.chunks_exact(2)) {
            sum[0] -= pair[0];
            sum[1] -= pair[1];
        }
    }
    Ok(sums)
}

/// Whether a cause is of a rotary axis, by the unit of its first parameter.
pub(crate) fn turns(cause: &Cause) -> bool {
    let first = cause.parameters.first();
    first.is_some_and(|one| one.unit.starts_with("rad"))
}

/// A machine of that axis alone, and a ball 1 m from it that it moves along the normal of a plane.
fn specimen(axis: &str, turns: bool) -> Result<Observations, CureError> {
    let (kind, along) = if turns {
        ("continuous", "0 0 1")
    } else {
        ("prismatic", "0 1 0")
    };
    let robot_description = format!(
        r#"<robot name="axis"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
        <joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
        <joint name="{axis}" type="{kind}"><parent link="foundation"/><child link="probe_mount"/><axis xyz="{along}"/>
        <limit lower="-1000" upper="1000" effort="1" velocity="1"/></joint></robot>"#
    );
    let radius = 1e-3;
    let point = |x: f64, y: f64| geometry_msgs::Point { x, y, z: 0.0 };
    let normal = geometry_msgs::Vector3 {
        x: 0.0,
        y: 1.0,
        z: 0.0,
    };
    let mut pose = geometry_msgs::Pose::default();
    pose.orientation.w = 1.0;
    let touched = InspectionPoint {
        position: point(1.0, -radius),
        normal,
        operation: -1,
        feed: 1e-3,
        ..InspectionPoint::default()
    };
    let plan = InspectionPlan {
        plan_id: "axis".to_owned(),
        part_pose: pose,
        stylus: Stylus {
            id: "ball".to_owned(),
            ball_center: point(1.0, 0.0),
            ball_radius: radius,
        },
        features: vec![InspectionFeature {
            id: "plane".to_owned(),
            kind: InspectionFeature::PLANE,
            origin: point(1.0, -radius),
            axis: normal,
            ..InspectionFeature::default()
        }],
        points: vec![touched; TOUCHES],
        ..InspectionPlan::default()
    };
    let event = |sequence: usize| ProbeEvent {
        header: std_msgs::Header {
            stamp: probecell_msgs::builtin_interfaces::Time {
                sec: sequence as i32 + 1,
                nanosec: 0,
            },
            ..std_msgs::Header::default()
        },
        sequence: sequence as u64,
        plan_id: "axis".to_owned(),
        point_index: sequence as u32,
        axis_names: vec![axis.to_owned()],
        axis_positions: vec![0.0],
        tip: point(1.0, 0.0),
        approach: geometry_msgs::Vector3 {
            x: 0.0,
            y: -1.0,
            z: 0.0,
        },
        feed: 1e-3,
        ..ProbeEvent::default()
    };
    let session = Session {
        name: "axis".to_owned(),
        robot_description,
        plan: Some(plan),
        events: (0..TOUCHES).map(event).collect(),
        ..Session::default()
    };
    Observations::from_session(&session).map_err(|error| CureError::Report(error.to_string()))
}
