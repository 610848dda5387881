//! What a viewer gets: frames by the kinematics, markers of every touch.

use std::collections::BTreeMap;

use cell_tests::{cell, messages, recording, session::Session};
use graph::{Published, Stamp, replay::Verdict as ReplayVerdict, topics};
use machine::{Chain, deviation::Nominal};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use probecell_msgs::{
    InspectionPlan, TouchDeviation, Verdict,
    geometry_msgs::Transform,
    sensor_msgs::JointState,
    tf2_msgs::TFMessage,
    visualization_msgs::{Marker, MarkerArray},
};

fn pose(transform: &Transform) -> Isometry3<f64> {
    let (at, turn) = (&transform.translation, &transform.rotation);
    let rotation = Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    assert!((rotation.norm() - 1.0).abs() < 1e-12, "a unit quaternion");
    Isometry3::from_parts(
        Translation3::new(at.x, at.y, at.z),
        UnitQuaternion::from_quaternion(rotation),
    )
}

/// Frames by child, as a tf2 buffer holds them.
type Frames = BTreeMap<String, (String, Isometry3<f64>)>;

fn take(frames: &mut Frames, message: &TFMessage) {
    for transform in &message.transforms {
        let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
        frames.insert(child.clone(), (parent.clone(), pose(&transform.transform)));
    }
}

/// Pose in `foundation`.
fn in_foundation(frames: &Frames, name: &str) -> Isometry3<f64> {
    let mut pose = Isometry3::identity();
    let mut name = name;
    while name != "foundation" {
        let (parent, of_it) = frames
            .get(name)
            .unwrap_or_else(|| panic!("no frame {name}"));
        pose = of_it * pose;
        name = parent;
    }
    pose
}

/// The stylus in the part, by frames alone, is where the chain says for the joints of the same stamp.
fn frames_are_those_of_the_chain(urdf: &str, log: &[Published]) -> usize {
    let chain = Chain::from_urdf(urdf).expect("a chain");
    let joints: BTreeMap<Stamp, JointState> =
        messages::<JointState>(log, topics::JOINT_STATES.name)
            .into_iter()
            .map(|joints| (Stamp::from(&joints.header.stamp), joints))
            .collect();
    let fixed = messages::<TFMessage>(log, topics::TF_STATIC.name);
    let plan: InspectionPlan = messages(log, topics::INSPECTION_PLAN.name)
        .pop()
        .expect("a plan");
    let part = Nominal::from_plan(&plan).expect("a part");
    let mut frames = Frames::new();
    take(&mut frames, fixed.last().expect("fixed frames"));
    let moving = messages::<TFMessage>(log, topics::TF.name);
    for message in &moving {
        take(&mut frames, message);
        let stamp = Stamp::from(&message.transforms[0].header.stamp);
        let state = &joints[&stamp];
        let positions = chain
            .positions(&state.name, &state.position)
            .expect("positions");
        let expected = chain.ball_in_part(&positions, &part.part_pose, &part.ball);
        let stylus = in_foundation(&frames, "part").inverse() * in_foundation(&frames, "stylus");
        let off = (stylus.translation.vector - expected.coords).norm();
        assert!(off < 1e-12, "{off} m at {stamp:?}");
    }
    moving.len()
}

#[test]
fn frames_and_markers_of_a_session_are_those_of_its_touches() {
    let mut poses = 0;
    for (file, part) in [("turn_mill.toml", "punch"), ("ball_plate.toml", "plate")] {
        let cell = cell(file, str::to_owned);
        let mut session = Session::new(&cell);
        session.make(part);
        // The last markers are due a second after those before.
        session.run_s(2.0);
        let log = session.finish();
        poses += frames_are_those_of_the_chain(&cell.text().robot_description, &log);
        markers_show_every_touch(&log);
        let factories = cell_tests::factories(&cell, &["visualization"]);
        let again = graph::replay::replay(&recording(&log), &factories).expect("a wiring");
        assert_eq!(again.verdict, ReplayVerdict::Equal);
    }
    assert!(poses > 1000, "{poses} poses");
}

/// The last markers hold each touch of the last plan, its deviation a thousandfold along the normal, and the verdicts.
fn markers_show_every_touch(log: &[Published]) {
    let plan: InspectionPlan = messages(log, topics::INSPECTION_PLAN.name)
        .pop()
        .expect("a plan");
    let touches: BTreeMap<u32, f64> =
        messages::<TouchDeviation>(log, topics::TOUCH_DEVIATIONS.name)
            .into_iter()
            .filter(|touch| touch.plan_id == plan.plan_id)
            .map(|touch| (touch.point_index, touch.deviation))
            .collect();
    assert!(touches.len() > 3);
    let last: MarkerArray = messages(log, topics::TOUCH_MARKERS.name)
        .pop()
        .expect("markers");
    assert_eq!(last.markers[0].action, Marker::DELETEALL);
    assert!(
        last.markers
            .iter()
            .all(|marker| marker.header.frame_id == "part")
    );
    let of = |namespace: &'static str| {
        (last.markers.iter()).filter(move |marker| marker.ns == namespace)
    };
    let lines = &of("deviations").next().expect("deviations").points;
    assert_eq!(lines.len(), 2 * touches.len());
    for (line, (&index, &deviation)) in lines.chunks(2).zip(&touches) {
        let normal = &plan.points[index as usize].normal;
        let along = (line[1].x - line[0].x) * normal.x
            + (line[1].y - line[0].y) * normal.y
            + (line[1].z - line[0].z) * normal.z;
        assert!(
            (along - 1000.0 * deviation).abs() < 1e-12,
            "{along} for {deviation}"
        );
    }
    let verdicts = messages::<Verdict>(log, topics::VERDICTS.name);
    let judged = verdicts
        .iter()
        .filter(|verdict| verdict.plan_id == plan.plan_id)
        .count();
    let labels = of("features").chain(of("characteristics"));
    let told = labels.filter(|label| label.text.contains(": ")).count();
    assert_eq!(told, judged);
    assert_eq!(of("features").count(), plan.features.len());
}
