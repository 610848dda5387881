//! `probecell import contacts`: a recording of ROS 2 with positions over time and a contact signal.

use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use bags::Bag;
use cell::{Cell, CellText};
use exchange::import::contacts::{self, Motion};
use probecell_msgs::Message;
use probecell_msgs::geometry_msgs::PoseStamped;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::std_msgs::{Bool, Header};
use session_io::import;

use super::super::plan;
use super::{OutArguments, Source, write};

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "A touch is where the signal (std_msgs/Bool) rises; the position is interpolated to the instant of its publication, less --delay-ms.\n\n\
Examples:\n  \
probecell import contacts my_bag --pose /tcp --contact /probe --plan my_plan --out my_session\n  \
probecell import contacts my_bag --joint-states /joint_states --contact /probe --cell robot.toml --out my_session"
)]
pub(crate) struct Arguments {
    /// Recording of rosbag2 (MCAP): a folder or an .mcap file.
    bag: PathBuf,
    /// Topic of the centre of the ball in the part frame (geometry_msgs/PoseStamped).
    #[arg(long, value_name = "TOPIC", required_unless_present = "joint_states")]
    pose: Option<String>,
    /// Topic of the joints (sensor_msgs/JointState), by the names of the machine's axes.
    #[arg(long, value_name = "TOPIC", conflicts_with = "pose")]
    joint_states: Option<String>,
    /// Joints whose names differ: AXIS=JOINT,...
    #[arg(
        long,
        value_name = "NAMES",
        requires = "joint_states",
        default_value = "",
        hide_default_value = true
    )]
    joints: String,
    /// Topic of the contact signal (std_msgs/Bool).
    #[arg(long, value_name = "TOPIC")]
    contact: String,
    /// Cell file with the plan that was measured, and its machine.
    #[arg(long, value_name = "CELL", required_unless_present = "plan")]
    cell: Option<PathBuf>,
    /// Bag with the plan that was measured, as `import plan` makes it, and its machine.
    #[arg(long, value_name = "BAG", conflicts_with = "cell")]
    plan: Option<PathBuf>,
    /// Radius of the stylus ball, where the plan does not say it.
    #[arg(long, value_name = "MM")]
    ball_radius_mm: Option<f64>,
    /// Delay of the signal after the contact.
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    delay_ms: f64,
    /// Standard uncertainty of the instant of contact; multiplied by the speed, it contributes to that of a touch.
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0.0,
        requires = "touch_uncertainty_um"
    )]
    time_uncertainty_ms: f64,
    /// Maximum distance of a touch from its point of the plan.
    #[arg(long, value_name = "MM", default_value_t = 2.0)]
    within_mm: f64,
    /// Skip contacts that match no point of the plan; they are listed, and the exit status is 3.
    #[arg(long)]
    skip_strays: bool,
    #[command(flatten)]
    out: OutArguments,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    for (value, option) in [
        (arguments.delay_ms.abs(), "--delay-ms"),
        (arguments.time_uncertainty_ms, "--time-uncertainty-ms"),
        (arguments.within_mm, "--within-mm"),
        (arguments.ball_radius_mm.unwrap_or(0.0), "--ball-radius-mm"),
    ] {
        ensure!(
            value.is_finite() && value >= 0.0,
            "{option} must be a number that is not negative"
        );
    }
    let bag = Bag::open(&arguments.bag)?;
    if let Some(damage) = bag.verify().first() {
        bail!("{}: {damage}", arguments.bag.display());
    }
    let motion = match (&arguments.pose, &arguments.joint_states) {
        (Some(topic), _) => poses(&bag, topic)?,
        (None, Some(topic)) => joints(&bag, topic, &arguments.joints)?,
        (None, None) => bail!("name the topic of the positions: --pose or --joint-states"),
    };
    let signal: Vec<(f64, bool)> = messages::<Bool>(&bag, &arguments.contact)?
        .map(|(at, message)| (at, message.data))
        .collect();
    let cell = (arguments.cell.as_deref()).map(Cell::read).transpose()?;
    let (machine, mut plan) = match (&cell, &arguments.plan) {
        (Some(cell), _) => plan::shown(|progress| import::machine_of_cell(cell, progress))?,
        (None, Some(path)) => import::machine_of_bag(path)?,
        (None, None) => bail!("name the plan that was measured: --cell or --plan"),
    };
    let mut machine = machine;
    if let Some(radius) = arguments.ball_radius_mm {
        plan.stylus.ball_radius = radius * 1e-3;
        machine.stylus.ball_radius = radius * 1e-3;
    }
    plan.plan_id = arguments.out.name(&arguments.bag)?;
    let settings = contacts::Settings {
        plan,
        machine: Some(machine),
        delay: arguments.delay_ms * 1e-3,
        within: arguments.within_mm * 1e-3,
        skip_strays: arguments.skip_strays,
    };
    let (mut imported, speed) = contacts::read(&motion, &signal, &settings)
        .with_context(|| arguments.bag.display().to_string())?;
    imported.remarks.push(format!(
        "{} rises of {} at up to {:.1} mm/s: 1 ms of delay is {:.1} um",
        imported.events.len(),
        arguments.contact,
        speed * 1e3,
        speed * 1e3
    ));
    let own = arguments.out.settings().map(|mut settings| {
        let of_time = arguments.time_uncertainty_ms * 1e-3 * speed * 1e6;
        settings.touch_standard_uncertainty_um =
            settings.touch_standard_uncertainty_um.hypot(of_time);
        settings
    });
    let analysis = own.or_else(|| cell.as_ref().map(|cell| cell.analysis.clone()));
    let topics = [&arguments.pose, &arguments.joint_states]
        .into_iter()
        .flatten();
    let source = Source {
        kind: "contacts",
        files: Vec::new(),
        settings: vec![
            ("bag", arguments.bag.display().to_string()),
            ("positions", topics.cloned().collect()),
            ("contact", arguments.contact.clone()),
            ("delay_ms", arguments.delay_ms.to_string()),
        ],
        cell: cell.as_ref().map(|cell| CellText::clone(cell.text())),
    };
    write(&arguments.out.out, &imported, analysis.as_ref(), &source)
}

