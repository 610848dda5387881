//! A session as a recording to the interface contract.

use std::path::Path;

use bags::{Channel, Overflow, Qos, Recorder, RecorderOptions};
use nalgebra::{Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::std_msgs::Header;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, Message, ProbeEvent, Stylus,
    geometry_msgs, std_msgs, to_cdr,
};

use super::plant::{BALL, CENTRES, NORMALS, STYLUS};

/// The machine of all types, whose name is replaced.
const MACHINE: &str = include_str!("../../../../launch-scripts/three_axis.urdf");
/// Between two touches, s.
const PERIOD: f64 = 6.0;
/// Speeds of approach, m/s, by turns.
const FEEDS: [f64; 2] = [0.005, 0.01];

fn nanoseconds(days: f64, seconds: f64) -> u64 {
    ((days * 86_400.0).floor() as u64) * 1_000_000_000 + (seconds * 1e9) as u64
}

fn header(at: u64) -> Header {
    Header {
        stamp: Time {
            sec: (at / 1_000_000_000) as i32,
            nanosec: (at % 1_000_000_000) as u32,
        },
        frame_id: "part".to_owned(),
    }
}

fn point(at: &Point3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point {
        x: at.x,
        y: at.y,
        z: at.z,
    }
}

fn vector(of: &Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: of.x,
        y: of.y,
        z: of.z,
    }
}

fn plan(at: u64) -> InspectionPlan {
    let mut features = Vec::new();
    let mut points = Vec::new();
    for (ball, centre) in CENTRES.iter().enumerate() {
        let centre = Point3::from(*centre);
        features.push(InspectionFeature {
            id: format!("ball_{ball}"),
            kind: InspectionFeature::SPHERE,
            origin: point(&centre),
            axis: vector(&Vector3::z()),
            radius: BALL,
            ..InspectionFeature::default()
        });
        for normal in NORMALS {
            let normal = Vector3::from(normal);
            points.push(InspectionPoint {
                feature: ball as u32,
                position: point(&(centre + normal * BALL)),
                normal: vector(&normal),
                approach_distance: 0.005,
                retract_distance: 0.005,
                feed: FEEDS[(ball + points.len()) % 2],
                operation: -1,
                ..InspectionPoint::default()
            });
        }
    }
    let mut plan = InspectionPlan {
        header: header(at),
        plan_id: "artefact".to_owned(),
        part_id: "artefact".to_owned(),
        stylus: Stylus {
            id: "stylus_6".to_owned(),
            ball_radius: STYLUS,
            ..Stylus::default()
        },
        features,
        points,
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    plan
}

/// Writes the session of a machine of a type that began at `days` since 1970, with the readings at its touches.
pub(super) fn write(
    folder: &Path,
    machine: &str,
    kind: usize,
    days: f64,
    readings: &[Point3<f64>],
    temperature: f64,
) -> anyhow::Result<()> {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder)
    })?;
    let begin = nanoseconds(days, 0.0);
    let channel = |name: &str, message: &'static probecell_msgs::MessageType, qos: Qos| {
        recorder.channel(&Channel::of(format!("/{machine}/{name}"), message, qos))
    };
    let description = std_msgs::String {
        data: MACHINE.replace("three_axis_xyz", &format!("mill_type_{kind}")),
    };
    let descriptions = channel("robot_description", std_msgs::String::TYPE, Qos::latched())?;
    recorder.push(descriptions, 1, begin, begin, to_cdr(&description))?;
    let plan = plan(begin);
    let plans = channel("inspection_plan", InspectionPlan::TYPE, Qos::latched())?;
    recorder.push(plans, 1, begin, begin, to_cdr(&plan))?;
    let states = channel("machine_state", MachineState::TYPE, Qos::default())?;
    let state = MachineState {
        header: header(begin),
        machine_id: machine.to_owned(),
        feed_override: 1.0,
        temperature_names: vec!["part".to_owned()],
        temperatures: vec![temperature],
        ..MachineState::default()
    };
    recorder.push(states, 1, begin, begin, to_cdr(&state))?;
    let events = channel("probe_events", ProbeEvent::TYPE, Qos::default())?;
    for (number, reading) in readings.iter().enumerate() {
        let at = nanoseconds(days, PERIOD * (number as f64 + 1.0));
        let target = &plan.points[number];
        let event = ProbeEvent {
            header: header(at),
            sequence: number as u64,
            plan_id: plan.plan_id.clone(),
            point_index: number as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            axis_positions: reading
                .coords
                .iter()
                .map(|value| (value * 1e7).round() / 1e7)
                .collect(),
            tip: point(reading),
            approach: vector(&-Vector3::new(
                target.normal.x,
                target.normal.y,
                target.normal.z,
            )),
            feed: target.feed,
        };
        recorder.push(events, number as u64 + 1, at, at, to_cdr(&event))?;
    }
    recorder.stop()?;
    Ok(())
}
