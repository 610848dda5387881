//! Step by step: what is told of the machine, and what the machine is told.

use graph::{Node, Outbox, START, Stamp};
use machine_state::{Input, MachineStateNode, Output};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction,
    CorrectionAcknowledgement as Ack, MachineState, MeasurementOrder, OperationReport,
    OperationRequest, OperatorKeys, PartReport, PartStatus, PlanProgress, RecordingStatus,
};

use crate::common::{approved, config, correction, key, sample};

/// A correction with the signature of the cell's policy at that instant; anything else as it is.
fn signed(input: Input, now: Stamp) -> Input {
    match input {
        Input::Correction(correction) => Input::Correction(approved(correction, now)),
        other => other,
    }
}

fn status() -> Input {
    Input::Status(sample())
}

fn request(kind: u8, request_id: u64) -> Input {
    let (operation, plan_id) = ("turn".to_owned(), "p/1".to_owned());
    Input::Request(OperationRequest {
        kind,
        request_id,
        operation,
        plan_id,
        ..OperationRequest::default()
    })
}

fn order(plan: &str) -> Input {
    Input::Order(MeasurementOrder {
        plan_id: plan.to_owned(),
        order: vec![1, 0],
        ..MeasurementOrder::default()
    })
}

fn reply(command_id: u64, outcome: u8, value: f64) -> Input {
    let session = "run 1".to_owned();
    Input::Reply(ControllerReply {
        session,
        command_id,
        outcome,
        value,
        ..ControllerReply::default()
    })
}

/// The machine is there, and plan p/1 was measured: command 0.
fn measured() -> Vec<Input> {
    vec![
        status(),
        order("p/1"),
        request(OperationRequest::MEASURE, 5),
        reply(0, ControllerReply::DONE, 0.0),
    ]
}

/// The cell is recorded, and the part whose measurement is `p/1` waits for its corrections.
fn context() -> [Input; 2] {
    let recording = RecordingStatus {
        state: RecordingStatus::RECORDING,
        ..RecordingStatus::default()
    };
    let part = PartStatus {
        stage: PartStatus::CORRECTING,
        run_number: 1,
        run_id: "p".to_owned(),
        part_id: "p".to_owned(),
        plan_id: "p/1".to_owned(),
        ..PartStatus::default()
    };
    [Input::Recording(recording), Input::PartStatus(part)]
}

/// Gives the inputs 0.1 s apart; what the last one makes the node say, a line each, readings of the axes left out.
fn check(inputs: Vec<Input>, expected: &[&str]) {
    let config = config();
    let mut state = MachineStateNode::start(&config);
    let mut said = Vec::new();
    for (index, input) in inputs.into_iter().enumerate() {
        let mut out = Outbox::default();
        for context in context() {
            let now = Stamp(index as i64 * 100_000_000);
            MachineStateNode::step(&config, &mut state, now, context, &mut Outbox::default());
        }
        let now = Stamp(index as i64 * 100_000_000);
        MachineStateNode::step(&config, &mut state, now, signed(input, now), &mut out);
        said = out.messages().iter().filter_map(line).collect();
    }
    assert_eq!(said, expected);
}

fn line(output: &Output) -> Option<String> {
    Some(match output {
        Output::JointStates(_)
        | Output::JointCommands(_)
        | Output::Heartbeat(_)
        | Output::Supervised(_) => return None,
        Output::Report(one) if one.outcome == OperationReport::UNDERWAY => return None,
        Output::Stopped(one) => format!("stop {}: {}", one.accepted, one.text),
        Output::RobotDescription(one) => format!("robot {}", one.data),
        Output::State(one) => format!("{} execution {}", one.machine_id, one.execution),
        Output::ToolOffsets(one) if !one.volumetric_entries.is_empty() => {
            format!("wear {:?} table {:?}", one.wear, one.volumetric_values)
        }
        Output::ToolOffsets(one) => format!("wear {:?}", one.wear),
        Output::Command(one) => match one.kind {
            ControllerCommand::RUN_OPERATION => {
                format!("{} {} run {}", one.session, one.command_id, one.operation)
            }
            ControllerCommand::RUN_MEASUREMENT => {
                format!(
                    "{} {} measure {} {:?}",
                    one.session, one.command_id, one.plan_id, one.order
                )
            }
            ControllerCommand::SET_TOOL_WEAR => {
                format!(
                    "{} {} wear of {} {:.1} µm",
                    one.session,
                    one.command_id,
                    one.tool_number,
                    one.value * 1e6
                )
            }
            ControllerCommand::SET_WORK_OFFSET => {
                format!(
                    "{} {} work offset of {} {:.1} µm",
                    one.session,
                    one.command_id,
                    one.axis,
                    one.value * 1e6
                )
            }
            ControllerCommand::SET_VOLUMETRIC => {
                format!(
                    "{} {} table {:?} {:?}",
                    one.session, one.command_id, one.entries, one.values
                )
            }
            _ => format!("{} {} stop", one.session, one.command_id),
        },
        Output::Report(one) => {
            let outcome = match one.outcome {
                OperationReport::DONE => "done",
                OperationReport::REFUSED => "refused",
                _ => "failed",
            };
            format!("request {} {outcome}: {}", one.request_id, one.text)
        }
        Output::Acknowledgement(one) => format!(
            "{} outcome {}: {}",
            one.correction_id, one.outcome, one.text
        ),
        Output::Fault(one) => one.code.clone(),
    })
}

