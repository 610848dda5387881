//! What an event does.

use std::rc::Rc;

use cell_tests::session::{answer, approved, operator_keys};
use graph::{START, Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, Fault, Message,
    OperatorRequest, from_cdr, to_cdr,
};

use super::{
    CYCLE, GATE, NODES, PERIOD, Search, check,
    state::{DRIVER, Driver, Event, Forged, Heard, Node, OPERATORS, Route, State},
    store::{Given, Made},
};

/// Timer of the periodic checks of each of the nodes.
const TICK: u32 = 1;
/// Who says nothing in these searches: what they have said before reaches a node that is restarted at once.
const STANDING: [&str; 5] = [
    "operator",
    "recorder",
    "path_planning",
    "analysis",
    "instrument",
];
/// ns between an event from outside and the steps before it: more than a node publishes messages in between, in µs.
const EVENT: i64 = 1_000_000;

impl Search {
    /// Makes an event happen; a sentence where something must not be.
    pub(super) fn happen(
        &mut self,
        state: &mut State,
        event: Event,
        writes: &mut usize,
    ) -> Option<String> {
        match event {
            Event::Arrive(route) => {
                let payload = state.take(route)?;
                return self.arrive(state, route, payload, writes);
            }
            Event::Late(route, payload) => {
                state.late.remove(&(route, payload));
                return self.arrive(state, route, payload, writes);
            }
            Event::Repeat(route) => {
                state.left.repeats -= 1;
                let payload = state.take(route)?;
                state.late.insert((route, payload));
                return self.arrive(state, route, payload, writes);
            }
            Event::Lose(route) => {
                state.left.losses -= 1;
                let payload = state.take(route)?;
                state.late.insert((route, payload));
                return None;
            }
            _ => state.outside(),
        }
        match event {
            Event::Answer(index, by, approve) => {
                state.left.answers -= 1;
                state.answered.insert((index, by));
                let by = OPERATORS[usize::from(by)];
                let proposal = &self.proposed[usize::from(index)];
                let request = answer(proposal, by, approve, self.instant(state));
                self.post(state, topics::APPROVALS.name, &request);
            }
            Event::Withdraw => {
                state.left.withdrawals -= 1;
                let keys = operator_keys(2, &["Eve", OPERATORS[0]]);
                self.post(state, topics::OPERATOR_KEYS.name, &keys);
            }
            Event::Stop => {
                state.left.stops -= 1;
                let request = OperatorRequest::default();
                self.post(state, topics::STOP_REQUESTS.name, &request);
            }
            Event::Forge(forged) => {
                state.left.forgeries -= 1;
                self.forge(state, forged);
            }
            Event::Restart(DRIVER) => {
                state.left.restarts -= 1;
                let wear = self.sample.tool_wear.iter().map(|wear| wear.to_bits());
                state.driver = Driver {
                    restarts: state.driver.restarts + 1,
                    wear: (self.sample.tool_numbers.iter().copied())
                        .zip(wear)
                        .collect(),
                    ..Driver::default()
                };
                state.routes.retain(|(_, to), _| *to != DRIVER);
                self.sample(state);
                self.process_ended(state, "driver");
            }
            Event::Restart(node) => {
                state.left.restarts -= 1;
                self.process_ended(state, NODES[usize::from(node)]);
                return self.restart(state, node, writes);
            }
            Event::Period => return self.period(state, writes),
            _ => {}
        }
        None
    }

    /// The instant of an event from outside.
    fn instant(&self, state: &State) -> Stamp {
        Stamp(
            self.begin.0
                + PERIOD * i64::from(state.period)
                + EVENT * (1 + i64::from(state.happened)),
        )
    }

    /// The instant of a step: of the last event from outside, and of `cycle` later than what it has published since. So it
    /// does not depend on the order in which messages arrive.
    fn now(&self, state: &State, node: u8) -> Stamp {
        let said = i64::from(state.nodes[usize::from(node)].said);
        Stamp(self.instant(state).0 + 1000 * (1 + said))
    }

    /// Puts a message on its routes to the nodes that subscribe to it.
    fn post<M: Message>(&mut self, state: &mut State, topic: &'static str, message: &M) {
        let payload = self.store.payload(&to_cdr(message));
        self.deliver(state, topic, payload);
    }

