//! What an event does.

use std::rc::Rc;

use cell_tests::session::{answer, approved};
use graph::{Emitted, START, Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, OperatorRequest, from_cdr,
    to_cdr,
};

use super::{
    GATE, NODES, PERIOD, Search, check,
    state::{DRIVER, Event, Forged, Heard, Node, State},
};

/// Timer of the periodic checks of each of the nodes.
const TICK: u32 = 1;

impl Search {
    /// Makes an event happen; a sentence where a write must not be.
    pub(super) fn happen(
        &mut self,
        state: &mut State,
        event: Event,
        writes: &mut usize,
    ) -> Option<String> {
        match event {
            Event::Arrive(topic, to) => {
                let letter = state.ways.get_mut(&(topic, to))?.pop_front()?;
                return self.arrive(state, topic, to, &letter.payload, writes);
            }
            Event::Repeat(topic, to) => {
                state.left.repeats -= 1;
                let letter = state.ways.get(&(topic, to))?.front()?.clone();
                return self.arrive(state, topic, to, &letter.payload, writes);
            }
            Event::Lose(topic, to) => {
                state.left.losses -= 1;
                state.ways.get_mut(&(topic, to))?.pop_front();
            }
            Event::Answer(index, by, approve) => {
                state.left.answers -= 1;
                state.answered.insert((index, by));
                let request = answer(&self.proposed[index], by, approve, self.now(state));
                self.post(state, topics::APPROVALS.name, &to_cdr(&request));
            }
            Event::Stop => {
                state.left.stops -= 1;
                let request = to_cdr(&OperatorRequest::default());
                self.post(state, topics::STOP_REQUESTS.name, &request);
            }
            Event::Forge(forged) => {
                state.left.forgeries -= 1;
                let correction = self.forged(forged, self.now(state));
                self.post(state, topics::CORRECTIONS.name, &to_cdr(&correction));
            }
            Event::Restart(DRIVER) => {
                state.left.restarts -= 1;
                state.driver += 1;
                state.taken.clear();
                state.ways.retain(|(_, to), _| *to != DRIVER);
                state.wear = (self.sample.tool_numbers.iter().copied())
                    .zip(self.sample.tool_wear.iter().map(|wear| wear.to_bits()))
                    .collect();
                self.sample(state);
            }
            Event::Restart(node) => {
                state.left.restarts -= 1;
                return self.restart(state, node, writes);
            }
            Event::Period => return self.period(state, writes),
        }
        None
    }

    /// The instant of a period, by the clock of an operator.
    fn now(&self, state: &State) -> Stamp {
        Stamp(self.begin.0 + PERIOD * i64::from(state.period) + 1)
    }

    /// Puts a message on its ways to the nodes that subscribe to it.
    fn post(&self, state: &mut State, topic: &'static str, payload: &[u8]) {
        let to = (0..NODES.len()).filter(|&node| {
            let mut inputs = self.workers[node].inputs().iter();
            inputs.any(|known| known.name == topic)
        });
        let to: Vec<usize> = to.collect();
        state.post(topic, payload, &to);
    }

    /// A sample of the machine goes to the gate.
    fn sample(&self, state: &mut State) {
        let sample = ControllerStatus {
            session: self.session(state),
            tool_wear: state.wear.values().copied().map(f64::from_bits).collect(),
            ..self.sample.clone()
        };
        state.post(topics::CONTROLLER_STATUS.name, &to_cdr(&sample), &[GATE]);
    }

    /// Name of the driver's session.
    pub(super) fn session(&self, state: &State) -> String {
        match state.driver {
            0 => self.sample.session.clone(),
            restarts => format!("{}-{restarts}", self.sample.session),
        }
    }

    fn forged(&self, forged: Forged, now: Stamp) -> Correction {
        let first = Correction {
            header: now.header(""),
            correction_id: "forged".to_owned(),
            ..self.proposed[0].clone()
        };
        match forged {
            Forged::Unsigned => Correction {
                approval: Correction::APPROVAL_OPERATOR,
                approved_by: "Ada".to_owned(),
                approved_at: now.time(),
                signature: vec![1; 64],
                ..self.proposed[0].clone()
            },
            Forged::OutOfBounds => {
                let changed = Correction {
                    new_value: 5e-3,
                    upper_bound: 1.0,
                    ..first
                };
                approved(changed, "Ada", now)
            }
            Forged::NoSource => {
                let changed = Correction {
                    plan_id: "other/1".to_owned(),
                    ..first
                };
                approved(changed, "Ada", now)
            }
            Forged::Session => {
                let changed = Correction {
                    session: "another".to_owned(),
                    ..first
                };
                approved(changed, "Ada", now)
            }
        }
    }

