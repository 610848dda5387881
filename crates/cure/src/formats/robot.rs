//! Robots: calibrated robot descriptions (masses and friction: [`super::arm`]), the kinematics of Universal Robots, offsets of `robot_calibration`.
//!
//! A location error acts right after the origin of its joint, before its motion (interface contract), so that the origin of the
//! calibrated joint is that of the nominal one times the displacement of the error; the zero of a joint is such an error about its own
//! axis. `robot_calibration` (`Chain3dModel::getChainFK`) adds the offset NAME to the position of joint NAME, and applies the offsets
//! NAME_x … NAME_c, a displacement and a rotation vector, between its origin and its motion.

use std::collections::BTreeMap;

use effects::registry;
use machine::tree::{TreeJoint, joints};
use machine::{NO_TWIST, Twist, displacement};
use nalgebra::Isometry3;

use crate::CureError;
use crate::cause::Cause;
use crate::formats::arm;
use crate::formats::description::Description;
use crate::head::{Change, commented, number};
use crate::job::{Format, Job};

const LINK_ERROR: &str = "link.E<c>0<A>";
const HOLDS: &[&str] = &[LINK_ERROR];
/// Components of a location error, in the order of a twist.
const COMPONENTS: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// A robot description with calibrated origins.
pub(crate) const URDF: Format = Format {
    name: "urdf",
    about: "the robot description with calibrated origins, masses and friction; --urdf FILE",
    holds: &[
        LINK_ERROR,
        arm::PAYLOAD,
        arm::LINKS,
        arm::COULOMB,
        arm::VISCOUS,
    ],
    write: urdf,
};

/// Kinematics of Universal Robots' description package.
pub(crate) const UR_KINEMATICS: Format = Format {
    name: "ur-kinematics",
    about: "default_kinematics.yaml of ur_description; --urdf FILE, expanded for that arm",
    holds: HOLDS,
    write: ur_kinematics,
};

/// Offsets of the package `robot_calibration`.
pub(crate) const ROBOT_CALIBRATION: Format = Format {
    name: "robot-calibration",
    about: "offsets of robot_calibration; --urdf FILE",
    holds: HOLDS,
    write: robot_calibration,
};

/// A joint with what was found of it.
struct Calibrated {
    nominal: Isometry3<f64>,
    twist: Twist,
}

impl Calibrated {
    fn origin(&self) -> Isometry3<f64> {
        self.nominal * displacement(&self.twist)
    }
}

/// All joints that err, by name.
fn calibrated(job: &Job<'_>) -> Result<BTreeMap<String, Calibrated>, CureError> {
    let file = job.urdf()?;
    let all = joints(&file.text)?;
    let mut found: BTreeMap<String, Calibrated> = BTreeMap::new();
    for cause in &job.causes {
        let Some((component, axis)) = component(cause) else {
            continue;
        };
        let joint = all.iter().find(|one| one.joint.name == axis);
        let joint = joint.ok_or_else(|| {
            file.wrong(format!(
                "it has no joint {axis}, in which {} was found",
                cause.name
            ))
        })?;
        let entry = found.entry(axis.to_owned()).or_insert_with(|| Calibrated {
            nominal: joint.joint.origin,
            twist: NO_TWIST,
        });
        entry.twist[component] += cause.value("e");
    }
    Ok(found)
}

/// Component of a twist and name of the joint.
fn component(cause: &Cause) -> Option<(usize, &str)> {
    let (_, of) = registry::find(&cause.name)?;
    let component = COMPONENTS
        .iter()
        .position(|&letter| Some(letter) == of.component)?;
    Some((component, of.axis))
}

fn urdf(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.urdf()?;
    if file.text.contains(job.request.digest) {
        return Err(file.wrong("it holds this report already"));
    }
    let found = calibrated(job)?;
    let mut description = Description::of(file)?;
    for (name, joint) in &found {
        description.origin(name, &joint.origin())?;
    }
    let (masses, remarks) = arm::write(job, &mut description)?;
    let changes: Vec<Change> = changes(&found).into_iter().chain(masses).collect();
    let undo = format!("use {} again", file.name);
    let mut head = job.head(&job.causes, &changes, &undo);
    let undo = head.len() - 1;
    head.splice(undo..undo, remarks);
    Ok(description.changed(&head))
}