fn with(mut inputs: Vec<Input>, more: Vec<Input>) -> Vec<Input> {
    inputs.extend(more);
    inputs
}

#[test]
fn the_machine_model_is_published_once_at_the_start() {
    check(vec![Input::Timer(START)], &["robot <robot/>"]);
    check(vec![Input::Timer(START), Input::Timer(1)], &[]);
}

#[test]
fn wear_offsets_are_told_when_they_change() {
    check(vec![status()], &["mill execution 0", "wear [0.0]"]);
    check(vec![status(), status()], &["mill execution 0"]);
    let worn = ControllerStatus {
        tool_wear: vec![-1e-5],
        ..sample()
    };
    check(
        vec![status(), Input::Status(worn)],
        &["mill execution 0", "wear [-1e-5]"],
    );
}

/// A machine with a table of two entries, and plan p/1 measured on it.
fn with_table(values: [f64; 2]) -> Input {
    Input::Status(ControllerStatus {
        volumetric_entries: vec!["EX0C".to_owned(), "EA0B".to_owned()],
        volumetric_values: values.to_vec(),
        ..sample()
    })
}

fn table() -> Correction {
    Correction {
        kind: Correction::VOLUMETRIC,
        previous_value: 11e-6,
        new_value: 30e-6,
        lower_bound: 0.0,
        upper_bound: 50e-6,
        entries: vec!["EX0C".to_owned(), "EA0B".to_owned()],
        previous_values: vec![1e-6, -2e-6],
        new_values: vec![9e-6, 40e-6],
        value_limits: vec![20e-6, 80e-6],
        value_uncertainties: vec![1e-7, 2e-6],
        ..correction()
    }
}

fn asked(correction: Correction) -> Vec<Input> {
    let table = with_table([1e-6, -2e-6]);
    with(measured(), vec![table, Input::Correction(correction)])
}

fn read_back(values: &[f64]) -> Input {
    Input::Reply(ControllerReply {
        session: "run 1".to_owned(),
        command_id: 1,
        outcome: ControllerReply::DONE,
        values_before: vec![1e-6, -2e-6],
        values: values.to_vec(),
        ..ControllerReply::default()
    })
}

#[test]
fn a_table_is_told_when_it_changes_and_written_whole() {
    let [old, new] = [[1e-6, -2e-6], [1e-6, 0.0]];
    check(
        vec![with_table(old), with_table(new)],
        &["mill execution 0", "wear [0.0] table [1e-6, 0.0]"],
    );
    check(
        vec![with_table(old), with_table(old)],
        &["mill execution 0"],
    );
    check(
        asked(table()),
        &["run 1 1 table [\"EX0C\", \"EA0B\"] [9e-6, 4e-5]"],
    );
}

#[test]
fn a_table_is_applied_only_when_every_entry_is_read_back() {
    let after = |values: &[f64]| with(asked(table()), vec![read_back(values)]);
    check(after(&[9e-6, 40e-6]), &["c outcome 0: "]);
    // A controller keeps 0.1 µm and 0.1 µrad.
    check(after(&[9.04e-6, 39.96e-6]), &["c outcome 0: "]);
    for read in [&[9e-6, 39.8e-6][..], &[9e-6], &[9e-6, f64::NAN], &[]] {
        check(
            after(read),
            &["c outcome 7: the value read back differs from the value written"],
        );
    }
}

