//! `probecell import contacts`: a recording of ROS 2 with positions over time and a contact signal.

mod clocks;

use std::collections::BTreeSet;
use std::path::PathBuf;

use anyhow::{Context, bail, ensure};
use bags::Bag;
use cell::{Cell, CellText};
use exchange::import::contacts::{self, Motion};
use machine::Chain;
use machine::contact_position::POSITION_LIMIT;
use probecell_msgs::Message;
use probecell_msgs::geometry_msgs::PoseStamped;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::std_msgs::{Bool, Header};
use session_io::import;
use session_io::imported::Source;

use self::clocks::{CLOCK_RESOLUTION, Clock, Clocks, Lag, PASSED, lag};
use super::{OutArguments, REVISION, write};
use crate::output;

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "A touch is where the signal (std_msgs/Bool) rises, with --normally-closed where it falls; the position is that of the approach at the instant of its publication, less --delay-ms.\n\n\
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
    /// The signal is high at rest and falls at the contact.
    #[arg(long)]
    normally_closed: bool,
    /// Take the instants at which the recorder received positions and contacts, instead of their stamps.
    #[arg(long)]
    log_times: bool,
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
    /// Maximum error of the position at a contact where it is interpolated across it.
    #[arg(long, value_name = "UM", default_value_t = POSITION_LIMIT * 1e6)]
    position_limit_um: f64,
    /// Skip contacts that match no point of the plan, or whose position is not known; they are listed, and the exit status is 3.
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
        (arguments.position_limit_um, "--position-limit-um"),
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
    let cell = (arguments.cell.as_deref()).map(Cell::read).transpose()?;
    let (machine, mut plan) = match (&cell, &arguments.plan) {
        (Some(cell), _) => {
            output::with_progress(|progress| import::machine_of_cell(cell, progress))?
        }
        (None, Some(path)) => import::machine_of_bag(path)?,
        (None, None) => bail!("name the plan that was measured: --cell or --plan"),
    };
    let mut machine = machine;
    if let Some(radius) = arguments.ball_radius_mm {
        plan.stylus.ball_radius = radius * 1e-3;
        machine.stylus.ball_radius = radius * 1e-3;
    }
    let mut remarks = Vec::new();
    let clock = if arguments.log_times {
        Clock::Recorder
    } else {
        Clock::Stamps
    };
    let (topic, (motion, positions)) = match (&arguments.pose, &arguments.joint_states) {
        (Some(topic), _) => (topic, poses(&bag, topic, clock)?),
        (None, Some(topic)) => {
            let urdf = &machine.urdf;
            let joints = joints(&bag, topic, &arguments.joints, urdf, clock, &mut remarks)?;
            (topic, joints)
        }
        (None, None) => bail!("name the topic of the positions: --pose or --joint-states"),
    };
    let (signal, contacts) = signal(&bag, arguments, clock)?;
    let clocks = Clocks {
        topics: [topic, &arguments.contact],
        of: [positions, contacts],
    };
    clocks.check(PASSED, PASSED)?;
    plan.plan_id = arguments.out.name(&arguments.bag)?;
    let settings = contacts::Settings {
        plan,
        machine: Some(machine),
        delay: arguments.delay_ms * 1e-3,
        time_uncertainty: arguments.time_uncertainty_ms * 1e-3,
        within: arguments.within_mm * 1e-3,
        position_limit: arguments.position_limit_um * 1e-6,
        skip_strays: arguments.skip_strays,
    };
    let read = contacts::read(&motion, &signal, &settings)
        .with_context(|| arguments.bag.display().to_string())?;
    let (mut imported, speed) = (read.imported, read.fastest);
    let stated = 3.0 * arguments.time_uncertainty_ms * 1e-3;
    let limit = (POSITION_LIMIT / speed.max(POSITION_LIMIT))
        .max(stated)
        .max(CLOCK_RESOLUTION);
    remarks.extend(clocks.check(limit, PASSED)?);
    imported.remarks.extend(remarks);
    if arguments.log_times {
        imported.remarks.push(
            "instants are those at which the recorder received the messages: the two topics may be late by different times"
                .to_owned(),
        );
    }
    imported.remarks.push(format!(
        "{} rises of {} at up to {:.1} mm/s: 1 ms of delay is {:.1} um",
        imported.events.len(),
        arguments.contact,
        speed * 1e3,
        speed * 1e3
    ));
    let own = arguments.out.settings().map(|mut settings| {
        let of_time = arguments.time_uncertainty_ms * 1e-3 * speed * 1e6;
        // The error of a position is somewhere within its bound.
        let of_position = read.position_bound / 3.0_f64.sqrt() * 1e6;
        settings.touch_standard_uncertainty_um = settings
            .touch_standard_uncertainty_um
            .hypot(of_time)
            .hypot(of_position);
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
            ("log_times", arguments.log_times.to_string()),
            ("normally_closed", arguments.normally_closed.to_string()),
        ],
        cell: cell.as_ref().map(|cell| CellText::clone(cell.text())),
        revision: REVISION,
    };
    write(&arguments.out.out, &imported, analysis.as_ref(), &source)
}