    fn restart(&mut self, state: &mut State, node: usize, writes: &mut usize) -> Option<String> {
        for topic in self.workers[node].outputs() {
            state.latched.remove(topic.name);
        }
        state.ways.retain(|(_, to), _| *to != node);
        let steps = state.nodes[node].steps;
        state.nodes[node] = Node::new(Rc::clone(&self.fresh[node]), steps);
        if node == GATE {
            state.heard = Heard {
                began: self.now(state).0 - 1 + i64::from(steps) * 1000,
                alive: state.period,
                ..Heard::default()
            };
        }
        let wrong = self.step(state, node, |worker, now| worker.timer(now, START), writes);
        for topic in self.workers[node].inputs() {
            for letter in state.latched.get(topic.name).into_iter().flatten() {
                let way = state.ways.entry((topic.name, node)).or_default();
                way.push_back(letter.clone());
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
        let sample = ControllerStatus {
            session: self.session(state),
            tool_wear: state.wear.values().copied().map(f64::from_bits).collect(),
            ..self.sample.clone()
        };
        let sample = to_cdr(&sample);
        self.arrive(state, topics::CONTROLLER_STATUS.name, GATE, &sample, writes)
            .or_else(|| {
                (0..NODES.len()).find_map(|node| {
                    self.step(state, node, |worker, now| worker.timer(now, TICK), writes)
                })
            })
    }

    fn arrive(
        &mut self,
        state: &mut State,
        topic: &'static str,
        to: usize,
        payload: &[u8],
        writes: &mut usize,
    ) -> Option<String> {
        if to == DRIVER {
            self.obey(state, payload);
            return None;
        }
        if to == GATE {
            check::hear(state, topic, payload);
        }
        let mut inputs = self.workers[to].inputs().iter();
        let port = inputs.position(|known| known.name == topic)?;
        let deliver = |worker: &mut Box<dyn graph::Instance>, now| {
            worker.deliver(now, port, payload).unwrap_or_default()
        };
        self.step(state, to, deliver, writes)
    }

    fn step(
        &mut self,
        state: &mut State,
        node: usize,
        step: impl FnOnce(&mut Box<dyn graph::Instance>, Stamp) -> Emitted,
        writes: &mut usize,
    ) -> Option<String> {
        let steps = state.nodes[node].steps + 1;
        let now = Stamp(self.now(state).0 - 1 + i64::from(steps) * 1000);
        let worker = &mut self.workers[node];
        let before = (*state.nodes[node].snapshot).clone();
        worker
            .restore(before)
            .unwrap_or_else(|error| panic!("{error}"));
        let emitted = step(worker, now);
        let mut snapshot = worker.snapshot();
        if let Some(tamper) = self.tamper.filter(|_| node == GATE) {
            tamper(&mut snapshot);
        }
        state.nodes[node] = Node::new(Rc::new(snapshot), steps);
        let outputs = self.workers[node].outputs();
        for (port, payload) in emitted.messages {
            let topic = outputs[port].name;
            if topic == topics::CONTROLLER_COMMANDS.name {
                let command: ControllerCommand = from_cdr(&payload).ok()?;
                let wear = command.kind == ControllerCommand::SET_TOOL_WEAR;
                *writes += usize::from(wear);
                if wear && let Some(why) = check::write(self, state, now, &command) {
                    return Some(why);
                }
                state.post(topic, &payload, &[DRIVER]);
            } else {
                self.post(state, topic, &payload);
            }
        }
        None
    }

    /// The machine, as docs/driver-guide.md has it; a program runs for longer than any search.
    fn obey(&self, state: &mut State, payload: &[u8]) {
        let Ok(command) = from_cdr::<ControllerCommand>(payload) else {
            return;
        };
        let session = self.session(state);
        let mut reply = ControllerReply {
            session: session.clone(),
            command_id: command.command_id,
            outcome: ControllerReply::DONE,
            ..ControllerReply::default()
        };
        if command.session != session {
            reply.outcome = ControllerReply::REFUSED;
        } else if !state.taken.insert(command.command_id) {
            return;
        } else if command.kind == ControllerCommand::SET_TOOL_WEAR {
            let before = state
                .wear
                .insert(command.tool_number, command.value.to_bits());
            reply.value_before = before.map_or(0.0, f64::from_bits);
            reply.value = command.value;
            self.sample(state);
        } else if command.kind != ControllerCommand::STOP {
            return;
        }
        state.post(topics::CONTROLLER_REPLIES.name, &to_cdr(&reply), &[GATE]);
    }
}