    /// Puts a payload on its routes to the nodes that subscribe to it; whether there are any.
    fn deliver(&mut self, state: &mut State, topic: &'static str, payload: u32) -> bool {
        let to = (0..DRIVER).filter(|&node| {
            let mut inputs = self.workers[usize::from(node)].inputs().iter();
            inputs.any(|known| known.name == topic)
        });
        let to: Vec<u8> = to.collect();
        let heard = !to.is_empty();
        if heard {
            state.post(topic, payload, to.into_iter());
        }
        if topic == topics::CORRECTIONS.name
            && from_cdr::<Correction>(&self.store.bytes(payload))
                .is_ok_and(|one| one.approval == Correction::APPROVAL_OPERATOR)
        {
            state.approved.insert(payload);
        }
        heard
    }

    /// A sample of the machine.
    fn sampled(&mut self, state: &State) -> u32 {
        let wear = state.driver.wear.values();
        let sample = ControllerStatus {
            session: self.session(state.driver.restarts),
            tool_wear: wear.copied().map(f64::from_bits).collect(),
            ..self.sample.clone()
        };
        self.store.payload(&to_cdr(&sample))
    }

    /// A sample of the machine goes to the gate.
    fn sample(&mut self, state: &mut State) {
        let sample = self.sampled(state);
        state.post(topics::CONTROLLER_STATUS.name, sample, [GATE].into_iter());
    }

    /// Name of the session of a driver that was restarted so often.
    pub(super) fn session(&self, restarts: u8) -> String {
        match restarts {
            0 => self.sample.session.clone(),
            _ => format!("{}-{restarts}", self.sample.session),
        }
    }

    /// The launcher reports that a process has ended.
    fn process_ended(&mut self, state: &mut State, name: &str) {
        let fault = Fault {
            header: self.instant(state).header(""),
            severity: Fault::ERROR,
            code: "process_ended".to_owned(),
            text: format!("{name} has ended"),
            ..Fault::default()
        };
        self.post(state, topics::LAUNCHER_FAULTS.name, &fault);
    }

    fn forge(&mut self, state: &mut State, forged: Forged) {
        let now = self.instant(state);
        let proposal = self.proposed[0].clone();
        let first = Correction {
            header: now.header(""),
            correction_id: "forged".to_owned(),
            ..proposal.clone()
        };
        let correction = match forged {
            Forged::Approval => {
                let request = OperatorRequest {
                    signature: vec![1; 64],
                    ..answer(&proposal, OPERATORS[0], true, now)
                };
                return self.post(state, topics::APPROVALS.name, &request);
            }
            Forged::Unsigned => Correction {
                header: now.header(""),
                approval: Correction::APPROVAL_OPERATOR,
                approved_by: OPERATORS[0].to_owned(),
                approved_at: now.time(),
                ..proposal
            },
            Forged::OutOfBounds => Correction {
                new_value: 5e-3,
                upper_bound: 1.0,
                ..first
            },
            Forged::NoSource => Correction {
                plan_id: "other/1".to_owned(),
                ..first
            },
            Forged::NoTouch => Correction {
                sequences: Vec::new(),
                ..first
            },
            Forged::Session => Correction {
                session: "another".to_owned(),
                ..first
            },
            Forged::WithdrawnKey => first,
        };
        let correction = match forged {
            Forged::Unsigned => correction,
            Forged::WithdrawnKey => approved(correction, "Eve", now),
            _ => approved(correction, OPERATORS[0], now),
        };
        self.post(state, topics::CORRECTIONS.name, &correction);
    }

    fn restart(&mut self, state: &mut State, node: u8, writes: &mut usize) -> Option<String> {
        let index = usize::from(node);
        for topic in self.workers[index].outputs() {
            state.latched.remove(topic.name);
        }
        state.routes.retain(|(_, to), _| *to != node);
        state.nodes[index] = Node {
            snapshot: self.fresh[index],
            said: 0,
        };
        if node == GATE {
            state.heard = Heard {
                began: self.now(state, node).0,
                alive: (state.period, 0),
                ..Heard::default()
            };
        }
        let mut wrong = self.step(state, node, Given::Timer(START), writes);
        for topic in self.workers[index].inputs() {
            for payload in state.latched.get(topic.name).cloned().unwrap_or_default() {
                let route = (topic.name, node);
                if STANDING.contains(&topic.producer) && topic.name != topics::OPERATOR_KEYS.name {
                    wrong = wrong.or_else(|| self.arrive(state, route, payload, writes));
                } else {
                    state.routes.entry(route).or_default().push(payload);
                }
            }
        }
        if node == GATE {
            self.sample(state);
        }
        wrong
    }

