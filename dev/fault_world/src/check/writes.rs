//! What reaches the machine: corrections, operations, and for how long it moves alone.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::{Published, Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, GateHeartbeat, MachineState,
    OperationRequest, OperatorKeys, PartReport, PartStatus, ProbeEvent, RecordingStatus,
};
use signatures::{Approval, SecretKey, Trust};

use super::{Findings, Invariant, read};
use crate::traffic::Taken;

/// s between two checks of the gate, and what else may lie between an instant and the step that notices it.
const TICK: f64 = 0.25;
/// s without a sign of life of the gate after which a driver stops its machine.
const SILENCE: f64 = 1.0;

/// What the gate could know at an instant: what has reached it, the newest by its stamp.
#[derive(Default)]
struct Known {
    part: Option<(Stamp, PartStatus)>,
    reported: BTreeSet<String>,
    ended: BTreeMap<String, Stamp>,
    recording: Option<(Stamp, RecordingStatus)>,
    keys: Option<OperatorKeys>,
}

/// Commands and what entitles them.
pub(super) struct Writes {
    wear_limit: f64,
    part_limit: f64,
    known: Known,
    /// Runs that an operator has stopped, and plans of which an operator has rejected a correction, as far as the gate has
    /// heard.
    stopped: BTreeSet<String>,
    rejected: BTreeSet<String>,
    corrections: BTreeMap<String, Vec<Correction>>,
    events: BTreeMap<String, BTreeSet<u64>>,
    requests: BTreeMap<u64, OperationRequest>,
    commands: BTreeMap<(String, u64), ControllerCommand>,
    replies: BTreeSet<(String, u64)>,
    written: BTreeSet<String>,
    /// Corrections written in earlier sessions of the cell.
    before: usize,
    /// Wear offsets that have been sent and that the machine has not shown yet: tool and value.
    sent: VecDeque<(u32, f64)>,
    wear: Option<(String, BTreeMap<u32, f64>)>,
    gate: Option<((u64, u64), Stamp)>,
}

impl Writes {
    pub(super) fn new(wear_limit: f64, part_limit: f64) -> Self {
        Self {
            wear_limit,
            part_limit,
            known: Known::default(),
            stopped: BTreeSet::new(),
            rejected: BTreeSet::new(),
            corrections: BTreeMap::new(),
            events: BTreeMap::new(),
            requests: BTreeMap::new(),
            commands: BTreeMap::new(),
            replies: BTreeSet::new(),
            written: BTreeSet::new(),
            before: 0,
            sent: VecDeque::new(),
            wear: None,
            gate: None,
        }
    }

    pub(super) fn new_session(&mut self) {
        self.before += self.written.len();
        self.written.clear();
        self.corrections.clear();
        self.stopped.clear();
        self.rejected.clear();
        self.requests.clear();
    }

    pub(super) fn ended(&mut self, node: &str) {
        match node {
            "machine_state" => self.known = Known::default(),
            "simulator" => {
                (self.wear, self.gate) = (None, None);
                self.sent.clear();
            }
            _ => {}
        }
    }

    pub(super) fn taken(&mut self, taken: &Taken) {
        match (taken.by, taken.topic.as_str()) {
            ("machine_state", topic) => self.gate_takes(taken.now, topic, &taken.payload),
            ("simulator", topic) if topic == topics::GATE_HEARTBEAT.name => {
                let beat: GateHeartbeat = read(&taken.payload);
                let key = (beat.started, beat.count);
                // One by a clock that was set back is the gate once the known one is silent.
                if self.gate.is_none_or(|(known, heard)| {
                    key > known || key.0 != known.0 && taken.now.since_s(heard) > SILENCE
                }) {
                    self.gate = Some((key, taken.now));
                }
            }
            ("simulator", topic) if topic == topics::CONTROLLER_COMMANDS.name => {
                if let Some((_, at)) = &mut self.gate {
                    *at = taken.now;
                } else {
                    self.gate = Some(((0, 0), taken.now));
                }
            }
            _ => {}
        }
    }

