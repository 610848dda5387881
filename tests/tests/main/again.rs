//! An interrupted scan is resumed, and points are measured again: every point counts once, and the decision is made
//! on the whole set.

use std::collections::{BTreeMap, BTreeSet};

use cell::Cell;
use cell_tests::{cell, factories, recording, session::Session};
use graph::{
    Published,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{
    ControllerCommand, ControllerStatus, FeatureResult, InspectionPlan, InspectionPoint,
    MachineState, MeasurementOrder, OperatorReply, OperatorRequest, PartReport, PassDecision,
    ProbeEvent, ProbingMove, sensor_msgs::JointState,
};

/// The first measurement of the punch.
const ROUGH: &str = "punch/rough/1";
/// Its touches.
const TOUCHES: u32 = 32;

/// The turn-mill cell, whose probe fails at some touches of the session.
fn failing(kind: &str, after: u32, touches: u32) -> Cell {
    cell("turn_mill.toml", |text| {
        format!(
            "{text}\n[simulator.fault]\nkind = {kind:?}\nafter_touches = {after}\ntouches = {touches}\n"
        )
    })
}

fn ask(
    session: &mut Session,
    request: graph::Topic,
    reply: graph::Topic,
    asked: &OperatorRequest,
) -> OperatorReply {
    session.send(request, asked);
    session.run_to(reply);
    session.last(reply)
}

/// Requests points of a plan to be measured again, and its remaining points.
fn plan(session: &mut Session, plan_id: &str, points: &[InspectionPoint]) -> OperatorReply {
    let asked = OperatorRequest {
        subject: plan_id.to_owned(),
        points: points.to_vec(),
        ..OperatorRequest::default()
    };
    ask(session, topics::PLAN_REQUESTS, topics::PLAN_REPLIES, &asked)
}

/// Goes on with a plan.
fn go_on(session: &mut Session, plan_id: &str) -> OperatorReply {
    run(session, "", plan_id)
}

/// Runs a plan under the name of a part.
fn run(session: &mut Session, part_id: &str, plan_id: &str) -> OperatorReply {
    let asked = OperatorRequest {
        subject: part_id.to_owned(),
        plan_id: plan_id.to_owned(),
        ..OperatorRequest::default()
    };
    ask(session, topics::RUN_REQUESTS, topics::RUN_REPLIES, &asked)
}

fn of_plan(session: &Session, plan_id: &str) -> Vec<ProbeEvent> {
    let mut events: Vec<ProbeEvent> = session.all(topics::PROBE_EVENTS);
    events.retain(|event| event.plan_id == plan_id);
    events
}

/// Points with a contact.
fn touched(events: &[ProbeEvent]) -> BTreeSet<u32> {
    let met = events
        .iter()
        .filter(|event| event.outcome == ProbeEvent::OUTCOME_TOUCHED);
    met.map(|event| event.point_index).collect()
}

/// The last results of a plan rest on the newest contact at each point of their features, and on nothing else.
fn assert_newest_touch_of_each_point_counts(session: &Session, plan_id: &str) {
    let plans: Vec<InspectionPlan> = session.all(topics::INSPECTION_PLAN);
    let plan = plans
        .iter()
        .rfind(|plan| plan.plan_id == plan_id)
        .expect("a plan");
    let mut newest: BTreeMap<u32, u64> = BTreeMap::new();
    for event in of_plan(session, plan_id) {
        newest.insert(event.point_index, event.sequence);
    }
    let results: Vec<FeatureResult> = session.all(topics::FEATURE_RESULTS);
    for (index, feature) in plan.features.iter().enumerate() {
        let result = results
            .iter()
            .rfind(|result| result.plan_id == plan_id && result.feature_id == feature.id)
            .unwrap_or_else(|| panic!("no result of {}", feature.id));
        let points = (0..plan.points.len() as u32)
            .filter(|&point| plan.points[point as usize].feature as usize == index);
        let expected: Vec<u64> = points.map(|point| newest[&point]).collect();
        assert_eq!(result.sequences, expected, "{}", feature.id);
        assert_ne!(result.decision, FeatureResult::INVALID, "{}", feature.id);
    }
}

fn assert_replays(cell: &Cell, log: &[Published]) {
    let made = replay(&recording(log), &factories(cell, &cell.node_names()));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Verdict::Equal, "{:?}", made.first_difference);
}