    /// Time passes: the machine is sampled, and each node makes its checks.
    fn period(&mut self, state: &mut State, writes: &mut usize) -> Option<String> {
        state.left.periods -= 1;
        state.period += 1;
        let sample = self.sampled(state);
        let route = (topics::CONTROLLER_STATUS.name, GATE);
        self.arrive(state, route, sample, writes).or_else(|| {
            (0..DRIVER).find_map(|node| self.step(state, node, Given::Timer(TICK), writes))
        })
    }

    fn arrive(
        &mut self,
        state: &mut State,
        (topic, to): Route,
        payload: u32,
        writes: &mut usize,
    ) -> Option<String> {
        if to == DRIVER {
            return self.obey(state, payload);
        }
        if to == GATE {
            check::hear(self, state, topic, payload);
        }
        let mut inputs = self.workers[usize::from(to)].inputs().iter();
        let port = inputs.position(|known| known.name == topic)?;
        self.step(state, to, Given::Message(port, payload), writes)
    }

    /// A step of a node, computed once for each state, input and instant.
    fn made(&mut self, state: &State, node: u8, given: Given) -> (Stamp, Rc<Made>) {
        let (index, now) = (usize::from(node), self.now(state, node));
        let before = state.nodes[index].snapshot;
        let step = (node, before, now.0, given);
        if let Some(made) = self.store.made.get(&step) {
            return (now, Rc::clone(made));
        }
        let worker = &mut self.workers[index];
        let restored = worker.restore(self.store.value(before));
        restored.unwrap_or_else(|error| panic!("{error}"));
        let emitted = match given {
            Given::Timer(id) => worker.timer(now, id),
            Given::Message(port, payload) => {
                let payload = self.store.bytes(payload);
                worker.deliver(now, port, &payload).unwrap_or_default()
            }
        };
        let snapshot = self.store.snapshot(&worker.snapshot());
        let messages = emitted.messages.into_iter();
        let messages = messages.map(|(port, payload)| (port, self.store.payload(&payload)));
        let made = Rc::new(Made {
            snapshot,
            messages: messages.collect(),
        });
        self.store.made.insert(step, Rc::clone(&made));
        (now, made)
    }

    fn step(
        &mut self,
        state: &mut State,
        node: u8,
        given: Given,
        writes: &mut usize,
    ) -> Option<String> {
        let (now, made) = self.made(state, node, given);
        let outputs = self.workers[usize::from(node)].outputs();
        let mut heard = false;
        for &(port, payload) in &made.messages {
            let topic = outputs[port].name;
            if topic == topics::CONTROLLER_COMMANDS.name {
                if let Some(why) = check::command(self, state, now, payload, writes) {
                    return Some(why);
                }
                state.post(topic, payload, [DRIVER].into_iter());
                heard = true;
            } else {
                heard |= self.deliver(state, topic, payload);
            }
        }
        let made_by = &mut state.nodes[usize::from(node)];
        made_by.snapshot = made.snapshot;
        // The stamps of `part_status` tell which of two is the later one; those of other messages are compared with no others
        // of the same instant.
        made_by.said += u16::from(heard && node == CYCLE);
        None
    }

    /// The machine, as docs/driver-guide.md has it; a program runs for longer than any search.
    fn obey(&mut self, state: &mut State, payload: u32) -> Option<String> {
        let command: ControllerCommand = from_cdr(&self.store.bytes(payload)).ok()?;
        let session = self.session(state.driver.restarts);
        let mut reply = ControllerReply {
            session: session.clone(),
            command_id: command.command_id,
            outcome: ControllerReply::DONE,
            ..ControllerReply::default()
        };
        if command.session != session {
            reply.outcome = ControllerReply::REFUSED;
        } else if !state.driver.taken.insert(command.command_id) {
            return None;
        } else if command.kind == ControllerCommand::SET_TOOL_WEAR {
            if state.driver.running {
                let id = command.correction_id;
                return Some(format!("{id} is written while a program runs"));
            }
            let bits = command.value.to_bits();
            let before = state.driver.wear.insert(command.tool_number, bits);
            reply.value_before = before.map_or(0.0, f64::from_bits);
            reply.value = command.value;
            self.sample(state);
        } else if command.kind == ControllerCommand::STOP {
            state.driver.running = false;
        } else {
            state.driver.running = true;
            return None;
        }
        let payload = self.store.payload(&to_cdr(&reply));
        state.post(topics::CONTROLLER_REPLIES.name, payload, [GATE].into_iter());
        None
    }
}
