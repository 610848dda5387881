//! No correction reaches the machine without a bound, a source, an approval and the session that runs now; and the
//! decision table (`docs/source_systems.md, A.4`) and the scenarios A of its section F, through the whole graph.

use std::collections::BTreeMap;

use cell::Cell;
use cell_tests::{
    cell,
    session::{Session, Spoilt, approved, refuses_all_but_the_sound},
};
use graph::topics;
use probecell_msgs::{
    ControllerCommand, Correction, CorrectionAcknowledgement as Ack, InspectionPlan, OperatorReply,
    PartReport, PassDecision, ToolOffsets, TouchDeviation, Verdict, builtin_interfaces::Time,
};

fn asking() -> Cell {
    cell("turn_mill.toml", |text| {
        text.replace("automatic_approval = true", "automatic_approval = false")
    })
}

/// A session whose first measurement has proposed corrections, which wait.
fn proposed() -> (Session, Vec<Correction>) {
    let mut session = Session::new(&asking());
    session.ask_for("punch");
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    let corrections: Vec<Correction> = session.all(topics::CORRECTIONS);
    assert_eq!(corrections.len(), 2, "one for each tool");
    (session, corrections)
}

/// Number of wear commands sent to the driver, and the offsets that it holds.
fn wear(session: &Session) -> (usize, Vec<f64>) {
    let commands: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
    let written = commands
        .iter()
        .filter(|command| command.kind == ControllerCommand::SET_TOOL_WEAR)
        .count();
    (
        written,
        session.last::<ToolOffsets>(topics::TOOL_OFFSETS).wear,
    )
}

