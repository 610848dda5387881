//! A session on virtual time in which a test takes part, as an operator or with invalid messages.

use cell::Cell;
use graph::{Executor, Published, Stamp, Topic, topics};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement as Ack, Fault, Message, OperatorKeys, OperatorRequest,
    PartReport, to_cdr,
};
use signatures::{SecretKey, approval, operators};

use crate::{BEGIN, begin, executor, instance, messages};

/// Longest virtual time that anything may take, s.
const LIMIT: f64 = 600.0;

/// Operators of every session, with private keys that are no secret. The key of the last one was withdrawn.
pub const OPERATORS: [(&str, [u8; 32]); 3] = [
    ("Ada", *b"Ada's key in tests: not a secret"),
    ("Grace", *b"Grace's key in tests: no secret."),
    ("Eve", *b"Eve's key in tests: not a secret"),
];

/// The private key of one of them.
pub fn operator_key(name: &str) -> SecretKey {
    let known = OPERATORS.iter().find(|(known, _)| *known == name);
    let (_, seed) = known.unwrap_or_else(|| panic!("{name} is no operator of a session"));
    SecretKey::from_seed(*seed)
}

/// The list of operators, as the launcher publishes it.
pub fn operator_keys(number: u64, withdrawn: &[&str]) -> OperatorKeys {
    let keys = OPERATORS.map(|(name, _)| operator_key(name).public().to_string());
    let list = OperatorKeys {
        number,
        names: OPERATORS.map(|(name, _)| name.to_owned()).to_vec(),
        keys: keys.to_vec(),
        withdrawn: OPERATORS
            .map(|(name, _)| withdrawn.contains(&name))
            .to_vec(),
        ..OperatorKeys::default()
    };
    operators::signed(&SecretKey::of_simulations(), list)
}

/// The correction with the signed approval of an operator, or of the policy.
#[must_use]
pub fn approved(correction: Correction, by: &str, now: Stamp) -> Correction {
    let (approval, key) = if by == "policy" {
        (Correction::APPROVAL_POLICY, SecretKey::of_simulations())
    } else {
        (Correction::APPROVAL_OPERATOR, operator_key(by))
    };
    let mut claimed = Correction {
        approval,
        approved_by: by.to_owned(),
        approved_at: now.time(),
        ..correction
    };
    sign(&mut claimed, &key);
    claimed
}

/// Signs what the correction claims of its approval.
pub fn sign(correction: &mut Correction, key: &SecretKey) {
    let cell = SecretKey::of_simulations().public();
    correction.signature = approval::sign(key, &cell, correction);
}

/// An operator's answer to a proposal, as `probecell approve` sends it.
pub fn answer(correction: &Correction, by: &str, approve: bool, now: Stamp) -> OperatorRequest {
    let mut claimed = Correction {
        approval: if approve {
            Correction::APPROVAL_OPERATOR
        } else {
            Correction::APPROVAL_REJECTED
        },
        approved_by: by.to_owned(),
        approved_at: now.time(),
        shown: format!("{} µm", correction.new_value * 1e6),
        ..correction.clone()
    };
    sign(&mut claimed, &operator_key(by));
    OperatorRequest {
        subject: claimed.correction_id.clone(),
        operator_name: by.to_owned(),
        approve,
        signed_at: claimed.approved_at,
        signature: claimed.signature,
        shown: claimed.shown,
        ..OperatorRequest::default()
    }
}

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
        session.send(topics::OPERATOR_KEYS, &operator_keys(1, &["Eve"]));
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

    /// The whole state of a node.
    pub fn snapshot(&self, name: &str) -> serde_json::Value {
        let mut nodes = self.executor.nodes().iter();
        let node = nodes.find(|node| node.name() == name);
        node.map_or_else(|| panic!("there is no node {name}"), |node| node.snapshot())
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
        let request = answer(correction, "Ada", approve, self.now());
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

/// What is wrong with a correction, the outcome that it must have, and how it is made wrong.
pub type Spoilt = (&'static str, u8, Box<dyn Fn(&mut Correction)>);

/// Asserts that corrections spoilt in one respect each are refused with their outcomes, though an operator has signed even
/// them, and that the sound one is then written. `unchanged` asserts that nothing was written so far.
pub fn refuses_all_but_the_sound(
    session: &mut Session,
    sound: &Correction,
    spoilt: Vec<Spoilt>,
    unchanged: impl Fn(&Session, &str),
) {
    for (what, outcome, spoil) in spoilt {
        let mut bad = Correction {
            correction_id: what.to_owned(),
            ..sound.clone()
        };
        spoil(&mut bad);
        sign(&mut bad, &operator_key("Ada"));
        session.send(topics::CORRECTIONS, &bad);
        session.run_s(0.1);
        let answer: Ack = session.last(topics::CORRECTION_ACKNOWLEDGEMENTS);
        assert_eq!(
            (answer.correction_id.as_str(), answer.outcome),
            (what, outcome),
            "{}",
            answer.text
        );
        assert!(!answer.text.is_empty(), "{what}");
        unchanged(session, what);
    }
    session.send(topics::CORRECTIONS, sound);
    session.run_s(0.1);
    let answer: Ack = session.last(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert_eq!(answer.outcome, Ack::APPLIED, "{}", answer.text);
}