#[test]
fn a_controller_without_that_table_or_another_one_is_told_none() {
    check(
        with(measured(), vec![Input::Correction(table())]),
        &["c outcome 7: the controller has no volumetric table"],
    );
    let three = Correction {
        entries: ["EX0C", "EA0B", "EC0B"].map(str::to_owned).to_vec(),
        ..table()
    };
    check(
        asked(three),
        &[
            "c outcome 7: it has the entries [EX0C, EA0B, EC0B], but the controller's table has [EX0C, EA0B]",
        ],
    );
    let beyond = Correction {
        new_values: vec![9e-6, -80.2e-6],
        ..table()
    };
    check(
        asked(beyond),
        &["c outcome 4: EA0B = -80.2 µrad lies outside ±80.0 µrad"],
    );
}

/// The controller holds 40 µm in X; the machine's limit is 2 mm.
#[test]
fn a_work_offset_starts_from_what_the_controller_tells_and_stays_within_its_bounds() {
    let offset = Correction {
        kind: Correction::WORK_OFFSET,
        tool_number: 0,
        axis: "X".to_owned(),
        previous_value: 40e-6,
        new_value: 350e-6,
        lower_bound: -1e-3,
        upper_bound: 1e-3,
        ..correction()
    };
    let holding = |axes: &[&str], values: &[f64]| {
        Input::Status(ControllerStatus {
            work_offset_axes: axes.iter().map(|axis| (*axis).to_owned()).collect(),
            work_offsets: values.to_vec(),
            ..sample()
        })
    };
    let asked = |held: Input, offset: Correction| {
        let correction = Input::Correction(offset);
        with(measured(), vec![held, correction])
    };
    let held = || holding(&["Z", "X"], &[0.0, 40e-6]);
    let written = asked(held(), offset.clone());
    check(written.clone(), &["run 1 1 work offset of X 350.0 µm"]);
    for (value, said) in [
        (350e-6, "c outcome 0: "),
        (
            340e-6,
            "c outcome 7: the value read back differs from the value written",
        ),
    ] {
        let answered = vec![reply(1, ControllerReply::DONE, value)];
        check(with(written.clone(), answered), &[said]);
    }
    let stale = "c outcome 3: it was computed from 40.0 µm, but the controller holds 45.0 µm";
    check(asked(holding(&["X"], &[45e-6]), offset.clone()), &[stale]);
    let unknown = "c outcome 7: the controller reports no work offset of axis \"X\"";
    check(asked(holding(&["Z"], &[0.0]), offset.clone()), &[unknown]);
    check(asked(holding(&["X"], &[]), offset.clone()), &[unknown]);
    for (value, lower, upper) in [
        (1.1e-3, -1e-3, 1e-3),
        (2.5e-3, -9e-3, 9e-3),
        (f64::NAN, -1e-3, 1e-3),
    ] {
        let beyond = Correction {
            new_value: value,
            lower_bound: lower,
            upper_bound: upper,
            ..offset.clone()
        };
        let limit = upper.min(2e-3) * 1e6;
        let said = format!(
            "c outcome 4: {:.1} µm lies outside -{limit:.1} to {limit:.1} µm",
            value * 1e6
        );
        check(asked(held(), beyond), &[&said]);
    }
}

#[test]
fn nothing_is_asked_of_a_machine_that_has_not_been_heard_or_is_busy() {
    check(
        vec![request(OperationRequest::CUT, 3)],
        &["request 3 refused: no sample of the controller has been received"],
    );
    check(
        vec![status(), request(OperationRequest::CUT, 3)],
        &["run 1 0 run turn"],
    );
    check(
        vec![
            status(),
            request(OperationRequest::CUT, 3),
            request(OperationRequest::CUT, 4),
        ],
        &["request 4 refused: the machine is busy"],
    );
    check(
        vec![
            status(),
            request(OperationRequest::CUT, 3),
            request(OperationRequest::STOP, 4),
        ],
        &["run 1 1 stop"],
    );
}