#[test]
fn a_proposed_correction_changes_nothing_until_an_operator_has_approved_it() {
    let (mut session, corrections) = proposed();
    session.run_s(60.0);
    assert_eq!(wear(&session), (0, vec![0.0, 0.0]));
    assert!(
        session
            .all::<Ack>(topics::CORRECTION_ACKNOWLEDGEMENTS)
            .is_empty()
    );
    assert!(
        session.all::<PartReport>(topics::PART_REPORTS).is_empty(),
        "the part waits"
    );

    session.answer(&corrections[0], true);
    session.run_s(1.0);
    let answer: Ack = session.last(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert_eq!(
        (answer.outcome, &answer.correction_id),
        (Ack::APPLIED, &corrections[0].correction_id)
    );
    assert_eq!(wear(&session), (1, vec![corrections[0].new_value, 0.0]));
    let approved: Correction = session.last(topics::CORRECTIONS);
    assert_eq!(
        (approved.approval, approved.approved_by.as_str()),
        (Correction::APPROVAL_OPERATOR, "Ada")
    );

    session.answer(&corrections[1], true);
    session.run_to(topics::PASS_DECISIONS);
    assert_eq!(
        session
            .last::<PassDecision>(topics::PASS_DECISIONS)
            .decision,
        PassDecision::NEXT
    );
}

#[test]
fn a_rejected_correction_stops_the_part_and_is_not_written() {
    let (mut session, corrections) = proposed();
    session.answer(&corrections[1], false);
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert_eq!(
        report.text,
        format!("Ada rejected correction {}", corrections[1].correction_id)
    );
    session.run_s(5.0);
    assert_eq!(wear(&session), (0, vec![0.0, 0.0]));
}

#[test]
fn an_approval_of_nothing_or_by_nobody_is_refused() {
    let (mut session, corrections) = proposed();
    let unknown = Correction {
        correction_id: "other".to_owned(),
        ..corrections[0].clone()
    };
    session.answer(&unknown, true);
    let reply: OperatorReply = session.last(topics::APPROVAL_REPLIES);
    assert_eq!(
        (reply.accepted, reply.text.as_str()),
        (false, "no correction \"other\" waits for approval")
    );
    let nobody = probecell_msgs::OperatorRequest {
        subject: corrections[0].correction_id.clone(),
        approve: true,
        ..probecell_msgs::OperatorRequest::default()
    };
    session.send(topics::APPROVALS, &nobody);
    session.run_s(1.0);
    let reply: OperatorReply = session.last(topics::APPROVAL_REPLIES);
    assert_eq!(
        (reply.accepted, reply.text.as_str()),
        (false, "an approval needs the name of the operator")
    );
    assert_eq!(wear(&session).0, 0);
}

#[test]
fn a_proposal_that_has_expired_is_not_revived_by_an_approval() {
    // Nobody comes within the validity of 600 s: the part does not wait for ever.
    let (mut session, corrections) = proposed();
    session.run_s(590.0);
    assert!(session.all::<PartReport>(topics::PART_REPORTS).is_empty());
    session.run_s(10.0);
    let report = session.last::<PartReport>(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED);
    let ids: Vec<&str> = (corrections.iter())
        .map(|one| one.correction_id.as_str())
        .collect();
    let said = format!(
        "nobody approved or rejected {} within 600 s",
        ids.join(", ")
    );
    assert_eq!(report.text, said);
    assert_eq!(session.fault_codes(), ["approval_overdue"]);
    session.answer(&corrections[0], true);
    let reply: OperatorReply = session.last(topics::APPROVAL_REPLIES);
    let expected = format!("correction {:?} has expired", corrections[0].correction_id);
    assert_eq!((reply.accepted, reply.text), (false, expected));
    assert_eq!(wear(&session).0, 0);
    // The cell makes the next part.
    session.ask_for("second");
    session.run_to(topics::PASS_DECISIONS);
    let decision: PassDecision = session.last(topics::PASS_DECISIONS);
    assert_eq!(decision.decision, PassDecision::RECUT);
}

#[test]
fn an_approval_limit_of_the_cell_file_ends_the_wait_before_the_correction_expires() {
    let cell = cell("turn_mill.toml", |text| {
        text.replace(
            "automatic_approval = true",
            "automatic_approval = false\napproval_limit_s = 45",
        )
    });
    let mut session = Session::new(&cell);
    session.ask_for("punch");
    session.run_to(topics::PASS_DECISIONS);
    let asked = session.now();
    // One of the two is approved and written; that does not stop the clock of the other.
    session.run_s(5.0);
    let corrections: Vec<Correction> = session.all(topics::CORRECTIONS);
    session.answer(&corrections[0], true);
    let report = session.wait_for_report();
    assert_eq!(session.now(), asked.after_s(45.0));
    let said = format!(
        "nobody approved or rejected {} within 45 s",
        corrections[1].correction_id
    );
    assert_eq!((report.verdict, report.text), (PartReport::STOPPED, said));
    assert_eq!(wear(&session), (1, vec![corrections[0].new_value, 0.0]));
}

#[test]
fn what_else_was_proposed_for_a_part_that_was_stopped_cannot_be_approved() {
    let (mut session, corrections) = proposed();
    session.answer(&corrections[1], false);
    session.answer(&corrections[0], true);
    let reply: OperatorReply = session.last(topics::APPROVAL_REPLIES);
    assert!(!reply.accepted, "{}", reply.text);
    session.run_s(5.0);
    assert_eq!(wear(&session), (0, vec![0.0, 0.0]));
}

#[test]
fn each_thing_that_a_correction_may_lack_has_its_own_refusal() {
    let (mut session, corrections) = proposed();
    let good = approved(corrections[0].clone(), "Ada", session.now());
    let past = session.now().after_s(-0.001);
    let variants: Vec<Spoilt> = vec![
        (
            "another session",
            Ack::REFUSED_STALE,
            Box::new(|c| c.session = "simulator-0".to_owned()),
        ),
        (
            "another previous value",
            Ack::REFUSED_STALE,
            Box::new(|c| c.previous_value = 1e-6),
        ),
        (
            "a previous value that is no number",
            Ack::REFUSED_STALE,
            Box::new(|c| c.previous_value = f64::NAN),
        ),
        (
            "expired",
            Ack::REFUSED_STALE,
            Box::new(move |c| c.expires = past.time()),
        ),
        (
            "no expiry",
            Ack::REFUSED_STALE,
            Box::new(|c| c.expires = Time::default()),
        ),
        (
            "below its bound",
            Ack::REFUSED_OUT_OF_BOUNDS,
            Box::new(|c| c.lower_bound = c.new_value + 1e-7),
        ),
        (
            "above its bound",
            Ack::REFUSED_OUT_OF_BOUNDS,
            Box::new(|c| c.upper_bound = c.new_value - 1e-7),
        ),
        (
            "no bound",
            Ack::REFUSED_OUT_OF_BOUNDS,
            Box::new(|c| c.lower_bound = f64::NAN),
        ),
        (
            "not a number",
            Ack::REFUSED_OUT_OF_BOUNDS,
            Box::new(|c| c.new_value = f64::NAN),
        ),
        (
            "beyond the machine's bound, whatever it says of its own",
            Ack::REFUSED_OUT_OF_BOUNDS,
            Box::new(|c| (c.lower_bound, c.new_value) = (-1.0, -0.000_110_1)),
        ),
        (
            "no features",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.feature_ids.clear()),
        ),
        (
            "no touches",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.sequences.clear()),
        ),
        (
            "a plan never measured",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.plan_id = "punch/rough/9".to_owned()),
        ),
        (
            "no error",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.measured_error = f64::NAN),
        ),
        (
            "approved by nobody",
            Ack::REFUSED_NOT_APPROVED,
            Box::new(|c| c.approved_by.clear()),
        ),
        (
            "an approval that does not exist",
            Ack::REFUSED_NOT_APPROVED,
            Box::new(|c| c.approval = 9),
        ),
        (
            "a replay",
            Ack::REFUSED_REPLAY,
            Box::new(|c| c.replayed = true),
        ),
        (
            "a tool that is not there",
            Ack::FAILED,
            Box::new(|c| c.tool_number = 77),
        ),
        (
            "a kind that is not written",
            Ack::FAILED,
            Box::new(|c| c.kind = Correction::WORK_OFFSET),
        ),
    ];
    refuses_all_but_the_sound(&mut session, &good, variants, |session, what| {
        assert_eq!(wear(session), (0, vec![0.0, 0.0]), "{what}");
    });
    assert_eq!(wear(&session), (1, vec![good.new_value, 0.0]));
}

