//! Every invariant bites: a node that is deliberately wrong is put in the place of the real one, and the world catches it
//! by exactly the invariant that it breaks. Under the same faults the real nodes break none.

#![allow(
    clippy::unnecessary_wraps,
    reason = "wrong nodes are functions of one shape"
)]

use std::sync::LazyLock;

use fault_world::{
    Alteration, Cells, Fault, Forgery, Invariant, Kind, Mood, Route, StandIn, altered, run,
};
use graph::{DeliverError, Emitted, Instance, RestoreError, Stamp, Topic, topics};
use probecell_msgs::{
    ControllerCommand, ControllerStatus, Correction, CorrectionAcknowledgement as Ack,
    GateHeartbeat, Message, OperationRequest, RecordingStatus, from_cdr, to_cdr,
};

/// What a wrong node is given in the place of an input; `None`: nothing.
type Before = fn(Stamp, &'static str, &[u8]) -> Option<Vec<u8>>;
/// What a wrong node says in the place of its outputs. The input is empty for a timer.
type After = fn(&mut Memory, Stamp, (&'static str, &[u8]), &mut Said);

/// What a wrong node remembers.
#[derive(Default)]
struct Memory {
    count: u64,
}

/// Messages of a step by topic.
struct Said {
    outputs: &'static [Topic],
    messages: Vec<(usize, Vec<u8>)>,
}

impl Said {
    fn of(&self, topic: Topic) -> Vec<&[u8]> {
        (self.messages.iter())
            .filter(|(port, _)| self.outputs[*port].name == topic.name)
            .map(|(_, payload)| payload.as_slice())
            .collect()
    }

    fn add<M: Message>(&mut self, topic: Topic, message: &M) {
        let port = self
            .outputs
            .iter()
            .position(|known| known.name == topic.name);
        self.messages
            .push((port.expect("an output"), to_cdr(message)));
    }

    fn drop_all(&mut self, topic: Topic) {
        let outputs = self.outputs;
        self.messages
            .retain(|(port, _)| outputs[*port].name != topic.name);
    }
}

struct Wrong {
    before: Before,
    after: After,
    memory: Memory,
}

impl Wrong {
    fn settle(
        &mut self,
        node: &dyn Instance,
        now: Stamp,
        input: (&'static str, &[u8]),
        emitted: Emitted,
    ) -> Emitted {
        let mut said = Said {
            outputs: node.outputs(),
            messages: emitted.messages,
        };
        (self.after)(&mut self.memory, now, input, &mut said);
        Emitted {
            messages: said.messages,
            ..emitted
        }
    }
}

impl Alteration for Wrong {
    fn deliver(
        &mut self,
        node: &mut dyn Instance,
        now: Stamp,
        port: usize,
        cdr: &[u8],
    ) -> Result<Emitted, DeliverError> {
        let topic = node.inputs()[port].name;
        let emitted = match (self.before)(now, topic, cdr) {
            Some(changed) => node.deliver(now, port, &changed)?,
            None => Emitted::default(),
        };
        Ok(self.settle(node, now, (topic, cdr), emitted))
    }

    fn timer(&mut self, node: &mut dyn Instance, now: Stamp, id: u32) -> Emitted {
        let emitted = node.timer(now, id);
        self.settle(node, now, ("", &[]), emitted)
    }
}

fn wrong(node: Box<dyn Instance>, name: &str, before: Before, after: After) -> Box<dyn Instance> {
    let memory = Memory::default();
    altered(
        node,
        name,
        Wrong {
            before,
            after,
            memory,
        },
    )
}

fn as_it_is(_: Stamp, _: &'static str, payload: &[u8]) -> Option<Vec<u8>> {
    Some(payload.to_vec())
}

fn nothing(_: &mut Memory, _: Stamp, _: (&'static str, &[u8]), _: &mut Said) {}

fn read<M: Message>(payload: &[u8]) -> M {
    from_cdr(payload).expect("a message of its topic")
}

/// A gate that writes what it has to refuse.
fn careless(
    memory: &mut Memory,
    now: Stamp,
    (topic, payload): (&'static str, &[u8]),
    said: &mut Said,
) {
    if topic != topics::CORRECTIONS.name {
        return;
    }
    let correction: Correction = read(payload);
    let refused = (said.of(topics::CORRECTION_ACKNOWLEDGEMENTS).into_iter())
        .map(read::<Ack>)
        .any(|ack| ack.correction_id == correction.correction_id && ack.outcome != Ack::APPLIED);
    if refused {
        memory.count += 1;
        let command = ControllerCommand {
            header: now.header(""),
            session: correction.session.clone(),
            command_id: 7 + memory.count,
            kind: ControllerCommand::SET_TOOL_WEAR,
            tool_number: correction.tool_number,
            value: correction.new_value,
            correction_id: correction.correction_id,
            ..ControllerCommand::default()
        };
        said.add(topics::CONTROLLER_COMMANDS, &command);
    }
}

fn careless_gate(node: Box<dyn Instance>) -> Box<dyn Instance> {
    wrong(node, "machine_state", as_it_is, careless)
}

static CELLS: LazyLock<Cells> = LazyLock::new(Cells::default);

/// Every half second from the first correction on.
fn again_and_again(kind: &Kind) -> Vec<Fault> {
    let instants = (20..240).map(|half| f64::from(half) / 2.0 + 0.13);
    let fault = |at| Fault {
        at,
        kind: kind.clone(),
    };
    instants.map(fault).collect()
}

/// The wrong node is caught by this invariant, and the real one breaks none under the same faults. `seed` 0: corrections
/// are approved by policy, 1: by operators.
fn caught(invariant: Invariant, seed: u64, faults: &[Fault], stand_in: StandIn) {
    let cell = CELLS.of(seed);
    let outcome = run(cell, seed, faults, Some(stand_in));
    let found = outcome.violation.map(|found| found.invariant);
    assert_eq!(found, Some(invariant));
    let real = run(cell, seed, faults, None);
    assert_eq!(real.violation, None);
}

fn forged(invariant: Invariant, forgery: Forgery) {
    caught(
        invariant,
        0,
        &again_and_again(&Kind::Forge(forgery)),
        careless_gate,
    );
}

#[test]
fn a_write_out_of_bounds_is_seen() {
    forged(Invariant::Bound, Forgery::OutOfBounds);
}

#[test]
fn a_write_without_a_source_is_seen() {
    forged(Invariant::Source, Forgery::NoSource);
}

#[test]
fn a_write_without_a_signature_is_seen() {
    forged(Invariant::Signature, Forgery::Unsigned);
    forged(Invariant::Signature, Forgery::Withdrawn);
    forged(Invariant::Signature, Forgery::Identifier);
}

#[test]
fn a_write_of_another_session_is_seen() {
    forged(Invariant::Session, Forgery::Session);
}

#[test]
fn a_write_for_a_part_that_is_not_waiting_is_seen() {
    forged(Invariant::LivingPart, Forgery::Sound);
}

#[test]
fn a_second_write_of_a_correction_is_seen() {
    forged(Invariant::Twice, Forgery::Again);
}

#[test]
fn a_machine_that_carries_out_a_command_twice_is_seen() {
    fn twice(_: &mut Memory, _: Stamp, (topic, _): (&'static str, &[u8]), said: &mut Said) {
        if topic == topics::CONTROLLER_COMMANDS.name {
            let replies: Vec<Vec<u8>> = said
                .of(topics::CONTROLLER_REPLIES)
                .into_iter()
                .map(<[u8]>::to_vec)
                .collect();
            let port = said.messages.first().map_or(0, |(port, _)| *port);
            said.messages
                .extend(replies.into_iter().map(|reply| (port, reply)));
        }
    }
    caught(Invariant::Twice, 0, &[], |node| {
        wrong(node, "simulator", as_it_is, twice)
    });
}

#[test]
fn an_operation_after_a_stop_is_seen() {
    fn deaf(_: Stamp, topic: &'static str, payload: &[u8]) -> Option<Vec<u8>> {
        (topic != topics::STOP_REQUESTS.name).then(|| payload.to_vec())
    }
    let route = Route {
        topic: topics::STOP_REQUESTS.name,
        to: "cycle",
    };
    let faults = [
        Fault {
            at: 1.5,
            kind: Kind::Lose(route, 10.0, 1),
        },
        Fault {
            at: 2.0,
            kind: Kind::Stop(false),
        },
    ];
    caught(Invariant::AfterStop, 0, &faults, |node| {
        wrong(node, "machine_state", deaf, nothing)
    });
}

#[test]
fn a_write_after_a_rejection_is_seen() {
    let route = Route {
        topic: topics::PASS_DECISIONS.name,
        to: "cycle",
    };
    // The first answer is a rejection, and `cycle` does not hear that the part ends with it.
    let mut faults = vec![
        Fault {
            at: 1.0,
            kind: Kind::Operators(Mood::Reject, 100.0),
        },
        Fault {
            at: 1.0,
            kind: Kind::Lose(route, 115.0, 1),
        },
    ];
    faults.extend(again_and_again(&Kind::Forge(Forgery::Sound)));
    caught(Invariant::AfterWithdrawal, 1, &faults, careless_gate);
}

#[test]
fn an_unrecorded_operation_is_seen() {
    fn waived(_: Stamp, topic: &'static str, payload: &[u8]) -> Option<Vec<u8>> {
        if topic != topics::RECORDING_STATUS.name {
            return Some(payload.to_vec());
        }
        Some(to_cdr(&RecordingStatus {
            state: RecordingStatus::WAIVED,
            ..RecordingStatus::default()
        }))
    }
    let faults = [Fault {
        at: 2.0,
        kind: Kind::RecorderStops(60.0),
    }];
    caught(Invariant::Unrecorded, 0, &faults, |node| {
        wrong(node, "machine_state", waived, nothing)
    });
}

#[test]
fn a_machine_that_moves_without_a_gate_is_seen() {
    /// It makes its own signs of life.
    struct Driver {
        count: u64,
    }
    impl Alteration for Driver {
        fn deliver(
            &mut self,
            node: &mut dyn Instance,
            now: Stamp,
            port: usize,
            cdr: &[u8],
        ) -> Result<Emitted, DeliverError> {
            if node.inputs()[port].name == topics::GATE_HEARTBEAT.name {
                return Ok(Emitted::default());
            }
            node.deliver(now, port, cdr)
        }
        fn timer(&mut self, node: &mut dyn Instance, now: Stamp, id: u32) -> Emitted {
            self.count += 1;
            let beat = GateHeartbeat {
                started: 1,
                count: self.count,
                ..GateHeartbeat::default()
            };
            let mut inputs = node.inputs().iter();
            let port = inputs.position(|topic| topic.name == topics::GATE_HEARTBEAT.name);
            let mut emitted = node
                .deliver(now, port.expect("an input"), &to_cdr(&beat))
                .expect("a heartbeat");
            let more = node.timer(now, id);
            emitted.messages.extend(more.messages);
            emitted.timers.extend(more.timers);
            emitted
        }
    }
    let faults = [Fault {
        at: 1.5,
        kind: Kind::Kill("machine_state", 20.0, false),
    }];
    caught(Invariant::Unsupervised, 0, &faults, |node| {
        altered(node, "simulator", Driver { count: 0 })
    });
}

/// Found on a real driver on 2026-11-22: after its first sample a gate gave itself out for another process than before, so that
/// the driver ended what the gate had begun meanwhile.
#[test]
fn a_gate_that_changes_its_identity_is_seen() {
    fn later(
        memory: &mut Memory,
        _: Stamp,
        (topic, payload): (&'static str, &[u8]),
        said: &mut Said,
    ) {
        if topic == topics::CONTROLLER_STATUS.name && memory.count == 0 {
            let sample: ControllerStatus = read(payload);
            memory.count = Stamp::from(&sample.header.stamp).0.unsigned_abs();
        }
        let beats: Vec<GateHeartbeat> = (said.of(topics::GATE_HEARTBEAT).into_iter())
            .map(read)
            .collect();
        said.drop_all(topics::GATE_HEARTBEAT);
        for beat in beats {
            let started = beat.started.max(memory.count);
            said.add(topics::GATE_HEARTBEAT, &GateHeartbeat { started, ..beat });
        }
    }
    caught(Invariant::Recovery, 0, &[], |node| {
        wrong(node, "machine_state", as_it_is, later)
    });
}

/// Found on LinuxCNC on 2026-11-22: a gate that begins an operation while a stop is not confirmed yet, which ends it.
#[test]
fn a_gate_that_does_not_wait_for_the_end_of_a_stop_is_seen() {
    struct Hasty(Box<dyn Instance>);
    impl Instance for Hasty {
        fn name(&self) -> &'static str {
            self.0.name()
        }
        fn inputs(&self) -> &'static [Topic] {
            self.0.inputs()
        }
        fn outputs(&self) -> &'static [Topic] {
            self.0.outputs()
        }
        fn fault_codes(&self) -> Vec<&'static str> {
            self.0.fault_codes()
        }
        fn deliver(
            &mut self,
            now: Stamp,
            port: usize,
            cdr: &[u8],
        ) -> Result<Emitted, DeliverError> {
            if self.0.inputs()[port].name != topics::OPERATION_REQUESTS.name {
                return self.0.deliver(now, port, cdr);
            }
            // It does not know of stops while it takes a request.
            let mut state = self.0.snapshot();
            let stops = std::mem::replace(&mut state["stops"], serde_json::json!({}));
            self.0.restore(state).expect("a state of the node");
            let emitted = self.0.deliver(now, port, cdr);
            let mut state = self.0.snapshot();
            state["stops"] = stops;
            self.0.restore(state).expect("a state of the node");
            emitted
        }
        fn timer(&mut self, now: Stamp, id: u32) -> Emitted {
            self.0.timer(now, id)
        }
        fn snapshot(&self) -> serde_json::Value {
            self.0.snapshot()
        }
        fn restore(&mut self, snapshot: serde_json::Value) -> Result<(), RestoreError> {
            self.0.restore(snapshot)
        }
    }
    // The machine of this seed takes two seconds to stand.
    caught(Invariant::Recovery, 9, &[], |node| {
        if node.name() == "machine_state" {
            Box::new(Hasty(node))
        } else {
            node
        }
    });
}

#[test]
fn a_touch_that_is_lost_or_published_twice_is_seen() {
    fn swallow(memory: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        if !said.of(topics::PROBE_EVENTS).is_empty() {
            memory.count += 1;
            if memory.count == 7 {
                said.drop_all(topics::PROBE_EVENTS);
            }
        }
    }
    fn double(_: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        let again = said.messages.clone();
        said.messages.extend(again);
    }
    caught(Invariant::TouchLost, 0, &[], |node| {
        wrong(node, "probe_events", as_it_is, swallow)
    });
    caught(Invariant::TouchTwice, 0, &[], |node| {
        wrong(node, "probe_events", as_it_is, double)
    });
}

#[test]
fn a_number_that_recurs_is_seen() {
    fn recur(_: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        let requests = said.of(topics::OPERATION_REQUESTS).into_iter();
        let requests: Vec<OperationRequest> = requests.map(read).collect();
        for request in requests {
            let other = OperationRequest {
                operation: format!("{} again", request.operation),
                ..request
            };
            said.add(topics::OPERATION_REQUESTS, &other);
        }
    }
    caught(Invariant::Number, 0, &[], |node| {
        wrong(node, "cycle", as_it_is, recur)
    });
}

#[test]
fn a_part_without_a_report_and_one_with_two_are_seen() {
    fn swallow(_: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        said.drop_all(topics::PART_REPORTS);
    }
    fn double(_: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        let reports: Vec<Vec<u8>> = said
            .of(topics::PART_REPORTS)
            .into_iter()
            .map(<[u8]>::to_vec)
            .collect();
        for report in reports {
            said.add::<probecell_msgs::PartReport>(topics::PART_REPORTS, &read(&report));
        }
    }
    caught(Invariant::PartLate, 0, &[], |node| {
        wrong(node, "cycle", as_it_is, swallow)
    });
    caught(Invariant::ReportTwice, 0, &[], |node| {
        wrong(node, "cycle", as_it_is, double)
    });
}

#[test]
fn a_session_that_replays_otherwise_is_seen() {
    fn swallow(memory: &mut Memory, _: Stamp, _: (&'static str, &[u8]), said: &mut Said) {
        memory.count += u64::from(!said.messages.is_empty());
        if memory.count == 100 {
            said.messages.clear();
        }
    }
    caught(Invariant::Replay, 0, &[], |node| {
        wrong(node, "visualization", as_it_is, swallow)
    });
}

#[test]
fn a_cell_that_makes_no_part_any_more_is_seen() {
    fn from_the_third_on(
        memory: &mut Memory,
        _: Stamp,
        (topic, _): (&'static str, &[u8]),
        said: &mut Said,
    ) {
        memory.count += u64::from(topic == topics::RUN_REQUESTS.name);
        if memory.count > 1 {
            said.drop_all(topics::RUN_REPLIES);
        }
    }
    caught(Invariant::Recovery, 0, &[], |node| {
        wrong(node, "cycle", as_it_is, from_the_third_on)
    });
}