/// A stop that the driver has not confirmed would end what is begun meanwhile: the request waits until it is repeated.
#[test]
fn nothing_is_begun_while_a_stop_is_not_confirmed() {
    let stopping = || vec![status(), request(OperationRequest::STOP, 3)];
    check(
        with(stopping(), vec![request(OperationRequest::CUT, 4)]),
        &[],
    );
    let confirmed = Input::Reply(ControllerReply {
        session: sample().session,
        command_id: 0,
        outcome: ControllerReply::DONE,
        ..ControllerReply::default()
    });
    check(
        with(
            stopping(),
            vec![
                request(OperationRequest::CUT, 4),
                confirmed,
                request(OperationRequest::CUT, 4),
            ],
        ),
        &["run 1 1 run turn"],
    );
}

/// A driver that ended before it answered, and began again: what it says of the stop that each session begins with is the answer.
#[test]
fn a_stop_that_a_driver_took_with_it_is_confirmed_by_the_next_one() {
    let of = |session: &str| ControllerStatus {
        session: session.to_owned(),
        ..sample()
    };
    let confirmed = |session: &str, command_id: u64| {
        Input::Reply(ControllerReply {
            session: session.to_owned(),
            command_id,
            outcome: ControllerReply::DONE,
            ..ControllerReply::default()
        })
    };
    // Numbers count from the instant at which the gate began, ns.
    let restarted = || {
        vec![
            status(),
            Input::Timer(START),
            request(OperationRequest::STOP, 3),
            Input::Status(of("run 2")),
        ]
    };
    let answer = confirmed("run 2", 100_000_001);
    check(with(restarted(), vec![answer]), &["request 3 done: "]);
    // What is said in the name of the session that has ended counts for nothing.
    let late = confirmed("run 1", 100_000_000);
    check(with(restarted(), vec![late]), &[]);
}

/// Steps are 0.1 s apart and the limit is 10 s: the order comes 16 s after the request.
#[test]
fn a_measurement_waits_on_while_progress_of_its_plan_is_heard() {
    let progress = |plan_id: &str, phase: u8| {
        Input::Progress(PlanProgress {
            plan_id: plan_id.to_owned(),
            phase,
            ..PlanProgress::default()
        })
    };
    let waits = |heard: Input| {
        let mut inputs = vec![status(), request(OperationRequest::MEASURE, 5)];
        inputs.extend((0..80).map(|_| status()));
        inputs.push(heard);
        inputs.extend((0..80).map(|_| status()));
        inputs.push(Input::Timer(1));
        inputs
    };
    let overdue = "request 5 failed: no measuring order for plan \"p/1\" arrived in time";
    check(waits(progress("p/1", PlanProgress::SEARCHING)), &[]);
    check(waits(progress("p/1", PlanProgress::GIVEN_UP)), &[overdue]);
    check(waits(progress("p/2", PlanProgress::SEARCHING)), &[overdue]);
    let mut inputs = waits(progress("p/1", PlanProgress::SEARCHING));
    inputs.push(order("p/1"));
    check(inputs.clone(), &["run 1 0 measure p/1 [1, 0]"]);
    // From the last progress on it is as long as from the request.
    inputs.pop();
    inputs.extend((0..30).map(|_| status()));
    inputs.push(Input::Timer(1));
    check(inputs, &[overdue]);
}

#[test]
fn a_measurement_waits_for_the_order_of_its_own_plan() {
    let asked = || vec![status(), request(OperationRequest::MEASURE, 3)];
    check(asked(), &[]);
    check(
        with(asked(), vec![order("p/1")]),
        &["run 1 0 measure p/1 [1, 0]"],
    );
    check(with(asked(), vec![order("p/0")]), &[]);
    check(
        with(
            vec![status(), order("p/1")],
            vec![request(OperationRequest::MEASURE, 3)],
        ),
        &["run 1 0 measure p/1 [1, 0]"],
    );
}

#[test]
fn a_reply_is_reported_to_the_request_it_answers_and_only_from_this_run_of_the_driver() {
    let cutting = || vec![status(), request(OperationRequest::CUT, 3)];
    check(
        with(cutting(), vec![reply(0, ControllerReply::DONE, 0.0)]),
        &["request 3 done: "],
    );
    check(
        with(cutting(), vec![reply(7, ControllerReply::DONE, 0.0)]),
        &[],
    );
    let other = ControllerReply {
        session: "run 0".to_owned(),
        ..ControllerReply::default()
    };
    check(with(cutting(), vec![Input::Reply(other)]), &[]);
}

