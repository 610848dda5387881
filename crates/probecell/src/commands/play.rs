//! `probecell play`: plays back a recording on the bus.
//!
//! Topics are published under another namespace by default, so that a running cell does not take them for its own; names that
//! are published already are refused. Commands, requests and approvals are never published, under any namespace. Messages
//! are published in the order and with the spacing of their log times, at a chosen rate; `/clock` gives the recorded time.

use std::{
    collections::BTreeMap,
    io::BufRead,
    path::PathBuf,
    sync::mpsc::{Receiver, channel},
    time::{Duration, Instant},
};

use anyhow::{Context, bail};
use bags::{Bag, Durability, History, Reliability};
use clap::Args;
use graph::{Stamp, topics};
use host::bus::{self, Bus, BusConfig, Publisher, Qos, TypeId};
use probecell_msgs::{Message, rosgraph_msgs::Clock, to_cdr};

use crate::{
    output,
    own_socket::{COMMAND_PATIENCE, own_locator},
    signals,
};

/// Longest interval between two messages of `/clock`.
const CLOCK_PERIOD: Duration = Duration::from_millis(25);

/// Time in which a session that has joined discovers other publishers.
const DISCOVERY: Duration = Duration::from_millis(500);

/// Topics that make a cell act: requests of the operator and the launcher, and commands to the machine. They are never played.
fn is_command(recorded: &str) -> bool {
    let commands = |topic: &&topics::Topic| {
        topic.producer == "operator"
            || [
                topics::CONTROLLER_COMMANDS.name,
                topics::OPERATION_REQUESTS.name,
            ]
            .contains(&topic.name)
    };
    topics::ALL.iter().filter(commands).any(|topic| {
        recorded
            .strip_suffix(topic.name)
            .is_some_and(|namespace| namespace.ends_with('/'))
    })
}

/// Speeds at which a recording can be played.
const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e6;

/// What the user asks for.
#[derive(Args)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// Namespace to publish under instead of the recorded one.
    #[arg(long, default_value = "/replay")]
    namespace: String,
    /// Playback rate: 2 is twice as fast.
    #[arg(long, default_value_t = 1.0)]
    rate: f64,
    /// Start offset, in seconds.
    #[arg(long, default_value_t = 0.0)]
    start_s: f64,
    /// Loop.
    #[arg(long = "loop")]
    again: bool,
    /// Start paused: wait for a line on standard input.
    #[arg(long)]
    paused: bool,
    /// Read commands from standard input: pause, resume, seek SECONDS, rate FACTOR, quit.
    #[arg(long)]
    interactive: bool,
    /// Wait until this topic (recorded name) has a subscriber; may be repeated.
    #[arg(long)]
    wait_for: Vec<String>,
    /// Publish `/clock`.
    #[arg(long)]
    clock: bool,
    /// Zenoh endpoint of the router.
    #[arg(long, default_value = bus::ROUTER_ENDPOINT)]
    router: String,
    /// ROS domain [default: ROS_DOMAIN_ID of the environment, else 0].
    #[arg(long)]
    domain_id: Option<u32>,
}

enum PlayerCommand {
    Pause,
    Resume,
    Seek(f64),
    Rate(f64),
    Quit,
}

/// Plays the bag.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    if !RATES.contains(&arguments.rate) {
        bail!(
            "--rate {} must lie between {} and {}",
            arguments.rate,
            RATES.start(),
            RATES.end()
        );
    }
    if !arguments.start_s.is_finite() {
        bail!("--start-s {} must be a finite number", arguments.start_s);
    }
    let bag = Bag::open(&arguments.bag)?;
    let (first, last) = bag.bounds().context("the bag has no messages to play")?;
    let length_s = (last - first) as f64 * 1e-9;
    if arguments.start_s > length_s {
        bail!(
            "--start-s {} is after the end of the recording, which is {length_s:.3} s long",
            arguments.start_s
        );
    }
    let domain = (arguments.domain_id).map_or_else(cell::domain_of_environment, Ok);
    let config = BusConfig {
        endpoints: vec![own_locator(&arguments.router, COMMAND_PATIENCE)],
        domain_id: domain.map_err(anyhow::Error::msg)?,
        ..BusConfig::default()
    };
    check_names(arguments, &bag)?;
    let bus = Bus::open(&config, "play", "/")?;
    check_free(&bus, arguments, &bag)?;
    let player = Player::new(&bus, &bag, arguments)?;
    player.wait_for_subscribers(&arguments.wait_for);
    let commands = commands(arguments.interactive || arguments.paused, arguments.paused)?;
    let mut pace = Pace {
        rate: arguments.rate,
        paused: arguments.paused,
        zero: first,
        since: Instant::now(),
        at: first,
    };
    pace.seek(first + (arguments.start_s.max(0.0) * 1e9) as u64);
    loop {
        let finished = player.play_once(&bag, &mut pace, &commands, first, last)?;
        if !finished || !arguments.again {
            break;
        }
        pace.seek(first);
    }
    bus.close(Duration::from_secs(5))?;
    Ok(output::damage(&bag.damage()))
}

