//! `probecell import motion`: a recording of a moving robot, with the description that its maker ships.

use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use bags::Bag;
use diagnosis::Session;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::std_msgs;
use session_io::import::text_of;
use session_io::write;

use crate::{GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "Two motions of one arm are compared by `probecell diagnose --fit ONE --withhold OTHER`.\n\n\
Examples:\n  \
probecell import motion my_bag --urdf ur10e.urdf --out my_motion\n  \
probecell import motion my_bag --joint-states /arm/joint_states --commands /arm/joint_commands --out my_motion"
)]
pub(crate) struct Arguments {
    /// Recording of rosbag2 (MCAP): a folder or an .mcap file.
    bag: PathBuf,
    /// Robot description (URDF, expanded from xacro); default: what the recording has on `robot_description`.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Topic of what the joints did (sensor_msgs/JointState: positions, and speeds and efforts where there are any).
    #[arg(long, value_name = "TOPIC", default_value = "/joint_states")]
    joint_states: String,
    /// Topic of the commands (sensor_msgs/JointState); without it the efforts are compared.
    #[arg(long, value_name = "TOPIC")]
    commands: Option<String>,
    /// Link that carries the tool; default: the one behind the most joints of the recording.
    #[arg(long, value_name = "LINK")]
    mount: Option<String>,
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let bag = Bag::open(&arguments.bag)?;
    if let Some(damage) = bag.verify().first() {
        bail!("{}: {damage}", arguments.bag.display());
    }
    let states = messages(&bag, &arguments.joint_states)?;
    let commands = match &arguments.commands {
        Some(topic) => messages(&bag, topic)?,
        None => Vec::new(),
    };
    let text = match &arguments.urdf {
        Some(file) => text_of(file)?,
        None => description(&bag)?,
    };
    let mut joints: Vec<String> = states.iter().flat_map(|state| state.name.clone()).collect();
    joints.sort_unstable();
    joints.dedup();
    let made = machine::as_cell(&text, arguments.mount.as_deref(), &joints)?;
    let mut session = Session {
        name: arguments.out.display().to_string(),
        robot_description: made.text,
        joint_states: states,
        joint_commands: commands,
        ..Session::default()
    };
    // Joints of other machines on the same topic are no part of this one.
    let known = machine::tree::joint_names(&session.robot_description)?;
    let foreign: Vec<&String> = joints
        .iter()
        .filter(|joint| !known.contains(joint))
        .collect();
    ensure!(
        foreign.len() < joints.len(),
        "{} has no joint of the description; it has {}",
        arguments.joint_states,
        joints.join(", ")
    );
    for all in [&mut session.joint_states, &mut session.joint_commands] {
        for message in all.iter_mut() {
            keep(message, &known);
        }
        all.retain(|message| !message.name.is_empty());
    }
    effects::session::check_drives(&session)?;
    let count = |of: &dyn Fn(&JointState) -> bool| {
        session.joint_states.iter().filter(|one| of(one)).count()
    };
    let (efforts, speeds) = (
        count(&|one| !one.effort.is_empty()),
        count(&|one| !one.velocity.is_empty()),
    );
    write::write(&arguments.out, "cell", &session)?;
    output::line(&format!(
        "{} states of {} joints, {speeds} with speeds, {efforts} with efforts, {} commands; taken as rad, rad/s and N m (m and N for sliding joints)",
        session.joint_states.len(),
        joints.len() - foreign.len(),
        session.joint_commands.len(),
    ));
    if !foreign.is_empty() {
        let names: Vec<&str> = foreign.iter().map(|one| one.as_str()).collect();
        output::remark(&format!(
            "not in the description, left out: {}",
            names.join(", ")
        ));
    }
    if !made.added.is_empty() {
        output::line(&format!(
            "added to the description: {}",
            made.added.join("; ")
        ));
    }
    output::line(&format!("written to {}", arguments.out.display()));
    Ok(GOOD)
}

fn messages(bag: &Bag, topic: &str) -> anyhow::Result<Vec<JointState>> {
    let all: Result<Vec<JointState>, _> = (bag.typed::<JointState>(topic)?)
        .map(|one| one.map(|one| one.message))
        .collect();
    let all = all?;
    ensure!(!all.is_empty(), "the recording has no message on {topic}");
    Ok(all)
}

/// What the recording has on a topic `robot_description`.
fn description(bag: &Bag) -> anyhow::Result<String> {
    let last = |topic: &str| -> anyhow::Result<Option<String>> {
        let Ok(mut all) = bag.typed::<std_msgs::String>(topic) else {
            return Ok(None);
        };
        Ok(all.next().transpose()?.map(|one| one.message.data))
    };
    last("/robot_description")?
        .context("the recording has no /robot_description: name the file, --urdf")
}

/// Leaves out the joints that are not among some.
fn keep(message: &mut JointState, known: &[String]) {
    let kept: Vec<usize> = (0..message.name.len())
        .filter(|&at| known.contains(&message.name[at]))
        .collect();
    if kept.len() == message.name.len() {
        return;
    }
    let pick = |values: &[f64]| -> Vec<f64> {
        kept.iter()
            .filter_map(|&at| values.get(at).copied())
            .collect()
    };
    message.position = pick(&message.position);
    message.velocity = pick(&message.velocity);
    message.effort = pick(&message.effort);
    message.name = kept.iter().map(|&at| message.name[at].clone()).collect();
}
