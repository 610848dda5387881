//! Processes of a cell that end or fall silent: the machine stops by itself, nothing is written for a part that nobody makes,
//! nothing is done twice, and every part ends in a report.

use std::collections::BTreeSet;

use cell::Cell;
use cell_tests::{cell, messages, session::Session};
use graph::{Published, Stamp, topics};
use probecell_msgs::{
    ControllerCommand, ControllerStatus, Correction, CorrectionAcknowledgement, Fault,
    MachineState, OperationRequest, OperatorReply, OperatorRequest, PartReport, PartStatus,
    ProbeEvent, RecordingStatus, builtin_interfaces::Time,
};

/// The turn-mill, whose first cut takes eight seconds.
fn slow(edit: impl Fn(&str) -> String) -> Cell {
    cell("turn_mill.toml", |text| {
        edit(&text.replacen("duration_s = 2.0", "duration_s = 8.0", 1))
    })
}

fn samples(log: &[Published]) -> Vec<ControllerStatus> {
    messages(log, topics::CONTROLLER_STATUS.name)
}

fn commands(session: &Session, kind: u8) -> Vec<ControllerCommand> {
    let all: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
    all.into_iter().filter(|one| one.kind == kind).collect()
}

/// The instants of the samples in which a program ran, within the log from `begin` on.
fn running(log: &[Published], begin: Stamp) -> Vec<Stamp> {
    let samples = samples(log).into_iter();
    samples
        .filter(|sample| sample.execution == MachineState::EXECUTION_RUNNING)
        .map(|sample| Stamp::from(&sample.header.stamp))
        .filter(|at| *at > begin)
        .collect()
}

/// A part whose first cut has lasted for a second.
fn cutting(cell: &Cell) -> Session {
    let mut session = Session::new(cell);
    session.ask_for("punch");
    session.run_s(1.0);
    let sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
    assert_eq!(sample.execution, MachineState::EXECUTION_RUNNING);
    session
}

#[test]
fn a_machine_whose_gate_is_killed_stops_by_itself_within_two_seconds() {
    let cell = slow(str::to_owned);
    let mut session = cutting(&cell);
    let killed = session.now();
    session.kill("machine_state");
    session.run_s(30.0);
    let last = running(session.log(), killed).pop().unwrap_or(killed);
    assert!(last.since_s(killed) < 1.5, "{} s", last.since_s(killed));
    // The part does not hang either, although nobody says that a process has ended.
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.contains("has not confirmed"), "{}", report.text);
}

#[test]
fn the_first_word_of_a_gate_is_stop_and_another_gate_ends_what_the_former_began() {
    let cell = slow(str::to_owned);
    let mut session = cutting(&cell);
    let before = session.all::<ControllerCommand>(topics::CONTROLLER_COMMANDS);
    let killed = session.now();
    session.restart(&cell, "machine_state");
    session.run_s(20.0);
    let all = session.all::<ControllerCommand>(topics::CONTROLLER_COMMANDS);
    assert_eq!(all[before.len()].kind, ControllerCommand::STOP);
    assert_eq!(before[0].kind, ControllerCommand::STOP);
    let last = running(session.log(), killed).pop().unwrap_or(killed);
    assert!(last.since_s(killed) < 0.2, "{} s", last.since_s(killed));
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    assert!(
        !report.text.contains("has not confirmed"),
        "{}",
        report.text
    );
}

#[test]
fn a_request_that_nobody_took_is_repeated_and_carried_out_once() {
    let cell = slow(str::to_owned);
    let mut session = Session::new(&cell);
    session.kill("machine_state");
    session.ask_for("punch");
    session.run_s(3.5);
    session.restart(&cell, "machine_state");
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    // Repeated while nobody was there, and again now as if the link had delivered everything twice.
    let requests: Vec<OperationRequest> = session.all(topics::OPERATION_REQUESTS);
    let distinct: BTreeSet<u64> = requests.iter().map(|one| one.request_id).collect();
    assert!(requests.len() > distinct.len() + 1);
    let cuts = requests
        .iter()
        .filter(|one| one.kind == OperationRequest::CUT)
        .map(|one| one.request_id)
        .collect::<BTreeSet<_>>();
    let runs = || commands(&session, ControllerCommand::RUN_OPERATION).len();
    assert_eq!(runs(), cuts.len());
}

#[test]
fn every_request_may_come_twice_and_is_carried_out_once() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut once = Session::new(&cell);
    once.make("punch");
    let mut twice = Session::new(&cell);
    twice.ask_for("punch");
    let mut seen = 0;
    while twice.all::<PartReport>(topics::PART_REPORTS).is_empty() {
        twice.run_s(0.05);
        let requests: Vec<OperationRequest> = twice.all(topics::OPERATION_REQUESTS);
        if let Some(request) = requests.get(seen) {
            twice.send(topics::OPERATION_REQUESTS, request);
            seen += 2;
        }
    }
    let report: PartReport = twice.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    assert!(seen > 8);
    for kind in [
        ControllerCommand::RUN_OPERATION,
        ControllerCommand::RUN_MEASUREMENT,
        ControllerCommand::SET_TOOL_WEAR,
    ] {
        assert_eq!(commands(&once, kind).len(), commands(&twice, kind).len());
    }
}

