//! A session on virtual time in which a test takes part, as an operator or with invalid messages.

use cell::Cell;
use graph::{Executor, Published, Stamp, Topic, topics};
use probecell_msgs::{Correction, Fault, Message, OperatorRequest, PartReport, to_cdr};

use crate::{BEGIN, begin, executor, instance, messages};

/// Longest virtual time that anything may take, s.
const LIMIT: f64 = 600.0;

/// A session under way and everything published in it so far.
pub struct Session {
    executor: Executor,
    log: Vec<Published>,
}

impl Session {
    /// A session of all nodes of the cell; the controller has reported its state.
    pub fn new(cell: &Cell) -> Self {
        Self::begin(executor(cell))
    }

    /// The same with nodes started for a recording.
    pub fn replayed(cell: &Cell) -> Self {
        let nodes = cell.nodes(true).unwrap_or_else(|error| panic!("{error}"));
        Self::begin(begin(nodes))
    }

    fn begin(executor: Executor) -> Self {
        let mut session = Self {
            executor,
            log: Vec::new(),
        };
        session.run_s(0.5);
        session
    }

    /// Publishes a message, now.
    pub fn send<M: Message>(&mut self, topic: Topic, message: &M) {
        assert_eq!(topic.message.name, M::TYPE.name, "{}", topic.name);
        self.executor
            .inject(self.executor.now(), topic.name, to_cdr(message));
    }

    /// Advances the virtual time.
    pub fn run_s(&mut self, seconds: f64) {
        let until = self.now().after_s(seconds);
        self.executor.run_until(until);
        self.log.append(&mut self.executor.take_log());
    }

    /// Runs until the next publication on the topic.
    pub fn run_to(&mut self, topic: Topic) {
        let until = self.now().after_s(LIMIT);
        let published = self.executor.run_until_published(topic.name, until);
        assert!(
            published,
            "nothing on {} within {LIMIT} s of virtual time",
            topic.name
        );
        self.log.append(&mut self.executor.take_log());
    }

    /// Ends the process of a node; nothing starts it again but [`Session::restart`].
    pub fn kill(&mut self, name: &str) {
        self.executor.kill(name);
        self.log.append(&mut self.executor.take_log());
    }

    /// Starts the process of a node again, as the launcher does.
    pub fn restart(&mut self, cell: &Cell, name: &str) {
        self.executor.restart(instance(cell, name));
        self.log.append(&mut self.executor.take_log());
    }

    /// The instant of the last event.
    pub fn now(&self) -> Stamp {
        self.executor.now()
    }

    /// What was published on a topic so far.
    pub fn all<M: Message>(&self, topic: Topic) -> Vec<M> {
        messages(&self.log, topic.name)
    }

    /// What was published last on a topic.
    pub fn last<M: Message>(&self, topic: Topic) -> M {
        self.all(topic)
            .pop()
            .unwrap_or_else(|| panic!("nothing was published on {}", topic.name))
    }

    /// Codes of the faults on all topics so far.
    pub fn fault_codes(&self) -> Vec<String> {
        let faults = self
            .log
            .iter()
            .filter(|published| published.topic.ends_with("/faults"));
        faults
            .map(|published| {
                let fault: Fault = probecell_msgs::from_cdr(&published.payload)
                    .unwrap_or_else(|error| panic!("{error}"));
                fault.code
            })
            .collect()
    }

    /// Requests a part.
    pub fn ask_for(&mut self, part: &str) {
        let request = OperatorRequest {
            subject: part.to_owned(),
            operator_name: "test".to_owned(),
            ..OperatorRequest::default()
        };
        self.send(topics::RUN_REQUESTS, &request);
    }

    /// Asks for a part and waits for its report; what the report causes at that instant is still made.
    pub fn make(&mut self, part: &str) -> PartReport {
        self.ask_for(part);
        self.wait_for_report()
    }

    /// Waits for the report of the part that is being made.
    pub fn wait_for_report(&mut self) -> PartReport {
        self.run_to(topics::PART_REPORTS);
        self.run_s(0.0);
        self.last(topics::PART_REPORTS)
    }

    /// Approves or rejects a proposed correction.
    pub fn answer(&mut self, correction: &Correction, approve: bool) {
        let request = OperatorRequest {
            subject: correction.correction_id.clone(),
            operator_name: "Ada".to_owned(),
            approve,
            ..OperatorRequest::default()
        };
        self.send(topics::APPROVALS, &request);
        self.run_to(topics::APPROVAL_REPLIES);
        self.run_s(0.0);
    }

    /// What was published so far.
    pub fn log(&self) -> &[Published] {
        &self.log
    }

    /// Everything that was published.
    pub fn finish(mut self) -> Vec<Published> {
        self.run_s(0.0);
        self.log
    }
}

/// One node of the cell alone with its inputs from `log`, those on topics in `late` delayed by `seconds`.
pub fn alone(
    cell: &Cell,
    node: &str,
    log: &[Published],
    late: &[Topic],
    seconds: f64,
) -> Vec<Published> {
    let node = instance(cell, node);
    let inputs: Vec<&str> = node.inputs().iter().map(|topic| topic.name).collect();
    let mut executor = Executor::new(vec![node], BEGIN).unwrap_or_else(|error| panic!("{error}"));
    let mut end = BEGIN;
    for published in log
        .iter()
        .filter(|published| inputs.contains(&published.topic.as_str()))
    {
        let delayed = late.iter().any(|topic| topic.name == published.topic);
        let at = if delayed {
            published.at.after_s(seconds)
        } else {
            published.at
        };
        executor.inject(at, published.topic.clone(), published.payload.clone());
        end = end.max(at);
    }
    executor.run_until(end.after_s(1.0));
    executor.take_log()
}

/// A cell file with a fault after `after_touches` touches.
pub fn with_fault(text: &str, kind: &str, after_touches: u32) -> String {
    format!("{text}\n[simulator.fault]\nkind = \"{kind}\"\nafter_touches = {after_touches}\n")
}