/// The namespace is one, and the bag has every topic that is waited for.
fn check_names(arguments: &Arguments, bag: &Bag) -> anyhow::Result<()> {
    let namespace = &arguments.namespace;
    let legal = |part: &str| {
        part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && part
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    let parts = namespace.strip_prefix('/');
    if !parts.is_some_and(|parts| parts.is_empty() || parts.split('/').all(legal)) {
        bail!("--namespace {namespace:?} is not an absolute ROS namespace, such as /replayed");
    }
    for wanted in &arguments.wait_for {
        if !bag
            .channels()
            .iter()
            .any(|channel| channel.topic == *wanted)
        {
            bail!("--wait-for {wanted}: the bag has no such topic");
        }
        if is_command(wanted) {
            bail!("--wait-for {wanted}: requests, approvals and commands are never played");
        }
    }
    Ok(())
}

/// No publisher uses the names of the playback: a running cell would mistake it for its own messages.
fn check_free(bus: &Bus, arguments: &Arguments, bag: &Bag) -> anyhow::Result<()> {
    std::thread::sleep(DISCOVERY);
    let taken = bus.graph().topics();
    for channel in bag.channels() {
        let target = target(&arguments.namespace, &channel.topic);
        if taken
            .iter()
            .any(|topic| topic.name == target && !topic.offered.is_empty())
        {
            bail!(
                "{target} is published already: a running cell would mistake the playback for its own messages; choose another \
                 --namespace"
            );
        }
    }
    Ok(())
}

/// Where a recorded topic is published.
fn target(namespace: &str, topic: &str) -> String {
    format!("{}{topic}", namespace.trim_end_matches('/'))
}

/// Where the playing stands, in recorded time.
struct Pace {
    rate: f64,
    paused: bool,
    zero: u64,
    since: Instant,
    at: u64,
}

impl Pace {
    /// Recorded time that is due now, ns.
    fn due(&self) -> u64 {
        if self.paused {
            self.at
        } else {
            self.zero + (self.since.elapsed().as_secs_f64() * self.rate * 1e9) as u64
        }
    }

    fn seek(&mut self, to: u64) {
        (self.zero, self.at, self.since) = (to, to, Instant::now());
    }

    /// Until recorded time `to` is due.
    fn wait(&self, to: u64) -> Duration {
        if self.paused {
            CLOCK_PERIOD
        } else {
            let seconds = to.saturating_sub(self.due()) as f64 * 1e-9 / self.rate;
            Duration::from_secs_f64(seconds.min(CLOCK_PERIOD.as_secs_f64()))
        }
    }
}

struct Player<'a> {
    bus: &'a Bus,
    publishers: BTreeMap<String, Publisher>,
    clock: Option<Publisher>,
}

impl<'a> Player<'a> {
    fn new(bus: &'a Bus, bag: &Bag, arguments: &Arguments) -> anyhow::Result<Self> {
        let mut publishers = BTreeMap::new();
        for channel in bag.channels() {
            if is_command(&channel.topic) || publishers.contains_key(&channel.topic) {
                continue;
            }
            let Some(ty) = type_of(channel) else {
                output::remark(&format!(
                    "{} is not played: its type {} has no hash",
                    channel.topic, channel.type_name
                ));
                continue;
            };
            let target = target(&arguments.namespace, &channel.topic);
            publishers.insert(
                channel.topic.clone(),
                bus.publisher(&target, ty, qos(channel.qos))?,
            );
        }
        let clock = if arguments.clock {
            Some(bus.publisher("/clock", Clock::TYPE, Qos::best_effort(1))?)
        } else {
            None
        };
        Ok(Self {
            bus,
            publishers,
            clock,
        })
    }

    fn wait_for_subscribers(&self, wanted: &[String]) {
        for publisher in wanted.iter().filter_map(|topic| self.publishers.get(topic)) {
            let deadline = Instant::now() + Duration::from_secs(3600);
            self.bus.wait_for_subscribers(publisher, 1, deadline);
        }
    }

