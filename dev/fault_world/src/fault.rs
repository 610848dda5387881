//! What can go wrong in a run, and the list of it that a seed stands for.

use std::fmt;

use cell::Cell;
use graph::{Wiring, topics};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64;

/// s; no fault begins later.
pub(crate) const FAULTS_END: f64 = 120.0;
/// Processes that a fault may hit. The launcher and those that only observe are left out.
pub(crate) const PROCESSES: [&str; 8] = [
    "machine_state",
    "cycle",
    "compensation",
    "analysis",
    "probe_events",
    "path_planning",
    "simulator",
    "recorder",
];
/// Processes that publish nothing on which a machine depends.
const OBSERVERS: [&str; 2] = ["gap", "visualization"];

/// One disturbance of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// s after the beginning of the session.
    pub at: f64,
    /// What happens.
    pub kind: Kind,
}

/// What may happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// For a while one message in so many on the way to a subscriber is lost.
    Lose(Route, f64, u32),
    /// For a while messages on the way to a subscriber are late by up to so many s; their order on the topic stays.
    Delay(Route, f64, f64),
    /// For a while each message on the way to a subscriber comes once more, so many s later.
    Repeat(Route, f64, f64),
    /// A process is killed and started again so many s later, with empty memory. `true`: the launcher reports it.
    Kill(&'static str, f64, bool),
    /// A process is started at first so many s after the others.
    StartsLate(&'static str, f64),
    /// A process stands still for so many s.
    Pause(&'static str, f64),
    /// The recorder stops for so many s and says so: an operator has stopped it, or the disk is full.
    RecorderStops(f64),
    /// All processes but the driver's end at once and are started again a second later, by a wall clock that has been set
    /// by so many s.
    CellRestart(f64),
    /// The wall clock is set by so many s: the launcher reports it, and operators sign by it.
    ClockSet(f64),
    /// An operator stops the machine, `true`: with a double click.
    Stop(bool),
    /// An operator asks for a part, `true`: with a double click.
    Run(bool),
    /// For so many s operators answer proposals in another way than by an approval.
    Operators(Mood, f64),
    /// A stranger puts a message on `corrections`, made from the last correction that was published.
    Forge(Forgery),
}

/// From a topic to a subscriber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// The topic.
    pub topic: &'static str,
    /// The subscriber.
    pub to: &'static str,
}

/// How operators answer proposals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mood {
    /// Not at all.
    Absent,
    /// With a rejection.
    Reject,
    /// The first one is approved, each later one rejected.
    RejectLater,
    /// Ada approves, Grace rejects at the same instant.
    Disagree,
    /// Two clicks.
    Twice,
    /// With a key that was withdrawn.
    Withdrawn,
    /// Shortly before the proposal expires.
    Late,
}

/// What a stranger makes of a correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Forgery {
    /// The same once more.
    Again,
    /// Another value, with wider bounds.
    Value,
    /// Another identifier.
    Identifier,
    /// An approval by policy without a signature.
    Unsigned,
    /// An approval by an operator whose key is not in force.
    Withdrawn,
    /// Signed by an operator, and out of all bounds: the operator's key was stolen.
    OutOfBounds,
    /// Signed by an operator, without a source measurement.
    NoSource,
    /// Signed by an operator, of another session of the driver.
    Session,
    /// Signed by an operator, and sound but for what it was computed from.
    Sound,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:7.2} s  {:?}", self.at, self.kind)
    }
}

/// All routes of messages in a cell, but those to observers.
pub fn routes(cell: &Cell) -> Vec<Route> {
    let nodes = cell.nodes(false).unwrap_or_else(|error| panic!("{error}"));
    let wiring = Wiring::of(&nodes).unwrap_or_else(|error| panic!("{error}"));
    let mut routes = Vec::new();
    for topic in topics::ALL {
        for &(node, _) in wiring.subscribers(topic.name) {
            let to = nodes[node].name();
            if !OBSERVERS.contains(&to) {
                routes.push(Route {
                    topic: topic.name,
                    to,
                });
            }
        }
    }
    routes
}

/// The faults of a seed, in order of time. Half of all seeds have few of them, which are easier to read.
pub fn of_seed(seed: u64, routes: &[Route]) -> Vec<Fault> {
    let mut random = Pcg64::seed_from_u64(seed);
    let count = if seed.is_multiple_of(2) {
        random.random_range(1..=6)
    } else {
        random.random_range(8..=24)
    };
    let mut faults: Vec<Fault> = (0..count)
        .map(|_| Fault {
            at: rounded(random.random_range(0.2..FAULTS_END)),
            kind: kind(&mut random, routes),
        })
        .collect();
    // The driver or the gate is older than the other in most runs, and now and then another process comes late.
    let late = [
        "simulator",
        "machine_state",
        "simulator",
        "machine_state",
        "",
        PROCESSES[random.random_range(0..8)],
    ];
    if let Some(&process) = late
        .choose(&mut random)
        .filter(|process| !process.is_empty())
    {
        let seconds = rounded(random.random_range(0.02_f64.ln()..6.0_f64.ln()).exp());
        faults.push(Fault {
            at: 0.0,
            kind: Kind::StartsLate(process, seconds),
        });
    }
    faults.sort_by(|one, other| one.at.total_cmp(&other.at));
    faults
}

fn kind(random: &mut Pcg64, routes: &[Route]) -> Kind {
    let route = *routes
        .choose(random)
        .unwrap_or(&Route { topic: "", to: "" });
    let process = PROCESSES.choose(random).copied().unwrap_or_default();
    let mut seconds = |from: f64, to: f64| rounded((random.random_range(from.ln()..to.ln())).exp());
    let (short, long, step) = (seconds(0.05, 5.0), seconds(1.0, 30.0), seconds(1.0, 7200.0));
    let sign = if random.random() { 1.0 } else { -1.0 };
    let twice = random.random();
    match random.random_range(0..100) {
        0..18 => Kind::Lose(route, long, random.random_range(1..=3)),
        18..32 => Kind::Delay(route, long, short),
        32..46 => Kind::Repeat(route, long, short),
        46..62 => Kind::Kill(process, short, random.random_ratio(4, 5)),
        62..70 => Kind::Pause(process, short * 2.0),
        70..74 => Kind::RecorderStops(long),
        74..75 => Kind::CellRestart(sign * step),
        75..79 => Kind::ClockSet(sign * step),
        79..83 => Kind::Stop(twice),
        83..87 => Kind::Run(twice),
        87..95 => {
            let moods = [
                Mood::Absent,
                Mood::Reject,
                Mood::RejectLater,
                Mood::Disagree,
                Mood::Twice,
                Mood::Withdrawn,
                Mood::Late,
            ];
            Kind::Operators(*moods.choose(random).unwrap_or(&Mood::Twice), long * 2.0)
        }
        _ => {
            let forgeries = [
                Forgery::Again,
                Forgery::Value,
                Forgery::Identifier,
                Forgery::Unsigned,
                Forgery::Withdrawn,
                Forgery::OutOfBounds,
                Forgery::NoSource,
                Forgery::Session,
                Forgery::Sound,
            ];
            Kind::Forge(*forgeries.choose(random).unwrap_or(&Forgery::Again))
        }
    }
}

/// To the hundredth of a second, so that a printed list is the list.
fn rounded(seconds: f64) -> f64 {
    (seconds * 100.0).round() / 100.0
}
