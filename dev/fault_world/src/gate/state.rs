//! The states of the search, and the events that lead from one to another.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    hash::{DefaultHasher, Hash, Hasher},
};

use cell_tests::session::Session;
use graph::topics;
use probecell_msgs::ControllerStatus;

use super::{Bounds, NODES, store::Store};

/// The route to the driver.
pub(super) const DRIVER: u8 = NODES.len() as u8;
/// Who answers proposals.
pub(super) const OPERATORS: [&str; 2] = ["Ada", "Grace"];

/// A topic, and who receives it.
pub(super) type Route = (&'static str, u8);

/// A node: the number of its state, and how often `cycle` has published since something last happened from outside.
#[derive(Clone, Copy, Hash)]
pub(super) struct Node {
    pub(super) snapshot: u32,
    pub(super) said: u16,
}

/// What has reached the gate that runs now.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a fact of its own, in any combination"
)]
#[derive(Clone, Default, Hash)]
pub(super) struct Heard {
    /// A correction of the measurement was rejected.
    pub(super) rejected: bool,
    /// The part has ended, or is being stopped.
    pub(super) over: bool,
    /// An operator has stopped the machine.
    pub(super) stopped: bool,
    /// Period of the last new word of `cycle` on the living part, and its stamp, ns.
    pub(super) alive: (u8, i64),
    /// Number and payload of the latest list of operators' keys.
    pub(super) keys: (u64, Option<u32>),
    /// The last session of the driver.
    pub(super) session: u8,
    /// ns; begin of the process.
    pub(super) began: i64,
    /// It has commanded something since.
    pub(super) commanded: bool,
}

/// The driver and its machine.
#[derive(Clone, Default, Hash)]
pub(super) struct Driver {
    pub(super) restarts: u8,
    /// Wear of each tool, m, in bits.
    pub(super) wear: BTreeMap<u32, u64>,
    /// Numbers of the commands that it has taken.
    pub(super) taken: BTreeSet<u64>,
    /// A program runs.
    pub(super) running: bool,
}

#[derive(Clone, Hash)]
pub(super) struct State {
    pub(super) nodes: [Node; NODES.len()],
    /// Payloads on their way, the oldest first; no route is empty.
    pub(super) routes: BTreeMap<Route, Vec<u32>>,
    /// Payloads that were lost, or came already: they may come at any time.
    pub(super) late: BTreeSet<(Route, u32)>,
    pub(super) latched: BTreeMap<&'static str, Vec<u32>>,
    pub(super) left: Bounds,
    pub(super) period: u8,
    /// Events from outside so far.
    pub(super) happened: u8,
    pub(super) driver: Driver,
    /// Approved corrections on the bus so far.
    pub(super) approved: BTreeSet<u32>,
    /// Corrections that were written, and answers that were given: operator and proposal.
    pub(super) written: BTreeSet<String>,
    pub(super) answered: BTreeSet<(u8, u8)>,
    pub(super) heard: Heard,
}

/// What happens next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    Arrive(Route),
    /// A link loses it: it is fetched at any time later, or never.
    Lose(Route),
    /// It arrives, and comes once more at any time later, or never.
    Repeat(Route),
    Late(Route, u32),
    /// Proposal, operator, approved.
    Answer(u8, u8, bool),
    Withdraw,
    Stop,
    Restart(u8),
    Forge(Forged),
    Period,
}

/// What a stranger puts on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Forged {
    Unsigned,
    OutOfBounds,
    NoSource,
    NoTouch,
    Session,
    WithdrawnKey,
    Approval,
}

impl Forged {
    const ALL: [Self; 7] = [
        Self::Unsigned,
        Self::OutOfBounds,
        Self::NoSource,
        Self::NoTouch,
        Self::Session,
        Self::WithdrawnKey,
        Self::Approval,
    ];
}

fn receiver(to: u8) -> &'static str {
    NODES.get(usize::from(to)).copied().unwrap_or("driver")
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Arrive((topic, to)) => write!(f, "{topic} reaches {}", receiver(to)),
            Self::Lose((topic, to)) => write!(f, "{topic} to {} is lost", receiver(to)),
            Self::Repeat((topic, to)) => write!(f, "{topic} reaches {} once", receiver(to)),
            Self::Late((topic, to), _) => write!(f, "{topic} reaches {} late", receiver(to)),
            Self::Answer(index, by, approve) => {
                let answer = if approve { "approves" } else { "rejects" };
                let by = OPERATORS[usize::from(by)];
                write!(f, "{by} {answer} correction {}", index + 1)
            }
            Self::Withdraw => write!(f, "the key of {} is withdrawn", OPERATORS[0]),
            Self::Stop => f.write_str("an operator stops"),
            Self::Restart(who) => write!(f, "{} is restarted", receiver(who)),
            Self::Forge(what) => write!(f, "a stranger forges {what:?}"),
            Self::Period => f.write_str("1.3 s pass"),
        }
    }
}

