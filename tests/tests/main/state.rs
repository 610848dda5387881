//! Nothing in the memory of a node is there for nothing, and nothing in it can be lost unseen.
//!
//! Each field of each node's state is put back to its value at the start, in the middle of a session, and the node goes
//! on from there on the inputs that it had. Somewhere what it says must change: a field for which it never does is either
//! not needed, or no session shown here needs it.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        LazyLock, Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};

use cell::Cell;
use cell_tests::{
    cell, messages,
    series::series,
    session::{Session, alone, with_fault},
    trace::{Cause, Trace},
};
use graph::{Published, START, topics};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, Correction, FeatureResult,
    InspectionPlan, MachineState, OperationRequest, OperatorReply, OperatorRequest, OrderRequest,
    Orders, PartReport, ProbeEvent, ProbeTrigger, ReferenceMeasurement,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    from_cdr,
    sensor_msgs::JointState,
    to_cdr,
};
use serde_json::Value;

/// Steps of a trace at which a field is lost, at most.
const CUTS: usize = 240;
/// Of those, tried for one field.
const TRIES: usize = 200;
/// The same for `gap`, each of whose runs holds whole diagnoses.
const FEW: usize = 12;
/// The first sessions, which a share of these tests takes.
const SHARE: usize = 8;

fn turn_mill(edit: impl Fn(&str) -> String) -> Cell {
    cell("turn_mill.toml", edit)
}

/// Two parts, the first previewed; a part that bends; duplicate corrections.
fn automatic() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| {
        text.replace(
            "spring_back = 0.0",
            "spring_back = 0.0\ndeflection_um = [8.0, 35.0]",
        )
    });
    let mut session = Session::new(&cell);
    let preview = OperatorRequest {
        subject: "punch/rough/1".to_owned(),
        ..OperatorRequest::default()
    };
    session.send(topics::PLAN_REQUESTS, &preview);
    session.make("punch");
    for correction in session.all::<Correction>(topics::CORRECTIONS) {
        session.send(topics::CORRECTIONS, &correction);
    }
    session.make("second");
    (cell, session.finish())
}

/// Every request of the cycle comes twice, one of them again when most features have been measured; an operator stops the
/// second part.
fn twice() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let mut session = Session::new(&cell);
    let mut seen = 0;
    let mut is_repeated = false;
    for (part, reports) in [("punch", 1), ("second", 2)] {
        session.ask_for(part);
        while session.all::<PartReport>(topics::PART_REPORTS).len() < reports {
            session.run_s(0.05);
            let requests: Vec<OperationRequest> = session.all(topics::OPERATION_REQUESTS);
            if let Some(request) = requests.get(seen) {
                session.send(topics::OPERATION_REQUESTS, request);
                seen += 2;
            }
            let measured = session.all::<FeatureResult>(topics::FEATURE_RESULTS).len();
            if !is_repeated && measured >= 8 {
                is_repeated = true;
                let last = requests.last().expect("what is measured was requested");
                session.send(topics::OPERATION_REQUESTS, last);
            }
            if reports == 2 && request_to_measure(&requests) {
                let stop = OperatorRequest {
                    operator_name: "Ada".to_owned(),
                    ..OperatorRequest::default()
                };
                session.send(topics::STOP_REQUESTS, &stop);
            }
        }
    }
    (cell, session.finish())
}

/// The last request is to measure.
fn request_to_measure(requests: &[OperationRequest]) -> bool {
    (requests.last()).is_some_and(|last| last.kind == OperationRequest::MEASURE)
}

/// Corrections wait for an operator, who approves one twice.
fn approved() -> (Cell, Vec<Published>) {
    let cell =
        turn_mill(|text| text.replace("automatic_approval = true", "automatic_approval = false"));
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    for proposed in session.all::<Correction>(topics::CORRECTIONS) {
        session.answer(&proposed, true);
        session.answer(&proposed, true);
        session.send(
            topics::CORRECTIONS,
            &session.last::<Correction>(topics::CORRECTIONS),
        );
    }
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    (cell, session.finish())
}

