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

/// s between two samples of the simulated machine.
const PERIOD: f64 = 0.01;
/// m/s² and rad/s²; of every axis in the test below.
const ACCELERATION: f64 = 1.5;

/// Slopes of the positions of a session against the velocities told with them: intervals whose slope lies beyond both
/// velocities at its ends by more than `slack` (m/s, rad/s), and intervals in which an axis moves.
fn slopes(log: &[Published], slack: f64) -> (usize, usize) {
    let joints = messages::<JointState>(log, topics::JOINT_STATES.name);
    let (mut beyond, mut moving) = (0, 0);
    for pair in joints.windows(2) {
        let [from, to] = pair else { continue };
        assert_eq!(from.velocity.len(), from.name.len());
        assert!(
            from.effort.is_empty(),
            "the simulated machine has no efforts"
        );
        let seconds = Stamp::from(&to.header.stamp).since_s(Stamp::from(&from.header.stamp));
        assert!(seconds <= 1.001 * PERIOD, "{seconds} s");
        // Two samples within a millisecond: the stamps are whole nanoseconds, and the positions doubles.
        if seconds < 1e-3 {
            continue;
        }
        for axis in 0..from.name.len() {
            let slope = (to.position[axis] - from.position[axis]) / seconds;
            let ends = [from.velocity[axis], to.velocity[axis]];
            let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            moving += usize::from(slope.abs() > 1e-3);
            beyond += usize::from(!(low - slack..=high + slack).contains(&slope));
        }
    }
    (beyond, moving)
}

#[test]
fn velocities_are_the_slopes_of_the_positions() {
    // By top speeds alone velocities jump, and a move or a standstill that is shorter than an interval is seen at neither end.
    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    session.make("punch");
    let (beyond, moving) = slopes(&session.finish(), 1e-6);
    assert!(
        moving > 1000 && beyond * 50 < moving,
        "{beyond} of {moving}"
    );
    // With an acceleration they do not, but where a move at a feed begins and ends.
    let limits = "[motion.axes]\nX = { acceleration_mm_per_s2 = 1500.0 }\nY = { acceleration_mm_per_s2 = 1500.0 }\nZ = { acceleration_mm_per_s2 = 1500.0 }\n\
                  C = { acceleration_deg_per_s2 = 85.0 }\n";
    let cell = cell("turn_mill.toml", |text| format!("{text}\n{limits}"));
    let mut session = Session::new(&cell);
    session.make("punch");
    let (beyond, moving) = slopes(&session.finish(), ACCELERATION * PERIOD);
    assert!(
        moving > 1000 && beyond * 50 < moving,
        "{beyond} of {moving}"
    );
}