/// A message with the instant of its publication and that of its reception, s since 1970.
struct Dated<M> {
    published: f64,
    received: f64,
    message: M,
}

/// Messages of a topic in the order of the recording.
fn messages<M: Message>(bag: &Bag, topic: &str) -> anyhow::Result<Vec<Dated<M>>> {
    let mut all = Vec::new();
    for one in bag.typed::<M>(topic)? {
        let one = one?;
        // A recorder that knows no instant of publication writes that of reception, or none.
        let published = if one.publish_time == 0 {
            one.log_time
        } else {
            one.publish_time
        };
        let received = Dated {
            published: published as f64 * 1e-9,
            received: one.log_time as f64 * 1e-9,
            message: one.message,
        };
        all.push((one.sequence, received));
    }
    // A recording is read by its times, which a clock that goes back has mixed; the numbers of the recorder tell the order.
    let numbers: BTreeSet<u32> = all.iter().map(|one| one.0).collect();
    if numbers.len() == all.len() {
        all.sort_by_key(|one| one.0);
    }
    Ok(all.into_iter().map(|(_, received)| received).collect())
}

fn instant(header: &Header) -> f64 {
    f64::from(header.stamp.sec) + f64::from(header.stamp.nanosec) * 1e-9
}

/// The level of the contact: high where the probe touches.
fn signal(
    bag: &Bag,
    arguments: &Arguments,
    clock: Clock,
) -> anyhow::Result<(Vec<(f64, bool)>, Lag)> {
    let messages = messages::<Bool>(bag, &arguments.contact)?;
    let times: Vec<(f64, f64)> = messages
        .iter()
        .map(|one| (one.published, one.received))
        .collect();
    let lag = lag(&times, &arguments.contact, clock)?;
    let mut signal: Vec<(f64, bool)> = messages
        .into_iter()
        .map(|one| {
            let at = match clock {
                Clock::Stamps => one.published,
                Clock::Recorder => one.received,
            };
            (at, one.message.data != arguments.normally_closed)
        })
        .collect();
    put_in_order(&mut signal, &arguments.contact)?;
    Ok((signal, lag))
}

fn poses(bag: &Bag, topic: &str, clock: Clock) -> anyhow::Result<(Motion, Lag)> {
    let messages = messages::<PoseStamped>(bag, topic)?;
    let samples = messages.into_iter().map(|one| {
        let at = one.message.pose.position;
        Sample {
            stamp: instant(&one.message.header),
            received: one.received,
            numbers: vec![at.x, at.y, at.z],
        }
    });
    in_order(
        &["x", "y", "z"].map(str::to_owned),
        samples.collect(),
        topic,
        clock,
    )
}

/// Positions with their stamp and the instant of reception, s.
struct Sample {
    stamp: f64,
    received: f64,
    numbers: Vec<f64>,
}