/// A preview is asked for while the machine measures; nobody approves in time, and somebody does afterwards, by
/// `compensation` and past it.
fn unanswered() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| {
        text.replace(
            "automatic_approval = true",
            "automatic_approval = false\napproval_limit_s = 5",
        )
    });
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::PROBE_EVENTS);
    session.send(topics::PLAN_REQUESTS, &OperatorRequest::default());
    session.wait_for_report();
    let proposed: Correction = session.last(topics::CORRECTIONS);
    session.answer(&proposed, true);
    let past = cell_tests::session::approved(proposed, "Ada", session.now());
    session.send(topics::CORRECTIONS, &past);
    session.run_s(1.0);
    (cell, session.finish())
}

/// The reference refutes a part that was qualified, and the next is asked for in vain.
fn refuted() -> (Cell, Vec<Published>) {
    let cell = cell("turn_mill_uncalibrated.toml", str::to_owned);
    let mut session = Session::new(&cell);
    session.make("punch");
    session.ask_for("second");
    session.run_s(1.0);
    (cell, session.finish())
}

/// The reference comes when the part has been reported as qualified, and the next is asked for in vain.
fn refuted_later() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let mut session = Session::new(&cell);
    session.make("punch");
    let mut late: ReferenceMeasurement = session.last(topics::REFERENCE);
    for deviation in &mut late.deviation {
        *deviation -= 35e-6;
    }
    session.run_s(1.0);
    session.send(topics::REFERENCE, &late);
    session.run_s(1.0);
    session.ask_for("second");
    session.run_s(1.0);
    (cell, session.finish())
}

/// Two parts of an order, whose request comes twice; the launcher keeps what it is told.
fn ordered() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let mut session = Session::new(&cell);
    session.send(topics::KEPT_ORDERS, &Orders::default());
    let order = OrderRequest {
        kind: OrderRequest::ADD,
        order_id: 1,
        part_id: "punch".to_owned(),
        count: 2,
        expires: session.now().after_s(600.0).time(),
        ..OrderRequest::default()
    };
    session.send(topics::ORDER_REQUESTS, &order);
    let mut kept = 0;
    while session.all::<PartReport>(topics::PART_REPORTS).len() < 2 {
        session.run_s(0.25);
        let orders: Vec<Orders> = session.all(topics::ORDERS);
        for one in orders.iter().skip(kept) {
            session.send(topics::KEPT_ORDERS, one);
            session.send(topics::ORDER_REQUESTS, &order);
        }
        kept = orders.len();
    }
    (cell, session.finish())
}

/// `compensation` in that session, where some topics come later than others.
fn refuted_late(topics: &[graph::Topic], seconds: f64) -> (Cell, Vec<Published>) {
    let (cell, log) = refuted();
    let log = alone(&cell, "compensation", &log, topics, seconds);
    (cell, log)
}

/// A tool that moves less than commanded.
fn not_converging() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| {
        text.replace("error_um = 20.0", "error_um = 100.0").replace(
            "max_corrections = 5",
            "max_corrections = 2\nwear_per_size = 0.2",
        )
    });
    let mut session = Session::new(&cell);
    session.make("punch");
    (cell, session.finish())
}

/// Tools that wear at each cut, on a machine that warms up.
fn wearing() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| {
        let warming = "[simulator.machine.warming]\nshift_um = [4.0, -3.0, 6.0]\ntime_constant_s = 60.0\n\n[simulator.plant]";
        text.replace("error_um = 20.0", "error_um = 20.0\nwear_per_cut_um = 5.0")
            .replace("[simulator.plant]", warming)
    });
    let mut session = Session::new(&cell);
    session.make("punch");
    session.make("second");
    (cell, session.finish())
}

/// A pass is cut again before its first correction.
fn springing() -> (Cell, Vec<Published>) {
    let cell =
        turn_mill(|text| text.replace("[compensation]\n", "[compensation]\nspring_pass = true\n"));
    let mut session = Session::new(&cell);
    session.make("punch");
    (cell, session.finish())
}

/// A tool path is corrected more than once.
fn path() -> (Cell, Vec<Published>) {
    let cell = cell("free_form.toml", |text| {
        text.replace("path = \"deterministic\"", "path = \"raw\"")
            .replace("tolerance_mm = 0.020", "tolerance_mm = 0.005")
    });
    let mut session = Session::new(&cell);
    session.make("profile");
    (cell, session.finish())
}

