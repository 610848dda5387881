//! What the interface contract asks of a session's messages: numbers, lengths, names, finite values.

use std::collections::{BTreeMap, BTreeSet};

use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{InspectionPlan, InspectionPoint, MachineState, ProbeEvent, std_msgs};

use super::{Missing, SessionError};
use crate::reader::Stamped;

pub(super) fn check_machine(
    topic: &str,
    index: usize,
    Stamped { message, .. }: &Stamped<MachineState>,
) -> Result<(), SessionError> {
    let (names, values) = (message.temperature_names.len(), message.temperatures.len());
    if names != values {
        return Err(SessionError::TemperatureCount {
            topic: topic.to_owned(),
            index,
            names,
            values,
        });
    }
    finite(topic, index, "temperatures", &message.temperatures)?;
    finite(topic, index, "spindle_speed", &[message.spindle_speed])?;
    finite(topic, index, "feed_override", &[message.feed_override])
}

pub(super) fn check_joints(
    topic: &str,
    states: &[Stamped<JointState>],
) -> Result<(), SessionError> {
    for (index, Stamped { message, .. }) in states.iter().enumerate() {
        let fields = [
            ("position", &message.position),
            ("velocity", &message.velocity),
            ("effort", &message.effort),
        ];
        for (field, values) in fields {
            // sensor_msgs/JointState allows each list to be empty.
            if !values.is_empty() && values.len() != message.name.len() {
                let (names, values) = (message.name.len(), values.len());
                return Err(SessionError::AxisCount {
                    topic: topic.to_owned(),
                    index,
                    field,
                    names,
                    values,
                });
            }
            finite(topic, index, field, values)?;
        }
    }
    Ok(())
}

pub(super) fn check_plan(topic: &str, plan: &InspectionPlan) -> Result<(), SessionError> {
    let pose = &plan.part_pose;
    let position = [pose.position.x, pose.position.y, pose.position.z];
    let orientation = [
        pose.orientation.x,
        pose.orientation.y,
        pose.orientation.z,
        pose.orientation.w,
    ];
    finite(
        topic,
        0,
        "part_pose",
        &[&position[..], &orientation[..]].concat(),
    )?;
    let ball = &plan.stylus.ball_center;
    finite(
        topic,
        0,
        "stylus",
        &[ball.x, ball.y, ball.z, plan.stylus.ball_radius],
    )?;
    for (number, feature) in plan.features.iter().enumerate() {
        let (origin, axis) = (&feature.origin, &feature.axis);
        let fields: [(&str, &[f64]); 4] = [
            ("origin", &[origin.x, origin.y, origin.z]),
            ("axis", &[axis.x, axis.y, axis.z]),
            ("radius", &[feature.radius]),
            ("half_angle", &[feature.half_angle]),
        ];
        // A tolerance may be open to one side; no number it must not be.
        let tolerances = [feature.lower_tolerance, feature.upper_tolerance];
        let tolerances = tolerances.map(|value| if value.is_nan() { value } else { 0.0 });
        for (field, values) in fields.into_iter().chain([("tolerance", &tolerances[..])]) {
            finite(topic, 0, format_args!("features[{number}].{field}"), values)?;
        }
    }
    for (number, operation) in plan.operations.iter().enumerate() {
        let fields: [(&str, &[f64]); 2] = [
            (
                "tool_radius or feed",
                &[operation.tool_radius, operation.feed],
            ),
            ("rotary_positions", &operation.rotary_positions),
        ];
        for (field, values) in fields {
            finite(
                topic,
                0,
                format_args!("operations[{number}].{field}"),
                values,
            )?;
        }
    }
    for (number, point) in plan.points.iter().enumerate() {
        check_point(topic, plan, number, point)?;
    }
    Ok(())
}

fn check_point(
    topic: &str,
    plan: &InspectionPlan,
    number: usize,
    point: &InspectionPoint,
) -> Result<(), SessionError> {
    if point.feature as usize >= plan.features.len() {
        let (feature, features) = (point.feature, plan.features.len());
        return Err(SessionError::NoSuchFeature {
            point: number,
            feature,
            features,
        });
    }
    // -1: not cut on this machine; 0 is what a plan without operations leaves unsaid.
    let unspecified = plan.operations.is_empty() && point.operation == 0;
    if !unspecified && !(-1..plan.operations.len() as i32).contains(&point.operation) {
        let (operation, operations) = (point.operation, plan.operations.len());
        return Err(SessionError::NoSuchOperation {
            point: number,
            operation,
            operations,
        });
    }
    let (at, normal) = (&point.position, &point.normal);
    let fields: [(&str, &[f64]); 9] = [
        ("position", &[at.x, at.y, at.z]),
        ("normal", &[normal.x, normal.y, normal.z]),
        ("rotary_positions", &point.rotary_positions),
        ("approach_distance", &[point.approach_distance]),
        ("retract_distance", &[point.retract_distance]),
        ("feed", &[point.feed]),
        ("cut_length", &[point.cut_length]),
        ("tool_height", &[point.tool_height]),
        ("overhang", &[point.overhang]),
    ];
    for (field, values) in fields {
        finite(topic, 0, format_args!("points[{number}].{field}"), values)?;
    }
    Ok(())
}

