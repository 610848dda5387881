//! `probecell import motion`: a recording or a table of a moving robot, with the description that its maker ships.

use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use bags::{Bag, Channel};
use diagnosis::Session;
use exchange::import::motion::{Motion, Settings, read};
use exchange::table::Table;
use exchange::units::Units;
use machine::JointKind;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{Message, std_msgs};
use session_io::import::{table_text_of, text_of};
use session_io::write;

use super::{TableArguments, controller_state};
use crate::{GOOD, output};

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "Two motions of one arm are compared by `probecell diagnose --fit ONE --withhold OTHER`.\n\n\
Examples:\n  \
probecell import motion my_bag --urdf ur10e.urdf --out my_motion\n  \
probecell import motion my_bag --joint-states /arm/joint_states --commands /arm/joint_commands --out my_motion\n  \
probecell import motion log.csv --urdf ur10e.urdf --units time=s,angle=rad --out my_motion \\\n      \
--columns time=timestamp,position.elbow_joint=actual_q_2,effort.elbow_joint=actual_current_2"
)]
pub(crate) struct Arguments {
    /// Recording of rosbag2 (MCAP): a folder or an .mcap file; or a table with --units.
    bag: PathBuf,
    /// Columns of a table by role, ROLE=COLUMN,..., where they are not named like their roles: time, position.JOINT, velocity.JOINT (a
    /// second), effort.JOINT (N m), command.JOINT; COLUMN is a name of the header or #N for the N-th.
    #[arg(long, default_value = "", hide_default_value = true)]
    columns: String,
    #[command(flatten)]
    table: TableArguments,
    /// Robot description (URDF, expanded from xacro); default: what the recording has on a topic `robot_description`.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Topic of what the joints did (sensor_msgs/JointState: positions, and speeds and efforts where there are any).
    #[arg(long, value_name = "TOPIC", default_value = "/joint_states")]
    joint_states: String,
    /// Topic of the commands: sensor_msgs/JointState, or what a joint trajectory controller of ros2_control says on `controller_state`;
    /// without it the efforts are compared.
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
    let (states, commands, text) = if arguments.table.units.is_empty() {
        recorded(arguments)?
    } else {
        tabulated(arguments)?
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
    let moving = moving(&session.robot_description)?;
    let names = moving.iter().map(|(name, _)| name.as_str());
    ensure!(
        foreign.len() < joints.len(),
        "no joint of {} is in the robot description, which has {}; recorded are {}",
        arguments.bag.display(),
        names.collect::<Vec<_>>().join(", "),
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
    let absent = moving.iter().map(|(name, _)| name);
    let absent: Vec<&str> = absent
        .filter(|name| !joints.contains(name))
        .map(String::as_str)
        .collect();
    if !absent.is_empty() {
        output::remark(&format!("not recorded, held at 0: {}", absent.join(", ")));
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

/// States and commands of the joints, and the robot description.
type Read = (Vec<JointState>, Vec<JointState>, String);

/// Joints of a description that move by themselves.
fn moving(urdf: &str) -> anyhow::Result<Vec<(String, JointKind)>> {
    let joints = machine::tree::joints(urdf)?
        .into_iter()
        .map(|one| one.joint);
    let moving = joints.filter(machine::Joint::moves);
    Ok(moving.map(|joint| (joint.name, joint.kind)).collect())
}

/// Of a recording.
fn recorded(arguments: &Arguments) -> anyhow::Result<Read> {
    ensure!(
        arguments.columns.is_empty(),
        "--columns is for a table, whose units are named by --units"
    );
    let name = arguments.bag.extension().unwrap_or_default();
    ensure!(
        !arguments.bag.is_file() || name == "mcap",
        "{} is no recording (.mcap, or a folder); of a table name the units: --units time=s,angle=rad",
        arguments.bag.display()
    );
    let bag = Bag::open(&arguments.bag)?;
    if let Some(damage) = bag.verify().first() {
        bail!("{}: {damage}", arguments.bag.display());
    }
    let states = messages(&bag, &arguments.joint_states)?;
    let commands = match &arguments.commands {
        Some(topic) => commands(&bag, topic)?,
        None => Vec::new(),
    };
    let text = match &arguments.urdf {
        Some(file) => text_of(file)?,
        None => description(&bag)?,
    };
    Ok((states, commands, text))
}

/// Of a table.
fn tabulated(arguments: &Arguments) -> anyhow::Result<Read> {
    let urdf = arguments.urdf.as_ref();
    let urdf = text_of(urdf.context("a table has no robot description: name the file, --urdf")?)?;
    let (text, assumed) = table_text_of(&arguments.bag)?;
    let of_file = || arguments.bag.display().to_string();
    let settings = Settings {
        columns: arguments.columns.clone(),
        layout: arguments.table.layout()?,
        units: Units::parse(&arguments.table.units).context("--units")?,
    };
    let table = Table::read(&text, settings.layout).with_context(of_file)?;
    let joints = moving(&urdf)?;
    let Motion { states, commands } = read(&table, &settings, &joints).with_context(of_file)?;
    if let Some(assumed) = assumed {
        output::remark(&assumed);
    }
    if table.left_out > 0 {
        output::remark(&format!(
            "{} rows are left out: of very many an even share is read",
            table.left_out
        ));
    }
    Ok((states, commands, urdf))
}

fn commands(bag: &Bag, topic: &str) -> anyhow::Result<Vec<JointState>> {
    let is_state = |channel: &std::sync::Arc<Channel>| channel.type_name == controller_state::TYPE;
    if !bag.channels_of(topic).any(is_state) {
        return messages(bag, topic);
    }
    let all = controller_state::commands(bag, topic)?;
    ensure!(!all.is_empty(), "{topic} has no commanded positions");
    Ok(all)
}

fn messages(bag: &Bag, topic: &str) -> anyhow::Result<Vec<JointState>> {
    let of_type = |channel: &&std::sync::Arc<Channel>| channel.type_name == JointState::TYPE.name;
    if bag.channels_of(topic).next().is_none() {
        let others = bag.channels().iter().filter(of_type);
        let others: Vec<&str> = others.map(|channel| channel.topic.as_str()).collect();
        bail!(
            "{} has no topic {topic}; joint states are on {}",
            bag.path().display(),
            if others.is_empty() {
                "none".to_owned()
            } else {
                others.join(", ")
            }
        );
    }
    let all: Result<Vec<JointState>, _> = (bag.typed::<JointState>(topic)?)
        .map(|one| one.map(|one| one.message))
        .collect();
    let all = all?;
    ensure!(!all.is_empty(), "the recording has no message on {topic}");
    Ok(all)
}

/// What the recording has on a topic `robot_description`, of whatever namespace.
fn description(bag: &Bag) -> anyhow::Result<String> {
    let topics = bag.channels().iter().map(|channel| channel.topic.as_str());
    let mut topics = topics.filter(|topic| topic.ends_with("/robot_description"));
    let topic = topics
        .next()
        .context("the recording has no robot_description: name the file, --urdf")?;
    if let Some(other) = topics.find(|other| *other != topic) {
        bail!("the recording has {topic} and {other}: name the file, --urdf");
    }
    let mut all = bag.typed::<std_msgs::String>(topic)?;
    let last = all.next().transpose()?.map(|one| one.message.data);
    last.with_context(|| format!("{topic} has no message: name the file, --urdf"))
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