/// Joint states, joints by the names of the axes that they are named for. Positions belong to the names of their own message;
/// messages of other joints alone are passed over, and so are those without any position.
fn joints(
    bag: &Bag,
    topic: &str,
    named: &str,
    urdf: &str,
    clock: Clock,
    remarks: &mut Vec<String>,
) -> anyhow::Result<(Motion, Lag)> {
    let mut renamed = Vec::new();
    for pair in named.split(',').filter(|pair| !pair.is_empty()) {
        let pair = pair
            .split_once('=')
            .context("--joints must be AXIS=JOINT,...")?;
        renamed.push(pair);
    }
    let chain = Chain::from_urdf(urdf)?;
    let of_axis = |axis: &str| {
        let own = renamed.iter().find(|(name, _)| *name == axis);
        own.map_or(axis, |(_, joint)| joint).to_owned()
    };
    let axes: Vec<String> = chain.axis_names().map(str::to_owned).collect();
    let wanted: Vec<String> = axes.iter().map(|axis| of_axis(axis)).collect();
    let mut samples = Vec::new();
    let mut others = BTreeSet::new();
    let (mut passed_over, mut empty) = (0, 0);
    for one in messages::<JointState>(bag, topic)? {
        let message = one.message;
        let at = instant(&message.header);
        let place = |joint: &String| message.name.iter().position(|name| name == joint);
        let places: Vec<Option<usize>> = wanted.iter().map(place).collect();
        if places.iter().all(Option::is_none) {
            passed_over += 1;
            others.extend(message.name);
            continue;
        }
        if message.position.is_empty() {
            empty += 1;
            continue;
        }
        let mut positions = Vec::with_capacity(wanted.len());
        for (joint, place) in wanted.iter().zip(places) {
            let position = place.and_then(|place| message.position.get(place));
            positions.push(*position.with_context(|| {
                format!(
                    "{topic}: the message stamped {at:.6} s has no position of joint {joint}; it has {}",
                    message.name.join(", ")
                )
            })?);
        }
        samples.push(Sample {
            stamp: at,
            received: one.received,
            numbers: positions,
        });
    }
    let others: Vec<String> = others.into_iter().collect();
    ensure!(
        !samples.is_empty() || empty == 0,
        "no message of {topic} has a position"
    );
    ensure!(
        !samples.is_empty(),
        "the recording has no joint {}; it has {}",
        wanted.join(", "),
        others.join(", ")
    );
    if passed_over > 0 {
        remarks.push(format!(
            "{passed_over} messages of {topic} have no joint of the machine and are passed over ({})",
            others.join(", ")
        ));
    }
    if empty > 0 {
        remarks.push(format!(
            "{empty} messages of {topic} have no positions and are passed over"
        ));
    }
    let (motion, lag) = in_order(&wanted, samples, topic, clock)?;
    Ok((
        Motion {
            joints: axes,
            ..motion
        },
        lag,
    ))
}

/// A motion of samples, whose numbers have these names.
fn in_order(
    names: &[String],
    samples: Vec<Sample>,
    topic: &str,
    clock: Clock,
) -> anyhow::Result<(Motion, Lag)> {
    for sample in &samples {
        let mut named = names.iter().zip(&sample.numbers);
        if let Some((name, number)) = named.find(|(_, number)| !number.is_finite()) {
            bail!(
                "{topic}: the message stamped {:.6} s has {name} = {number}, which is no position",
                sample.stamp
            );
        }
    }
    let times: Vec<(f64, f64)> = samples
        .iter()
        .map(|sample| (sample.stamp, sample.received))
        .collect();
    let lag = lag(&times, topic, clock)?;
    let mut samples: Vec<(f64, Vec<f64>)> = samples
        .into_iter()
        .map(|sample| match clock {
            Clock::Stamps => (sample.stamp, sample.numbers),
            Clock::Recorder => (sample.received, sample.numbers),
        })
        .collect();
    put_in_order(&mut samples, topic)?;
    samples.dedup_by(|a, b| a.0 == b.0);
    Ok((
        Motion {
            joints: Vec::new(),
            samples,
        },
        lag,
    ))
}

/// Puts messages in order that passed each other; a clock that goes back is another matter.
fn put_in_order<T>(samples: &mut [(f64, T)], topic: &str) -> anyhow::Result<()> {
    let mut latest = f64::NEG_INFINITY;
    for (index, (at, _)) in samples.iter().enumerate() {
        ensure!(
            latest - at < PASSED,
            "the clock of {topic} goes back by {:.1} s, to {at:.6} s, after {index} of {} messages: cut the recording there",
            latest - at,
            samples.len()
        );
        latest = latest.max(*at);
    }
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::put_in_order;

    #[test]
    fn a_clock_that_goes_back_is_refused_and_messages_that_pass_each_other_are_put_in_order() {
        let mut passed = [(1.0, 'a'), (1.02, 'c'), (1.01, 'b')];
        put_in_order(&mut passed, "/joint_states").expect("they passed each other");
        assert_eq!(passed.map(|one| one.1), ['a', 'b', 'c']);
        let mut back = [(10.0, ()), (10.1, ()), (0.3, ()), (0.4, ())];
        let told = put_in_order(&mut back, "/joint_states").expect_err("it goes back");
        let says = "the clock of /joint_states goes back by 9.8 s, to 0.300000 s, after 2 of 4 messages: cut the recording there";
        assert_eq!(told.to_string(), says);
    }
}
