//! A whole cell whose part may be touched at several poses: order and poses are chosen together, and what is measured,
//! measured again or measured further stands on the poses chosen.

use std::collections::BTreeSet;

use cell::Cell;
use cell_tests::{cell, factories, recording, session::Session};
use graph::{
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{
    FeatureResult, InspectionPlan, MeasurementOrder, OperatorReply, OperatorRequest, PartReport,
    PlanProgress, ProbeEvent,
};

/// The cell of four balls, searched for longer than other tests search.
fn balls(edit: impl Fn(&str) -> String) -> Cell {
    cell("ball_plate.toml", |text| {
        edit(&text.replacen("kicks = 50\n", "kicks = 5000\n", 1))
    })
}

/// The same with every ball at its own index only.
fn facing() -> Cell {
    balls(|text| {
        let (head, rest) = text.split_once("\nrotary_alternatives_deg").expect("poses");
        let (_, tail) = rest.split_once("\n]\n").expect("their end");
        format!("{head}\n{tail}")
    })
}

fn made(cell: &Cell) -> (Session, MeasurementOrder, InspectionPlan) {
    let mut session = Session::new(cell);
    let report = session.make("plate");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    session.run_s(1.0);
    let order = session.last(topics::MEASUREMENT_ORDER);
    let plan = session.last(topics::INSPECTION_PLAN);
    (session, order, plan)
}

/// Every touch was made with the rotary axes where the plan has them, and met its point.
fn assert_touches_stand_on_the_plan(session: &Session, plan: &InspectionPlan) {
    let events: Vec<ProbeEvent> = session.all(topics::PROBE_EVENTS);
    let of_plan = events.iter().filter(|event| event.plan_id == plan.plan_id);
    let mut seen = BTreeSet::new();
    for event in of_plan {
        assert_eq!(event.outcome, ProbeEvent::OUTCOME_TOUCHED);
        let point = &plan.points[event.point_index as usize];
        for (name, angle) in plan.rotary_names.iter().zip(&point.rotary_positions) {
            let axis = event.axis_names.iter().position(|axis| axis == name);
            let read = event.axis_positions[axis.expect("a rotary axis")];
            assert!(
                (read - angle).abs() < 1e-6,
                "{name}: {read} against {angle}"
            );
        }
        seen.insert(event.point_index);
    }
    assert_eq!(seen.len(), plan.points.len());
}

#[test]
fn poses_are_chosen_with_the_order_and_all_touches_end_right() {
    let cell = balls(str::to_owned);
    let (session, order, plan) = made(&cell);
    let (_, alone, _) = made(&facing());
    // The order to beat is the same, and a fifth of the time of the shortest at one index each is saved.
    assert!((order.given_air_time - alone.given_air_time).abs() < 1e-9);
    assert!(
        order.air_time < 0.8 * alone.air_time,
        "{} against {}",
        order.air_time,
        alone.air_time
    );
    assert_touches_stand_on_the_plan(&session, &plan);
    let results: Vec<FeatureResult> = session.all(topics::FEATURE_RESULTS);
    assert_eq!(results.len(), 4);
    for result in &results {
        // Five touches of a cap, 0.5 µm each.
        assert!(
            result.size_deviation.abs() < 5e-6,
            "{}: {}",
            result.feature_id,
            result.size_deviation
        );
    }
    let progress: Vec<PlanProgress> = session.all(topics::PLAN_PROGRESS);
    let last = progress.last().expect("progress");
    assert_eq!((last.phase, last.touches), (PlanProgress::DONE, 20));
    assert!(progress.len() > 5 && last.air_time == order.air_time);
    let log = session.finish();
    let made = replay(&recording(&log), &factories(&cell, &cell.node_names()));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Verdict::Equal, "{:?}", made.first_difference);
}

fn planned(session: &mut Session, asked: &OperatorRequest) -> OperatorReply {
    session.send(topics::PLAN_REQUESTS, asked);
    session.run_to(topics::PLAN_REPLIES);
    session.last(topics::PLAN_REPLIES)
}

#[test]
fn what_is_measured_again_or_further_keeps_its_poses() {
    let cell = balls(str::to_owned);
    let (mut session, _, plan) = made(&cell);
    let asked = OperatorRequest {
        subject: plan.plan_id.clone(),
        points: vec![plan.points[2].clone(), plan.points[13].clone()],
        ..OperatorRequest::default()
    };
    let reply = planned(&mut session, &asked);
    assert!(
        reply.accepted && reply.text.starts_with("2 touches"),
        "{}",
        reply.text
    );
    let run = OperatorRequest {
        plan_id: plan.plan_id.clone(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &run);
    assert_eq!(session.wait_for_report().verdict, PartReport::QUALIFIED);
    assert_touches_stand_on_the_plan(&session, &plan);
    // Further touches of the balls, at poses of the plan and at others.
    let mut points = plan.points[..3].to_vec();
    points[1].rotary_positions = vec![0.0, 1.0, 0.0];
    let asked = OperatorRequest {
        subject: format!("{}/next", plan.plan_id),
        points: points.clone(),
        ..OperatorRequest::default()
    };
    let reply = planned(&mut session, &asked);
    assert!(
        reply.accepted && reply.text.starts_with("3 touches"),
        "{}",
        reply.text
    );
    let run = OperatorRequest {
        subject: "plate".to_owned(),
        plan_id: asked.subject,
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &run);
    assert_eq!(session.wait_for_report().verdict, PartReport::MEASURED);
    let further: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    assert_eq!(further.points, points);
    assert_touches_stand_on_the_plan(&session, &further);
}

/// The cell handles requests while an order is computed: the part is stopped, and no late plan is measured.
#[test]
fn a_preview_in_the_making_gives_way_to_a_part() {
    let cell = balls(str::to_owned);
    let mut session = Session::new(&cell);
    session.send(topics::PLAN_REQUESTS, &OperatorRequest::default());
    session.run_to(topics::PLAN_PROGRESS);
    session.run_to(topics::PLAN_PROGRESS);
    let report = session.make("plate");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let reply: OperatorReply = session.last(topics::PLAN_REPLIES);
    assert!(
        !reply.accepted && reply.text.contains("the cell continues with its part"),
        "{}",
        reply.text
    );
    let plans: Vec<InspectionPlan> = session.all(topics::INSPECTION_PLAN);
    assert_eq!(plans.len(), 1);
}
