//! Robotic cells on virtual time: parts made by an arm, with and without a rotary table, and what the diagnosis says of an arm
//! whose errors are planted. The errors are the cell files' and the changes' here; nothing but the simulator reads them.

use bags::Measurement;
use cell::Cell;
use cell_tests::{bag, cell, factories, gaps, make_part, messages, recording, session::Session};
use diagnosis::Report;
use graph::{
    Published,
    replay::{Verdict as Replayed, replay},
    topics,
};
use machine::{Chain, Nominal};
use probecell_msgs::{
    ControllerCommand, CorrectionAcknowledgement as Ack, FeatureResult, InspectionPlan,
    MeasurementOrder, PartReport, ProbeEvent, ProbingMove,
};

const JOINTS: [&str; 6] = ["A1", "A2", "A3", "A4", "A5", "A6"];

fn chain(cell: &Cell) -> Chain {
    Chain::from_urdf(&cell.text().robot_description).expect("a machine")
}

/// Every touch, approach and retract of the orders brings the ball where the plan wants it, by the forward chain; every
/// target is within the travels; and how many touches there were.
fn check_orders(cell: &Cell, log: &[Published]) -> usize {
    let chain = chain(cell);
    let plans: Vec<InspectionPlan> = messages(log, topics::INSPECTION_PLAN.name);
    let mut touches = 0;
    for order in messages::<MeasurementOrder>(log, topics::MEASUREMENT_ORDER.name) {
        let plan = plans
            .iter()
            .find(|plan| plan.plan_id == order.plan_id)
            .expect("its plan");
        let nominal = Nominal::from_plan(plan).expect("a usable plan");
        let mut touched = Vec::new();
        for step in &order.moves {
            for (axis, position) in step.axis_positions.iter().enumerate() {
                let (lower, upper) = chain.axis(axis).limits.expect("a travel");
                assert!((lower..=upper).contains(position));
            }
            let (place, normal) = &nominal.points[step.point_index as usize];
            let planned = &plan.points[step.point_index as usize];
            let ball = chain.ball_in_part(&step.axis_positions, &nominal.part_pose, &nominal.ball);
            let wanted = match step.kind {
                ProbingMove::APPROACH => nominal.ball_radius + planned.approach_distance,
                ProbingMove::RETRACT => nominal.ball_radius + planned.retract_distance,
                ProbingMove::TOUCH => {
                    touched.push(step.point_index);
                    nominal.ball_radius - 2e-3
                }
                _ => continue,
            };
            assert!((ball - (place + normal.into_inner() * wanted)).norm() < 1e-8);
        }
        touched.sort_unstable();
        assert_eq!(touched, (0..plan.points.len() as u32).collect::<Vec<_>>());
        touches += touched.len();
    }
    touches
}

/// The nodes of the cell make the same messages again from the recording.
fn check_replay(cell: &Cell, log: &[Published]) {
    let nodes = [
        "machine_state",
        "probe_events",
        "path_planning",
        "analysis",
        "compensation",
        "cycle",
    ];
    let made = replay(&recording(log), &factories(cell, &nodes));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Replayed::Equal, "{made:?}");
}

fn written(log: &[Published], kind: u8) -> Vec<ControllerCommand> {
    let commands: Vec<ControllerCommand> = messages(log, topics::CONTROLLER_COMMANDS.name);
    commands
        .into_iter()
        .filter(|one| one.kind == kind)
        .collect()
}

/// A casting off its place is bored by an arm: the frame of the programme follows it, the wear offset of the tool corrects the
/// bore, and the part is qualified.
fn check_part(file: &str, axes: &[&str], place: f64) {
    let cell = cell(file, str::to_owned);
    let (report, log) = make_part(&cell, "casting_1");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let orders = messages::<MeasurementOrder>(&log, topics::MEASUREMENT_ORDER.name).len();
    let touches = check_orders(&cell, &log);
    let events: Vec<ProbeEvent> = messages(&log, topics::PROBE_EVENTS.name);
    assert_eq!(events.len(), touches);
    assert!(orders >= 4, "set up twice, bored twice: {orders}");
    for event in &events {
        assert_eq!(event.outcome, ProbeEvent::OUTCOME_TOUCHED);
        assert_eq!(event.axis_names, axes);
    }
    // The casting lies off by 410, -280 and 195 µm; sag and zero offsets of the arm (up to 230 µrad at 0.75 m) add to what it sees.
    let offsets = written(&log, ControllerCommand::SET_WORK_OFFSET);
    for (axis, hidden) in [("X", 410e-6), ("Y", -280e-6), ("Z", 195e-6)] {
        let own = offsets
            .iter()
            .rfind(|one| one.axis == axis)
            .expect("written");
        assert!(
            (own.value - hidden).abs() < 250e-6,
            "{axis}: {:e}",
            own.value
        );
    }
    // The tool leaves 120 µm on the diameter; more wear offset makes an inner size larger.
    let wear = written(&log, ControllerCommand::SET_TOOL_WEAR);
    let last = wear.last().expect("written");
    assert_eq!(last.tool_number, 1);
    assert!((last.value - 120e-6).abs() < 40e-6, "{:e}", last.value);
    let answers: Vec<Ack> = messages(&log, topics::CORRECTION_ACKNOWLEDGEMENTS.name);
    assert!(!answers.is_empty() && answers.iter().all(|one| one.outcome == Ack::APPLIED));
    let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS.name);
    let mut bores = results.into_iter().filter(|one| one.feature_id == "bore");
    let bore = bores.next_back().expect("the bore was measured");
    assert_eq!(bore.aligned_to, ["A", "B", "C"]);
    assert!(bore.position < place, "{:.1} µm", bore.position * 1e6);
    check_replay(&cell, &log);
}

