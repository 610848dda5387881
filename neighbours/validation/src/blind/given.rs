//! The scene of a recorded session: its machine, its part and its plan, on which causes of our own choice are hidden.
//!
//! Only what is nominal is taken over: the description of the machine, the plan, when and how warm each point was
//! touched, and what an outside instrument measured again. What the touches said is not looked at. Whatever is no
//! cylinder, bore or sphere is its tangent plane at each touch. Effects that the cell declares are left out. Metres.

use machine::{Chain, Joint, JointKind, Side};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use probecell_msgs::{InspectionFeature, InspectionPlan, geometry_msgs};

use super::plant::Plant;
use super::scene::{Axis, Feature, Given, Reference, Scene, Shape, Touch};
use effects::observation::Row;
use effects::observe;
use effects::session::{Session, SessionError, seconds};

/// Axes that put a ball anywhere without turning it.
const LINEAR: usize = 3;

/// The scene of a session.
///
/// # Errors
/// [`SessionError`] for a session that could not be diagnosed either.
pub(super) fn scene(session: &Session) -> Result<Scene, SessionError> {
    let observations = observe(&Session {
        declared: Vec::new(),
        ..session.clone()
    })?;
    let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
    let chain = &observations.chain;
    let (part_axes, behind_part) = axes(chain, Side::Part);
    let (tool_axes, mount) = axes(chain, Side::Tool);
    let rows = &observations.rows[..observations.touches()];
    let start = |row: &Row| {
        let event = session
            .events
            .iter()
            .find(|event| Some(event.sequence) == row.sequence);
        event.map(|event| seconds(&event.header.stamp) - row.time)
    };
    let began = rows.first().and_then(start).unwrap_or_default();
    let mut scene = Scene {
        machine: chain.name().to_owned(),
        part_axes,
        tool_axes,
        fixed: plan.rotary_names.clone(),
        part: behind_part * pose(&plan.part_pose),
        mount,
        stylus: observations.nominal.ball.coords,
        ball_radius: observations.nominal.ball_radius,
        features: plan.features.iter().map(feature).collect(),
        touches: Vec::new(),
        cut_here: observations.cut_here,
        given: None,
    };
    scene.touches = rows.iter().map(|row| touch(plan, row)).collect();
    let references = references(session, plan, &scene.touches);
    scene.given = Some(Given {
        urdf: session.robot_description.clone(),
        plan: plan.clone(),
        machine_states: session.machine_states.clone(),
        began,
        references,
        operations: (plan.operations.iter())
            .map(|operation| operation.rotary_positions.clone())
            .collect(),
    });
    let names = || scene.part_axes.iter().chain(&scene.tool_axes);
    let free: Vec<&Axis> = names()
        .filter(|axis| !scene.fixed.contains(&axis.name))
        .collect();
    if free.len() != LINEAR || free.iter().any(|axis| axis.turns) {
        let order: Vec<Option<usize>> = names().map(|axis| chain.axis_index(&axis.name)).collect();
        let reaches: Vec<_> = (scene.touches.iter().zip(rows))
            .map(|(touch, row)| {
                let known = row.pose.as_ref().map_or(&[][..], |pose| &pose.positions);
                let own = order
                    .iter()
                    .map(|place| place.and_then(|place| known.get(place)));
                let own: Vec<f64> = own.map(|value| value.copied().unwrap_or(0.0)).collect();
                Plant::reach(&scene, touch, &own)
            })
            .collect();
        for (touch, reach) in scene.touches.iter_mut().zip(reaches) {
            touch.reach = Some(reach);
        }
    }
    Ok(scene)
}

/// The moving joints of a branch, and what stands fixed behind the last of them.
fn axes(chain: &Chain, side: Side) -> (Vec<Axis>, Isometry3<f64>) {
    let mut axes = Vec::new();
    let mut before = Isometry3::identity();
    for &index in chain.branch(side) {
        let joint: &Joint = &chain.joints()[index];
        before *= joint.origin;
        if joint.moves() {
            axes.push(Axis {
                name: joint.name.clone(),
                turns: joint.kind == JointKind::Revolute,
                direction: joint.axis.into_inner(),
                origin: before,
            });
            before = Isometry3::identity();
        }
    }
    (axes, before)
}

fn pose(pose: &geometry_msgs::Pose) -> Isometry3<f64> {
    let turn = &pose.orientation;
    let turn = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    Isometry3::from_parts(
        Translation3::new(pose.position.x, pose.position.y, pose.position.z),
        UnitQuaternion::from_quaternion(turn),
    )
}

fn feature(feature: &InspectionFeature) -> Feature {
    let (at, along) = (&feature.origin, &feature.axis);
    let origin = Point3::new(at.x, at.y, at.z);
    let axis = Vector3::new(along.x, along.y, along.z);
    let axis = axis.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let round = |hole: bool| Shape::Round {
        centre: origin,
        axis,
        hole,
    };
    Feature {
        name: feature.id.clone(),
        kind: feature.kind,
        shape: match feature.kind {
            InspectionFeature::CYLINDER => round(false),
            InspectionFeature::BORE => round(true),
            InspectionFeature::SPHERE => Shape::Ball { centre: origin },
            _ => Shape::Free,
        },
        origin,
        axis,
        radius: feature.radius,
    }
}

fn touch(plan: &InspectionPlan, row: &Row) -> Touch {
    let point = plan.points.get(row.point);
    let round = plan.features.get(row.feature).is_some_and(|feature| {
        [InspectionFeature::CYLINDER, InspectionFeature::BORE].contains(&feature.kind)
    });
    Touch {
        number: row.point as u32,
        feature: row.feature,
        point: row.position,
        normal: row.normal,
        fixed: point.map_or_else(Vec::new, |point| point.rotary_positions.clone()),
        feed: row.feed,
        time: row.time,
        operation: point.map_or(-1, |point| point.operation),
        tool: row.tool.unwrap_or(0),
        cut_length: row.cut_length,
        tool_height: row.tool_height,
        overhang: row.overhang,
        round,
        warm: row.kelvin_above_20_celsius.unwrap_or(0.0),
        reach: None,
    }
}

/// References of touched points, as far as they are.
fn references(session: &Session, plan: &InspectionPlan, touches: &[Touch]) -> Vec<Reference> {
    let own = session
        .references
        .iter()
        .filter(|known| known.plan_id == plan.plan_id);
    own.map(|reference| {
        let touched: Vec<&Touch> = (reference.point_index.iter())
            .filter_map(|&number| touches.iter().find(|touch| touch.number == number))
            .collect();
        let mut message = reference.clone();
        message.point_index = touched.iter().map(|touch| touch.number).collect();
        Reference {
            message,
            points: touched.into_iter().cloned().collect(),
        }
    })
    .collect()
}
