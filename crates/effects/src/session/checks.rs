//! What must hold of a session before its numbers are used, however it came here: from a recording or from the bus.
//!
//! Only what would make an answer wrong without anybody noticing; what a reader of recordings can say better, with
//! topic and message number, it says before.

use machine::{Chain, tree};
use probecell_msgs::InspectionPlan;

use crate::session::{Session, SessionError};

/// No machine reaches so far, m: numbers beyond are no lengths.
const FAR: f64 = 1e3;

/// Checks a drive session against its machine.
///
/// # Errors
/// [`SessionError`] names an axis that the machine lacks, or says that there is nothing to compare.
pub fn drives(session: &Session) -> Result<(), SessionError> {
    Chain::from_urdf(&session.robot_description)?;
    let known = tree::joint_names(&session.robot_description)?;
    let topics = [
        ("joint_states", &session.joint_states),
        ("joint_commands", &session.joint_commands),
    ];
    for (topic, messages) in topics {
        let named = messages.iter().flat_map(|message| &message.name);
        // A gripper beside the two branches is among the joint states as well.
        if let Some(axis) = unknown(&known, named) {
            return Err(SessionError::Axis { topic, axis });
        }
    }
    let effort = session
        .joint_states
        .iter()
        .any(|one| !one.effort.is_empty());
    if !effort && session.joint_commands.is_empty() {
        return Err(SessionError::NoPlan);
    }
    Ok(())
}

/// Checks the numbers of a plan and its events that no later step checks.
pub(crate) fn touches(session: &Session, plan: &InspectionPlan) -> Result<(), SessionError> {
    let far = |what: String, value: f64| {
        (!(value.abs() < FAR)).then_some(SessionError::Far { what, value })
    };
    for (number, point) in plan.points.iter().enumerate() {
        let values = [
            (
                "position",
                [point.position.x, point.position.y, point.position.z],
            ),
            (
                "cut_length, tool_height or overhang",
                [point.cut_length, point.tool_height, point.overhang],
            ),
        ];
        for (field, values) in values {
            // Tools cut kilometres.
            let limit = if field == "position" { 1.0 } else { 1e-6 };
            for value in values {
                let what = || format!("{field} of point {number} of plan `{}`", plan.plan_id);
                if let Some(error) = far(what(), value * limit) {
                    return Err(match error {
                        SessionError::Far { what, .. } => SessionError::Far { what, value },
                        other => other,
                    });
                }
            }
        }
        let operations = plan.operations.len();
        // 0 is what a plan without operations leaves unsaid.
        let unspecified = operations == 0 && point.operation == 0;
        if !unspecified && !(-1..operations as i32).contains(&point.operation) {
            return Err(SessionError::Operation {
                point: number,
                operation: point.operation,
                operations,
            });
        }
    }
    for event in &session.events {
        for (axis, &value) in event.axis_names.iter().zip(&event.axis_positions) {
            let what = || format!("position of axis `{axis}` of event {}", event.sequence);
            if let Some(error) = far(what(), value) {
                return Err(error);
            }
        }
    }
    Ok(())
}

fn unknown<'a>(known: &[String], mut names: impl Iterator<Item = &'a String>) -> Option<String> {
    names.find(|name| !known.contains(name)).cloned()
}

/// Which of plan and events has lengths that look like millimetres, for the sentence that says so.
pub(crate) fn larger(session: &Session, plan: &InspectionPlan, chain: &Chain) -> &'static str {
    let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0_f64, |a, b| a.max(b.abs()));
    let points = plan.points.iter().map(|point| &point.position);
    let points = most(&mut points.flat_map(|at| [at.x, at.y, at.z]));
    let pose = &plan.part_pose.position;
    let pose = most(&mut [pose.x, pose.y, pose.z].into_iter());
    let ball = &plan.stylus.ball_center;
    let stylus = most(&mut [ball.x, ball.y, ball.z, plan.stylus.ball_radius].into_iter());
    let linear = |name: &String| {
        chain
            .axis_index(name)
            .is_some_and(|axis| chain.axis(axis).kind == machine::JointKind::Prismatic)
    };
    let axes = session.events.iter().flat_map(|event| {
        let named = event.axis_names.iter().zip(&event.axis_positions);
        named.filter(|(name, _)| linear(name)).map(|(_, &q)| q)
    });
    let axes = most(&mut axes.into_iter());
    let all = [
        ("the axis positions of the events", axes),
        ("the points of the plan", points),
        ("part_pose of the plan", pose),
        ("the stylus of the plan", stylus),
    ];
    let largest = all.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    largest.map_or("something", |one| one.0)
}
