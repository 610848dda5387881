//! Further touches of a part in its clamping: a cell whose first plan is ambiguous makes discriminating touches.

use std::sync::LazyLock;

use bags::Measurement;
use cell::Cell;
use cell_tests::{bag, cell, factories, recording, session::Session};
use diagnosis::{Options, Report, diagnose};
use effects::session::joined::join;
use graph::{
    Published,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{
    Correction, GapReport, InspectionPlan, InspectionPoint, MeasurementOrder, OperationRequest,
    OperatorReply, OperatorRequest, PartReport, ProbeEvent,
};

/// Two balls at one index; the true ball centre is off the spindle axis.
fn check() -> Cell {
    cell("ball_check.toml", |text| {
        text.replace("at_end_of_plan = false", "at_end_of_plan = true")
    })
}

/// What the cell touches by itself, on the finished surfaces.
fn own_plan(cell: &Cell) -> InspectionPlan {
    let chain = cell.chain().expect("a chain");
    cell.part.check(&chain).expect("a part").plan(0.0)
}

/// Asks for further touches.
fn plan(session: &mut Session, plan_id: &str, points: &[InspectionPoint]) -> OperatorReply {
    let request = OperatorRequest {
        subject: plan_id.to_owned(),
        points: points.to_vec(),
        ..OperatorRequest::default()
    };
    session.send(topics::PLAN_REQUESTS, &request);
    session.run_to(topics::PLAN_REPLIES);
    session.last(topics::PLAN_REPLIES)
}

/// Asks for a run that only measures.
fn measure(session: &mut Session, plan_id: &str) -> OperatorReply {
    let request = OperatorRequest {
        subject: "balls".to_owned(),
        plan_id: plan_id.to_owned(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &request);
    session.run_to(topics::RUN_REPLIES);
    session.last(topics::RUN_REPLIES)
}

/// A whole session: a part, the proposal of its diagnosis, and its measurement.
struct Refined {
    cell: Cell,
    log: Vec<Published>,
    first: diagnosis::Session,
    before: Report,
}

static REFINED: LazyLock<Refined> = LazyLock::new(|| {
    let cell = check();
    let mut running = Session::new(&cell);
    assert_eq!(running.make("balls").verdict, PartReport::QUALIFIED);
    running.run_s(1.0);
    let folder = tempfile::tempdir().expect("a folder");
    let until_now = folder.path().join("first");
    bag::write(&cell, running.log(), &until_now);
    let first = bag::session(&cell, &until_now, &Measurement::Last);
    let before = diagnose(&first, &Options::default()).expect("a report");
    let proposed = before.next_measurement[0].plan.clone().expect("touches");
    let reply = plan(&mut running, &proposed.plan_id, &proposed.points);
    assert!(reply.accepted, "{}", reply.text);
    let reply = measure(&mut running, &proposed.plan_id);
    assert!(reply.accepted, "{}", reply.text);
    let report = running.wait_for_report();
    assert_eq!(report.verdict, PartReport::MEASURED, "{}", report.text);
    assert_eq!(report.plan_id, proposed.plan_id);
    running.run_s(1.0);
    assert!(running.fault_codes().is_empty());
    Refined {
        cell,
        log: running.finish(),
        first,
        before,
    }
});

/// The session of one plan of the log.
fn measured(refined: &Refined, plan_id: &str) -> diagnosis::Session {
    let folder = tempfile::tempdir().expect("a folder");
    let to = folder.path().join("session");
    bag::write(&refined.cell, &refined.log, &to);
    bag::session(&refined.cell, &to, &Measurement::Named(plan_id.to_owned()))
}

#[test]
fn what_the_first_plan_cannot_tell_is_told_by_the_touches_that_it_proposes() {
    let refined = &*REFINED;
    // The truth is the cell file's: the ball centre is 18 and -11 µm off the axis; displaced balls look alike.
    let effect = &refined.before.effects[0];
    let mut rivals = effect.indistinguishable_from.clone();
    rivals.push(effect.effect.clone());
    for name in ["probe.stylus_offset", "fixture.shift"] {
        assert!(rivals.iter().any(|rival| rival == name), "{rivals:?}");
    }
    let proposed = &refined.before.next_measurement[0];
    let plan_id = &proposed.plan.as_ref().expect("touches").plan_id;
    let later = measured(refined, plan_id);
    assert_eq!(later.events.len(), proposed.points.len());
    let after = join(&refined.first, &later).expect("one session");
    let after = diagnose(&after, &Options::default()).expect("a report");
    let names: Vec<&str> = after
        .effects
        .iter()
        .map(|one| one.effect.as_str())
        .collect();
    assert_eq!(names, ["probe.stylus_offset"]);
    let found = &after.effects[0];
    // Of what looked alike only a run-out of the spindle is left: the touches turned the table, not the spindle.
    for rival in &found.indistinguishable_from {
        assert!(
            rivals.contains(rival) || rival == "axis.S.error_motion",
            "{rival}"
        );
        assert!(rival != "fixture.shift" && rival != "axis.C.error_motion");
    }
    assert!(
        found.indistinguishable_from.len() + 1 < rivals.len(),
        "{found:?}"
    );
    assert!(proposed.chance > 0.5, "{}", proposed.chance);
    for (parameter, truth) in found.parameters.iter().zip([18e-6, -11e-6]) {
        assert!((parameter.value - truth).abs() < 1e-6, "{parameter:?}");
    }
}

#[test]
fn the_cell_itself_answers_over_both_as_the_recording_does() {
    let refined = &*REFINED;
    let reports: Vec<GapReport> = cell_tests::messages(&refined.log, topics::GAP_REPORT.name);
    let last = reports.last().expect("a report");
    let plan_id = &refined.before.next_measurement[0]
        .plan
        .as_ref()
        .expect("touches")
        .plan_id;
    assert_eq!(&last.plan_id, plan_id);
    let mut both = join(&refined.first, &measured(refined, plan_id)).expect("one session");
    both.name = "live".to_owned();
    let joint = diagnose(&both, &Options::default()).expect("a report");
    assert_eq!(last.json, serde_json::to_string(&joint).expect("JSON"));
}

#[test]
fn nothing_is_cut_decided_or_corrected_and_a_replay_makes_every_message_again() {
    let refined = &*REFINED;
    let all = |name: &str| refined.log.iter().filter(|one| one.topic == name).count();
    let requests: Vec<OperationRequest> =
        cell_tests::messages(&refined.log, topics::OPERATION_REQUESTS.name);
    let only: Vec<bool> = requests.iter().map(|one| one.only_measure).collect();
    assert_eq!(only, [false, true]);
    assert_eq!(all(topics::PASS_DECISIONS.name), 1);
    assert_eq!(all(topics::CORRECTIONS.name), 0);
    let made = replay(
        &recording(&refined.log),
        &factories(&refined.cell, &refined.cell.node_names()),
    );
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Verdict::Equal, "{:?}", made.first_difference);
    let compared = |name: &str| made.topics.iter().find(|topic| topic.topic == name);
    for name in [topics::PROBE_EVENTS.name, topics::GAP_REPORT.name] {
        assert_eq!(compared(name).map(|one| one.equal), Some(all(name) as u64));
    }
}

#[test]
fn a_touch_off_the_plan_finds_the_part_as_it_was_cut() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let mut session = Session::new(&cell);
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    let own: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    // Midway between two heights that the plan touches, on a cylinder that the finishing cut has left.
    let (low, high) = (&own.points[0], &own.points[5]);
    assert_eq!(low.normal, high.normal);
    let mut between = low.clone();
    between.position.z = f64::midpoint(low.position.z, high.position.z);
    let reply = plan(&mut session, "punch/next", &[between, low.clone()]);
    assert!(reply.accepted, "{}", reply.text);
    assert!(measure(&mut session, "punch/next").accepted);
    assert_eq!(session.wait_for_report().verdict, PartReport::MEASURED);
    session.run_s(1.0);
    let order: MeasurementOrder = session.last(topics::MEASUREMENT_ORDER);
    assert_eq!(order.order.len(), 2);
    let deviations: Vec<probecell_msgs::TouchDeviation> = session.all(topics::TOUCH_DEVIATIONS);
    let of = |plan_id: &str, point: u32| {
        let mut found = deviations.iter().rev();
        let found = found.find(|one| one.plan_id == plan_id && one.point_index == point);
        found.map(|one| one.deviation).expect("a touch")
    };
    // Five standard deviations of a difference of touches, 0.5 µm each; the part bends by less along its length.
    for point in [0, 1] {
        let off = of("punch/next", point) - of(&own.plan_id, 0);
        assert!(off.abs() < 5.0 * 0.5e-6 * 2.0_f64.sqrt(), "{off:e}");
    }
    // Nothing asks for a correction on the ground of it, and nothing could.
    let after: Vec<Correction> = session.all(topics::CORRECTIONS);
    assert!(after.iter().all(|one| one.plan_id != "punch/next"));
}

