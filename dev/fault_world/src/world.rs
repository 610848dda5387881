//! A run: the nodes of the default cell with its simulated machine, under a list of faults.

use std::{
    cell::RefCell,
    collections::{BTreeMap, BTreeSet},
    rc::Rc,
};

use cell::Cell;
use cell_tests::{BEGIN, factories, instance, recording, session::operator_keys};
use graph::{
    Executor, Instance, Published, Running, Stamp, Topic,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{
    Correction, Fault as FaultMessage, Message, OperatorReply, OperatorRequest, PartReport,
    from_cdr, to_cdr,
};

use crate::{
    check::{Checker, Count, Invariant, Violation},
    fault::{FAULTS_END, Fault, Kind, Mood},
    operators,
    recorder::Recorder,
    settings::{PART_LIMIT, WEAR_LIMIT},
    traffic::{Shared, Traffic, chance},
};

/// s in which every part must have ended after all faults are over.
const SETTLING: f64 = 250.0;
/// s in which the part that is made last must end.
const RECOVERY: f64 = 400.0;
/// s between two batches of the step journals.
const BATCH: f64 = 0.5;

/// Puts another node in the place of one, in a proof that an invariant bites.
pub type StandIn = fn(Box<dyn Instance>) -> Box<dyn Instance>;

/// What happened in a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The first invariant that did not hold.
    pub violation: Option<Violation>,
    /// What was made.
    pub count: Count,
    /// Of the replay of what was recorded, where there was one.
    pub replay: Option<Verdict>,
}

enum Act {
    Fault(Fault),
    Start(&'static str),
    Resume(&'static str),
    Records,
    Answer(Box<Correction>, &'static str, bool),
    Send(&'static str, Vec<u8>),
    Run,
    Batch,
}

#[expect(
    clippy::struct_excessive_bools,
    reason = "what has happened to the recording, each by itself"
)]
struct World<'a> {
    cell: &'a Cell,
    seed: u64,
    stand_in: Option<StandIn>,
    executor: Executor,
    traffic: Rc<RefCell<Traffic>>,
    checker: Checker,
    acts: BTreeMap<(Stamp, u64), Act>,
    next_act: u64,
    seen: usize,
    /// What a recorder would have of the session, and why a replay may be incomplete.
    log: Vec<Published>,
    records: bool,
    incomplete: bool,
    forged: bool,
    restarted: bool,
    moods: Vec<(Stamp, Stamp, Mood)>,
    /// ns: by which the clocks of the processes, and that of the operators, are ahead of the driver's.
    ahead: i64,
    wall: i64,
    down: Vec<&'static str>,
    paused: Vec<&'static str>,
    request: u64,
    asked: u64,
    last_correction: Option<Correction>,
    last_report: Option<PartReport>,
    /// Plans by which the conformity of a part is neither proved nor refuted (ISO 14253-1).
    indeterminate: BTreeSet<String>,
    reply: Option<OperatorReply>,
    healed: bool,
}

/// Runs the cell under these faults.
pub fn run(cell: &Cell, seed: u64, faults: &[Fault], stand_in: Option<StandIn>) -> Outcome {
    let mut world = World::new(cell, seed, faults, stand_in);
    world.live();
    let replay = world.replay();
    Outcome {
        violation: world.checker.violation().cloned(),
        count: world.checker.count(),
        replay,
    }
}

impl<'a> World<'a> {
    fn new(cell: &'a Cell, seed: u64, faults: &[Fault], stand_in: Option<StandIn>) -> Self {
        let traffic = Rc::new(RefCell::new(Traffic::new(seed, faults)));
        let mut nodes = cell.nodes(false).unwrap_or_else(|error| panic!("{error}"));
        nodes.push(Box::new(Running::<Recorder>::new(true)));
        if let Some(stand_in) = stand_in {
            nodes = nodes.into_iter().map(stand_in).collect();
        }
        let names: Vec<&str> = nodes.iter().map(|node| node.name()).collect();
        let executor = Executor::new(nodes, BEGIN).unwrap_or_else(|error| panic!("{error}"));
        let mut checker = Checker::new(WEAR_LIMIT, PART_LIMIT);
        for name in names {
            checker.begins(BEGIN, name);
        }
        let mut world = Self {
            cell,
            seed,
            stand_in,
            executor: executor.over(Box::new(Shared(Rc::clone(&traffic)))),
            traffic,
            checker,
            acts: BTreeMap::new(),
            next_act: 0,
            seen: 0,
            log: Vec::new(),
            records: true,
            incomplete: false,
            forged: false,
            restarted: false,
            moods: Vec::new(),
            ahead: 0,
            wall: 0,
            down: Vec::new(),
            paused: Vec::new(),
            request: 0,
            asked: 0,
            last_correction: None,
            last_report: None,
            indeterminate: BTreeSet::new(),
            reply: None,
            healed: false,
        };
        let keys = to_cdr(&operator_keys(1, &["Eve"]));
        world.plan(BEGIN, Act::Send(topics::OPERATOR_KEYS.name, keys));
        let mut ready = BEGIN;
        for fault in faults {
            if let Kind::StartsLate(node, seconds) = fault.kind
                && !world.down.contains(&node)
            {
                world.executor.start_later(node);
                world.down.push(node);
                ready = ready.max(BEGIN.after_s(seconds));
                world.plan(BEGIN.after_s(seconds), Act::Start(node));
            }
        }
        world.plan(ready.after_s(1.0), Act::Run);
        world.plan(BEGIN.after_s(BATCH), Act::Batch);
        for fault in faults {
            world.plan(BEGIN.after_s(fault.at), Act::Fault(fault.clone()));
        }
        world
    }

