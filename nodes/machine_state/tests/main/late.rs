//! What a link delivers late, twice or not at all, and clocks that were set.

use graph::{Node, Outbox, START, Stamp};
use machine_state::{Config, Input, MachineStateNode, Output, State};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction,
    CorrectionAcknowledgement as Ack, MeasurementOrder, OperationReport, OperationRequest,
    OperatorRequest, PartReport, PartStatus, RecordingStatus,
};

use crate::common::{approved, config, correction, sample};

const SECOND: i64 = 1_000_000_000;
/// When the gate starts.
const BEGIN: i64 = 1_000 * SECOND;

struct Gate {
    config: Config,
    state: State,
}

impl Gate {
    /// A gate whose machine stands, of a recorded cell, and whose part waits for corrections of plan p/1.
    fn new() -> Self {
        let config = config();
        let mut gate = Self {
            state: MachineStateNode::start(&config),
            config,
        };
        gate.step(0.0, Input::Timer(START));
        gate.sample(0.0, BEGIN);
        gate.step(0.0, recording(0.0, RecordingStatus::RECORDING));
        gate.step(0.0, part(0.0, PartStatus::MEASURING));
        let order = MeasurementOrder {
            plan_id: "p/1".to_owned(),
            ..MeasurementOrder::default()
        };
        gate.step(0.0, Input::Order(order));
        gate.step(0.0, request(0.0, 5, OperationRequest::MEASURE));
        gate.state.operation = None;
        gate.step(0.1, part(0.1, PartStatus::CORRECTING));
        gate
    }

    /// A step, after which the driver confirms each stop.
    fn step(&mut self, seconds: f64, input: Input) -> Vec<Output> {
        let mut out = Outbox::default();
        let now = Stamp(BEGIN).after_s(seconds);
        MachineStateNode::step(&self.config, &mut self.state, now, input, &mut out);
        let said = out.messages().to_vec();
        for command in said.iter().filter_map(|one| match one {
            Output::Command(command) if command.kind == ControllerCommand::STOP => Some(command),
            _ => None,
        }) {
            let reply = Input::Reply(ControllerReply {
                session: command.session.clone(),
                command_id: command.command_id,
                outcome: ControllerReply::DONE,
                ..ControllerReply::default()
            });
            self.step(seconds, reply);
        }
        said
    }

    /// A sample with the stamp of the driver's clock, ns.
    fn sample(&mut self, seconds: f64, clock: i64) -> Vec<Output> {
        let sample = ControllerStatus {
            header: Stamp(clock).header(""),
            ..sample()
        };
        self.step(seconds, Input::Status(sample))
    }

    /// The outcome of a correction that is given at an instant; `None`: it is written.
    fn correct(&mut self, seconds: f64, id: &str) -> Option<u8> {
        let said = self.step(seconds, Input::Correction(correction_at(seconds, id)));
        said.iter().find_map(|one| match one {
            Output::Acknowledgement(ack) => Some(ack.outcome),
            _ => None,
        })
    }

    /// The answer to a request to cut.
    fn cut(&mut self, seconds: f64, request_id: u64) -> (u8, String) {
        self.state.writing.clear();
        let said = self.step(seconds, request(seconds, request_id, OperationRequest::CUT));
        let report = said.iter().find_map(|one| match one {
            Output::Report(report) => Some((report.outcome, report.text.clone())),
            _ => None,
        });
        report.expect("an answer")
    }
}

fn part(seconds: f64, stage: u8) -> Input {
    Input::PartStatus(PartStatus {
        header: Stamp(BEGIN).after_s(seconds).header(""),
        stage,
        run_number: 1,
        run_id: "p".to_owned(),
        part_id: "p".to_owned(),
        plan_id: "p/1".to_owned(),
        ..PartStatus::default()
    })
}

fn recording(seconds: f64, state: u8) -> Input {
    Input::Recording(RecordingStatus {
        header: Stamp(BEGIN).after_s(seconds).header(""),
        state,
        validity: 30.0,
        ..RecordingStatus::default()
    })
}

fn request(seconds: f64, request_id: u64, kind: u8) -> Input {
    Input::Request(OperationRequest {
        header: Stamp(BEGIN).after_s(seconds).header(""),
        kind,
        request_id,
        operation: "turn".to_owned(),
        plan_id: "p/1".to_owned(),
        run_id: "p".to_owned(),
        ..OperationRequest::default()
    })
}

fn correction_at(seconds: f64, id: &str) -> Correction {
    let now = Stamp(BEGIN).after_s(seconds);
    let correction = Correction {
        header: now.header(""),
        correction_id: id.to_owned(),
        expires: now.after_s(60.0).time(),
        ..correction()
    };
    approved(correction, now)
}

fn ended(seconds: f64) -> Input {
    Input::Part(PartReport {
        header: Stamp(BEGIN).after_s(seconds).header(""),
        run_id: "p".to_owned(),
        verdict: PartReport::QUALIFIED,
        ..PartReport::default()
    })
}

#[test]
fn a_correction_of_a_part_that_waits_for_it_is_written() {
    let mut gate = Gate::new();
    assert_eq!(gate.correct(0.5, "c"), None);
    assert_eq!(gate.state.writing.len(), 1);
}

#[test]
fn a_late_status_does_not_bring_a_part_back() {
    let mut gate = Gate::new();
    gate.step(0.5, ended(0.5));
    gate.step(0.6, part(0.1, PartStatus::CORRECTING));
    assert_eq!(gate.correct(0.7, "c"), Some(Ack::REFUSED_STALE));
}