#[test]
fn each_stage_of_a_part_has_a_deadline() {
    let limited = |key: &str| {
        let line = format!("[cycle]\n{key}\n");
        slow(move |text| {
            text.replacen("[cycle]\n", &line, 1).replace(
                "automatic_approval = true",
                "automatic_approval = false\napproval_limit_s = 5",
            )
        })
    };
    // A cut that takes too long, a decision that does not come, corrections that nobody answers any more.
    for (key, killed, says) in [
        ("operation_limit_s = 5.0", None, "lasted longer than 5 s"),
        (
            "decision_limit_s = 5.0",
            Some((topics::OPERATION_REQUESTS, "compensation")),
            "no decision on",
        ),
        (
            "correction_limit_s = 7.0",
            Some((topics::PASS_DECISIONS, "compensation")),
            "not acknowledged within 7 s",
        ),
    ] {
        let cell = limited(key);
        let mut session = Session::new(&cell);
        session.ask_for("punch");
        if let Some((topic, node)) = killed {
            session.run_to(topic);
            session.kill(node);
        }
        let report = session.wait_for_report();
        assert_eq!(report.verdict, PartReport::STOPPED, "{key}");
        assert!(report.text.contains(says), "{key}: {}", report.text);
        session.run_s(0.1);
        let sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
        assert_eq!(sample.execution, MachineState::EXECUTION_IDLE, "{key}");
    }
}

#[test]
fn an_operator_stops_machine_and_part_and_is_told_that_it_stands() {
    let cell = slow(str::to_owned);
    let mut session = cutting(&cell);
    let asked = session.now();
    let request = OperatorRequest {
        request_id: 77,
        operator_name: "Ada".to_owned(),
        ..OperatorRequest::default()
    };
    session.send(topics::STOP_REQUESTS, &request);
    let report = session.wait_for_report();
    session.run_s(5.0);
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.starts_with("stopped by Ada"), "{}", report.text);
    let reply: OperatorReply = session.last(topics::STOP_REPLIES);
    assert_eq!((reply.request_id, reply.accepted), (77, true));
    let last = running(session.log(), asked).pop().unwrap_or(asked);
    assert!(last.since_s(asked) < 0.1);
}

#[test]
fn a_part_whose_cycle_is_killed_is_stopped_gets_no_correction_and_is_reported() {
    let cell = slow(|text| text.replace("automatic_approval = true", "automatic_approval = false"));
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::CORRECTIONS);
    session.run_s(1.0);
    let proposed: Vec<Correction> = session.all(topics::CORRECTIONS);
    session.kill("cycle");
    session.run_s(0.5);
    // At once: the gate has not noticed yet that nobody makes the part.
    session.answer(&proposed[0], true);
    session.run_s(6.0);
    // Later: it has.
    session.answer(&proposed[1], true);
    session.run_s(6.0);
    let answers: Vec<CorrectionAcknowledgement> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
    let late = answers
        .iter()
        .find(|one| one.correction_id == proposed[1].correction_id)
        .expect("an answer");
    assert_eq!(late.outcome, CorrectionAcknowledgement::REFUSED_STALE);
    let written = commands(&session, ControllerCommand::SET_TOOL_WEAR).len();
    assert!(written <= 1, "only what came within the gate's patience");
    assert!(session.fault_codes().contains(&"cycle_lost".to_owned()));
    assert!(session.all::<PartReport>(topics::PART_REPORTS).is_empty());
    session.restart(&cell, "cycle");
    session.run_s(1.0);
    let reports: Vec<PartReport> = session.all(topics::PART_REPORTS);
    let [report] = &reports[..] else {
        panic!("{reports:?}")
    };
    assert_eq!(
        (report.part_id.as_str(), report.run_id.as_str()),
        ("punch", "punch")
    );
    assert_eq!(report.verdict, PartReport::STOPPED);
    let known: PartStatus = session.last(topics::SUPERVISED_PART);
    assert_eq!((known.stage, known.run_number), (PartStatus::NONE, 1));
    // The next part of that name is another run.
    session.ask_for("punch");
    session.run_s(1.0);
    let status: PartStatus = session.last(topics::PART_STATUS);
    assert_eq!(status.run_id, "punch#2");
}

#[test]
fn a_cut_whose_cycle_is_killed_is_stopped() {
    let cell = slow(str::to_owned);
    let mut session = cutting(&cell);
    let killed = session.now();
    session.kill("cycle");
    session.run_s(10.0);
    let last = running(session.log(), killed).pop().unwrap_or(killed);
    assert!(last.since_s(killed) < 4.0, "{} s", last.since_s(killed));
}

