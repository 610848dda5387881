//! A small session for the tests of effects: a block on a rotary table, touched by a probe in a turning spindle.
//!
//! Slides X, Y, Z stand on one another along the axes of the foundation and carry the spindle S; the table C turns about
//! z and carries the part, whose frame is the table's. All touches are those of a perfect cell.

use machine::Chain;
use nalgebra::{Point3, Rotation3, Vector3};
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, MachiningOperation, Stylus,
    builtin_interfaces::Time, geometry_msgs, std_msgs,
};

use crate::observation::Row;
use crate::session::perfect::with_nominal_touches;
use crate::{DeclaredEffect, DeclaredParameter, Session, observe};

const MACHINE: &str = r#"<robot name="specimen">
  <link name="foundation"/><link name="workpiece"/><link name="x"/><link name="y"/><link name="z"/><link name="probe_mount"/>
  <joint name="C" type="revolute"><parent link="foundation"/><child link="workpiece"/><axis xyz="0 0 1"/>
    <limit lower="-6.3" upper="6.3" effort="1" velocity="1"/></joint>
  <joint name="X" type="prismatic"><parent link="foundation"/><child link="x"/><axis xyz="1 0 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="Y" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="Z" type="prismatic"><parent link="y"/><child link="z"/><axis xyz="0 0 1"/>
    <limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="S" type="revolute"><parent link="z"/><child link="probe_mount"/><axis xyz="0 0 1"/>
    <limit lower="-6.3" upper="6.3" effort="1" velocity="1"/></joint>
</robot>"#;

/// The machine.
pub(crate) fn chain() -> Chain {
    Chain::from_urdf(MACHINE).expect("a machine")
}

/// The session: five faces of a block, five by five points each, at several angles of table and spindle.
pub(crate) fn session() -> Session {
    let faces = [
        Vector3::x(),
        -Vector3::x(),
        Vector3::y(),
        -Vector3::y(),
        Vector3::z(),
    ];
    let feature = |(face, normal): (usize, &Vector3<f64>)| InspectionFeature {
        id: format!("face {face}"),
        kind: InspectionFeature::PLANE,
        origin: point(&(0.05 * normal)),
        axis: vector(normal),
        ..InspectionFeature::default()
    };
    let mut points = Vec::new();
    for (face, normal) in faces.iter().enumerate() {
        let across = if normal.z == 0.0 {
            Vector3::z()
        } else {
            Vector3::x()
        };
        let along = normal.cross(&across);
        for number in 0..25 {
            // Steps of no common pitch.
            let (u, v) = (number % 5, number / 5);
            let place = |step: i32| 0.021 * f64::from(step - 2) + 0.0013 * f64::from(step * step);
            let position = 0.05 * normal + place(u) * across + place(v) * along;
            points.push(InspectionPoint {
                feature: face as u32,
                position: point(&position),
                normal: vector(normal),
                rotary_positions: vec![0.7 * f64::from(number % 7), 0.4 * f64::from(number % 4)],
                approach_distance: 0.002,
                retract_distance: 0.002,
                feed: if number % 2 == 0 { 0.002 } else { 0.005 },
                operation: number % 2,
                cut_length: 0.4 * f64::from(number),
                tool_height: 0.001 * f64::from(number),
                overhang: 0.004 * f64::from(number),
            });
        }
    }
    let operation = |tool: u32| MachiningOperation {
        id: format!("finish {tool}"),
        tool_number: tool,
        tool_radius: 0.005,
        feed: 0.01,
        finish: true,
        rotary_positions: vec![0.0, 0.0],
    };
    let warm = |(sec, celsius): (i32, f64)| MachineState {
        header: std_msgs::Header {
            stamp: Time { sec, nanosec: 0 },
            ..std_msgs::Header::default()
        },
        temperature_names: vec!["part".to_owned()],
        temperatures: vec![celsius],
        ..MachineState::default()
    };
    let mut pose = geometry_msgs::Pose::default();
    pose.orientation.w = 1.0;
    let plan = InspectionPlan {
        plan_id: "specimen".to_owned(),
        part_pose: pose,
        stylus: Stylus {
            id: "probe".to_owned(),
            ball_center: point(&Vector3::new(0.0, 0.0, -0.1)),
            ball_radius: 0.003,
        },
        rotary_names: vec!["C".to_owned(), "S".to_owned()],
        features: faces.iter().enumerate().map(feature).collect(),
        operations: [1, 2].map(operation).into(),
        points,
        ..InspectionPlan::default()
    };
    let unmeasured = Session {
        name: "specimen".to_owned(),
        robot_description: MACHINE.to_owned(),
        plan: Some(plan),
        machine_states: [(100, 22.0), (10_000, 25.0)].map(warm).into(),
        ..Session::default()
    };
    with_nominal_touches(&unmeasured).expect("within reach")
}

/// A touch as the formulas of effects see it.
pub(crate) struct Seen<'a> {
    /// Its row.
    pub(crate) row: &'a Row,
    /// Outward normal in the foundation.
    pub(crate) normal: Vector3<f64>,
    /// Centre of the ball in the foundation, m.
    pub(crate) ball: Point3<f64>,
    chain: &'a Chain,
}

impl Seen<'_> {
    /// Position of an axis, m or rad.
    pub(crate) fn position(&self, axis: &str) -> f64 {
        let axis = self.chain.axis_index(axis).expect("an axis");
        self.row.pose.as_ref().expect("a touch").positions[axis]
    }
}

/// Asserts that a declared effect is predicted to change the deviation (m) of every touch as `expected` says.
pub(crate) fn predicts(
    effect: &str,
    parameters: &[(&str, f64, &str)],
    expected: impl Fn(&Seen<'_>) -> f64,
) {
    let declared = DeclaredEffect {
        effect: effect.to_owned(),
        parameters: (parameters.iter())
            .map(|&(name, value, unit)| DeclaredParameter {
                name: name.to_owned(),
                value,
                unit: unit.to_owned(),
                ci95: None,
            })
            .collect(),
        chosen_from: Vec::new(),
        source: None,
        measured: None,
        promised: None,
    };
    let session = Session {
        declared: vec![declared],
        ..session()
    };
    let rows = observe(&session).unwrap_or_else(|error| panic!("{effect}: {error}"));
    let mut largest = 0.0_f64;
    for (number, row) in rows.rows.iter().enumerate() {
        let table = rows.chain.axis_index("C").expect("a table");
        let pose = row.pose.as_ref().expect("a touch");
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), pose.positions[table]);
        let seen = Seen {
            row,
            normal: turn * row.normal,
            ball: turn * pose.sensitivity.ball,
            chain: &rows.chain,
        };
        let (found, expected) = (rows.declared[0][number], expected(&seen));
        largest = largest.max(expected.abs());
        assert!(
            (found - expected).abs() < 1e-11,
            "{effect}, touch {number}: {found:e} m for {expected:e} m"
        );
    }
    assert!(largest > 1e-7, "{effect} shows nowhere");
}

fn point(at: &Vector3<f64>) -> geometry_msgs::Point {
    geometry_msgs::Point {
        x: at.x,
        y: at.y,
        z: at.z,
    }
}

fn vector(along: &Vector3<f64>) -> geometry_msgs::Vector3 {
    geometry_msgs::Vector3 {
        x: along.x,
        y: along.y,
        z: along.z,
    }
}