#[test]
fn nothing_begins_for_a_part_that_an_operator_has_stopped_though_cycle_has_not_heard_of_it() {
    let mut gate = Gate::new();
    gate.step(0.5, Input::Stop(OperatorRequest::default()));
    gate.step(0.6, part(0.6, PartStatus::CORRECTING));
    assert_eq!(gate.correct(0.7, "c"), Some(Ack::REFUSED_STALE));
    let (outcome, text) = gate.cut(0.8, 6);
    assert_eq!(outcome, OperationReport::REFUSED);
    assert_eq!(text, "an operator has stopped the machine");
    // Its end is known: its measurement may be resumed under the same identity.
    gate.step(0.9, ended(0.9));
    assert_eq!(gate.cut(1.0, 7).0, OperationReport::UNDERWAY);
}

#[test]
fn nothing_is_corrected_from_a_measurement_of_which_a_correction_was_rejected() {
    let mut gate = Gate::new();
    let rejected = Correction {
        approval: Correction::APPROVAL_REJECTED,
        ..correction_at(0.5, "a")
    };
    gate.step(0.5, Input::Correction(rejected));
    assert_eq!(gate.correct(0.6, "b"), Some(Ack::REFUSED_STALE));
}

#[test]
fn a_late_status_of_the_recorder_does_not_bring_the_recording_back() {
    let mut gate = Gate::new();
    gate.step(0.5, recording(0.5, RecordingStatus::STOPPED));
    gate.step(0.6, recording(0.0, RecordingStatus::RECORDING));
    let (outcome, text) = gate.cut(0.7, 6);
    assert_eq!(outcome, OperationReport::REFUSED);
    assert!(text.contains("nothing is recorded"), "{text}");
    // Another recorder, by a clock that is behind.
    gate.step(31.0, recording(-500.0, RecordingStatus::RECORDING));
    gate.sample(31.0, BEGIN + 31 * SECOND);
    assert_eq!(gate.cut(31.1, 7).0, OperationReport::UNDERWAY);
}

#[test]
fn a_request_that_comes_after_a_newer_one_begins_nothing() {
    let mut gate = Gate::new();
    assert_eq!(gate.cut(0.5, 7).0, OperationReport::UNDERWAY);
    gate.state.operation = None;
    let said = gate.step(0.6, request(0.4, 6, OperationRequest::CUT));
    assert!(said.is_empty(), "{said:?}");
}

/// Over DDS on a loaded machine the request to cut came before the first report of the recorder, and the part was given up.
#[test]
fn a_gate_that_has_just_started_waits_for_the_recorder() {
    let config = config();
    let mut gate = Gate {
        state: MachineStateNode::start(&config),
        config,
    };
    gate.step(0.0, Input::Timer(START));
    gate.sample(0.0, BEGIN);
    gate.step(0.0, part(0.0, PartStatus::CUTTING));
    let asked = |gate: &mut Gate, seconds: f64| {
        let said = gate.step(seconds, request(seconds, 5, OperationRequest::CUT));
        let told = said.iter().find_map(|one| match one {
            Output::Report(report) => Some((report.outcome, report.text.clone())),
            _ => None,
        });
        let begun = said.iter().any(|one| match one {
            Output::Command(command) => command.kind == ControllerCommand::RUN_OPERATION,
            _ => false,
        });
        (told, begun)
    };
    let mut late = Gate {
        state: gate.state.clone(),
        config: gate.config.clone(),
    };
    assert_eq!(asked(&mut gate, 0.5), (None, false));
    gate.step(1.0, recording(1.0, RecordingStatus::RECORDING));
    let underway = (OperationReport::UNDERWAY, String::new());
    assert_eq!(asked(&mut gate, 1.5), (Some(underway), true));
    // Nobody waits for ever for a recorder that does not report.
    late.sample(10.5, BEGIN + 10 * SECOND);
    let (told, begun) = asked(&mut late, 10.5);
    let (outcome, text) = told.expect("an answer");
    assert_eq!((outcome, begun), (OperationReport::REFUSED, false));
    assert!(text.contains("no recorder has reported"), "{text}");
}

/// Seed 57: the cell was started anew by a clock that had been set back; the driver, a process of its own, took the gate for
/// its predecessor and its signs of life for late ones, and gave up every program.
#[test]
fn a_gate_is_known_as_another_process_although_the_clock_was_set_back() {
    let mut gate = Gate::new();
    let ahead = BEGIN + 3600 * SECOND;
    let mut later = Gate {
        state: MachineStateNode::start(&gate.config),
        config: gate.config.clone(),
    };
    later.step(0.0, Input::Timer(START));
    let said = later.sample(0.0, ahead);
    let command = said.iter().find_map(|one| match one {
        Output::Command(command) => Some(command.command_id),
        _ => None,
    });
    assert!(command.is_some_and(|number| number >= ahead as u64));
    let beat = |gate: &mut Gate| {
        let said = gate.step(0.1, Input::Timer(1));
        let beat = said.iter().find_map(|one| match one {
            Output::Heartbeat(beat) => Some(beat.started),
            _ => None,
        });
        beat.expect("a heartbeat")
    };
    assert!(beat(&mut later) >= ahead as u64);
    // A driver whose clock is not ahead changes nothing, nor does one that began just before this process or stands on the
    // clock of a neighbour: the first sample comes after the first signs of life.
    assert_eq!(beat(&mut gate), BEGIN as u64);
    let mut beside = Gate {
        state: MachineStateNode::start(&gate.config),
        config: gate.config.clone(),
    };
    beside.step(0.0, Input::Timer(START));
    beside.sample(0.1, BEGIN + SECOND / 2);
    assert_eq!(beat(&mut beside), BEGIN as u64);
}