    fn plan(&mut self, at: Stamp, act: Act) {
        self.acts.insert((at, self.next_act), act);
        self.next_act += 1;
    }

    fn plan_in(&mut self, seconds: f64, act: Act) {
        self.plan(self.executor.now().after_s(seconds), act);
    }

    /// Runs to an instant, or until `done`, or until an invariant does not hold. True where `done`.
    fn run_until(&mut self, end: Stamp, done: impl Fn(&Self) -> bool) -> bool {
        loop {
            let next = self.acts.first_key_value().map(|(&key, _)| key);
            let next = next.filter(|(at, _)| *at <= end);
            let until = next.map_or(end, |(at, _)| at);
            while self.executor.step(until) {
                self.observe();
                if self.checker.violation().is_some() {
                    return false;
                }
                if done(self) {
                    return true;
                }
            }
            let Some(act) = next.and_then(|key| self.acts.remove(&key)) else {
                return false;
            };
            self.act(until, act);
        }
    }

    fn live(&mut self) {
        self.run_until(BEGIN.after_s(FAULTS_END), |_| false);
        if self.checker.violation().is_some() {
            return;
        }
        self.heal();
        let settled = self.executor.now().after_s(SETTLING);
        // What has just been asked for begins, and what is over is heard of.
        self.run_until(self.executor.now().after_s(5.0), |_| false);
        self.run_until(settled, |world| world.checker.open_parts().is_empty());
        let pause = self.executor.now().after_s(12.0);
        self.run_until(pause, |_| false);
        if self.checker.violation().is_none() {
            let waiting = self.waiting();
            self.checker.end(self.executor.now(), &waiting);
            self.recover();
        }
    }

    /// Numbers of the triggers that `probe_events` holds.
    fn waiting(&self) -> Vec<u64> {
        let mut nodes = self.executor.nodes().iter();
        let node = nodes.find(|node| node.name() == "probe_events");
        let state = node.map(|node| node.snapshot()).unwrap_or_default();
        let waiting = state["waiting"].as_array().cloned().unwrap_or_default();
        (waiting.iter())
            .filter_map(|trigger| trigger["sequence"].as_u64())
            .collect()
    }

    /// The gate is started again, and has received a sample of the machine and the status of the recorder.
    fn renew_gate(&mut self) {
        self.kill("machine_state", 0.1, true);
        let limit = self.executor.now().after_s(10.0);
        let mut knows = false;
        while !knows && self.executor.now() < limit {
            let next = self.executor.now().after_s(0.01);
            self.run_until(next, |_| false);
            let mut nodes = self.executor.nodes().iter();
            let gate = nodes.find(|node| node.name() == "machine_state");
            let state = gate.map(|node| node.snapshot()).unwrap_or_default();
            knows = !self.down.contains(&"machine_state")
                && !state["controller"].is_null()
                && !state["recording"].is_null();
        }
        let then = [0.0, 0.03, 0.2, 1.0][(self.seed / 12 % 4) as usize];
        let then = self.executor.now().after_s(then);
        self.run_until(then, |_| false);
    }