/// A part whose first measurement broke off.
fn broken(cell: &Cell) -> Session {
    let mut session = Session::new(cell);
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    session.run_s(3.0);
    session
}

#[test]
fn a_scan_that_broke_off_goes_on_with_what_is_left_and_the_part_with_it() {
    for (kind, failing_touches) in [("dead_probe", 2), ("stuck_probe", 1)] {
        let cell = failing(kind, 20, failing_touches);
        let mut session = broken(&cell);
        let before = of_plan(&session, ROUGH);
        let left: BTreeSet<u32> = &(0..TOUCHES).collect() - &touched(&before);
        assert_eq!(left.len(), 12, "{kind}");
        let reply = plan(&mut session, ROUGH, &[]);
        assert!(
            reply.accepted && reply.text.starts_with("12 touches"),
            "{}",
            reply.text
        );
        let plans = session.all::<InspectionPlan>(topics::INSPECTION_PLAN).len();
        assert!(go_on(&mut session, ROUGH).accepted);
        session.run_to(topics::PASS_DECISIONS);
        let decision: PassDecision = session.last(topics::PASS_DECISIONS);
        assert_eq!(decision.plan_id, ROUGH);
        // The plan stands; what is left is touched, each point once.
        assert_eq!(
            session.all::<InspectionPlan>(topics::INSPECTION_PLAN).len(),
            plans
        );
        let after = of_plan(&session, ROUGH).split_off(before.len());
        assert_eq!((after.len(), touched(&after)), (12, left), "{kind}");
        assert_newest_touch_of_each_point_counts(&session, ROUGH);
        let report = session.wait_for_report();
        assert_eq!(
            report.verdict,
            PartReport::QUALIFIED,
            "{kind}: {}",
            report.text
        );
        assert_eq!(report.part_id, "punch");
        assert_replays(&cell, &session.finish());
    }
}

#[test]
fn a_scan_stopped_at_the_machine_goes_on_as_often_as_it_is_stopped() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    for stops in [3, 7] {
        while of_plan(&session, ROUGH).len() < stops {
            session.run_to(topics::PROBE_EVENTS);
        }
        session.run_s(0.4);
        let status: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
        // What an operator's button does.
        let stop = ControllerCommand {
            session: status.session,
            command_id: u64::MAX - stops as u64,
            kind: ControllerCommand::STOP,
            ..ControllerCommand::default()
        };
        session.send(topics::CONTROLLER_COMMANDS, &stop);
        let report = session.wait_for_report();
        assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
        session.run_s(5.0);
        assert!(go_on(&mut session, ROUGH).accepted);
    }
    session.run_to(topics::PASS_DECISIONS);
    let events = of_plan(&session, ROUGH);
    assert_eq!(
        (events.len() as u32, touched(&events).len() as u32),
        (TOUCHES, TOUCHES)
    );
    assert_newest_touch_of_each_point_counts(&session, ROUGH);
    assert_eq!(session.wait_for_report().verdict, PartReport::QUALIFIED);
    // The button is not a node: inputs and outputs of the machine are replayed as recorded.
    let mut nodes = cell.node_names();
    nodes.retain(|&node| !["simulator", "machine_state"].contains(&node));
    let made = replay(&recording(&session.finish()), &factories(&cell, &nodes));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert!(
        made.first_difference.is_none(),
        "{:?}",
        made.first_difference
    );
    let events = made
        .topics
        .iter()
        .find(|one| one.topic == topics::PROBE_EVENTS.name);
    assert!(events.is_some_and(|one| one.equal > u64::from(TOUCHES)));
}

#[test]
fn points_measured_again_replace_what_was_there_and_the_decision_is_made_once_more() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    session.run_s(1.0);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let decisions = session.all::<PassDecision>(topics::PASS_DECISIONS).len();
    let before = of_plan(&session, &own.plan_id).len();
    // Two of one diameter, and one flat of a width.
    let wanted = [3, 7, 20].map(|point: usize| own.points[point].clone());
    let reply = plan(&mut session, &own.plan_id, &wanted);
    assert!(reply.accepted, "{}", reply.text);
    assert!(go_on(&mut session, &own.plan_id).accepted);
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let after = of_plan(&session, &own.plan_id).split_off(before);
    assert_eq!((after.len(), touched(&after)), (3, [3, 7, 20].into()));
    assert_newest_touch_of_each_point_counts(&session, &own.plan_id);
    let made: Vec<PassDecision> = session.all(topics::PASS_DECISIONS);
    assert_eq!(made.len(), decisions + 1);
    assert_eq!(made[decisions].plan_id, own.plan_id);
    // A width is published again where one of its planes is measured again; all others are unchanged.
    let widths: Vec<FeatureResult> = session.all(topics::FEATURE_RESULTS);
    for (width, times) in [("L1", 2), ("L2", 2), ("L3", 2)] {
        let of_width = |one: &&FeatureResult| one.feature_id == width && one.plan_id == own.plan_id;
        assert_eq!(widths.iter().filter(of_width).count(), times, "{width}");
    }
    assert_replays(&cell, &session.finish());
}