#[test]
fn a_correction_that_comes_again_is_written_once() {
    let (mut session, corrections) = proposed();
    let good = approved(corrections[0].clone(), "Ada", session.now());
    // Twice at once, and once more later.
    session.send(topics::CORRECTIONS, &good);
    session.send(topics::CORRECTIONS, &good);
    session.run_s(0.1);
    session.send(topics::CORRECTIONS, &good);
    session.run_s(0.1);
    let answers: Vec<Ack> = session.all(topics::CORRECTION_ACKNOWLEDGEMENTS);
    let outcomes: Vec<u8> = answers.iter().map(|answer| answer.outcome).collect();
    assert_eq!(outcomes, [Ack::APPLIED, Ack::ALREADY_APPLIED]);
    assert_eq!(wear(&session), (1, vec![good.new_value, 0.0]));
}

#[test]
fn a_cell_that_runs_on_a_recording_tells_a_machine_nothing() {
    let mut session = Session::replayed(&cell("turn_mill.toml", str::to_owned));
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(
        report.text.contains("runs on a recording"),
        "{}",
        report.text
    );
    assert!(
        session
            .all::<ControllerCommand>(topics::CONTROLLER_COMMANDS)
            .is_empty()
    );
}

/// One part with its verdicts.
fn judged(edit: impl Fn(&str) -> String) -> (PartReport, Session) {
    let mut session = Session::new(&cell("turn_mill.toml", edit));
    let report = session.make("punch");
    (report, session)
}

/// Verdicts of the last measurement that was decided on.
fn last_verdicts(session: &Session) -> Vec<Verdict> {
    let all: Vec<Verdict> = session.all(topics::VERDICTS);
    all[all.len() - 5..].to_vec()
}

/// Without the scatter of cutting and touching, so that a scenario's figures stand out.
fn steady(text: &str) -> String {
    text.replace("cut_sd_um = 1.5", "cut_sd_um = 0.0")
        .replace("touch_sd_um = 0.5", "touch_sd_um = 0.1")
}

#[test]
fn a_tool_without_room_for_its_correction_is_worn_and_its_offset_stays() {
    let (report, session) =
        judged(|text| text.replace("error_um = 20.0", "error_um = 120.0\nwear_um = -100.0"));
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(report.text.ends_with("is worn"), "{}", report.text);
    assert!(
        last_verdicts(&session)
            .iter()
            .any(|verdict| verdict.verdict == Verdict::TOOL_WORN)
    );
    let (written, held) = wear(&session);
    assert!(
        written == 0 && held.iter().all(|wear| (wear + 100e-6).abs() < 1e-12),
        "{held:?}"
    );
}