    fn gate_takes(&mut self, now: Stamp, topic: &str, payload: &[u8]) {
        if topic == topics::PART_STATUS.name {
            let status: PartStatus = read(payload);
            let stamp = Stamp::from(&status.header.stamp);
            let newest = (self.known.part.as_ref())
                .is_none_or(|(_, known)| stamp >= Stamp::from(&known.header.stamp));
            if newest {
                if status.stage == PartStatus::NONE {
                    // The end of the part is known; its measurement may be resumed.
                    self.stopped.clear();
                }
                let resumed = status.stage != PartStatus::NONE
                    && stamp
                        > self
                            .known
                            .ended
                            .get(&status.run_id)
                            .copied()
                            .unwrap_or(stamp);
                if resumed {
                    self.known.reported.remove(&status.run_id);
                }
                self.known.part = Some((now, status));
            }
        } else if topic == topics::PART_REPORTS.name {
            let report: PartReport = read(payload);
            self.stopped.remove(&report.run_id);
            let stamp = Stamp::from(&report.header.stamp);
            self.known.ended.insert(report.run_id.clone(), stamp);
            self.known.reported.insert(report.run_id);
        } else if topic == topics::STOP_REQUESTS.name {
            if let Some((_, status)) = &self.known.part
                && status.stage != PartStatus::NONE
                && !self.known.reported.contains(&status.run_id)
            {
                self.stopped.insert(status.run_id.clone());
            }
        } else if topic == topics::CORRECTIONS.name {
            let correction: Correction = read(payload);
            if correction.approval == Correction::APPROVAL_REJECTED {
                self.rejected.insert(correction.plan_id);
            }
        } else if topic == topics::RECORDING_STATUS.name {
            let status: RecordingStatus = read(payload);
            let stamp = Stamp::from(&status.header.stamp);
            let newest = (self.known.recording.as_ref())
                .is_none_or(|(_, known)| stamp >= Stamp::from(&known.header.stamp));
            if newest {
                self.known.recording = Some((now, status));
            }
        } else if topic == topics::OPERATOR_KEYS.name {
            self.known.keys = Some(read(payload));
        }
    }

    pub(super) fn published(&mut self, published: &Published, findings: &mut Findings) {
        let (topic, payload) = (published.topic.as_str(), &published.payload);
        if topic == topics::CORRECTIONS.name {
            let correction: Correction = read(payload);
            let known = self.corrections.entry(correction.correction_id.clone());
            known.or_default().push(correction);
        } else if topic == topics::PROBE_EVENTS.name {
            let event: ProbeEvent = read(payload);
            let numbers = self.events.entry(event.plan_id).or_default();
            numbers.insert(event.sequence);
        } else if topic == topics::OPERATION_REQUESTS.name {
            let request: OperationRequest = read(payload);
            let before = self.requests.insert(request.request_id, request.clone());
            findings.expect(
                before.is_none_or(|before| before == request),
                Invariant::Number,
                || format!("request {} stands for two things", request.request_id),
            );
        } else if topic == topics::CONTROLLER_COMMANDS.name {
            self.command(&read(payload), findings);
        } else if topic == topics::CONTROLLER_REPLIES.name {
            let reply: ControllerReply = read(payload);
            let new = self.replies.insert((reply.session, reply.command_id));
            findings.expect(new, Invariant::Twice, || {
                format!(
                    "command {} is carried out or answered twice",
                    reply.command_id
                )
            });
        } else if topic == topics::CONTROLLER_STATUS.name {
            self.sample(&read(payload), findings);
        }
    }

    fn command(&mut self, command: &ControllerCommand, findings: &mut Findings) {
        let key = (command.session.clone(), command.command_id);
        let before = self.commands.insert(key, command.clone());
        findings.expect(before.is_none(), Invariant::Number, || {
            format!("command {} is sent twice", command.command_id)
        });
        let moves = [
            ControllerCommand::RUN_OPERATION,
            ControllerCommand::RUN_MEASUREMENT,
        ];
        if moves.contains(&command.kind) {
            self.operation(command, findings);
        } else if command.kind != ControllerCommand::STOP {
            self.write(command, findings);
        }
    }

    fn operation(&self, command: &ControllerCommand, findings: &mut Findings) {
        let recorded = self.known.recording.as_ref().is_some_and(|(at, status)| {
            status.state == RecordingStatus::RECORDING
                && findings.now.since_s(*at) <= status.validity + TICK
        });
        findings.expect(recorded, Invariant::Unrecorded, || {
            format!("{:?} begins while nothing is recorded", command.operation)
        });
        let stopped = self.stopped.contains(&command.run_id);
        findings.expect(!stopped, Invariant::AfterStop, || {
            format!("something begins for {:?} after a STOP", command.run_id)
        });
    }

