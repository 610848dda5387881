//! Step by step: what the part program asks of the machine, and when it ends.

use cycle::{Config, CycleNode, Input, Output, Pass};
use graph::{Node, Outbox, Stamp};
use probecell_msgs::{
    CorrectionAcknowledgement as Ack, Fault, OperationReport, OperationRequest, OperatorRequest,
    PartReport, PartStatus, PassDecision,
};

/// A rough pass of two operations and a finishing pass of one.
fn config() -> Config {
    let pass = |name: &str, operations: &[&str]| Pass {
        name: name.to_owned(),
        operations: operations
            .iter()
            .map(|&operation| operation.to_owned())
            .collect(),
        allowance_mm: 0.0,
        for_record: false,
    };
    Config {
        passes: vec![pass("rough", &["turn", "mill"]), pass("finish", &["face"])],
        decision_limit: 30.0,
        operation_limit: 600.0,
        correction_limit: 60.0,
        answer_limit: 10.0,
    }
}

/// Gives the inputs one second apart; what the last one makes the node say, a line each.
fn check(inputs: Vec<Input>, expected: &[&str]) {
    let config = config();
    let mut state = CycleNode::start(&config);
    let mut said = Vec::new();
    let informed = Input::Supervised(PartStatus::default());
    CycleNode::step(
        &config,
        &mut state,
        Stamp(0),
        informed,
        &mut Outbox::default(),
    );
    for (second, input) in inputs.into_iter().enumerate() {
        let mut out = Outbox::default();
        CycleNode::step(
            &config,
            &mut state,
            Stamp(second as i64 * 1_000_000_000),
            input,
            &mut out,
        );
        said = out.messages().iter().filter_map(line).collect();
    }
    assert_eq!(said, expected);
}

fn line(output: &Output) -> Option<String> {
    Some(match output {
        Output::Status(_) | Output::Orders(_) | Output::OrderReply(_) => return None,
        Output::Request(one) if one.kind == OperationRequest::CUT => {
            format!("{} cut {}", one.request_id, one.operation)
        }
        Output::Request(one) if one.kind == OperationRequest::MEASURE => {
            format!(
                "{} measure {} in pass {}",
                one.request_id, one.plan_id, one.pass_number
            )
        }
        Output::Request(one) => format!("{} stop", one.request_id),
        Output::Part(one) => {
            let verdict = match one.verdict {
                PartReport::QUALIFIED => "qualified",
                PartReport::SCRAP => "scrap",
                _ => "stopped",
            };
            format!(
                "{} {verdict} after {} passes: {}",
                one.part_id, one.passes, one.text
            )
        }
        Output::Reply(one) => format!("accepted {}: {}", one.accepted, one.text),
    })
}

fn run(part: &str) -> Input {
    Input::Run(OperatorRequest {
        subject: part.to_owned(),
        ..OperatorRequest::default()
    })
}

fn done(request_id: u64) -> Input {
    report(request_id, OperationReport::DONE, "")
}

fn report(request_id: u64, outcome: u8, text: &str) -> Input {
    Input::Report(OperationReport {
        request_id,
        outcome,
        text: text.to_owned(),
        ..OperationReport::default()
    })
}

/// So many checks, a second apart.
fn ticks(count: usize) -> Vec<Input> {
    (0..count).map(|_| Input::Timer(1)).collect()
}

fn decision(plan_id: &str, decision: u8, corrections: &[&str]) -> Input {
    Input::Decision(PassDecision {
        plan_id: plan_id.to_owned(),
        decision,
        correction_ids: corrections.iter().map(|&id| id.to_owned()).collect(),
        text: "so decided".to_owned(),
        ..PassDecision::default()
    })
}

fn answer(correction: &str, outcome: u8) -> Input {
    Input::Acknowledgement(Ack {
        correction_id: correction.to_owned(),
        outcome,
        text: "because".to_owned(),
        ..Ack::default()
    })
}

/// The rough pass up to its measurement, which is request 2.
fn measured() -> Vec<Input> {
    vec![run("p"), done(0), done(1)]
}

fn with(mut inputs: Vec<Input>, more: Vec<Input>) -> Vec<Input> {
    inputs.extend(more);
    inputs
}

#[test]
fn a_run_begins_with_the_first_operation_of_the_first_pass() {
    check(vec![run("p")], &["accepted true: ", "0 cut turn"]);
}

/// Resumes the measurement of a plan.
fn resume(plan_id: &str) -> Input {
    Input::Run(OperatorRequest {
        plan_id: plan_id.to_owned(),
        ..OperatorRequest::default()
    })
}

fn machine_fault(code: &str) -> Input {
    Input::MachineFault(Fault {
        node: "machine_state".to_owned(),
        severity: Fault::ERROR,
        code: code.to_owned(),
        text: "so it is".to_owned(),
        ..Fault::default()
    })
}