/// Why further touches of the finished punch are refused.
fn refused(change: impl Fn(&mut InspectionPoint)) -> String {
    static MADE: LazyLock<(Cell, InspectionPlan)> = LazyLock::new(|| {
        let cell = cell("turn_mill.toml", str::to_owned);
        let own = own_plan(&cell);
        (cell, own)
    });
    let (cell, own) = &*MADE;
    let mut session = Session::new(cell);
    let mut point = own.points[0].clone();
    change(&mut point);
    let reply = plan(&mut session, "punch/next", &[point]);
    assert!(!reply.accepted);
    // What was refused is not there to be measured.
    assert!(measure(&mut session, "punch/next").accepted);
    assert_eq!(session.wait_for_report().verdict, PartReport::STOPPED);
    assert_eq!(session.all::<ProbeEvent>(topics::PROBE_EVENTS), []);
    reply.text
}

#[test]
fn each_touch_that_cannot_be_made_is_refused_with_its_reason() {
    let inside = refused(|point| point.position.x -= 5e-3);
    assert_eq!(inside, "point 0 lies 5.000 mm inside \"D2\"");
    let beyond = refused(|point| point.position.z += 0.5);
    assert_eq!(
        beyond,
        "point 0 lies beyond what the part's own touches of \"D2\" span"
    );
    let nowhere = refused(|point| point.position.y = f64::NAN);
    assert!(
        nowhere.contains("point 0") && nowhere.contains("position"),
        "{nowhere}"
    );
    let fast = refused(|point| point.feed *= 3.0);
    assert!(fast.starts_with("point 0 has a feed of 0.015"), "{fast}");
    let turned = refused(|point| point.rotary_positions[0] = f64::INFINITY);
    assert_eq!(turned, "point 0 has a number that is not finite");
    let slanted = refused(|point| point.normal.z = 1e-3);
    assert!(slanted.contains("normal"), "{slanted}");
    let other = refused(|point| point.feature = 99);
    assert_eq!(
        other,
        "point 0 names feature 99, which the part's plan does not touch"
    );
    // From behind, the probe would go through the part.
    let behind = refused(|point| point.rotary_positions[0] += std::f64::consts::PI);
    assert!(behind.starts_with("point 0"), "{behind}");
}