/// Messages of a topic in the order of their publication, s since 1970.
fn messages<M: Message>(bag: &Bag, topic: &str) -> anyhow::Result<impl Iterator<Item = (f64, M)>> {
    let mut all = Vec::new();
    for one in bag.typed::<M>(topic)? {
        let one = one?;
        // A recorder that knows no instant of publication writes that of reception, or none.
        let at = if one.publish_time == 0 {
            one.log_time
        } else {
            one.publish_time
        };
        all.push((at as f64 * 1e-9, one.message));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(all.into_iter())
}

fn instant(header: &Header) -> f64 {
    f64::from(header.stamp.sec) + f64::from(header.stamp.nanosec) * 1e-9
}

fn poses(bag: &Bag, topic: &str) -> anyhow::Result<Motion> {
    let samples = messages::<PoseStamped>(bag, topic)?.map(|(_, message)| {
        let at = message.pose.position;
        (instant(&message.header), vec![at.x, at.y, at.z])
    });
    in_order(Vec::new(), samples.collect(), topic)
}

/// Joint states, joints by the names of the axes that they are named for.
fn joints(bag: &Bag, topic: &str, named: &str) -> anyhow::Result<Motion> {
    let mut renamed = Vec::new();
    for pair in named.split(',').filter(|pair| !pair.is_empty()) {
        let pair = pair
            .split_once('=')
            .context("--joints must be AXIS=JOINT,...")?;
        renamed.push(pair);
    }
    let mut names: Vec<String> = Vec::new();
    let mut samples = Vec::new();
    for (_, message) in messages::<JointState>(bag, topic)? {
        if names.is_empty() {
            names.clone_from(&message.name);
        }
        ensure!(
            message.name == names && message.position.len() == names.len(),
            "{topic}: the joints are not the same in every message, with a position each"
        );
        samples.push((instant(&message.header), message.position));
    }
    for name in &mut names {
        if let Some((axis, _)) = renamed.iter().find(|(_, joint)| joint == name) {
            *name = (*axis).to_owned();
        }
    }
    in_order(names, samples, topic)
}

fn in_order(
    joints: Vec<String>,
    mut samples: Vec<(f64, Vec<f64>)>,
    topic: &str,
) -> anyhow::Result<Motion> {
    let finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
    ensure!(
        samples.iter().all(|(_, numbers)| finite(numbers)),
        "{topic}: a position is not a finite number"
    );
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    samples.dedup_by(|a, b| a.0 == b.0);
    Ok(Motion { joints, samples })
}