#[test]
fn a_part_cut_below_size_is_scrap_and_no_offset_is_changed() {
    let (report, session) = judged(|text| text.replace("error_um = 20.0", "error_um = -30.0"));
    assert_eq!(report.verdict, PartReport::SCRAP, "{}", report.text);
    assert!(report.text.ends_with("cut below size"), "{}", report.text);
    assert!(
        last_verdicts(&session)
            .iter()
            .all(|verdict| verdict.verdict == Verdict::OVERCUT_NOT_COMPENSABLE)
    );
    assert_eq!(wear(&session).0, 0);
}

#[test]
fn a_tool_that_moves_less_than_it_is_told_is_called_not_converging_after_the_last_correction() {
    let (report, session) = judged(|text| {
        text.replace("error_um = 20.0", "error_um = 80.0").replace(
            "max_corrections = 5",
            "max_corrections = 3\nwear_per_size = 0.2",
        )
    });
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(
        report
            .text
            .ends_with("still out of tolerance after 3 corrections"),
        "{}",
        report.text
    );
    assert!(
        last_verdicts(&session)
            .iter()
            .any(|verdict| verdict.verdict == Verdict::NOT_CONVERGED)
    );
    assert_eq!(wear(&session).0, 6, "three of each tool");
}

#[test]
fn the_printed_macro_stops_where_the_cell_would_correct() {
    let (report, session) = judged(|text| {
        text.replace(
            "max_corrections = 5",
            "max_corrections = 5\nliteral_macro = true",
        )
    });
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(
        report
            .text
            .ends_with("could be corrected, but the policy is to stop"),
        "{}",
        report.text
    );
    assert!(
        last_verdicts(&session)
            .iter()
            .any(|verdict| verdict.verdict == Verdict::COMPENSABLE)
    );
    assert_eq!(wear(&session).0, 0);
}

/// A-phantom-wear: the error of an uncalibrated probe goes into the wear register.
#[test]
fn an_uncalibrated_probe_makes_a_sound_tool_look_worn() {
    let tool = |text: &str| text.replace("error_um = 20.0", "error_um = 50.0");
    let (report, session) = judged(tool);
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let calibrated = wear(&session).1;
    let mut session = Session::new(&cell("turn_mill_uncalibrated.toml", tool));
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    assert!(
        last_verdicts(&session)
            .iter()
            .all(|verdict| verdict.verdict == Verdict::TOOL_WORN)
    );

    // With room for it, the register ends about 65 µm lower for the same tool.
    let (_, session) = judged(str::to_owned);
    let with = wear(&session).1;
    let mut session = Session::new(&cell("turn_mill_uncalibrated.toml", str::to_owned));
    // Qualified by its readings, until the reference contradicts them.
    let report = session.make("punch");
    assert!(
        report.text.contains("the reference contradicts"),
        "{}",
        report.text
    );
    for (tool, (lower, higher)) in wear(&session).1.iter().zip(&with).enumerate() {
        assert!(
            (higher - lower - 65e-6).abs() < 5e-6,
            "tool {tool}: {:.1} µm",
            (higher - lower) * 1e6
        );
    }
    assert!(
        calibrated.iter().all(|wear| *wear < -40e-6),
        "{calibrated:?}"
    );
}

/// The cell file with one pass of these operations in place of its passes.
fn with_one_pass(text: &str, operations: &str) -> String {
    let passes = text.find("passes = [").expect("the passes");
    let end = passes + text[passes..].find("\n]").expect("the end of the passes") + 2;
    let one = format!("passes = [{{ name = \"only\", operations = [{operations}] }}]");
    format!("{}{one}{}", &text[..passes], &text[end..])
}

/// A finishing cut of 0.5 mm on the diameter, of which 3.5 % springs back; `operations` are cut, then measured.
fn elastic(operations: &str) -> (PartReport, Session) {
    judged(|text| {
        let mut text = with_one_pass(text, operations);
        for (nominal, stock) in [("19.8", "26.0"), ("23.5", "26.0"), ("17.8", "23.5")] {
            let deep: f64 = nominal.parse::<f64>().expect("a number") + 0.5;
            text = text.replace(
                &format!("nominal_mm = {nominal}\nstock_mm = {stock}"),
                &format!("nominal_mm = {nominal}\nstock_mm = {deep}"),
            );
        }
        steady(&text)
            .replace("error_um = 20.0", "error_um = 0.0")
            .replace("spring_back = 0.0", "spring_back = 0.035")
            .replace(
                "max_corrections = 5",
                "max_corrections = 5\ndecision_rule = \"simple_acceptance\"",
            )
    })
}