/// Request 2, the measurement, is stopped by request 3.
#[test]
fn nothing_is_resumed_after_a_restart_of_the_driver_and_the_refusal_says_why() {
    let stopped = |code: &str| with(measured(), vec![machine_fault(code), done(3)]);
    let resumed = |code: &str| with(stopped(code), vec![resume("p/rough/1")]);
    check(
        resumed("probe_stuck"),
        &["accepted true: ", "4 measure p/rough/1 in pass 0"],
    );
    let restarted = "accepted false: nothing can be resumed: the driver was restarted, what it measured is void";
    check(resumed(Fault::CONTROLLER_RESTARTED), &[restarted]);
    // Also when the driver is restarted after the part has ended.
    let later = with(
        stopped("probe_stuck"),
        vec![
            machine_fault(Fault::CONTROLLER_RESTARTED),
            resume("p/rough/1"),
        ],
    );
    check(later, &[restarted]);
    check(
        resumed(Fault::PROCESS_ENDED),
        &["accepted false: nothing can be resumed: what was measured is void: so it is"],
    );
    check(
        vec![resume("p/rough/1")],
        &[
            "accepted false: nothing can be resumed: the last measurement is not one of this plan that was broken off",
        ],
    );
}

#[test]
fn a_part_without_a_name_and_a_second_part_are_refused() {
    check(
        vec![run("")],
        &["accepted false: the request names no part"],
    );
    check(
        vec![run("p"), run("q")],
        &["accepted false: a part is being made"],
    );
}

#[test]
fn a_pass_is_measured_when_all_its_operations_are_cut() {
    check(vec![run("p"), done(0)], &["1 cut mill"]);
    check(measured(), &["2 measure p/rough/1 in pass 0"]);
}

#[test]
fn a_decision_waits_until_the_probe_is_out_of_the_way() {
    let next = || decision("p/rough/1", PassDecision::NEXT, &[]);
    check(with(measured(), vec![next()]), &[]);
    check(with(measured(), vec![next(), done(2)]), &["3 cut face"]);
    check(with(measured(), vec![done(2), next()]), &["3 cut face"]);
}

#[test]
fn a_recut_waits_for_every_correction_in_whatever_order_they_are_answered() {
    let recut = || decision("p/rough/1", PassDecision::RECUT, &["a", "b"]);
    check(
        with(
            measured(),
            vec![done(2), recut(), answer("b", Ack::APPLIED)],
        ),
        &[],
    );
    check(
        with(
            measured(),
            vec![
                done(2),
                recut(),
                answer("b", Ack::APPLIED),
                answer("a", Ack::APPLIED),
            ],
        ),
        &["3 cut turn"],
    );
    check(
        with(
            measured(),
            vec![
                answer("a", Ack::APPLIED),
                answer("b", Ack::ALREADY_APPLIED),
                recut(),
                done(2),
            ],
        ),
        &["3 cut turn"],
    );
}

#[test]
fn a_refused_correction_stops_the_part() {
    let recut = decision("p/rough/1", PassDecision::RECUT, &["a"]);
    check(
        with(
            measured(),
            vec![done(2), recut, answer("a", Ack::REFUSED_STALE)],
        ),
        &["p stopped after 1 passes: correction a was refused: because"],
    );
}

#[test]
fn the_last_pass_qualified_qualifies_the_part_and_a_scrapped_pass_scraps_it() {
    let finish = || {
        with(
            measured(),
            vec![
                done(2),
                decision("p/rough/1", PassDecision::NEXT, &[]),
                done(3),
                done(4),
            ],
        )
    };
    check(
        with(
            finish(),
            vec![decision("p/finish/1", PassDecision::NEXT, &[])],
        ),
        &["p qualified after 2 passes: so decided"],
    );
    check(
        with(
            finish(),
            vec![decision("p/finish/1", PassDecision::SCRAP, &[])],
        ),
        &["p scrap after 2 passes: so decided"],
    );
}

#[test]
fn a_decision_on_another_measurement_is_not_followed() {
    check(
        with(
            measured(),
            vec![done(2), decision("p/rough/7", PassDecision::NEXT, &[])],
        ),
        &[],
    );
}

#[test]
fn a_fault_stops_machine_and_part_and_a_warning_does_not() {
    let fault = |severity| {
        let (node, code) = ("probe_events".to_owned(), "probe_dead".to_owned());
        Input::ProbeFault(Fault {
            node,
            code,
            severity,
            text: "no trigger".to_owned(),
            ..Fault::default()
        })
    };
    check(with(measured(), vec![fault(Fault::WARNING)]), &[]);
    check(with(measured(), vec![fault(Fault::ERROR)]), &["3 stop"]);
    // The part ends when the machine has confirmed that it stands, or has not.
    let told = |last: Input| with(measured(), vec![fault(Fault::ERROR), last]);
    let stopped = "p stopped after 1 passes: probe_events: probe_dead: no trigger";
    check(told(done(3)), &[stopped]);
    check(told(done(2)), &[]);
    check(told(fault(Fault::ERROR)), &[]);
    let unconfirmed = report(3, OperationReport::FAILED, "silence");
    let text = format!("{stopped}; the machine has not confirmed its standstill: silence");
    check(told(unconfirmed), &[&text]);
    let text = format!("{stopped}; the machine has not confirmed its standstill within 10 s");
    check(
        with(with(measured(), vec![fault(Fault::ERROR)]), ticks(11)),
        &["3 stop", &text],
    );
    check(vec![fault(Fault::ERROR)], &[]);
}