/// Seconds of straight moves at top speed, by the URDF's limits.
fn seconds(speeds: &[f64], way: &[&Vec<f64>]) -> f64 {
    let one = |pair: &[&Vec<f64>]| {
        let axes = pair[0].iter().zip(pair[1]).zip(speeds);
        axes.map(|((from, to), speed)| (to - from).abs() / speed)
            .fold(0.0, f64::max)
    };
    way.windows(2).map(one).sum()
}

/// All orders of some values.
fn orders(values: &[u32]) -> Vec<Vec<u32>> {
    if values.is_empty() {
        return vec![Vec::new()];
    }
    let mut all = Vec::new();
    for (place, &first) in values.iter().enumerate() {
        let mut rest = values.to_vec();
        rest.remove(place);
        for mut order in orders(&rest) {
            order.insert(0, first);
            all.push(order);
        }
    }
    all
}

#[test]
fn what_is_left_is_ordered_from_where_the_machine_stands_and_no_other_order_is_shorter() {
    let cell = failing("dead_probe", 27, 2);
    let mut session = broken(&cell);
    let joints: JointState = session.last(topics::JOINT_STATES);
    assert!(go_on(&mut session, ROUGH).accepted);
    session.run_to(topics::PASS_DECISIONS);
    let order: MeasurementOrder = session
        .all::<MeasurementOrder>(topics::MEASUREMENT_ORDER)
        .into_iter()
        .rfind(|order| order.plan_id == ROUGH)
        .expect("an order");
    let chain = cell.chain().expect("a chain");
    let here = chain
        .positions(&joints.name, &joints.position)
        .expect("positions");
    let (x, clear) = (chain.axis_index("X").expect("X"), -0.020);
    let away = |from: &[f64]| {
        let mut away = from.to_vec();
        away[x] = clear;
        away
    };
    // First the probe leaves the part from where it stands, and turns nothing while it does.
    assert_eq!(order.moves[0].kind, ProbingMove::CLEARANCE);
    assert_eq!(order.moves[0].axis_positions, away(&here));
    let station = |kind: u8, point: u32| {
        let found = order
            .moves
            .iter()
            .find(|one| one.kind == kind && one.point_index == point);
        found.expect("a move").axis_positions.clone()
    };
    let speeds: Vec<f64> = (0..here.len())
        .map(|axis| chain.axis(axis).speed.expect("a speed"))
        .collect();
    let plan: InspectionPlan = session
        .all::<InspectionPlan>(topics::INSPECTION_PLAN)
        .into_iter()
        .rfind(|plan| plan.plan_id == ROUGH)
        .expect("a plan");
    let time = |points: &[u32]| {
        let mut at = here.clone();
        let mut before: Option<u32> = None;
        let mut total = 0.0;
        for &point in points {
            let start = station(ProbingMove::APPROACH, point);
            let feature = |point: u32| plan.points[point as usize].feature;
            // Along one flat the probe goes straight; everywhere else it leaves the part.
            let flat =
                feature(point) >= 2 && before.is_some_and(|one| feature(one) == feature(point));
            total += if flat {
                seconds(&speeds, &[&at, &start])
            } else {
                seconds(&speeds, &[&at, &away(&at), &away(&start), &start])
            };
            at = station(ProbingMove::RETRACT, point);
            before = Some(point);
        }
        total
    };
    assert_eq!(order.order.len(), 5);
    let own = time(&order.order);
    assert!(
        (own - order.air_time).abs() < 1e-9,
        "{own} {}",
        order.air_time
    );
    let mut sorted = order.order.clone();
    sorted.sort_unstable();
    let all = orders(&sorted);
    let best = all
        .iter()
        .map(|one| time(one))
        .fold(f64::INFINITY, f64::min);
    let worst = all.iter().map(|one| time(one)).fold(0.0, f64::max);
    assert!(
        own <= best + 1e-9 && worst > best + 0.1,
        "{own} {best} {worst}"
    );
}