    /// Everything is in order again: a part can be made, also right after a start of the gate.
    fn recover(&mut self) {
        self.renew_gate();
        self.last_report = None;
        self.reply = None;
        self.ask();
        let end = self.executor.now().after_s(RECOVERY);
        let answered = self.run_until(self.executor.now().after_s(10.0), |world| {
            world.reply.is_some()
        });
        let (now, reply) = (self.executor.now(), self.reply.clone().unwrap_or_default());
        let refuted = reply.text.contains("no part is made until");
        self.checker.expect(
            now,
            answered && (reply.accepted || refuted),
            Invariant::Recovery,
            || {
                format!(
                    "a part that was asked for last was refused: {:?}",
                    reply.text
                )
            },
        );
        if refuted || self.checker.violation().is_some() {
            return;
        }
        self.run_until(end, |world| world.last_report.is_some());
        let (now, report) = (self.executor.now(), self.last_report.clone());
        // A part whose size lies within its uncertainty of a limit is made, and given to a person to decide.
        let made = (report.as_ref()).is_some_and(|report| {
            let of_run = |plan: &String| {
                let rest = plan.strip_prefix(&report.run_id);
                rest.is_some_and(|rest| rest.starts_with('/'))
            };
            report.verdict != PartReport::STOPPED || self.indeterminate.iter().any(of_run)
        });
        self.checker.expect(now, made, Invariant::Recovery, || {
            let text = report.map_or("no report".to_owned(), |report| report.text);
            format!("the part that was asked for last was not made: {text}")
        });
    }

    /// Ends every fault.
    fn heal(&mut self) {
        self.healed = true;
        self.traffic.borrow_mut().heal();
        self.moods.clear();
        self.wall = self.ahead;
        for node in std::mem::take(&mut self.paused) {
            self.resume(node);
        }
        let now = self.executor.now();
        let waiting: Vec<(Stamp, u64)> = (self.acts.iter())
            .filter(|(_, act)| matches!(act, Act::Start(_) | Act::Records | Act::Resume(_)))
            .map(|(&key, _)| key)
            .collect();
        for key in waiting {
            if let Some(act) = self.acts.remove(&key) {
                self.act(now, act);
            }
        }
    }

    /// Looks at everything that has happened since the last look.
    fn observe(&mut self) {
        let taken = std::mem::take(&mut self.traffic.borrow_mut().taken);
        for one in &taken {
            self.checker.taken(one);
        }
        let now = self.executor.now();
        let first = self.seen;
        self.seen = self.executor.log().len();
        for index in first..self.seen {
            let published = &self.executor.log()[index];
            self.checker.published(now, published);
            let (topic, payload) = (published.topic.as_str(), &published.payload);
            if topic == topics::CORRECTIONS.name {
                let correction = decoded(topics::CORRECTIONS, payload);
                self.proposed(correction);
            } else if topic == topics::VERDICTS.name {
                let verdict: probecell_msgs::Verdict = decoded(topics::VERDICTS, payload);
                if verdict.verdict == probecell_msgs::Verdict::INDETERMINATE {
                    self.indeterminate.insert(verdict.plan_id);
                }
            } else if topic == topics::PART_REPORTS.name {
                self.last_report = Some(decoded(topics::PART_REPORTS, payload));
                if !self.healed {
                    self.plan_in(1.5, Act::Run);
                }
            } else if topic == topics::RUN_REPLIES.name {
                let reply: OperatorReply = decoded(topics::RUN_REPLIES, payload);
                if reply.request_id == self.asked {
                    self.reply = Some(reply);
                }
            }
        }
    }

    fn proposed(&mut self, correction: Correction) {
        if correction.approval == Correction::APPROVAL_NONE {
            let now = self.executor.now();
            let mood = (self.moods.iter())
                .find(|(begin, end, _)| now >= *begin && now < *end)
                .map(|(.., mood)| *mood);
            let nth = chance(&[&correction.correction_id], &[]) % 3;
            let nth = if mood == Some(Mood::RejectLater) {
                u64::from(correction.tool_number > 2)
            } else {
                nth
            };
            for (after, by, approve) in operators::answers(mood, nth) {
                let act = Act::Answer(Box::new(correction.clone()), by, approve);
                self.plan_in(after, act);
            }
        } else {
            self.last_correction = Some(correction);
        }
    }