#[test]
fn a_silent_controller_is_lost_after_the_limit_and_found_again_by_its_next_sample() {
    let silent = |ticks: usize| {
        with(
            vec![status()],
            (0..ticks).map(|_| Input::Timer(1)).collect(),
        )
    };
    check(silent(10), &[]);
    check(silent(11), &["controller_lost", "mill execution 3"]);
    check(silent(12), &[]);
    check(
        with(silent(11), vec![request(OperationRequest::CUT, 3)]),
        &["request 3 refused: the controller sends no samples"],
    );
    check(
        with(
            silent(11),
            vec![status(), request(OperationRequest::CUT, 3)],
        ),
        &["run 1 0 run turn"],
    );
}

#[test]
fn an_alarm_fails_what_is_under_way_and_is_told_once_while_it_stands() {
    let alarm = |text: &str| {
        let alarms = vec![text.to_owned()];
        Input::Status(ControllerStatus {
            execution: MachineState::EXECUTION_ALARM,
            alarms,
            ..sample()
        })
    };
    let cutting = || vec![status(), request(OperationRequest::CUT, 3)];
    check(
        with(cutting(), vec![alarm("overtravel")]),
        &[
            "controller_alarm",
            "request 3 failed: overtravel",
            "mill execution 3",
        ],
    );
    check(
        with(cutting(), vec![alarm("overtravel"), alarm("overtravel")]),
        &["mill execution 3"],
    );
    check(
        with(
            cutting(),
            vec![alarm("Probe tripped during non-probe move.")],
        ),
        &[
            "unplanned_touch",
            "request 3 failed: the probe touched where no touch was planned",
            "mill execution 3",
        ],
    );
    check(
        vec![alarm("overtravel"), status(), alarm("overtravel")],
        &["controller_alarm", "mill execution 3"],
    );
}

#[test]
fn a_correction_is_written_when_nothing_speaks_against_it_and_acknowledged_by_what_is_read_back() {
    let written = || with(measured(), vec![Input::Correction(correction())]);
    check(written(), &["run 1 1 wear of 2 -20.0 µm"]);
    check(
        with(written(), vec![reply(1, ControllerReply::DONE, -20e-6)]),
        &["c outcome 0: "],
    );
    check(
        with(written(), vec![reply(1, ControllerReply::DONE, -19e-6)]),
        &["c outcome 7: the value read back differs from the value written"],
    );
    check(
        with(written(), vec![reply(1, ControllerReply::REFUSED, -20e-6)]),
        &["c outcome 7: the value read back differs from the value written"],
    );
    check(with(written(), vec![Input::Correction(correction())]), &[]);
    check(
        with(
            written(),
            vec![
                reply(1, ControllerReply::DONE, -20e-6),
                Input::Correction(correction()),
            ],
        ),
        &["c outcome 1: it has been applied already"],
    );
}

/// Inputs are 0.1 s apart and the limit is 30 s: the watch finds the driver silent on the one, and writes the other.
#[test]
fn a_driver_that_does_not_answer_a_correction_has_failed_it_and_the_next_one_is_written() {
    let next = Correction {
        correction_id: "d".to_owned(),
        ..correction()
    };
    let told = with(
        measured(),
        vec![
            Input::Correction(correction()),
            Input::Correction(next.clone()),
        ],
    );
    // Samples keep coming: the controller itself is not lost.
    let waiting = |samples: usize| with(told.clone(), vec![status(); samples]);
    check(with(waiting(298), vec![Input::Timer(1)]), &[]);
    check(
        with(waiting(299), vec![Input::Timer(1)]),
        &[
            "c outcome 7: the driver did not answer within 30 s: the value in the controller is unknown",
            "run 1 2 wear of 2 -20.0 µm",
        ],
    );
    // An answer after that says nothing of the other one.
    let late = vec![Input::Timer(1), reply(1, ControllerReply::DONE, -20e-6)];
    check(with(waiting(299), late), &[]);
}

fn part(verdict: u8) -> Input {
    Input::Part(PartReport {
        verdict,
        ..PartReport::default()
    })
}