    /// Plays to the end; false when the user ended it.
    fn play_once(
        &self,
        bag: &Bag,
        pace: &mut Pace,
        commands: &Receiver<PlayerCommand>,
        first: u64,
        last: u64,
    ) -> anyhow::Result<bool> {
        let seconds = |until: u64| until.saturating_sub(first) / 1_000_000_000;
        let mut from = pace.at;
        'again: loop {
            let mut published = Instant::now();
            for message in bag.messages() {
                let Ok(message) = message else { continue };
                if message.log_time < from {
                    continue;
                }
                loop {
                    let command = if pace.paused || pace.due() < message.log_time {
                        let wait = pace.wait(message.log_time).min(CLOCK_PERIOD);
                        commands.recv_timeout(wait).ok()
                    } else if let Ok(command) = commands.try_recv() {
                        Some(command)
                    } else {
                        break;
                    };
                    match command {
                        Some(PlayerCommand::Quit) => return Ok(false),
                        Some(PlayerCommand::Pause) => {
                            pace.at = pace.due();
                            pace.paused = true;
                        }
                        Some(PlayerCommand::Resume) => {
                            pace.seek(pace.at);
                            pace.paused = false;
                        }
                        Some(PlayerCommand::Rate(rate)) => {
                            pace.seek(pace.due());
                            pace.rate = rate;
                        }
                        Some(PlayerCommand::Seek(seconds)) => {
                            from = first + (seconds.max(0.0) * 1e9) as u64;
                            pace.seek(from);
                            continue 'again;
                        }
                        None => {}
                    }
                    if published.elapsed() >= CLOCK_PERIOD {
                        self.publish_clock(pace.due().min(message.log_time))?;
                        output::position("playing, s", seconds(message.log_time), seconds(last));
                        published = Instant::now();
                    }
                }
                if let Some(publisher) = self.publishers.get(&message.channel.topic) {
                    publisher.publish(message.payload.to_vec(), message.publish_time as i64)?;
                }
            }
            output::end_progress();
            return Ok(true);
        }
    }

    fn publish_clock(&self, recorded: u64) -> anyhow::Result<()> {
        if let Some(publisher) = &self.clock {
            let stamp = Stamp(recorded as i64);
            publisher.publish(
                to_cdr(&Clock {
                    clock: stamp.time(),
                }),
                stamp.0,
            )?;
        }
        Ok(())
    }
}

/// Commands from standard input, and the end by a signal.
fn commands(interactive: bool, paused: bool) -> anyhow::Result<Receiver<PlayerCommand>> {
    let (sender, receiver) = channel();
    let at_end = sender.clone();
    signals::on_end(move || drop(at_end.send(PlayerCommand::Quit)))?;
    if interactive {
        std::thread::Builder::new()
            .name("commands".to_owned())
            .spawn(move || {
                let mut waits = paused;
                for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                    match command(&line) {
                        Some(command) => {
                            waits &= !matches!(command, PlayerCommand::Resume);
                            drop(sender.send(command));
                        }
                        None => output::remark(
                            "commands are: pause, resume, seek SECONDS, rate FACTOR, quit",
                        ),
                    }
                }
                if waits {
                    output::remark("standard input ended while paused: playback cannot be resumed");
                    drop(sender.send(PlayerCommand::Quit));
                }
            })?;
    }
    Ok(receiver)
}

fn command(line: &str) -> Option<PlayerCommand> {
    let mut words = line.split_whitespace();
    let command = match words.next() {
        None | Some("resume") => PlayerCommand::Resume,
        Some("pause") => PlayerCommand::Pause,
        Some("quit") => PlayerCommand::Quit,
        Some("seek") => PlayerCommand::Seek(
            words
                .next()?
                .parse()
                .ok()
                .filter(|seconds: &f64| seconds.is_finite())?,
        ),
        Some("rate") => PlayerCommand::Rate(
            words
                .next()?
                .parse()
                .ok()
                .filter(|rate| RATES.contains(rate))?,
        ),
        Some(_) => return None,
    };
    Some(command)
}

/// The type on the bus, with the hash of this program where the bag has none.
fn type_of(channel: &bags::Channel) -> Option<TypeId> {
    let known = probecell_msgs::by_name(&channel.type_name);
    let (package, name) = channel.type_name.split_once("/msg/")?;
    let hash = if channel.type_hash.is_empty() {
        known?.type_hash.to_owned()
    } else {
        channel.type_hash.clone()
    };
    Some(TypeId::new(format!("{package}::msg::dds_::{name}_"), hash))
}

fn qos(recorded: bags::Qos) -> Qos {
    Qos {
        reliability: match recorded.reliability {
            Reliability::Reliable => bus::Reliability::Reliable,
            Reliability::BestEffort => bus::Reliability::BestEffort,
        },
        durability: match recorded.durability {
            Durability::Volatile => bus::Durability::Volatile,
            Durability::TransientLocal => bus::Durability::TransientLocal,
        },
        history: match recorded.history {
            History::KeepLast(depth) => bus::History::KeepLast(depth as usize),
            History::KeepAll => bus::History::KeepAll,
        },
        lifespan: None,
    }
}