#[test]
fn parts_of_one_name_are_runs_of_their_own_and_the_bar_of_each_is_new() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    for _ in 0..6 {
        let report = session.make("punch");
        assert_eq!(report.part_id, "punch");
        assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    }
    let reports: Vec<PartReport> = session.all(topics::PART_REPORTS);
    let runs: BTreeSet<&str> = reports.iter().map(|one| one.run_id.as_str()).collect();
    assert_eq!(runs.len(), 6);
    session.ask_for("punch#2");
    session.run_s(0.1);
    let reply: OperatorReply = session.last(topics::RUN_REPLIES);
    assert!(
        !reply.accepted && reply.text.contains('#'),
        "{}",
        reply.text
    );
}

#[test]
fn touches_keep_their_numbers_when_probe_events_is_started_again() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    session.make("first");
    session.restart(&cell, "probe_events");
    session.run_s(1.0);
    session.make("second");
    let events: Vec<ProbeEvent> = session.all(topics::PROBE_EVENTS);
    let numbers: Vec<u64> = events.iter().map(|event| event.sequence).collect();
    let expected: Vec<u64> = (0..numbers.len() as u64).collect();
    assert_eq!(numbers, expected);
    let corrections: Vec<Correction> = session.all(topics::CORRECTIONS);
    let ids: BTreeSet<&str> = corrections
        .iter()
        .map(|one| one.correction_id.as_str())
        .collect();
    assert_eq!(ids.len(), corrections.len());
}

#[test]
fn a_request_that_has_expired_starts_nothing() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    let expired = session.now().after_s(-0.1).time();
    for (expires, accepted) in [(expired, false), (Time::default(), true)] {
        let request = OperatorRequest {
            subject: "punch".to_owned(),
            operator_name: "Ada".to_owned(),
            expires,
            ..OperatorRequest::default()
        };
        session.send(topics::RUN_REQUESTS, &request);
        session.run_s(0.5);
        let reply: OperatorReply = session.last(topics::RUN_REPLIES);
        assert_eq!(reply.accepted, accepted, "{}", reply.text);
        let started = !commands(&session, ControllerCommand::RUN_OPERATION).is_empty();
        assert_eq!(started, accepted);
    }
}

#[test]
fn no_operation_starts_while_nothing_is_recorded() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    let tell = |session: &mut Session, state: u8, validity: f64| {
        let status = RecordingStatus {
            state,
            validity,
            ..RecordingStatus::default()
        };
        session.send(topics::RECORDING_STATUS, &status);
        session.run_s(1.0);
    };
    tell(&mut session, RecordingStatus::STOPPED, 0.0);
    let report = session.make("unrecorded");
    assert!(
        report.text.contains("nothing is recorded"),
        "{}",
        report.text
    );
    tell(&mut session, RecordingStatus::RECORDING, 2.0);
    session.run_s(2.0);
    let report = session.make("recorder silent");
    assert!(report.text.contains("fallen silent"), "{}", report.text);
    assert!(commands(&session, ControllerCommand::RUN_OPERATION).is_empty());
    tell(&mut session, RecordingStatus::RECORDING, 600.0);
    assert_eq!(session.make("recorded").verdict, PartReport::QUALIFIED);
}

/// What the launcher says when the recorder has ended, as it does when its disk refuses.
#[test]
fn the_end_of_the_recorder_stops_the_part() {
    let cell = slow(str::to_owned);
    let mut session = cutting(&cell);
    let ended = Fault {
        node: "recorder".to_owned(),
        code: Fault::PROCESS_ENDED.to_owned(),
        severity: Fault::ERROR,
        text: "cannot write the recording: Input/output error (os error 5)".to_owned(),
        ..Fault::default()
    };
    session.send(topics::LAUNCHER_FAULTS, &ended);
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(
        report.text.contains("recorder: process_ended"),
        "{}",
        report.text
    );
    session.run_s(0.1);
    let sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
    assert_eq!(sample.execution, MachineState::EXECUTION_IDLE);
}

#[test]
fn a_gate_that_is_started_again_does_not_answer_corrections_of_before() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    session.make("punch");
    let before: Vec<CorrectionAcknowledgement> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert!(!before.is_empty());
    let applied =
        |one: &CorrectionAcknowledgement| one.outcome == CorrectionAcknowledgement::APPLIED;
    assert!(before.iter().all(applied));
    session.restart(&cell, "machine_state");
    session.run_s(5.0);
    let after: Vec<CorrectionAcknowledgement> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert_eq!(after, before);
    let faults: Vec<Fault> = session.all(topics::MACHINE_STATE_FAULTS);
    assert!(faults.is_empty(), "{faults:?}");
    assert_eq!(session.make("second").verdict, PartReport::QUALIFIED);
}