/// A-elastic-loop.
#[test]
fn correcting_spring_back_overcuts_and_a_spring_pass_does_not() {
    let (report, session) = elastic("\"finish_turn\", \"finish_mill\"");
    assert_eq!(report.verdict, PartReport::SCRAP, "{}", report.text);
    let errors: Vec<f64> = session
        .all::<Verdict>(topics::VERDICTS)
        .iter()
        .map(|verdict| verdict.error * 1e6)
        .collect();
    for error in &errors[..5] {
        // The calibrated probe reads 6.2 µm too much.
        assert!((error - 17.5 - 6.2).abs() < 1.5, "first cut {error:.1} µm");
    }
    for error in &errors[5..10] {
        assert!(*error < -10.0, "after correcting {error:.1} µm");
    }
    let spring = "\"finish_turn\", \"finish_mill\", \"finish_turn\", \"finish_mill\"";
    let (report, session) = elastic(spring);
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    for verdict in last_verdicts(&session) {
        assert!(
            (verdict.error * 1e6 - 0.6 - 6.2).abs() < 1.5,
            "{}: {:.1} µm",
            verdict.feature_id,
            verdict.error * 1e6
        );
    }
    assert_eq!(wear(&session).0, 0);
}

/// A-deflection: the deviation of the touches of each height, µm, in one measurement.
fn by_height(session: &Session, plan_id: &str) -> (BTreeMap<i64, f64>, BTreeMap<i64, f64>) {
    let plan = session.all::<InspectionPlan>(topics::INSPECTION_PLAN);
    let plan = plan
        .iter()
        .find(|plan| plan.plan_id == plan_id)
        .expect("the plan");
    let mut turned: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    let mut milled = turned.clone();
    for touch in session.all::<TouchDeviation>(topics::TOUCH_DEVIATIONS) {
        if touch.plan_id == plan_id {
            let point = &plan.points[touch.point_index as usize];
            let round = plan.features[point.feature as usize].id.starts_with('D');
            let of_kind = if round { &mut turned } else { &mut milled };
            of_kind
                .entry((point.position.z * 1e3).round() as i64)
                .or_default()
                .push(touch.deviation * 1e6);
        }
    }
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let means = |all: BTreeMap<i64, Vec<f64>>| {
        all.into_iter()
            .map(|(height, values)| (height, mean(values)))
            .collect()
    };
    (means(turned), means(milled))
}

/// A sound tool on a part that bends while it is turned; all operations are cut, then measured.
fn bending(operations: &str) -> (PartReport, Session) {
    judged(|text| {
        steady(&with_one_pass(text, operations))
            .replace("error_um = 20.0", "error_um = 0.0")
            .replace(
                "spring_back = 0.0",
                "spring_back = 0.0\ndeflection_um = [8.0, 35.0]",
            )
    })
}

#[test]
fn a_turned_part_bends_away_towards_its_free_end_and_a_milled_one_does_not() {
    let rough = "\"rough_turn\", \"rough_mill\"";
    let (_, session) = bending(rough);
    let (turned, milled) = by_height(&session, "punch/only/1");
    assert_eq!(turned.len(), 4);
    // On the radius, at each touched height over the clamping: half of 27 (z/90)^3.
    let bent = |height: i64| 13.5 * (height as f64 / 90.0).powi(3);
    let (&lowest, &least) = turned.first_key_value().expect("four heights");
    for (&height, &deviation) in &turned {
        let (grown, expected) = (deviation - least, bent(height) - bent(lowest));
        assert!(
            (grown - expected).abs() < 0.5,
            "{height} mm: {grown:.2} µm against {expected:.2}"
        );
    }
    let milled: Vec<f64> = milled.into_values().collect();
    assert!((milled[0] - milled[1]).abs() < 0.5, "{milled:?}");

    let (report, session) = bending(&format!("{rough}, \"finish_turn\", \"finish_mill\""));
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    for verdict in last_verdicts(&session) {
        assert!(
            verdict.error.abs() <= 10e-6,
            "{}: {:.1} µm",
            verdict.feature_id,
            verdict.error * 1e6
        );
    }
}