impl State {
    pub(super) fn new(snapshots: [u32; 3], session: &Session, store: &mut Store) -> Self {
        let mut latched: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
        for topic in topics::ALL.iter().filter(|topic| topic.qos.transient_local) {
            let all = session.log().iter().filter(|one| one.topic == topic.name);
            let all: Vec<u32> = all.map(|one| store.payload(&one.payload)).collect();
            let depth = topic.qos.depth.unwrap_or(1) as usize;
            if !all.is_empty() {
                latched.insert(topic.name, all[all.len().saturating_sub(depth)..].to_vec());
            }
        }
        let sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
        let wear = sample.tool_wear.iter().map(|wear| wear.to_bits());
        let keys = latched[topics::OPERATOR_KEYS.name].last().copied();
        Self {
            nodes: snapshots.map(|snapshot| Node { snapshot, said: 0 }),
            routes: BTreeMap::new(),
            late: BTreeSet::new(),
            latched,
            left: Bounds::default(),
            period: 0,
            happened: 0,
            driver: Driver {
                wear: sample.tool_numbers.iter().copied().zip(wear).collect(),
                ..Driver::default()
            },
            approved: BTreeSet::new(),
            written: BTreeSet::new(),
            answered: BTreeSet::new(),
            heard: Heard {
                keys: (1, keys),
                commanded: true,
                ..Heard::default()
            },
        }
    }

    /// What two states are told apart by, in 128 bits.
    pub(super) fn key(&self) -> u128 {
        let half = |salt: u8| {
            let mut hasher = DefaultHasher::new();
            (salt, self).hash(&mut hasher);
            u128::from(hasher.finish())
        };
        (half(0) << 64) | half(1)
    }

    /// Everything that can happen in this state.
    pub(super) fn events(&self) -> Vec<Event> {
        let mut events = Vec::new();
        for &route in self.routes.keys() {
            events.push(Event::Arrive(route));
            if self.left.losses > 0 {
                events.push(Event::Lose(route));
            }
            if self.left.repeats > 0 {
                events.push(Event::Repeat(route));
            }
        }
        let late = self.late.iter();
        events.extend(late.map(|&(route, payload)| Event::Late(route, payload)));
        if self.left.answers > 0 {
            for (index, by) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                if !self.answered.contains(&(index, by)) {
                    events.push(Event::Answer(index, by, true));
                    events.push(Event::Answer(index, by, false));
                }
            }
        }
        if self.left.withdrawals > 0 {
            events.push(Event::Withdraw);
        }
        if self.left.stops > 0 {
            events.push(Event::Stop);
        }
        if self.left.restarts > 0 {
            events.extend((0..=DRIVER).map(Event::Restart));
        }
        if self.left.forgeries > 0 {
            events.extend(Forged::ALL.map(Event::Forge));
        }
        if self.left.periods > 0 {
            events.push(Event::Period);
        }
        events
    }

    /// Takes the oldest payload off a route.
    pub(super) fn take(&mut self, route: Route) -> Option<u32> {
        let payloads = self.routes.get_mut(&route)?;
        let first = payloads.remove(0);
        if payloads.is_empty() {
            self.routes.remove(&route);
        }
        Some(first)
    }

    /// Puts a payload on its routes.
    pub(super) fn post(&mut self, topic: &'static str, payload: u32, to: impl Iterator<Item = u8>) {
        for node in to {
            self.routes.entry((topic, node)).or_default().push(payload);
        }
        let known = topics::by_name(topic).filter(|known| known.qos.transient_local);
        if let Some(depth) = known.and_then(|known| known.qos.depth) {
            let kept = self.latched.entry(topic).or_default();
            kept.push(payload);
            if kept.len() > depth as usize {
                kept.remove(0);
            }
        }
    }

    /// Something happens from outside: time goes on.
    pub(super) fn outside(&mut self) {
        self.happened += 1;
        for node in &mut self.nodes {
            node.said = 0;
        }
    }
}