/// The run of the driver that each event is of, counted from 0 in the order recorded: numbers begin again with each. A run is
/// known by the session of the event's trigger; where the bag does not tell it, a second touch numbered 0 that was latched after
/// the one before it begins another.
pub(super) fn runs(events: &[Mark], sessions: &BTreeMap<(Instant, u64), usize>) -> Vec<usize> {
    let mut known: BTreeMap<usize, usize> = BTreeMap::new();
    let mut before: Option<(usize, Instant)> = None;
    let (mut runs, mut count) = (Vec::new(), 0);
    let mut with_first = BTreeSet::new();
    for event in events {
        let at = event.latched;
        let session = sessions.get(&(at, event.sequence)).copied();
        let goes_on = |run: usize, latched: Instant| {
            let begins = event.sequence == 0 && at > latched && with_first.contains(&run);
            let is_others = session.is_some() && known.values().any(|one| *one == run);
            !begins && !is_others
        };
        let run = match (session.and_then(|session| known.get(&session)), before) {
            (Some(run), _) => *run,
            (None, Some((run, latched))) if goes_on(run, latched) => run,
            (None, _) => {
                count += 1;
                count - 1
            }
        };
        if let Some(session) = session {
            known.insert(session, run);
        }
        if event.sequence == 0 {
            with_first.insert(run);
        }
        before = Some((run, at));
        runs.push(run);
    }
    runs
}

/// s and ns of a stamp.
pub(super) type Instant = (i32, u32);

/// What is known of every touch.
pub(super) struct Mark {
    pub(super) sequence: u64,
    pub(super) latched: Instant,
    /// Reception, ns since 1970.
    pub(super) log_time: u64,
    /// Index of the plan that it names.
    pub(super) plan: usize,
}

pub(super) fn instant(header: &std_msgs::Header) -> Instant {
    (header.stamp.sec, header.stamp.nanosec)
}

/// Events of a run of the driver are numbered from 0 in the order they stand, whatever plan they are of. Gives the gaps.
pub(super) fn check_numbers(events: &[Mark], runs: &[usize]) -> Result<Vec<Missing>, SessionError> {
    let mut last: BTreeMap<usize, u64> = BTreeMap::new();
    let mut missing: Vec<(usize, Missing)> = Vec::new();
    for (event, run) in events.iter().zip(runs) {
        let sequence = event.sequence;
        let before = last.insert(*run, sequence);
        if let Some(after) = before.filter(|&last| sequence <= last) {
            let mut gaps = missing.iter().filter(|(of, _)| of == run);
            let is_new = gaps.any(|(_, gap)| (gap.expected..gap.before).contains(&sequence));
            return Err(if is_new {
                SessionError::ReorderedEvent { sequence, after }
            } else {
                SessionError::DuplicateEvent(sequence)
            });
        }
        let expected = before.map_or(0, |last| last + 1);
        if sequence > expected {
            let gap = Missing {
                expected,
                before: sequence,
                count: sequence - expected,
            };
            missing.push((*run, gap));
        }
    }
    let missing: Vec<Missing> = missing.into_iter().map(|(_, gap)| gap).collect();
    let lost = |gap: &&Missing| gap.count > events.len() as u64;
    match missing.iter().find(lost) {
        Some(gap) => Err(SessionError::MissingEvents(*gap)),
        None => Ok(missing),
    }
}

/// Every event is of some plan of the bag.
pub(super) fn check_plans(
    plans: &[InspectionPlan],
    events: &[Mark],
    plan_ids: &[String],
) -> Result<(), SessionError> {
    let is_known = |id: &String| plans.iter().any(|plan| plan.plan_id == *id);
    let known: Vec<bool> = plan_ids.iter().map(is_known).collect();
    match events.iter().find(|event| !known[event.plan]) {
        Some(event) => Err(SessionError::EventOfOtherPlan {
            sequence: event.sequence,
            found: plan_ids[event.plan].clone(),
            expected: plans
                .iter()
                .map(|plan| plan.plan_id.clone())
                .collect::<Vec<_>>()
                .join(" or "),
        }),
        None => Ok(()),
    }
}

pub(super) fn check_event(
    topic: &str,
    plan: &InspectionPlan,
    index: usize,
    event: &ProbeEvent,
) -> Result<(), SessionError> {
    let sequence = event.sequence;
    if event.plan_id != plan.plan_id {
        let (found, expected) = (event.plan_id.clone(), plan.plan_id.clone());
        return Err(SessionError::EventOfOtherPlan {
            sequence,
            found,
            expected,
        });
    }
    if event.point_index as usize >= plan.points.len() {
        let (point_index, points) = (event.point_index, plan.points.len());
        return Err(SessionError::NoSuchPoint {
            sequence,
            point_index,
            points,
        });
    }
    if event.axis_names.len() != event.axis_positions.len() {
        return Err(SessionError::AxisCount {
            topic: topic.to_owned(),
            index,
            field: "axis_positions",
            names: event.axis_names.len(),
            values: event.axis_positions.len(),
        });
    }
    finite(topic, index, "axis_positions", &event.axis_positions)?;
    finite(
        topic,
        index,
        "tip",
        &[event.tip.x, event.tip.y, event.tip.z],
    )?;
    let approach = &event.approach;
    finite(
        topic,
        index,
        "approach",
        &[approach.x, approach.y, approach.z, event.feed],
    )?;
    Ok(())
}

pub(super) fn finite(
    topic: &str,
    index: usize,
    field: impl std::fmt::Display,
    values: &[f64],
) -> Result<(), SessionError> {
    if values.iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(SessionError::NotFinite {
        topic: topic.to_owned(),
        index,
        field: field.to_string(),
    })
}