#[test]
fn an_arm_makes_a_part_that_is_corrected_and_qualified_and_its_session_replays_equal() {
    check_part("robot_cell.toml", &JOINTS, 60e-6);
}

#[test]
fn an_arm_and_a_rotary_table_make_a_part_and_their_session_replays_equal() {
    let axes = ["C", "A1", "A2", "A3", "A4", "A5", "A6"];
    // The table turns the part against the errors of the arm (up to 230 µrad at 0.75 m), which datums and bore meet at
    // different positions of it.
    check_part("robot_turntable.toml", &axes, 350e-6);
}

#[test]
fn a_part_that_the_arm_cannot_get_to_is_refused_with_the_point_and_the_reason() {
    let far = cell("robot_check.toml", |text| {
        let at = "machined_on_this_machine = false";
        text.replacen(at, &format!("{at}\nposition_mm = [-1200.0, 0.0, 0.0]"), 1)
    });
    let mut session = Session::new(&far);
    let report = session.make("balls");
    assert_eq!(report.verdict, PartReport::STOPPED);
    let told =
        "cannot be touched: of 8 attitudes of the probe 0 postures of the arm are within reach";
    assert!(report.text.contains(told), "{}", report.text);
}

#[test]
fn stem_directions_of_a_machine_that_cannot_turn_its_probe_are_refused_and_those_of_an_arm_are_required()
 {
    for (file, old, new, says) in [
        (
            "clamped_casting.toml",
            "approach_mm = 2.0",
            "approach_mm = 2.0\nstem_directions = [[0.0, 0.0, 1.0]]",
            "six free rotary axes, but 0 are free here",
        ),
        (
            "robot_cell.toml",
            "stem_directions = [[0.0, 0.0, 1.0]]",
            "",
            "part.stem_directions (or its own) must say from where",
        ),
        (
            "robot_cell.toml",
            "axis = \"A2\"",
            "axis = \"A9\"",
            "machine.joints: \"A9\" is not an axis of this machine",
        ),
    ] {
        let text = cell(file, str::to_owned).text().clone();
        let edited = text.cell.replace(old, new);
        assert_ne!(edited, text.cell, "{old}");
        match Cell::from_text(cell::CellText {
            cell: edited,
            ..text
        }) {
            Ok(_) => panic!("{new} was taken"),
            Err(error) => assert!(error.to_string().contains(says), "{error}"),
        }
    }
}

/// The diagnosis of a check on three balls, with the arm's errors replaced.
fn diagnosed(errors: &str, joints: &str, seed: u64) -> Report {
    let cell = cell("robot_check.toml", |text| {
        let planted = "errors = [{ name = \"EC0A2\", value_urad = 200.0 }]\njoints = []";
        assert!(text.contains(planted));
        text.replace(
            planted,
            &format!("errors = [{errors}]\njoints = [{joints}]"),
        )
        .replacen("seed = 1\n", &format!("seed = {seed}\n"), 1)
    });
    let (_, log) = make_part(&cell, "balls");
    bag::diagnosis(&cell, &log, &Measurement::Last)
}

/// Value and 95 % interval of a parameter of the effect that stands for `id`, its own or that in its place.
fn interval(report: &Report, id: &str, parameter: &str) -> Option<[f64; 2]> {
    let effect = report.effects.iter().find(|one| one.effect == id)?;
    let found = effect.parameters.iter().find(|one| one.name == parameter)?;
    Some(found.ci95)
}

/// How often the interval holds the planted value, over some seeds; the cause is named in each.
fn coverage(id: &str, parameter: &str, truth: f64, errors: &str, joints: &str) {
    let mut held = 0;
    for seed in 1..=4 {
        let report = diagnosed(errors, joints, seed);
        assert!(
            gaps::stands_for(&report, id),
            "{id} seed {seed}: {:#?}",
            report.effects
        );
        if let Some([low, high]) = interval(&report, id, parameter) {
            held += usize::from((low..=high).contains(&truth));
        }
    }
    assert!(
        held >= 3,
        "{id}: {held} of 4 intervals hold the planted value"
    );
}

#[test]
fn a_planted_joint_zero_is_named_with_its_interval() {
    let zero = "{ name = \"EC0A3\", value_urad = 200.0 }";
    coverage("link.EC0A3", "e", 200e-6, zero, "");
}

#[test]
fn a_joint_that_sags_is_named_with_its_compliance() {
    let sag = "{ axis = \"A2\", compliance_urad_per_nm = 4.0 }";
    coverage("axis.A2.indexing", "compliance", 4e-6, "", sag);
}

#[test]
fn lost_motion_of_a_joint_is_named_with_its_size() {
    let lost = "{ axis = \"A1\", backlash_urad = 120.0 }";
    coverage("axis.A1.backlash", "b", 120e-6, "", lost);
}

#[test]
fn an_arm_without_errors_has_no_gap() {
    let report = diagnosed("", "", 1);
    assert_eq!(
        report.verdict,
        diagnosis::Verdict::NoGap,
        "{:#?}",
        report.effects
    );
}
