//! Sessions laid out as real machines are measured, by formulas of their own: nothing here uses a column of an effect.
//!
//! Each layout says where the ball or the reflector really is, and solves where the nominal machine would be read for it.

#![allow(dead_code, reason = "each test uses some of the layouts")]

pub(crate) mod arm;
pub(crate) mod bed;
pub(crate) mod iso230;
pub(crate) mod plate;
pub(crate) mod sealed;
pub(crate) mod warming;

use diagnosis::{Report, Session};
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, ProbeEvent, Stylus,
    builtin_interfaces::Time, geometry_msgs::Point, geometry_msgs::Vector3, std_msgs::Header,
};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Three slides that stand on one another and carry the probe; the part lies on the foundation.
pub(crate) const GANTRY: &str = r#"<robot name="gantry">
  <link name="foundation"/><link name="workpiece"/><link name="x"/><link name="y"/><link name="probe_mount"/>
  <joint name="clamping" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
  <joint name="X" type="prismatic"><parent link="foundation"/><child link="x"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="Y" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="Z" type="prismatic"><parent link="y"/><child link="probe_mount"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"#;

pub(crate) type V = [f64; 3];

/// One reading.
pub(crate) struct Reading {
    pub(crate) feature: u32,
    /// Nominal point, or where an instrument saw it, m.
    pub(crate) point: V,
    pub(crate) normal: V,
    pub(crate) feed: f64,
    /// As the control reads its axes.
    pub(crate) axes: Vec<f64>,
    pub(crate) time: f64,
}

/// A session of readings with a ball of this radius at `ball` of the mount.
pub(crate) fn session(
    name: &str,
    machine: &str,
    axes: &[&str],
    (ball, radius): (V, f64),
    readings: &[Reading],
) -> Session {
    let last = readings.iter().map(|one| one.feature).max().unwrap_or(0);
    let feature = |number: u32| {
        let own = readings.iter().find(|one| one.feature == number);
        let normal = own.map_or([0.0, 0.0, 1.0], |one| one.normal);
        InspectionFeature {
            id: format!("feature {number}"),
            kind: InspectionFeature::PLANE,
            origin: own.map_or_else(Point::default, |one| point(one.point)),
            axis: vector(normal),
            ..InspectionFeature::default()
        }
    };
    let mut plan = InspectionPlan {
        plan_id: name.to_owned(),
        stylus: Stylus {
            id: "probe".to_owned(),
            ball_center: point(ball),
            ball_radius: radius,
        },
        features: (0..=last).map(feature).collect(),
        points: readings
            .iter()
            .map(|one| InspectionPoint {
                feature: one.feature,
                position: point(one.point),
                normal: vector(one.normal),
                feed: one.feed,
                operation: -1,
                ..InspectionPoint::default()
            })
            .collect(),
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    let event = |(number, one): (usize, &Reading)| ProbeEvent {
        header: header(one.time),
        sequence: number as u64,
        plan_id: name.to_owned(),
        point_index: number as u32,
        outcome: ProbeEvent::OUTCOME_TOUCHED,
        axis_names: axes.iter().map(|&axis| axis.to_owned()).collect(),
        axis_positions: one.axes.clone(),
        tip: point(one.point),
        approach: vector(one.normal.map(|part| -part)),
        feed: one.feed,
    };
    Session {
        name: name.to_owned(),
        robot_description: machine.to_owned(),
        plan: Some(plan),
        events: readings.iter().enumerate().map(event).collect(),
        ..Session::default()
    }
}

pub(crate) fn header(time: f64) -> Header {
    Header {
        stamp: Time {
            sec: time.floor() as i32,
            nanosec: ((time - time.floor()) * 1e9) as u32,
        },
        frame_id: String::new(),
    }
}

pub(crate) fn state(time: f64, temperatures: &[(&str, f64)], spindle_speed: f64) -> MachineState {
    MachineState {
        header: header(time),
        spindle_speed,
        temperature_names: temperatures.iter().map(|one| one.0.to_owned()).collect(),
        temperatures: temperatures.iter().map(|one| one.1).collect(),
        ..MachineState::default()
    }
}

fn point([x, y, z]: V) -> Point {
    Point { x, y, z }
}

fn vector([x, y, z]: V) -> Vector3 {
    Vector3 { x, y, z }
}

/// Uniform and normal numbers, of streams that do not depend on one another where their seeds are neighbours.
pub(crate) struct Chance(Pcg64Mcg);

impl Chance {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Of unit variance.
    pub(crate) fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }
}

/// What a report names, each with all that these data cannot tell from it.
pub(crate) fn groups(report: &Report) -> Vec<Vec<&str>> {
    (report.effects.iter())
        .map(|effect| {
            std::iter::once(effect.effect.as_str())
                .chain(effect.indistinguishable_from.iter().map(String::as_str))
                .collect()
        })
        .collect()
}

/// True where some group of the report has this effect.
pub(crate) fn names(report: &Report, effect: &str) -> bool {
    groups(report).iter().any(|group| group.contains(&effect))
}

/// Effects whose group holds none of these: innocents.
pub(crate) fn innocents<'r>(report: &'r Report, guilty: &[&str]) -> Vec<&'r str> {
    let stands = |group: &&Vec<&str>| !group.iter().any(|one| guilty.contains(one));
    groups(report)
        .iter()
        .filter(stands)
        .map(|group| group[0])
        .collect()
}

/// Held-out rms after the last effect, m.
pub(crate) fn left(report: &Report) -> f64 {
    let judged = report.effects.iter().rfind(|effect| effect.held_out);
    judged.map_or(report.gap.rms, |effect| effect.rms_after)
}