/// Whoever approved it, and however long it waited behind another one.
#[test]
fn a_correction_of_a_part_that_has_ended_is_refused_until_its_measurement_is_asked_for_again() {
    let stale = format!(
        "c outcome {}: the part that it was made for has ended",
        Ack::REFUSED_STALE
    );
    let written = "run 1 1 wear of 2 -20.0 µm";
    for (verdict, said) in [
        (PartReport::QUALIFIED, written),
        (PartReport::MEASURED, written),
        (PartReport::STOPPED, &stale),
        (PartReport::SCRAP, &stale),
    ] {
        let ended = vec![part(verdict), Input::Correction(correction())];
        check(with(measured(), ended), &[said]);
    }
    let first = Correction {
        correction_id: "b".to_owned(),
        ..correction()
    };
    let waits = vec![
        Input::Correction(first),
        Input::Correction(correction()),
        part(PartReport::STOPPED),
        reply(1, ControllerReply::DONE, -20e-6),
    ];
    check(with(measured(), waits), &["b outcome 0: ", &stale]);

    let Input::Request(mut later) = request(OperationRequest::MEASURE, 6) else {
        unreachable!("a request");
    };
    later.header.stamp.sec = 1;
    let again = vec![
        part(PartReport::STOPPED),
        order("p/1"),
        Input::Request(later),
        reply(1, ControllerReply::DONE, 0.0),
        Input::Correction(correction()),
    ];
    check(with(measured(), again), &["run 1 2 wear of 2 -20.0 µm"]);
}

/// Inputs are 0.1 s apart and the limit is 30 s.
#[test]
fn an_operation_of_which_nothing_is_said_while_the_machine_is_idle_has_failed() {
    let cutting = |samples: Vec<Input>| {
        let begun = vec![status(), request(OperationRequest::CUT, 3)];
        with(begun, with(samples, vec![Input::Timer(1)]))
    };
    let idle = |count: usize| -> Vec<Input> { (0..count).map(|_| status()).collect() };
    let running = || {
        Input::Status(ControllerStatus {
            execution: MachineState::EXECUTION_RUNNING,
            ..sample()
        })
    };
    let failed = "request 3 failed: the machine has been idle for 30 s, but the driver has not reported an outcome";
    check(cutting(idle(300)), &[]);
    check(cutting(idle(301)), &[failed]);
    let worked = with(idle(200), with(vec![running()], idle(200)));
    check(cutting(worked), &[]);
    let long = (0..1000).map(|_| running()).collect();
    check(cutting(long), &[]);
}

#[test]
fn a_correction_that_rests_on_nothing_measured_here_is_refused() {
    let refused = format!(
        "c outcome {}: plan \"p/1\" was not measured on this machine in this session",
        Ack::REFUSED_NO_SOURCE
    );
    check(vec![status(), Input::Correction(correction())], &[&refused]);
}

#[test]
fn a_new_run_of_the_driver_voids_what_was_measured_and_what_was_under_way() {
    let restarted = || {
        Input::Status(ControllerStatus {
            session: "run 2".to_owned(),
            ..sample()
        })
    };
    check(
        vec![status(), request(OperationRequest::CUT, 3), restarted()],
        &[
            "request 3 failed: the driver was restarted",
            "controller_restarted",
            "mill execution 0",
            "wear [0.0]",
        ],
    );
    let stale = format!(
        "c outcome {}: its source was measured in another session of the driver",
        Ack::REFUSED_STALE
    );
    check(
        with(
            measured(),
            vec![restarted(), Input::Correction(correction())],
        ),
        &[&stale],
    );
}

/// A correction that is computed after the restart names the new session, though its plan was measured in the one before.
#[test]
fn what_an_earlier_run_of_the_driver_measured_entitles_to_no_correction_in_this_one() {
    let session = "run 2".to_owned();
    let restarted = Input::Status(ControllerStatus {
        session: session.clone(),
        ..sample()
    });
    let of_this_run = Correction {
        session,
        ..correction()
    };
    let refused = format!(
        "c outcome {}: plan \"p/1\" was not measured on this machine in this session",
        Ack::REFUSED_NO_SOURCE
    );
    let inputs = vec![restarted, Input::Correction(of_this_run)];
    check(with(measured(), inputs), &[&refused]);
}

/// Faults, commands and refusals that an input of that instant, in ms, leads to.
fn told(state: &mut machine_state::State, at_ms: i64, input: Input) -> Vec<String> {
    let mut out = Outbox::default();
    let now = Stamp(at_ms * 1_000_000);
    MachineStateNode::step(&config(), state, now, input, &mut out);
    let told = out.messages().iter().filter_map(|output| match output {
        Output::Fault(one) => Some(format!("{}: {}", one.code, one.text)),
        Output::Command(one) if one.kind == ControllerCommand::STOP => {
            Some(format!("stop {}", one.session))
        }
        Output::Command(one) => Some(format!("run {:?} in {}", one.operation, one.session)),
        Output::Report(one) if one.outcome == OperationReport::REFUSED => Some(one.text.clone()),
        _ => None,
    });
    told.collect()
}