/// Each number of an origin that differs.
fn changes(found: &BTreeMap<String, Calibrated>) -> Vec<Change> {
    let of = |(name, joint): (&String, &Calibrated)| {
        let (before, after) = (numbers(&joint.nominal), numbers(&joint.origin()));
        let pairs = before
            .into_iter()
            .zip(after)
            .zip(["x", "y", "z", "roll", "pitch", "yaw"]);
        let changed = pairs.filter(|((before, after), _)| (before - after).abs() > 1e-12);
        let change = |((before, after), what): ((f64, f64), &str)| Change {
            what: format!("{name} {what}"),
            before: Some(before),
            after,
            interval: None,
        };
        changed.map(change).collect::<Vec<_>>()
    };
    found.iter().flat_map(of).collect()
}

/// x, y, z (m), roll, pitch, yaw (rad) of an origin.
fn numbers(origin: &Isometry3<f64>) -> [f64; 6] {
    let (roll, pitch, yaw) = origin.rotation.euler_angles();
    let at = &origin.translation.vector;
    [at.x, at.y, at.z, roll, pitch, yaw]
}

/// Joints of the arm, and what `ur_description` calls the frame of each.
const UR: [(&str, &str); 6] = [
    ("shoulder_pan_joint", "shoulder"),
    ("shoulder_lift_joint", "upper_arm"),
    ("elbow_joint", "forearm"),
    ("wrist_1_joint", "wrist_1"),
    ("wrist_2_joint", "wrist_2"),
    ("wrist_3_joint", "wrist_3"),
];

fn ur_kinematics(job: &Job<'_>) -> Result<String, CureError> {
    let file = job.urdf()?;
    let found = calibrated(job)?;
    let all = joints(&file.text)?;
    let mut lines = vec!["kinematics:\n".to_owned()];
    for (joint, frame) in UR {
        let named = |one: &&TreeJoint| one.joint.name.ends_with(joint);
        let nominal = all.iter().find(named).ok_or_else(|| {
            file.wrong(format!(
                "it has no joint {joint}: it is no arm of Universal Robots"
            ))
        })?;
        let of_it = found.get(&nominal.joint.name);
        let origin = of_it.map_or(nominal.joint.origin, Calibrated::origin);
        let names = ["x", "y", "z", "roll", "pitch", "yaw"];
        let values = names.into_iter().zip(numbers(&origin));
        lines.push(format!("  {frame}:\n"));
        lines.extend(values.map(|(name, value)| format!("    {name}: {value:.15}\n")));
    }
    let undo = "give the robot's own kinematics file as kinematics_params_file again";
    let mut head = job.head(&job.causes, &changes(&found), undo);
    head.push(
        "kinematics_params_file of ur_description; the driver compares hash with the robot's own"
            .to_owned(),
    );
    let hash = (job.request.current)
        .and_then(|file| {
            file.text
                .lines()
                .find_map(|line| line.trim().strip_prefix("hash:"))
        })
        .map_or_else(String::new, |hash| format!("  hash: {}\n", hash.trim()));
    Ok(commented("#", &head) + &lines.concat() + &hash)
}

fn robot_calibration(job: &Job<'_>) -> Result<String, CureError> {
    let found = calibrated(job)?;
    let mut values: BTreeMap<String, f64> = BTreeMap::new();
    for cause in &job.causes {
        let Some((component, axis)) = component(cause) else {
            continue;
        };
        // A zero and a turn of the frame do not commute: with other errors of its joint it is one of them.
        let alone = job
            .causes
            .iter()
            .filter(|other| other.axis() == axis)
            .count()
            == 1;
        if let Some(zero) = cause.joint_zero.as_ref().filter(|_| alone) {
            values.insert(zero.joint.clone(), zero.value);
            continue;
        }
        // A frame is read where all of its components are there.
        for letter in COMPONENTS {
            values
                .entry(format!("{axis}_{}", letter.to_ascii_lowercase()))
                .or_default();
        }
        let letter = COMPONENTS[component].to_ascii_lowercase();
        *values.entry(format!("{axis}_{letter}")).or_default() += cause.value("e");
    }
    let undo = "start from offsets without these lines";
    let head = job.head(&job.causes, &changes(&found), undo);
    let lines = values
        .iter()
        .map(|(name, value)| format!("{name}: {}\n", number(*value)));
    Ok(commented("#", &head) + &lines.collect::<Vec<_>>().concat())
}