    fn act(&mut self, now: Stamp, act: Act) {
        match act {
            Act::Fault(fault) => self.strike(now, &fault),
            Act::Start(node) => self.start(node),
            Act::Resume(node) => {
                self.paused.retain(|known| *known != node);
                self.resume(node);
            }
            Act::Records => self.set_recorder(true),
            Act::Answer(correction, by, approve) => {
                let signed_at = Stamp(now.0 + self.wall);
                self.request += 1;
                let id = self.request;
                let request = operators::request(&correction, (by, approve), signed_at, id);
                self.send(topics::APPROVALS, &request);
            }
            Act::Send(topic, payload) => self.executor.inject(now, topic, payload),
            Act::Run => self.ask(),
            Act::Batch => {
                self.batch();
                self.plan(now.after_s(BATCH), Act::Batch);
            }
        }
        self.observe();
    }

    fn send<M: Message>(&mut self, topic: Topic, message: &M) {
        assert_eq!(topic.message.name, M::TYPE.name, "{}", topic.name);
        let now = self.executor.now();
        self.executor.inject(now, topic.name, to_cdr(message));
    }

    fn operator(&mut self, subject: &str) -> OperatorRequest {
        self.request += 1;
        let now = Stamp(self.executor.now().0 + self.ahead);
        OperatorRequest {
            header: now.header(""),
            request_id: self.request,
            subject: subject.to_owned(),
            operator_name: "Ada".to_owned(),
            expires: now.after_s(10.0).time(),
            ..OperatorRequest::default()
        }
    }

    fn ask(&mut self) {
        let request = self.operator("punch");
        self.asked = request.request_id;
        self.send(topics::RUN_REQUESTS, &request);
    }

    fn strike(&mut self, now: Stamp, fault: &Fault) {
        match fault.kind {
            Kind::Lose(..) | Kind::Delay(..) | Kind::Repeat(..) | Kind::StartsLate(..) => {}
            Kind::Kill(node, down, told) => self.kill(node, down, told),
            Kind::Pause(node, seconds) => {
                if !self.down.contains(&node) && !self.paused.contains(&node) {
                    self.paused.push(node);
                    self.executor.pause(node);
                    self.checker.pauses(node);
                    self.plan_in(seconds, Act::Resume(node));
                }
            }
            Kind::RecorderStops(seconds) => {
                if !self.down.contains(&"recorder") && !self.paused.contains(&"recorder") {
                    self.set_recorder(false);
                    self.plan_in(seconds, Act::Records);
                }
            }
            Kind::CellRestart(clock) => self.restart_cell(clock),
            Kind::ClockSet(seconds) => {
                self.wall = self.ahead + (seconds * 1e9) as i64;
                let text = format!("the wall clock was set by {seconds} s");
                self.launcher_fault("launcher", FaultMessage::WARNING, "clock_set", &text);
            }
            Kind::Stop(twice) => {
                for _ in 0..=u32::from(twice) {
                    let request = self.operator("");
                    self.send(topics::STOP_REQUESTS, &request);
                }
            }
            Kind::Run(twice) => {
                for _ in 0..=u32::from(twice) {
                    self.ask();
                }
            }
            Kind::Operators(mood, seconds) => {
                self.moods.push((now, now.after_s(seconds), mood));
            }
            Kind::Forge(forgery) => {
                if let Some(last) = self.last_correction.clone() {
                    self.forged = true;
                    let at = Stamp(now.0 + self.ahead);
                    let message = operators::forged(forgery, &last, at);
                    self.send(topics::CORRECTIONS, &message);
                }
            }
        }
    }

    fn launcher_fault(&mut self, node: &str, severity: u8, code: &str, text: &str) {
        let fault = FaultMessage {
            header: Stamp(self.executor.now().0 + self.ahead).header(""),
            node: node.to_owned(),
            code: code.to_owned(),
            severity,
            text: text.to_owned(),
        };
        self.send(topics::LAUNCHER_FAULTS, &fault);
    }

    /// Ends a process. What it published of its journal in the last tenth of a second is lost in half of all cases.
    fn end(&mut self, node: &'static str) {
        self.batch();
        self.paused.retain(|known| *known != node);
        self.executor.kill(node);
        self.observe();
        let journal = topics::journal_name(node);
        let whole = chance(&[node], &[self.seed, self.executor.now().0 as u64]).is_multiple_of(2);
        self.take(|published| whole || published.topic != journal);
        self.incomplete |= !whole;
        self.checker.ended(node);
        self.down.push(node);
    }