/// A sample of a driver, taken at that instant, in ms.
fn sampled(session: &str, at_ms: i64) -> Input {
    let mut sample = ControllerStatus {
        session: session.to_owned(),
        ..sample()
    };
    sample.header.stamp = Stamp(at_ms * 1_000_000).time();
    Input::Status(sample)
}

/// Two drivers publish samples for six seconds, then the first one ends.
#[test]
fn two_drivers_are_reported_and_stopped_once_and_nothing_begins_until_one_has_ended() {
    let mut state = MachineStateNode::start(&config());
    let mut said = told(&mut state, 1, Input::Timer(START));
    said.extend(told(&mut state, 10, sampled("run 1", 10)));
    for at in (20..6000).step_by(10) {
        said.extend(told(&mut state, at, sampled("run 2", at)));
        said.extend(told(&mut state, at + 5, sampled("run 1", at + 5)));
        said.extend(told(&mut state, at + 6, Input::Timer(1)));
    }
    assert_eq!(
        said,
        [
            "stop run 1",
            "controller_restarted: the driver was restarted: its work is void",
            "stop run 2",
            "several_drivers: two drivers publish controller_status, in the sessions \"run 2\" and \"run 1\": the second is told to stop and is not listened to until one of them has ended",
            "stop run 1",
        ]
    );
    let [recorded, _] = context();
    assert!(told(&mut state, 6000, recorded).is_empty());
    assert_eq!(
        told(&mut state, 6000, request(OperationRequest::CUT, 3)),
        ["two drivers publish controller_status: all but one of them must be stopped"]
    );
    for at in (6010..7100).step_by(10) {
        assert!(told(&mut state, at, sampled("run 2", at)).is_empty());
        assert!(told(&mut state, at + 6, Input::Timer(1)).is_empty());
    }
    assert_eq!(
        told(&mut state, 7100, request(OperationRequest::CUT, 4)),
        ["run \"turn\" in run 2"]
    );
}

/// The one that took the place of the other ends: the other is a driver that has been started again.
#[test]
fn of_two_drivers_the_one_that_is_left_is_listened_to() {
    let mut state = MachineStateNode::start(&config());
    for (at, session) in [(10, "run 1"), (20, "run 2"), (30, "run 1")] {
        told(&mut state, at, sampled(session, at));
    }
    let mut said = Vec::new();
    for at in (40..1200).step_by(10) {
        said.extend(told(&mut state, at, sampled("run 1", at)));
        said.extend(told(&mut state, at + 5, Input::Timer(1)));
    }
    assert_eq!(
        said[..2],
        [
            "controller_lost: the controller sends no samples any more",
            "controller_restarted: the driver was restarted: its work is void",
        ]
    );
    assert!(!said.iter().any(|one| one.starts_with("several_drivers")));
}

/// Order holds within a topic of one publisher only.
#[test]
fn a_sample_of_the_driver_before_that_comes_late_is_no_second_driver() {
    let mut state = MachineStateNode::start(&config());
    for (at, session) in [(10, "run 1"), (30, "run 2")] {
        told(&mut state, at, sampled(session, at));
    }
    assert!(told(&mut state, 31, sampled("run 1", 20)).is_empty());
    let session = state.controller.map(|known| known.status.session);
    assert_eq!(session.as_deref(), Some("run 2"));
}

#[test]
fn the_keys_of_the_operators_outlive_a_run_of_the_driver() {
    let config = config();
    let keys = OperatorKeys {
        number: 1,
        ..OperatorKeys::default()
    };
    let mut state = MachineStateNode::start(&config);
    let restarted = ControllerStatus {
        session: "run 2".to_owned(),
        ..sample()
    };
    for input in [
        status(),
        Input::Keys(signatures::operators::signed(&key(), keys)),
        Input::Status(restarted),
    ] {
        let mut out = Outbox::default();
        MachineStateNode::step(&config, &mut state, Stamp(1), input, &mut out);
    }
    assert_eq!(state.keys.map(|keys| keys.number), Some(1));
}