/// A block cut without and with the volumetric table, placed by three of its planes.
fn five_axis() -> (Cell, Vec<Published>) {
    let cell = cell("five_axis.toml", |text| {
        let placed = "alignment = { datums = [\"P2a_2\", \"P4a_1\", \"P4b_1\"] }";
        text.replace("[analysis]\n", &format!("[analysis]\n{placed}\n"))
    });
    let mut session = Session::new(&cell);
    session.make("block");
    (cell, session.finish())
}

/// A machine finds and writes its own volumetric table, by one ball and roughly.
fn calibrating() -> (Cell, Vec<Published>) {
    let cell = cell("five_axis_calibrate.toml", |text| {
        let second = text
            .find("\n[[part.features]]\nid = \"ball_2_")
            .expect("a second ball");
        let rest = text.find("\n[path_planning]").expect("the rest");
        format!("{}{}", &text[..second], &text[rest..])
            .replace("uncertainty_urad = 5.0", "uncertainty_urad = 60.0")
            .replace("uncertainty_um = 1.0", "uncertainty_um = 5.0")
    });
    let mut session = Session::new(&cell);
    session.make("balls");
    (cell, session.finish())
}

/// A part that lies off its place, followed by the work offsets; then another one.
fn clamped() -> (Cell, Vec<Published>) {
    let cell = cell("clamped_casting.toml", str::to_owned);
    let mut session = Session::new(&cell);
    session.make("casting");
    session.make("second");
    (cell, session.finish())
}

/// Further touches of a part that was made, and touches that were measured already.
fn further() -> (Cell, Vec<Published>) {
    let cell = cell("ball_check.toml", |text| {
        text.replace("at_end_of_plan = false", "at_end_of_plan = true")
    });
    let mut session = Session::new(&cell);
    session.make("balls");
    session.run_s(1.0);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let asked = OperatorRequest {
        subject: "balls/check/1/next".to_owned(),
        points: own.points[..3].to_vec(),
        ..OperatorRequest::default()
    };
    session.send(topics::PLAN_REQUESTS, &asked);
    session.run_to(topics::PLAN_REPLIES);
    let run = OperatorRequest {
        subject: "balls".to_owned(),
        plan_id: asked.subject.clone(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &run);
    session.run_to(topics::PART_REPORTS);
    session.run_s(1.0);
    session.send(topics::PLAN_REQUESTS, &asked);
    session.run_to(topics::PLAN_REPLIES);
    (cell, session.finish())
}

/// A scan interrupted by the probe is resumed, with a point that was touched already; then another part is made.
fn again() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| format!("{}touches = 2\n", with_fault(text, "dead_probe", 20)));
    let mut session = Session::new(&cell);
    session.make("punch");
    session.run_s(1.0);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let asked = OperatorRequest {
        subject: own.plan_id.clone(),
        points: own.points[3..4].to_vec(),
        ..OperatorRequest::default()
    };
    session.send(topics::PLAN_REQUESTS, &asked);
    session.run_to(topics::PLAN_REPLIES);
    let run = OperatorRequest {
        plan_id: own.plan_id,
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &run);
    session.wait_for_report();
    // That surface is cut away by now.
    session.send(topics::PLAN_REQUESTS, &asked);
    session.run_to(topics::PLAN_REPLIES);
    (cell, session.finish())
}

/// Touches of the finished part, asked for while the rough one is cut: they lie inside it.
fn too_early() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let (_, log) = &*AUTOMATIC;
    let finished: InspectionPlan = messages(log, topics::INSPECTION_PLAN.name)
        .pop()
        .expect("a plan");
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::CONTROLLER_COMMANDS);
    let asked = OperatorRequest {
        subject: "punch/early".to_owned(),
        points: finished.points,
        ..OperatorRequest::default()
    };
    session.send(topics::PLAN_REQUESTS, &asked);
    session.run_to(topics::PLAN_REPLIES);
    (cell, session.finish())
}