#[test]
fn a_request_is_repeated_until_it_is_taken_and_silence_of_the_machine_stops_the_part() {
    check(with(vec![run("p")], ticks(1)), &["0 cut turn"]);
    check(with(vec![run("p")], ticks(2)), &["0 cut turn"]);
    let taken = || report(0, OperationReport::UNDERWAY, "");
    check(with(vec![run("p"), taken()], ticks(1)), &[]);
    check(with(vec![run("p"), taken()], ticks(10)), &[]);
    check(with(vec![run("p"), taken()], ticks(11)), &["1 stop"]);
    // As long as the machine says that it is under way, it may take its time.
    let mut long = vec![run("p")];
    for _ in 0..50 {
        long.extend(with(vec![taken()], ticks(5)));
    }
    check(with(long, vec![done(0)]), &["1 cut mill"]);
}

#[test]
fn a_decision_that_does_not_come_stops_the_part_but_only_for_its_own_measurement() {
    check(with(with(measured(), vec![done(2)]), ticks(29)), &[]);
    let late = || with(with(measured(), vec![done(2)]), ticks(31));
    check(late(), &["3 stop"]);
    let overdue = "p stopped after 1 passes: no decision on p/rough/1 arrived in time";
    check(with(late(), vec![done(3)]), &[overdue]);
    let recut = || decision("p/rough/1", PassDecision::RECUT, &["a"]);
    let correcting = || with(measured(), vec![done(2), recut()]);
    check(with(correcting(), ticks(59)), &[]);
    check(with(correcting(), ticks(61)), &["3 stop"]);
}

#[test]
fn an_operation_that_fails_stops_the_part() {
    let text = "p stopped after 0 passes: the machine did not complete an operation: no tool";
    let refused = report(0, OperationReport::REFUSED, "no tool");
    check(vec![run("p"), refused], &[text]);
    let failed = || report(0, OperationReport::FAILED, "no tool");
    check(vec![run("p"), failed()], &["1 stop"]);
    check(vec![run("p"), failed(), done(1)], &[text]);
}

/// The finishing pass of `part`, whose requests begin at `first`, up to its decision.
fn qualified(part: &str, first: u64) -> Vec<Input> {
    vec![
        run(part),
        done(first),
        done(first + 1),
        done(first + 2),
        decision(&format!("{part}/rough/1"), PassDecision::NEXT, &[]),
        done(first + 3),
        done(first + 4),
        decision(&format!("{part}/finish/1"), PassDecision::NEXT, &[]),
    ]
}

#[test]
fn a_part_that_a_reference_refutes_is_not_qualified_and_the_series_stops() {
    let revoked = || decision("p/finish/1", PassDecision::REVOKED, &[]);
    let refuted = "p stopped after 2 passes: not qualified any more: so decided";
    check(with(qualified("p", 0), vec![revoked()]), &[refuted]);
    // The next part is under way: it is stopped.
    check(
        with(qualified("p", 0), vec![run("q"), revoked()]),
        &["6 stop", refuted],
    );
    check(
        with(qualified("p", 0), vec![run("q"), revoked(), done(6)]),
        &["q stopped after 0 passes: so decided"],
    );
    // Said once.
    check(with(qualified("p", 0), vec![revoked(), revoked()]), &[]);
    check(
        with(qualified("p", 0), vec![revoked(), run("q")]),
        &[
            "accepted false: no part is made until the cause is found and the cell started again: so decided",
        ],
    );
    // Touches of the same part may help to find the cause.
    let touches = Input::Run(OperatorRequest {
        subject: "p".to_owned(),
        plan_id: "p/finish/1/next".to_owned(),
        ..OperatorRequest::default()
    });
    check(
        with(qualified("p", 0), vec![revoked(), touches]),
        &["accepted true: ", "5 measure p/finish/1/next in pass 0"],
    );
}

/// A link delivered the request for a part again when the part had ended, and another was begun.
#[test]
fn a_request_for_a_part_that_is_delivered_again_begins_no_second_one() {
    let once = || {
        Input::Run(OperatorRequest {
            request_id: 3,
            subject: "part".to_owned(),
            expires: Stamp(60_000_000_000).time(),
            ..OperatorRequest::default()
        })
    };
    let refused = report(0, OperationReport::REFUSED, "the machine is busy");
    check(vec![once(), refused.clone(), once()], &[]);
    // Another request is one of its own.
    check(
        vec![once(), refused, run("part")],
        &["accepted true: ", "1 cut turn"],
    );
}

/// `machine_state` told a restarted `cycle` twice which part there was.
#[test]
fn the_part_of_an_earlier_process_is_reported_once() {
    let known = || {
        Input::Supervised(PartStatus {
            stage: PartStatus::CUTTING,
            run_number: 1,
            run_id: "part".to_owned(),
            part_id: "part".to_owned(),
            ..PartStatus::default()
        })
    };
    let reported = "part stopped after 0 passes: cycle was restarted while the part was made";
    check(vec![known()], &[reported]);
    check(vec![known(), known()], &[]);
}