    fn kill(&mut self, node: &'static str, down: f64, told: bool) {
        if self.down.contains(&node) {
            return;
        }
        if node == "recorder" {
            self.records = false;
            self.incomplete = true;
        }
        self.end(node);
        if told {
            let severity = FaultMessage::ERROR;
            self.launcher_fault(node, severity, FaultMessage::PROCESS_ENDED, "it was killed");
        }
        self.plan_in(down, Act::Start(node));
    }

    fn start(&mut self, node: &'static str) {
        if !self.down.contains(&node) {
            return;
        }
        self.down.retain(|known| *known != node);
        let fresh = if node == "recorder" {
            self.records = true;
            Box::new(Running::<Recorder>::new(true))
        } else {
            instance(self.cell, node)
        };
        self.restart(fresh);
        self.checker.begins(self.executor.now(), node);
    }

    fn restart(&mut self, fresh: Box<dyn Instance>) {
        let wrapped = match self.stand_in {
            Some(stand_in) => stand_in(fresh),
            None => fresh,
        };
        self.executor.restart(wrapped);
        self.observe();
    }

    fn resume(&mut self, node: &'static str) {
        self.executor.resume(node);
        if !self.down.contains(&node) {
            self.checker.begins(self.executor.now(), node);
        }
    }

    fn set_recorder(&mut self, records: bool) {
        if self.down.contains(&"recorder") {
            return;
        }
        self.batch();
        self.records = records;
        self.incomplete = true;
        self.restart(Box::new(Running::<Recorder>::new(records)));
    }

    /// The launcher ends and is started again, by another wall clock; the driver is a process of its own.
    fn restart_cell(&mut self, clock: f64) {
        let names: Vec<&'static str> = (self.executor.nodes().iter())
            .map(|node| node.name())
            .filter(|name| *name != "simulator")
            .collect();
        for &node in &names {
            if !self.down.contains(&node) {
                self.end(node);
            }
        }
        self.ahead += (clock * 1e9) as i64;
        self.wall = self.ahead;
        for &node in &names {
            self.executor.set_clock(node, self.ahead);
        }
        self.checker.new_session();
        // It is another recording.
        self.log.clear();
        self.restarted = true;
        for node in names {
            self.plan_in(1.0, Act::Start(node));
        }
    }

    fn batch(&mut self) {
        self.observe();
        self.take(|_| true);
    }

    /// Takes what was published, for the recording.
    fn take(&mut self, keep: impl Fn(&Published) -> bool) {
        let log = self.executor.take_log();
        self.seen = 0;
        if self.records {
            self.log.extend(log.into_iter().filter(keep));
        }
    }

    /// Replays what was recorded, where nobody but the nodes has spoken for them.
    fn replay(&mut self) -> Option<Verdict> {
        // Messages are published after the step that made them.
        self.executor.run_until(self.executor.now());
        self.batch();
        if self.forged || self.checker.violation().is_some() {
            return None;
        }
        let mut names = self.cell.node_names();
        // After a restart of the cell the driver's journal begins in mid-session.
        names.retain(|name| *name != "simulator" || !self.restarted);
        let report = replay(&recording(&self.log), &factories(self.cell, &names));
        let report = report.unwrap_or_else(|error| panic!("{error}"));
        let holds = match report.verdict {
            Verdict::Equal => true,
            Verdict::Incomplete => self.incomplete || self.restarted,
            Verdict::Different => false,
        };
        self.checker
            .expect(self.executor.now(), holds, Invariant::Replay, || {
                let waits = report.nodes.iter().filter_map(|node| {
                    let waits = node.waits_for.as_ref()?;
                    Some(format!("{} waits for {waits}", node.node))
                });
                let topics = (report.topics.iter())
                    .filter(|topic| topic.not_recomputed + topic.not_recorded + topic.different > 0)
                    .map(|topic| format!("{topic:?}"));
                let waits: Vec<String> = waits.chain(topics).collect();
                let first = report.first_difference.as_ref();
                let first = first.map(|one| (one.topic.clone(), one.sequence));
                format!(
                    "{:?}, first difference {first:?}, {}",
                    report.verdict,
                    waits.join(", ")
                )
            });
        Some(report.verdict)
    }
}

fn decoded<M: Message>(topic: Topic, payload: &[u8]) -> M {
    from_cdr(payload).unwrap_or_else(|error| panic!("{}: {error}", topic.name))
}