/// A link delivers a trigger, a command and a request for a part again; an operator rejects one correction, and another of its
/// measurement was approved before.
fn delivered_again() -> (Cell, Vec<Published>) {
    let cell =
        turn_mill(|text| text.replace("automatic_approval = true", "automatic_approval = false"));
    let mut session = Session::new(&cell);
    let request = OperatorRequest {
        request_id: 9,
        subject: "punch".to_owned(),
        operator_name: "Ada".to_owned(),
        expires: session.now().after_s(300.0).time(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &request);
    session.run_to(topics::PROBE_EVENTS);
    let trigger: ProbeTrigger = session.last(topics::PROBE_TRIGGERS);
    session.send(topics::PROBE_TRIGGERS, &trigger);
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(3.0);
    let first: ControllerCommand = session.all(topics::CONTROLLER_COMMANDS).remove(1);
    session.send(topics::CONTROLLER_COMMANDS, &first);
    session.run_s(0.05);
    let proposed: Vec<Correction> = session.all(topics::CORRECTIONS);
    let rejected = Correction {
        approval: Correction::APPROVAL_REJECTED,
        ..proposed[0].clone()
    };
    session.send(topics::CORRECTIONS, &rejected);
    let approved = cell_tests::session::approved(proposed[1].clone(), "Ada", session.now());
    session.send(topics::CORRECTIONS, &approved);
    session.run_s(1.0);
    session.answer(&proposed[0], false);
    session.run_s(2.0);
    session.send(topics::RUN_REQUESTS, &request);
    session.run_s(1.0);
    (cell, session.finish())
}

/// A machine that takes its time to stand is told to stop while it cuts.
fn slow_to_stop() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| text.replace("[simulator]\n", "[simulator]\nstop_s = 3.0\n"));
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_s(4.0);
    session.send(topics::STOP_REQUESTS, &OperatorRequest::default());
    session.run_s(6.0);
    (cell, session.finish())
}

/// A clamping opens while the part is measured.
fn unclamped() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| {
        let chuck = "name = \"chuck\"\nrole = \"clamping_closed\"\nsource = \"s7://10.0.0.5/0/1\"\n\
                     address = \"M0.0\"\ntype = \"bool\"\ntimeout_s = 600\n";
        format!("{text}\n[[signals]]\n{chuck}")
    });
    let mut session = Session::new(&cell);
    let chuck = |session: &Session, value: &str| DiagnosticArray {
        header: session.now().header(""),
        status: vec![DiagnosticStatus {
            name: "chuck".to_owned(),
            values: vec![KeyValue {
                key: "value".to_owned(),
                value: value.to_owned(),
            }],
            ..DiagnosticStatus::default()
        }],
    };
    session.send(topics::SIGNALS, &chuck(&session, "1"));
    session.ask_for("punch");
    session.run_to(topics::PROBE_EVENTS);
    session.send(topics::SIGNALS, &chuck(&session, "0"));
    session.run_s(6.0);
    (cell, session.finish())
}

/// Another driver than that of the simulated machine publishes samples of a machine that stands, and confirms every stop.
fn other_driver(session: &mut Session, sample: &ControllerStatus, seconds: f64) {
    // Longer than that of the gate's heartbeat, without which the time of a silent graph would stand still.
    const PERIOD: f64 = 0.15;
    let end = session.now().after_s(seconds);
    let mut seen = session
        .all::<ControllerCommand>(topics::CONTROLLER_COMMANDS)
        .len();
    while session.now() < end {
        let mut status = sample.clone();
        status.header = session.now().header("");
        session.send(topics::CONTROLLER_STATUS, &status);
        session.run_s(PERIOD);
        let commands: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
        let new = commands[seen..].iter();
        for command in new.filter(|command| command.session == sample.session) {
            let reply = ControllerReply {
                header: session.now().header(""),
                session: sample.session.clone(),
                command_id: command.command_id,
                outcome: ControllerReply::DONE,
                ..ControllerReply::default()
            };
            session.send(topics::CONTROLLER_REPLIES, &reply);
        }
        seen = commands.len();
    }
}

/// The first sample of the session as one of another driver.
fn of_other_driver(session: &Session) -> ControllerStatus {
    ControllerStatus {
        session: "other".to_owned(),
        ..session.all(topics::CONTROLLER_STATUS).remove(0)
    }
}

/// The driver is restarted while it measures, and an operator wants the measurement resumed.
fn driver_restarted() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    for _ in 0..12 {
        session.run_to(topics::PROBE_EVENTS);
    }
    session.kill("simulator");
    let sample = of_other_driver(&session);
    other_driver(&mut session, &sample, 3.0);
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let run = OperatorRequest {
        plan_id: own.plan_id,
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &run);
    other_driver(&mut session, &sample, 0.5);
    let reply: OperatorReply = session.last(topics::RUN_REPLIES);
    assert!(!reply.accepted, "{}", reply.text);
    (cell, session.finish())
}