    fn write(&mut self, command: &ControllerCommand, findings: &mut Findings) {
        let id = &command.correction_id;
        findings.expect(self.written.insert(id.clone()), Invariant::Twice, || {
            format!("{id} is written twice")
        });
        let proposed = self.corrections.get(id).map_or(&[][..], Vec::as_slice);
        let trust = Trust {
            cell: Some(SecretKey::of_simulations().public()),
            automatic: true,
            unsigned_operators: false,
        };
        let inert = Correction::APPROVAL_REJECTED;
        let mut entitled = proposed.iter().filter(|one| {
            one.approval != inert
                && trust.check(self.known.keys.as_ref(), one) == Ok(Approval::Signed)
                && one.tool_number == command.tool_number
                && one.new_value == command.value
                && one.kind == Correction::TOOL_WEAR
                && command.kind == ControllerCommand::SET_TOOL_WEAR
        });
        // Of two of one name, the one for this machine.
        let first = entitled.clone().next();
        let signed = entitled
            .find(|one| one.session == command.session)
            .or(first);
        let Some(signed) = signed else {
            return findings.expect(false, Invariant::Signature, || {
                format!(
                    "{id} of {} m is written, which nobody entitled has signed",
                    command.value
                )
            });
        };
        self.sent.push_back((command.tool_number, command.value));
        let within = command.value >= signed.lower_bound.max(-self.wear_limit)
            && command.value <= signed.upper_bound.min(self.wear_limit);
        findings.expect(within, Invariant::Bound, || {
            format!("{id} of {} m is out of bounds", command.value)
        });
        let events = self.events.get(&signed.plan_id);
        let sourced = !signed.feature_ids.is_empty()
            && !signed.sequences.is_empty()
            && events.is_some_and(|events| signed.sequences.iter().all(|one| events.contains(one)));
        findings.expect(sourced, Invariant::Source, || {
            format!(
                "{id} has no source among the touches of {:?}",
                signed.plan_id
            )
        });
        let held = self.wear.as_ref().map(|(session, _)| session);
        let session =
            signed.session == command.session && held.is_none_or(|held| *held == command.session);
        findings.expect(session, Invariant::Session, || {
            format!(
                "{id} is of session {:?}, the machine's is {held:?}",
                signed.session
            )
        });
        let run = signed.plan_id.split('/').next().unwrap_or_default();
        let living = self.known.part.as_ref().is_some_and(|(at, status)| {
            status.run_id == run
                && status.plan_id == signed.plan_id
                && ![PartStatus::NONE, PartStatus::STOPPING].contains(&status.stage)
                && !self.known.reported.contains(run)
                && findings.now.since_s(*at) <= self.part_limit + TICK
        });
        findings.expect(living, Invariant::LivingPart, || {
            format!("{id} is written, but its part is not being made or does not wait for it")
        });
        findings.expect(!self.stopped.contains(run), Invariant::AfterStop, || {
            format!("{id} is written after a STOP")
        });
        let withdrawn = self.rejected.contains(&signed.plan_id);
        findings.expect(!withdrawn, Invariant::AfterWithdrawal, || {
            format!("{id} is written after a rejection")
        });
    }

    /// The machine shows what it holds, and that it stands when it has no gate.
    fn sample(&mut self, sample: &ControllerStatus, findings: &mut Findings) {
        let now: BTreeMap<u32, f64> = (sample.tool_numbers.iter().copied())
            .zip(sample.tool_wear.iter().copied())
            .collect();
        if let Some((session, before)) = &self.wear
            && *session == sample.session
        {
            for (tool, value) in &now {
                if before.get(tool) == Some(value) {
                    continue;
                }
                let position = self.sent.iter().position(|sent| *sent == (*tool, *value));
                findings.expect(position.is_some(), Invariant::Twice, || {
                    format!("tool {tool} holds {value} m, which was written before or by nobody")
                });
                // What was sent before has been lost on its way, or overtaken.
                self.sent
                    .drain(..position.map_or(0, |position| position + 1));
            }
        }
        self.wear = Some((sample.session.clone(), now));
        let alone = (self.gate).map_or(0.0, |(_, heard)| findings.now.since_s(heard));
        // Without a program it is about to stand.
        let moves =
            sample.execution == MachineState::EXECUTION_RUNNING && !sample.program.is_empty();
        findings.expect(
            !moves || alone <= SILENCE + TICK,
            Invariant::Unsupervised,
            || format!("the machine moves {alone:.2} s after the last sign of life of its gate"),
        );
    }

    pub(super) fn written(&self) -> usize {
        self.before + self.written.len()
    }
}