#[test]
fn a_touch_out_of_travel_is_refused() {
    let cell = check();
    let mut session = Session::new(&cell);
    let mut point = own_plan(&cell).points[0].clone();
    // B reaches 110 degrees.
    point.rotary_positions[0] = 2.2;
    let reply = plan(&mut session, "balls/next", &[point]);
    assert!(!reply.accepted);
    assert!(
        reply.text.contains("point 0") && reply.text.contains('B'),
        "{}",
        reply.text
    );
}

#[test]
fn further_touches_need_a_name_a_free_machine_and_the_part_as_it_was() {
    let cell = check();
    let mut session = Session::new(&cell);
    let points = own_plan(&cell).points[..1].to_vec();
    assert!(!plan(&mut session, "", &points).accepted);
    assert!(plan(&mut session, "balls/check/1/next", &points).accepted);
    session.ask_for("balls");
    session.run_to(topics::RUN_REPLIES);
    let reply = measure(&mut session, "balls/check/1/next");
    assert_eq!(
        (reply.accepted, reply.text.as_str()),
        (false, "a part is being made")
    );
    assert_eq!(session.wait_for_report().verdict, PartReport::QUALIFIED);
    assert!(measure(&mut session, "balls/check/1/next").accepted);
    let busy = measure(&mut session, "balls/check/1/next");
    assert_eq!(
        (busy.accepted, busy.text.as_str()),
        (false, "a part is being measured")
    );
    assert_eq!(session.wait_for_report().verdict, PartReport::MEASURED);
    // What was measured before keeps its name, and nothing is left of the further touches.
    assert!(!plan(&mut session, "balls/check/1", &points).accepted);
    assert!(measure(&mut session, "balls/check/1/next").accepted);
    assert_eq!(session.wait_for_report().verdict, PartReport::STOPPED);
    assert_eq!(session.fault_codes(), ["plan_unknown"]);
}

#[test]
fn a_cell_that_runs_on_a_recording_measures_nothing_further() {
    let cell = check();
    let mut session = Session::replayed(&cell);
    assert!(plan(&mut session, "balls/next", &own_plan(&cell).points[..1]).accepted);
    assert!(measure(&mut session, "balls/next").accepted);
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.contains("recording"), "{}", report.text);
}

/// Whoever hears touches has the plan that was published last: a preview must not take the place of the one that is
/// being measured. The part is made as if nobody had asked.
#[test]
fn a_preview_during_a_measurement_is_refused_and_disturbs_nothing() {
    let cell = check();
    let preview = |session: &mut Session| plan(session, "", &[]);
    let mut session = Session::new(&cell);
    session.ask_for("balls");
    session.run_to(topics::PROBE_EVENTS);
    let measured: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    let reply = preview(&mut session);
    let says = format!(
        "plan {:?} is being measured: a preview would replace it; ask again when that is done",
        measured.plan_id
    );
    assert_eq!((reply.accepted, reply.text), (false, says));
    let report = session.wait_for_report();
    let alone = Session::new(&cell).make("balls");
    assert_eq!((report.verdict, report.text), (alone.verdict, alone.text));
    assert!(session.fault_codes().is_empty());
    let plans: Vec<InspectionPlan> = session.all(topics::INSPECTION_PLAN);
    assert!(plans.iter().all(|one| one.plan_id != "preview"));
    assert!(preview(&mut session).accepted);
    let shown: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    assert_eq!(shown.plan_id, "preview");
}