/// Two drivers publish samples, and a part is asked for in vain; it begins when one of them has fallen silent.
fn two_drivers() -> (Cell, Vec<Published>) {
    let cell = turn_mill(str::to_owned);
    let mut session = Session::new(&cell);
    let sample = of_other_driver(&session);
    other_driver(&mut session, &sample, 1.0);
    session.ask_for("punch");
    other_driver(&mut session, &sample, 1.0);
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    session.run_s(2.0);
    session.ask_for("punch");
    session.run_s(1.0);
    let begun: ControllerCommand = session.last(topics::CONTROLLER_COMMANDS);
    assert_eq!(begun.kind, ControllerCommand::RUN_OPERATION);
    (cell, session.finish())
}

fn gone_wrong(kind: &str) -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| with_fault(text, kind, 20));
    let mut session = Session::new(&cell);
    session.make("punch");
    session.run_s(3.0);
    // What is asked of a machine in that state must not be carried out.
    session.ask_for("second");
    session.run_s(3.0);
    (cell, session.finish())
}

/// What the bus can do to the order of messages on different topics.
fn late(node: &str, topics: &[graph::Topic], seconds: f64) -> (Cell, Vec<Published>) {
    let (cell, log) = &*AUTOMATIC;
    (cell.clone(), alone(cell, node, log, topics, seconds))
}

/// `visualization`, where every second state of the joints names one that the machine does not have.
fn odd_joints() -> (Cell, Vec<Published>) {
    let (cell, log) = &*AUTOMATIC;
    let mut states = 0;
    let log: Vec<Published> = log
        .iter()
        .map(|published| {
            let mut published = published.clone();
            if published.topic == topics::JOINT_STATES.name {
                states += 1;
                let mut joints: JointState = from_cdr(&published.payload).expect("a state");
                if states / 100 % 2 == 1 {
                    "Q".clone_into(&mut joints.name[0]);
                }
                published.payload = to_cdr(&joints);
            }
            published
        })
        .collect();
    let log = alone(cell, "visualization", &log, &[], 0.0);
    (cell.clone(), log)
}

/// The measurement of that finished part by `gap`, which is quiet in the other sessions. Its clocks disagree and the part
/// grows warm, so that the answer holds what the axes and the machine were at each touch.
fn gap(topics: &[graph::Topic], seconds: f64) -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| text.replace("at_end_of_plan = false", "at_end_of_plan = true"));
    let (_, log) = &*AUTOMATIC;
    let measured = log
        .iter()
        .position(|published| published.topic == topics::REFERENCE.name)
        .expect("a reference");
    let end = log[measured].at.after_s(1.0);
    // From its plan on: the rough one would only be more to search.
    let planned = log[..measured]
        .iter()
        .rfind(|published| published.topic == topics::INSPECTION_PLAN.name)
        .expect("a plan");
    let begin = planned.at.after_s(-6.0);
    let log: Vec<Published> = log
        .iter()
        .filter(|published| {
            let of_it = (begin..=end).contains(&published.at);
            of_it || published.topic == topics::ROBOT_DESCRIPTION.name
        })
        .map(|published| Published {
            payload: disturbed(published),
            ..published.clone()
        })
        .collect();
    let log = alone(&cell, "gap", &log, topics, seconds);
    (cell, log)
}

fn disturbed(published: &Published) -> Vec<u8> {
    let name = published.topic.as_str();
    if name == topics::PROBE_EVENTS.name {
        let mut event: ProbeEvent = from_cdr(&published.payload).expect("an event");
        event.header.stamp.nanosec = (event.header.stamp.nanosec + 20_000_000) % 1_000_000_000;
        return to_cdr(&event);
    }
    if name == topics::MACHINE_STATE.name {
        let mut state: MachineState = from_cdr(&published.payload).expect("a state");
        state.temperature_names = vec!["part".to_owned()];
        state.temperatures = vec![20.0 + f64::from(state.header.stamp.sec % 100)];
        return to_cdr(&state);
    }
    published.payload.clone()
}

static AUTOMATIC: LazyLock<(Cell, Vec<Published>)> = LazyLock::new(automatic);

