//! A plan as a perfect cell would measure it.

use machine::{Chain, Nominal, Target};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{ProbeEvent, geometry_msgs, std_msgs};

use crate::session::{Session, SessionError, seconds};

/// Time between two touches of a plan that was not measured yet, s.
pub const PACE: f64 = 8.0;

/// A session whose plan was not measured gets the touches of a perfect cell, at an even pace in the plan's order.
///
/// # Errors
/// [`SessionError`] for a session without a machine or a plan that fits it.
pub fn with_nominal_touches(session: &Session) -> Result<Session, SessionError> {
    let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
    if session.robot_description.is_empty() {
        return Err(SessionError::NoMachine);
    }
    if !session.events.is_empty() {
        return Ok(session.clone());
    }
    let chain = Chain::from_urdf(&session.robot_description)?;
    let nominal = Nominal::from_plan(plan)?;
    let mut start: Vec<f64> = (0..chain.axes().len())
        .map(|axis| {
            let limits = chain.axis(axis).limits;
            limits.map_or(0.0, |(low, high)| f64::midpoint(low, high))
        })
        .collect();
    let first = session
        .machine_states
        .first()
        .map_or(0.0, |state| seconds(&state.header.stamp));
    let mut events = Vec::new();
    for (index, point) in plan.points.iter().enumerate() {
        let (position, normal) = nominal.points[index];
        let mut fixed = vec![None; start.len()];
        for (name, &angle) in plan.rotary_names.iter().zip(&point.rotary_positions) {
            if let Some(axis) = chain.axis_index(name) {
                fixed[axis] = Some(angle);
            }
        }
        let target = Target {
            ball: position + normal.into_inner() * nominal.ball_radius,
            orientation: None,
        };
        let reached = chain.reach(&target, &fixed, &start, &nominal.part_pose, &nominal.ball);
        // A point out of reach cannot be measured and carries no information.
        let Ok(positions) = reached else { continue };
        start.clone_from(&positions);
        let time = first + PACE * index as f64;
        events.push(ProbeEvent {
            header: std_msgs::Header {
                stamp: Time::from_nanos((time * 1e9) as i64),
                frame_id: String::new(),
            },
            sequence: index as u64,
            plan_id: plan.plan_id.clone(),
            point_index: index as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: chain.axis_names().map(str::to_owned).collect(),
            axis_positions: positions,
            tip: geometry_msgs::Point {
                x: target.ball.x,
                y: target.ball.y,
                z: target.ball.z,
            },
            approach: geometry_msgs::Vector3 {
                x: -normal.x,
                y: -normal.y,
                z: -normal.z,
            },
            feed: point.feed,
        });
    }
    Ok(Session {
        events,
        ..session.clone()
    })
}