#[test]
fn nothing_is_measured_again_across_a_cut_nor_under_another_name() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let plans: Vec<InspectionPlan> = session.all(topics::INSPECTION_PLAN);
    let rough = plans
        .iter()
        .find(|plan| plan.plan_id == ROUGH)
        .expect("a plan");
    for points in [&rough.points[..1], &[]] {
        let reply = plan(&mut session, ROUGH, points);
        assert!(
            !reply.accepted && reply.text.contains("cut"),
            "{}",
            reply.text
        );
    }
    let reply = plan(&mut session, &own.plan_id, &[]);
    assert!(
        !reply.accepted && reply.text.starts_with("no point of plan"),
        "{}",
        reply.text
    );
    // The rough surface is not there any more.
    let reply = plan(&mut session, &own.plan_id, &rough.points[..1]);
    assert!(
        !reply.accepted && reply.text.starts_with("point 0 is not a point of plan"),
        "{}",
        reply.text
    );
    let reply = run(&mut session, "another", &own.plan_id);
    assert_eq!(
        (reply.accepted, reply.text.as_str()),
        (false, "the plan belongs to another part")
    );
    // What is asked for past the planning is refused by it.
    assert!(!go_on(&mut session, "").accepted);
    let touches = session.all::<ProbeEvent>(topics::PROBE_EVENTS).len();
    assert!(run(&mut session, "punch", ROUGH).accepted);
    assert_eq!(session.wait_for_report().verdict, PartReport::STOPPED);
    assert_eq!(session.fault_codes(), ["plan_unknown"]);
    assert_eq!(
        session.all::<ProbeEvent>(topics::PROBE_EVENTS).len(),
        touches
    );
}

#[test]
fn nothing_goes_on_across_a_restart_of_the_driver_or_after_a_correction() {
    let cell = failing("stuck_probe", 20, 1);
    let mut session = broken(&cell);
    let mut sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
    sample.session = "another run".to_owned();
    session.send(topics::CONTROLLER_STATUS, &sample);
    session.run_s(0.0);
    // The axes may have been homed anew: the touches of before are not joined with those that would follow.
    assert!(
        session
            .fault_codes()
            .contains(&"controller_restarted".to_owned())
    );
    assert!(!go_on(&mut session, ROUGH).accepted);

    let cell = cell_tests::cell("turn_mill.toml", |text| {
        text.replace("automatic_approval = true", "automatic_approval = false")
    });
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::CORRECTIONS);
    session.run_s(5.0);
    let proposed: probecell_msgs::Correction = session.last(topics::CORRECTIONS);
    session.answer(&proposed, false);
    assert_eq!(
        session.last::<PartReport>(topics::PART_REPORTS).verdict,
        PartReport::STOPPED
    );
    assert!(!go_on(&mut session, &proposed.plan_id).accepted);
}

#[test]
fn further_touches_that_broke_off_go_on_too() {
    let mut sound = Session::new(&cell("turn_mill.toml", str::to_owned));
    sound.make("punch");
    let of_part = sound.all::<ProbeEvent>(topics::PROBE_EVENTS).len() as u32;
    let cell = failing("stuck_probe", of_part + 2, 1);
    let mut session = Session::new(&cell);
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let next = format!("{}/next", own.plan_id);
    assert!(plan(&mut session, &next, &own.points[..4]).accepted);
    assert!(run(&mut session, "punch", &next).accepted);
    assert_eq!(session.wait_for_report().verdict, PartReport::STOPPED);
    session.run_s(1.0);
    assert!(go_on(&mut session, &next).accepted);
    let report = session.wait_for_report();
    assert_eq!(
        (report.verdict, report.plan_id.as_str()),
        (PartReport::MEASURED, next.as_str())
    );
    assert_eq!(touched(&of_plan(&session, &next)).len(), 4);
    let status: MachineState = session.last(topics::MACHINE_STATE);
    assert_eq!(status.execution, MachineState::EXECUTION_IDLE);
    assert_replays(&cell, &session.finish());
}