static SESSIONS: LazyLock<Vec<(Cell, Vec<Published>)>> = LazyLock::new(sessions);

fn sessions() -> Vec<(Cell, Vec<Published>)> {
    let mut sessions = vec![
        AUTOMATIC.clone(),
        twice(),
        approved(),
        unanswered(),
        delivered_again(),
        slow_to_stop(),
        unclamped(),
        driver_restarted(),
    ];
    assert_eq!(sessions.len(), SHARE);
    if !shared_data::share(false, true) {
        return sessions;
    }
    sessions.append(&mut vec![
        two_drivers(),
        not_converging(),
        springing(),
        wearing(),
        five_axis(),
        calibrating(),
        clamped(),
        further(),
        too_early(),
        again(),
        refuted(),
        refuted_later(),
        ordered(),
        refuted_late(&[topics::REFERENCE_RESULTS], 2.0),
        refuted_late(&[topics::FEATURE_RESULTS], 100.0),
    ]);
    sessions.extend(
        [
            "dead_probe",
            "stuck_probe",
            "unplanned_touch",
            "estop",
            "silence",
        ]
        .map(gone_wrong),
    );
    sessions.push(late("probe_events", &[topics::INSPECTION_PLAN], 20.0));
    sessions.push(late("analysis", &[topics::INSPECTION_PLAN], 20.0));
    sessions.push(late("analysis", &[topics::REFERENCE], 100.0));
    sessions.push(late("compensation", &[topics::OPERATION_REQUESTS], 100.0));
    sessions.push(late("cycle", &[topics::PASS_DECISIONS], 4.0));
    sessions.push(late("simulator", &[topics::INSPECTION_PLAN], 0.005));
    sessions.push(late("simulator", &[topics::MEASUREMENT_ORDER], 0.005));
    sessions.push(late("machine_state", &[topics::MEASUREMENT_ORDER], 11.0));
    sessions.push(late("machine_state", &[topics::OPERATION_REQUESTS], 0.005));
    sessions.push(late("visualization", &[topics::INSPECTION_PLAN], 0.005));
    sessions.push(odd_joints());
    sessions.push(gap(&[topics::INSPECTION_PLAN], 20.0));
    sessions.push(gap(&[topics::MACHINE_STATE], 3.0));
    sessions.push(gap(&[topics::JOINT_STATES, topics::REFERENCE], 3.0));
    sessions.push(changing());
    // Planned at length each time: last, when little is left to look for.
    sessions.push(path());
    sessions
}

/// A series of parts that change, as `gap` watches it.
fn changing() -> (Cell, Vec<Published>) {
    let cell = turn_mill(|text| text.replace("at_end_of_plan = false", "at_end_of_plan = true"));
    let (_, log) = &*AUTOMATIC;
    let log = alone(&cell, "gap", &series(log, 11, 8, 30e-6), &[], 0.0);
    (cell, log)
}

/// Steps to cut at: those on rare messages and timers, and some of all.
fn cuts(trace: &Trace) -> Vec<usize> {
    let kind = |cause: &Cause| match cause {
        Cause::Message(port, _) => (*port, None),
        Cause::Timer(id) => (usize::MAX, Some(*id)),
    };
    let mut kinds: BTreeMap<_, usize> = BTreeMap::new();
    for cause in trace.causes() {
        *kinds.entry(kind(cause)).or_default() += 1;
    }
    let rare = |cause: &Cause| *cause != Cause::Timer(START) && kinds[&kind(cause)] < 300;
    let steps: Vec<usize> = trace
        .causes()
        .enumerate()
        .filter(|(_, cause)| rare(cause))
        .map(|(index, _)| index)
        .collect();
    let even = (0..CUTS / 4).map(|cut| cut * trace.len() / (CUTS / 4));
    let chosen: BTreeSet<usize> = spread(&steps, CUTS).into_iter().chain(even).collect();
    let chosen: Vec<usize> = chosen.into_iter().collect();
    if trace.node == "gap" {
        // The last touch is where a diagnosis waits for the streams to pass.
        let last = steps.iter().rev().take(FEW).copied();
        let both: BTreeSet<usize> = spread(&chosen, FEW).into_iter().chain(last).collect();
        return both.into_iter().collect();
    }
    chosen
}

/// At most `count` of the values, evenly chosen.
fn spread<T: Clone>(values: &[T], count: usize) -> Vec<T> {
    let chosen: BTreeSet<usize> = (0..count)
        .map(|index| index * values.len() / count)
        .collect();
    chosen
        .into_iter()
        .filter_map(|index| values.get(index).cloned())
        .collect()
}

/// Fields whose loss at some step of the trace changes what the node says; `wanted` are those not yet known to.
fn missed(trace: &Trace, wanted: &BTreeSet<String>) -> BTreeSet<String> {
    let cuts = cuts(trace);
    let mut node = trace.fresh();
    let start = trace.start();
    let snapshots: Vec<(usize, Value)> = cuts
        .iter()
        .zip(trace.snapshots(&cuts))
        .map(|(&cut, text)| (cut, serde_json::from_str(&text).expect("JSON")))
        .collect();
    wanted
        .iter()
        .filter(|field| {
            let changed: Vec<&(usize, Value)> = snapshots
                .iter()
                .filter(|(_, snapshot)| snapshot[*field] != start[*field])
                .collect();
            let tries = if trace.node == "gap" { 2 * FEW } else { TRIES };
            spread(&changed, tries).into_iter().any(|(cut, snapshot)| {
                let mut without = snapshot.clone();
                without[*field] = start[*field].clone();
                trace
                    .first_difference(node.as_mut(), *cut, usize::MAX, without)
                    .is_some()
            })
        })
        .cloned()
        .collect()
}

#[test]
fn losing_any_field_of_any_state_changes_what_is_said() {
    let wanted: Mutex<BTreeMap<&'static str, BTreeSet<String>>> = Mutex::default();
    let fields: Mutex<BTreeMap<&'static str, usize>> = Mutex::default();
    let next = AtomicUsize::new(0);
    let look = |cell: &Cell, trace: &Trace| {
        if trace.node == "gap" && !cell.gap.at_end_of_plan {
            return;
        }
        let mut all = wanted.lock().expect("no thread has panicked");
        let of_node = all.entry(trace.node).or_insert_with(|| {
            let fresh = trace.start();
            let keys = fresh.as_object().expect("a state has fields").keys();
            let mut fields = fields.lock().expect("no thread has panicked");
            fields.insert(trace.node, keys.len());
            keys.cloned().collect()
        });
        let left = of_node.clone();
        drop(all);
        if left.is_empty() || trace.is_empty() {
            return;
        }
        let missed = missed(trace, &left);
        let mut all = wanted.lock().expect("no thread has panicked");
        if let Some(of_node) = all.get_mut(trace.node) {
            of_node.retain(|field| !missed.contains(field));
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((cell, log)) = SESSIONS.get(next.fetch_add(1, Ordering::Relaxed)) {
                    for trace in Trace::all(cell, log) {
                        look(cell, &trace);
                    }
                }
            });
        }
    });
    let (wanted, fields) = (wanted.into_inner(), fields.into_inner());
    let wanted = wanted.expect("no thread has panicked");
    let fields = fields.expect("no thread has panicked");
    let all: usize = fields.values().sum();
    assert!(all > 30, "{all} fields of all nodes");
    let never: Vec<String> = wanted
        .iter()
        .flat_map(|(node, left)| left.iter().map(move |field| format!("{node}.{field}")))
        .collect();
    // Of the whole no field is left, of the share of the sessions half of them.
    let most = shared_data::share(all / 2, 0);
    assert!(
        never.len() <= most,
        "state of {all} fields that is never missed: {}",
        never.join(", ")
    );
}

#[test]
fn every_node_resumes_from_a_snapshot_wherever_something_rare_happens() {
    for (cell, log) in SESSIONS.iter() {
        for trace in Trace::all(cell, log)
            .iter()
            .filter(|trace| !trace.is_empty())
        {
            let cuts = cuts(trace);
            let mut node = trace.fresh();
            for (&cut, text) in cuts.iter().zip(trace.snapshots(&cuts)) {
                let snapshot = serde_json::from_str(&text).expect("JSON");
                // The next cut is nearer than that, or the rest of the session is quiet.
                assert_eq!(
                    trace.first_difference(node.as_mut(), cut, 200, snapshot),
                    None,
                    "{} from step {cut}",
                    trace.node
                );
            }
        }
    }
}
