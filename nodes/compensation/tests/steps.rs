//! Step by step: from sizes to verdicts, corrections and a decision (`docs/source_systems.md, A.4`).

use compensation::{
    CompensationNode, Config, Input, Output, PathCorrection, RawCharacteristic, RawConfig,
    RawDecisionRule, RawVolumetric,
};
use graph::{Node, Outbox, Stamp};
use machine::Chain;
use probecell_msgs::{
    Correction, FeatureResult, InspectionFeature, InspectionPlan, InspectionPoint,
    OperationRequest, OperatorKeys, OperatorRequest, PartReport, PassDecision, ToolOffsets,
    Verdict,
};
use signatures::{SecretKey, Signer, Trust, approval};

/// One outer diameter of 19.8 mm cut by tool 2, within 10 µm; the table's limits.
fn raw(automatic_approval: bool, inner: bool) -> RawConfig {
    let characteristic = RawCharacteristic {
        id: "D1".to_owned(),
        tolerance_mm: 0.010,
        tool_number: Some(2),
        inner,
        passes: Vec::new(),
    };
    RawConfig {
        characteristics: vec![characteristic],
        volumetric: None,
        work_offset: None,
        wear_limit_mm: 0.110,
        max_corrections: 5,
        automatic_approval,
        validity_s: 60.0,
        approval_limit_s: None,
        wear_per_size: 1.0,
        path: PathCorrection::Deterministic,
        path_limit_mm: 0.5,
        // The source's table.
        decision_rule: RawDecisionRule::SimpleAcceptance,
        literal_macro: false,
        spring_pass: false,
    }
}

/// No machine matters to sizes.
fn chain() -> Chain {
    Chain::from_urdf(machine::models::WCBXFZYST).expect("a chain")
}

fn config(automatic_approval: bool, inner: bool) -> Config {
    let raw = raw(automatic_approval, inner);
    trusting(&raw)
}

fn trusting(raw: &RawConfig) -> Config {
    let config = raw.check(&chain(), &["finish"], false);
    let trust = Trust {
        cell: Some(key(1).public()),
        automatic: raw.automatic_approval,
        unsigned_operators: false,
    };
    let config = config.expect("sound settings");
    config.with_trust(trust, Signer::Key(key(1)))
}

/// Of the cell (1) and of Ada (2).
fn key(seed: u8) -> SecretKey {
    SecretKey::from_seed([seed; 32])
}

/// The node at its start, to which the operators are known.
fn started(config: &Config) -> compensation::State {
    let mut state = CompensationNode::start(config);
    let keys = OperatorKeys {
        number: 1,
        names: vec!["Ada".to_owned()],
        keys: vec![key(2).public().to_string()],
        withdrawn: vec![false],
        ..OperatorKeys::default()
    };
    let keys = Input::Keys(signatures::operators::signed(&key(1), keys));
    CompensationNode::step(config, &mut state, Stamp(0), keys, &mut Outbox::default());
    state
}

/// An approval with Ada's signature on what is proposed; anything else as it is.
fn signed(state: &compensation::State, now: Stamp, input: Input) -> Input {
    let Input::Approval(mut request) = input else {
        return input;
    };
    if let Some((proposed, _)) = state.proposed.get(&request.subject) {
        let answer = Correction {
            approval: if request.approve {
                Correction::APPROVAL_OPERATOR
            } else {
                Correction::APPROVAL_REJECTED
            },
            approved_by: request.operator_name.clone(),
            approved_at: now.time(),
            ..proposed.clone()
        };
        request.signed_at = now.time();
        request.signature = approval::sign(&key(2), &key(1).public(), &answer);
    }
    Input::Approval(request)
}

fn offsets(wear_um: f64) -> Input {
    Input::Offsets(ToolOffsets {
        session: "run 1".to_owned(),
        tool_numbers: vec![2],
        wear: vec![wear_um * 1e-6],
        ..ToolOffsets::default()
    })
}

fn measure(plan: &str) -> Input {
    let (kind, plan_id) = (OperationRequest::MEASURE, plan.to_owned());
    Input::Request(OperationRequest {
        kind,
        plan_id,
        ..OperationRequest::default()
    })
}

fn result(plan: &str, size_mm: f64) -> Input {
    Input::Feature(FeatureResult {
        plan_id: plan.to_owned(),
        feature_id: "D1".to_owned(),
        size: size_mm * 1e-3,
        nominal_size: 19.8e-3,
        size_deviation: (size_mm - 19.8) * 1e-3,
        sequences: vec![4, 5],
        standard_uncertainty: 1e-6,
        ..FeatureResult::default()
    })
}

/// When the inputs of [`check`] come.
const NOW: Stamp = Stamp(10_000_000_000);

/// What the last of the inputs makes the node say, a line each.
fn check(config: &Config, inputs: Vec<Input>, expected: &[&str]) {
    let mut state = started(config);
    let mut said = Vec::new();
    for input in inputs {
        let input = signed(&state, NOW, input);
        let mut out = Outbox::default();
        CompensationNode::step(config, &mut state, NOW, input, &mut out);
        said = out.messages().iter().map(line).collect();
    }
    assert_eq!(said, expected);
}

fn line(output: &Output) -> String {
    match output {
        Output::Verdict(one) => {
            let verdict = match one.verdict {
                Verdict::QUALIFIED => "qualified",
                Verdict::COMPENSABLE => "compensable",
                Verdict::OVERCUT_NOT_COMPENSABLE => "overcut",
                Verdict::TOOL_WORN => "tool worn",
                Verdict::NOT_CONVERGED => "not converged",
                Verdict::INDETERMINATE => "indeterminate",
                Verdict::CONTRADICTED => "contradicted",
                _ => "invalid",
            };
            format!("{} {verdict}", one.feature_id)
        }
        Output::Correction(one) => {
            let approval = match one.approval {
                Correction::APPROVAL_NONE => "proposed",
                Correction::APPROVAL_REJECTED => "rejected",
                _ => "approved",
            };
            let (before, after) = (one.previous_value * 1e6, one.new_value * 1e6);
            format!(
                "{} {approval} {before:.1} to {after:.1} by {:?}",
                one.correction_id, one.approved_by
            )
        }
        Output::Decision(one) => {
            let decision = ["next", "recut", "stop", "scrap", "revoked"][usize::from(one.decision)];
            format!("{decision} {:?}", one.correction_ids)
        }
        Output::Reply(one) if one.accepted => "accepted".to_owned(),
        Output::Reply(one) => format!("refused: {}", one.text),
        Output::Fault(one) => format!("{}: {}", one.code, one.text),
    }
}

/// The verdict on one size at that wear.
fn check_size(size_mm: f64, wear_um: f64, expected: &[&str]) {
    check(
        &config(true, false),
        vec![offsets(wear_um), measure("p/1"), result("p/1", size_mm)],
        expected,
    );
}

/// A measurement that is stopped when the last size is there, and further features of the plan are not, is not decided on.
#[test]
fn nothing_is_decided_before_the_plan_is_measured_whole() {
    let feature = |id: &str| InspectionFeature {
        id: id.to_owned(),
        ..InspectionFeature::default()
    };
    let point = |feature: u32| InspectionPoint {
        feature,
        ..InspectionPoint::default()
    };
    let plan = |id: &str| {
        Input::Plan(InspectionPlan {
            plan_id: id.to_owned(),
            features: vec![feature("D1"), feature("top"), feature("untouched")],
            points: vec![point(0), point(1), point(0)],
            ..InspectionPlan::default()
        })
    };
    let top = || {
        let Input::Feature(mut top) = result("p/1", 5.0) else {
            unreachable!("a result");
        };
        top.feature_id = "top".to_owned();
        Input::Feature(top)
    };
    let size = || result("p/1", 19.8);
    let config = config(true, false);
    let begun = |plan: Input| vec![offsets(0.0), plan, measure("p/1")];
    let with = |mut inputs: Vec<Input>, more: Vec<Input>| {
        inputs.extend(more);
        inputs
    };
    let decided = ["D1 qualified", "next []"];
    let stop = Input::Request(OperationRequest {
        kind: OperationRequest::STOP,
        ..OperationRequest::default()
    });
    check(&config, with(begun(plan("p/1")), vec![size()]), &[]);
    check(&config, with(begun(plan("p/1")), vec![size(), stop]), &[]);
    for order in [vec![size(), top()], vec![top(), size()]] {
        check(&config, with(begun(plan("p/1")), order), &decided);
    }
    // Resumed, it is measured anew: what was reported before does not count.
    let resumed = Input::Request(OperationRequest {
        kind: OperationRequest::MEASURE,
        request_id: 7,
        plan_id: "p/1".to_owned(),
        ..OperationRequest::default()
    });
    let again = with(begun(plan("p/1")), vec![top(), resumed, size()]);
    check(&config, again.clone(), &[]);
    check(&config, with(again, vec![top()]), &decided);
    // Of a plan that is not known only the sizes are.
    check(&config, with(begun(plan("p/0")), vec![size()]), &decided);
}

#[test]
fn the_test_vectors_of_the_decision_table_hold() {
    let corrected = |wear: &str| {
        vec![
            "D1 compensable".to_owned(),
            format!("p/1/T2/4 approved {wear} by \"policy of the cell file\""),
            "recut [\"p/1/T2/4\"]".to_owned(),
        ]
    };
    let check_corrected = |size: f64, wear: f64, change: &str| {
        let expected = corrected(change);
        let expected: Vec<&str> = expected.iter().map(String::as_str).collect();
        check_size(size, wear, &expected);
    };
    check_size(19.810, 0.0, &["D1 qualified", "next []"]);
    check_corrected(19.811, 0.0, "0.0 to -11.0");
    check_size(19.790, 0.0, &["D1 qualified", "next []"]);
    check_size(19.789, 0.0, &["D1 overcut", "scrap []"]);
    check_corrected(19.835, -70.0, "-70.0 to -105.0");
    check_size(19.835, -80.0, &["D1 tool worn", "stop []"]);
    check_corrected(19.840, -70.0, "-70.0 to -110.0");
}

/// Offsets of a tool path are gone with the driver that held them.
#[test]
fn the_path_of_a_new_run_of_the_driver_is_offset_from_nothing() {
    let mut raw = RawConfig {
        path: PathCorrection::Raw,
        ..raw(true, false)
    };
    raw.characteristics[0].tool_number = None;
    let measured = |session: &str, plan: &str| {
        let Input::Feature(size) = result(plan, 19.8) else {
            unreachable!("a feature")
        };
        let profile = FeatureResult {
            deviations: vec![20e-6, -15e-6],
            ..size
        };
        let held = ToolOffsets {
            session: session.to_owned(),
            ..ToolOffsets::default()
        };
        [Input::Offsets(held), measure(plan), Input::Feature(profile)]
    };
    let said = |session: &str, change: &str| {
        let correction = format!("q/1/path/D1 approved {change} by \"policy of the cell file\"");
        check(
            &trusting(&raw),
            [measured("run 1", "p/1"), measured(session, "q/1")].concat(),
            &["D1 compensable", &correction, "recut [\"q/1/path/D1\"]"],
        );
    };
    said("run 1", "20.0 to 40.0");
    said("run 2", "0.0 to 20.0");
}

/// 1 µm of wear offset changes the size by 2 µm: 110 µm of it are 220 µm of size.
#[test]
fn the_limit_of_wear_counts_by_what_it_does_to_the_size() {
    let config = trusting(&RawConfig {
        wear_per_size: 0.5,
        ..raw(true, false)
    });
    let inputs = |wear_um: f64| vec![offsets(wear_um), measure("p/1"), result("p/1", 19.835)];
    let correction = "p/1/T2/4 approved -90.0 to -107.5 by \"policy of the cell file\"";
    let corrected = ["D1 compensable", correction, "recut [\"p/1/T2/4\"]"];
    check(&config, inputs(-90.0), &corrected);
    check(&config, inputs(-100.0), &["D1 tool worn", "stop []"]);
}

#[test]
fn a_bore_is_corrected_the_other_way() {
    let inputs = vec![offsets(0.0), measure("p/1"), result("p/1", 19.785)];
    let correction = "p/1/T2/4 approved 0.0 to 15.0 by \"policy of the cell file\"";
    check(
        &config(true, true),
        inputs,
        &["D1 compensable", correction, "recut [\"p/1/T2/4\"]"],
    );
    let inputs = vec![offsets(0.0), measure("p/1"), result("p/1", 19.811)];
    check(&config(true, true), inputs, &["D1 overcut", "scrap []"]);
}

/// GUM 5.2.2: two sizes of one tool, each 0.2 µm by its own touches and 1.0 µm by the stylus that measured both. Taking them
/// as independent would state 0.72 µm.
#[test]
fn the_uncertainty_of_a_mean_of_sizes_keeps_what_they_share() {
    let uncertainty = |common: [f64; 2], inner: bool| {
        let mut raw = raw(true, inner);
        let mut second = raw.characteristics[0].clone();
        second.id = "D2".to_owned();
        raw.characteristics.push(second);
        let config = raw
            .check(&chain(), &["finish"], false)
            .expect("sound settings");
        let names = ["D1".to_owned(), "D2".to_owned()];
        let config = config.with_common(names.into_iter().zip(common).collect());
        let mut state = CompensationNode::start(&config);
        let mut out = Outbox::default();
        let size = |id: &str| {
            let size_mm = if inner { 19.78 } else { 19.82 };
            let Input::Feature(result) = result("p/1", size_mm) else {
                unreachable!("a feature")
            };
            Input::Feature(FeatureResult {
                feature_id: id.to_owned(),
                standard_uncertainty: 0.2e-6_f64.hypot(1.0e-6),
                ..result
            })
        };
        for input in [offsets(0.0), measure("p/1"), size("D1"), size("D2")] {
            CompensationNode::step(&config, &mut state, Stamp(0), input, &mut out);
        }
        let corrections = out.messages().iter().filter_map(|message| match message {
            Output::Correction(correction) => Some(correction.standard_uncertainty * 1e6),
            _ => None,
        });
        corrections.collect::<Vec<f64>>()
    };
    let expected = |value: f64, found: &[f64]| {
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0] - value).abs() < 5e-7, "{found:?}");
    };
    let shared = (0.2_f64.powi(2) / 2.0 + 1.0).sqrt();
    assert_eq!(format!("{shared:.2}"), "1.01");
    expected(shared, &uncertainty([1e-6, 1e-6], false));
    expected(shared, &uncertainty([-1e-6, -1e-6], true));
    expected(
        1.04_f64.sqrt() / 2.0_f64.sqrt(),
        &uncertainty([0.0, 0.0], false),
    );
    // Of two sizes that the stylus changes in opposite directions the mean does not depend on it.
    expected(0.2 / 2.0_f64.sqrt(), &uncertainty([1e-6, -1e-6], false));
}

#[test]
fn a_result_that_comes_before_its_request_is_judged_when_the_request_comes() {
    check(
        &config(true, false),
        vec![offsets(0.0), result("p/1", 19.8)],
        &[],
    );
    let late = vec![offsets(0.0), result("p/1", 19.8), measure("p/1")];
    check(&config(true, false), late, &["D1 qualified", "next []"]);
}

#[test]
fn a_result_of_another_measurement_is_not_judged() {
    check(
        &config(true, false),
        vec![offsets(0.0), measure("p/2"), result("p/1", 19.8)],
        &[],
    );
}

#[test]
fn a_size_without_a_known_wear_or_without_a_number_is_invalid() {
    check(
        &config(true, false),
        vec![measure("p/1"), result("p/1", 19.8)],
        &["D1 invalid", "stop []"],
    );
    check_size(f64::NAN, 0.0, &["D1 invalid", "stop []"]);
    check_size(f64::INFINITY, 0.0, &["D1 invalid", "stop []"]);
    check_size(19.8, f64::NAN, &["D1 invalid", "stop []"]);
    let mut invalid = result("p/1", 19.8);
    if let Input::Feature(one) = &mut invalid {
        one.decision = FeatureResult::INVALID;
    }
    check(
        &config(true, false),
        vec![offsets(0.0), measure("p/1"), invalid],
        &["D1 invalid", "stop []"],
    );
}

fn answer(operator: &str, approve: bool) -> Input {
    Input::Approval(OperatorRequest {
        subject: "p/1/T2/4".to_owned(),
        operator_name: operator.to_owned(),
        approve,
        ..OperatorRequest::default()
    })
}

#[test]
fn a_proposed_correction_is_approved_once_by_somebody_with_a_name() {
    let proposed = || vec![offsets(0.0), measure("p/1"), result("p/1", 19.83)];
    let config = config(false, false);
    let unknown = "refused: no correction \"p/1/T2/4\" waits for approval";
    let proposal = "p/1/T2/4 proposed 0.0 to -30.0 by \"\"";
    check(
        &config,
        proposed(),
        &["D1 compensable", proposal, "recut [\"p/1/T2/4\"]"],
    );
    let with = |more: Vec<Input>| proposed().into_iter().chain(more).collect();
    let approved = "p/1/T2/4 approved 0.0 to -30.0 by \"Ada\"";
    check(
        &config,
        with(vec![answer("Ada", true)]),
        &[approved, "accepted"],
    );
    check(
        &config,
        with(vec![answer("Ada", true), answer("Ada", true)]),
        &[unknown],
    );
    check(
        &config,
        with(vec![answer("", true)]),
        &["refused: an approval needs the name of the operator"],
    );
    let rejected = "p/1/T2/4 rejected 0.0 to -30.0 by \"Ada\"";
    check(
        &config,
        with(vec![answer("Ada", false)]),
        &["stop []", rejected, "accepted"],
    );
    check(
        &config,
        with(vec![measure("p/2"), answer("Ada", true)]),
        &[unknown],
    );
}

/// Two diameters cut by two tools: who rejects one correction ends the part, and the other one is void.
#[test]
fn a_rejection_voids_what_else_was_proposed_for_the_part() {
    let mut raw = raw(false, false);
    let mut second = raw.characteristics[0].clone();
    (second.id, second.tool_number) = ("D2".to_owned(), Some(3));
    raw.characteristics.push(second);
    let held = Input::Offsets(ToolOffsets {
        session: "run 1".to_owned(),
        tool_numbers: vec![2, 3],
        wear: vec![0.0; 2],
        ..ToolOffsets::default()
    });
    let mut other = result("p/1", 19.83);
    if let Input::Feature(one) = &mut other {
        one.feature_id = "D2".to_owned();
    }
    let mut late = answer("Ada", true);
    if let Input::Approval(one) = &mut late {
        one.subject = "p/1/T3/4".to_owned();
    }
    let measured = vec![held, measure("p/1"), result("p/1", 19.83), other];
    let answered = vec![answer("Ada", false), late];
    check(
        &trusting(&raw),
        measured.into_iter().chain(answered).collect(),
        &["refused: correction \"p/1/T3/4\" is void: its part has ended"],
    );
}

fn part(verdict: u8, sec: i32) -> Input {
    let mut report = PartReport {
        verdict,
        ..PartReport::default()
    };
    report.header.stamp.sec = sec;
    Input::Part(report)
}

/// The proposal is made at 0 s.
#[test]
fn what_was_proposed_for_a_part_is_void_when_the_part_has_ended() {
    let config = config(false, false);
    let proposed = |more: Vec<Input>| {
        let proposal = vec![offsets(0.0), measure("p/1"), result("p/1", 19.83)];
        proposal.into_iter().chain(more).collect()
    };
    for verdict in [PartReport::STOPPED, PartReport::SCRAP] {
        check(
            &config,
            proposed(vec![part(verdict, 18), answer("Ada", true)]),
            &["refused: correction \"p/1/T2/4\" is void: its part has ended"],
        );
    }
    // The report of a part before, and of a run that only measured, take nothing back.
    for (verdict, sec) in [(PartReport::STOPPED, 6), (PartReport::MEASURED, 18)] {
        check(
            &config,
            proposed(vec![part(verdict, sec), answer("Ada", true)]),
            &["p/1/T2/4 approved 0.0 to -30.0 by \"Ada\"", "accepted"],
        );
    }
}

/// The node wakes itself when the limit has passed, and not again for what was answered.
#[test]
fn a_proposal_that_nobody_answers_stops_the_part_at_the_limit() {
    let config = RawConfig {
        approval_limit_s: Some(20.0),
        ..raw(false, false)
    };
    let config = trusting(&config);
    let begin = Stamp(7_000_000_000);
    let proposed = || {
        let mut state = started(&config);
        let mut out = Outbox::default();
        for input in [offsets(0.0), measure("p/1"), result("p/1", 19.83)] {
            CompensationNode::step(&config, &mut state, begin, input, &mut out);
        }
        assert_eq!(out.timers(), [(begin.after_s(20.0), 1)]);
        state
    };
    let said = |state: &mut compensation::State, after_s: f64, input: Input| -> Vec<String> {
        let mut out = Outbox::default();
        let now = begin.after_s(after_s);
        let input = signed(state, now, input);
        CompensationNode::step(&config, state, now, input, &mut out);
        out.messages().iter().map(line).collect()
    };
    let mut state = proposed();
    let nothing: Vec<String> = Vec::new();
    assert_eq!(said(&mut state, 19.9, Input::Timer(1)), nothing);
    assert_eq!(
        said(&mut state, 20.0, Input::Timer(1)),
        [
            "approval_overdue: nobody approved or rejected p/1/T2/4 within 20 s",
            "stop []"
        ]
    );
    assert_eq!(said(&mut state, 20.1, Input::Timer(1)), nothing);
    assert_eq!(
        said(&mut state, 21.0, answer("Ada", true)),
        ["refused: correction \"p/1/T2/4\" has expired"]
    );
    for approve in [true, false] {
        let mut state = proposed();
        said(&mut state, 3.0, answer("Ada", approve));
        assert_eq!(said(&mut state, 20.0, Input::Timer(1)), nothing);
    }
}

#[test]
fn a_limit_that_is_no_time_or_outlives_the_correction_is_refused() {
    for (limit, says) in [
        (0.0, "compensation.approval_limit_s = 0 must be"),
        (-5.0, "compensation.approval_limit_s = -5 must be"),
        (f64::NAN, "compensation.approval_limit_s = NaN must be"),
        (f64::INFINITY, "compensation.approval_limit_s = inf must be"),
        (
            60.5,
            "approval_limit_s = 60.5 is longer than validity_s = 60",
        ),
    ] {
        let raw = RawConfig {
            approval_limit_s: Some(limit),
            ..raw(false, false)
        };
        let error = raw
            .check(&chain(), &["finish"], false)
            .expect_err("refused");
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn a_correction_names_what_entitles_it() {
    let config = config(true, false);
    let mut state = CompensationNode::start(&config);
    let mut out = Outbox::default();
    for input in [offsets(-5.0), measure("p/1"), result("p/1", 19.83)] {
        CompensationNode::step(&config, &mut state, Stamp(7_000_000_000), input, &mut out);
    }
    let correction = out
        .messages()
        .iter()
        .find_map(|output| {
            if let Output::Correction(correction) = output {
                Some(correction)
            } else {
                None
            }
        })
        .expect("a correction");
    assert_eq!(
        (correction.session.as_str(), correction.plan_id.as_str()),
        ("run 1", "p/1")
    );
    assert_eq!(
        (&correction.sequences, &correction.feature_ids),
        (&vec![4, 5], &vec!["D1".to_owned()])
    );
    assert_eq!(
        (correction.lower_bound, correction.upper_bound),
        (-0.110e-3, 0.110e-3)
    );
    assert_eq!((correction.expires.sec, correction.replayed), (67, false));
    assert!((correction.measured_error - 30e-6).abs() < 1e-12);
    let decided = out.messages().iter().any(|output| {
        matches!(
            output,
            Output::Decision(PassDecision {
                decision: PassDecision::RECUT,
                ..
            })
        )
    });
    assert!(decided);
}

/// `docs/source_systems.md, A.4`, hazard 2: only what repeats after a cut with unchanged offsets is corrected, once
/// in a pass.
#[test]
fn a_spring_pass_comes_before_the_first_correction_of_a_pass() {
    let config = Config {
        spring_pass: true,
        ..config(true, false)
    };
    let said = |sizes: &[f64], expected: &[&str]| {
        let mut inputs = vec![offsets(0.0)];
        for (index, size) in sizes.iter().enumerate() {
            let plan = format!("p/{}", index + 1);
            inputs.extend([measure(&plan), result(&plan, *size)]);
        }
        check(&config, inputs, expected);
    };
    said(&[19.835], &["D1 compensable", "recut []"]);
    said(
        &[19.835, 19.822],
        &[
            "D1 compensable",
            "p/2/T2/4 approved 0.0 to -22.0 by \"policy of the cell file\"",
            "recut [\"p/2/T2/4\"]",
        ],
    );
    said(&[19.835, 19.801], &["D1 qualified", "next []"]);
    // Another pass has its own.
    let mut inputs = vec![offsets(0.0)];
    for plan in ["p/1", "q/1"] {
        inputs.extend([measure(plan), result(plan, 19.835)]);
    }
    check(&config, inputs, &["D1 compensable", "recut []"]);
}

#[test]
fn a_size_that_stands_there_for_each_pass_has_a_tolerance_and_a_register_in_each() {
    let of_pass = |pass: &str, tolerance_mm, tool| RawCharacteristic {
        id: "D1".to_owned(),
        tolerance_mm,
        tool_number: Some(tool),
        inner: false,
        passes: vec![pass.to_owned()],
    };
    let raw = |characteristics| RawConfig {
        characteristics,
        ..raw(true, false)
    };
    let both = raw(vec![
        of_pass("rough", 0.020, 2),
        of_pass("finish", 0.010, 12),
    ]);
    let config = both
        .check(&chain(), &["rough", "finish"], false)
        .expect("sound");
    let held = || {
        Input::Offsets(ToolOffsets {
            session: "run 1".to_owned(),
            tool_numbers: vec![2, 12],
            wear: vec![-15e-6, 3e-6],
            ..ToolOffsets::default()
        })
    };
    let measure_in = |pass_number, plan: &str| {
        Input::Request(OperationRequest {
            kind: OperationRequest::MEASURE,
            plan_id: plan.to_owned(),
            pass_number,
            ..OperationRequest::default()
        })
    };
    check(
        &config,
        vec![held(), measure_in(0, "p/1"), result("p/1", 19.815)],
        &["D1 qualified", "next []"],
    );
    check(
        &config,
        vec![held(), measure_in(1, "p/1"), result("p/1", 19.815)],
        &[
            "D1 compensable",
            "p/1/T12/4 approved 3.0 to -12.0 by \"policy of the cell file\"",
            "recut [\"p/1/T12/4\"]",
        ],
    );
    for (characteristics, expected) in [
        (
            vec![of_pass("rough", 0.020, 2)],
            "compensation.characteristics: no size decides in pass \"finish\"",
        ),
        (
            vec![of_pass("ruogh", 0.020, 2)],
            "compensation.characteristics: \"D1\" decides in pass \"ruogh\", which the cycle does not have",
        ),
        (
            vec![of_pass("rough", 0.020, 2), of_pass("rough", 0.010, 12)],
            "compensation.characteristics: \"D1\" decides twice in pass \"rough\"",
        ),
    ] {
        let refused = raw(characteristics).check(&chain(), &["rough", "finish"], false);
        let told = refused.err().map(|error| error.to_string());
        assert_eq!(told.as_deref(), Some(expected));
    }
}

#[test]
fn a_table_of_links_that_the_machine_lacks_or_of_none_is_refused() {
    for (links, says) in [
        (vec![], "compensation.volumetric.links is empty"),
        (
            vec!["EC0W"],
            "`EC0W` names axis `W`, which the robot description lacks",
        ),
        (vec!["ECY"], "`ECY` is not a location error"),
        (vec!["EC0Y", "EX0C", "EC0Y"], "\"EC0Y\" is listed twice"),
    ] {
        let table = RawVolumetric {
            id: "table".to_owned(),
            links: links.into_iter().map(str::to_owned).collect(),
            tolerance_mm: 0.01,
            limit_um: 50.0,
            limit_urad: 100.0,
            uncertainty_um: 2.0,
            uncertainty_urad: 5.0,
            displacement_limit_mm: 0.5,
            probe_effects: Vec::new(),
            passes: Vec::new(),
        };
        let raw = RawConfig {
            volumetric: Some(table),
            ..raw(true, false)
        };
        let error = raw
            .check(&chain(), &["finish"], false)
            .expect_err("refused");
        assert!(error.to_string().contains(says), "{error}");
    }
}

/// Expanded uncertainty 2 µm of a tolerance of 10 µm: ISO 14253-1:2013 accepts within 8 µm and refutes beyond 12 µm.
fn strict_result(plan: &str, size_mm: f64) -> Input {
    let Input::Feature(result) = result(plan, size_mm) else {
        unreachable!("a result")
    };
    Input::Feature(FeatureResult {
        coverage_factor: 2.0,
        ..result
    })
}

fn by_rule(rule: RawDecisionRule, passes: &[&str]) -> Config {
    let raw = RawConfig {
        decision_rule: rule,
        ..raw(true, false)
    };
    raw.check(&chain(), passes, false).expect("sound settings")
}

#[test]
fn what_the_uncertainty_leaves_open_is_never_qualified_by_the_default_rule() {
    let strict = by_rule(RawDecisionRule::default(), &["finish"]);
    let simple = by_rule(RawDecisionRule::SimpleAcceptance, &["finish"]);
    // 2.326 u = 2.3 µm: the quantile of 99 %.
    let guarded = by_rule(
        RawDecisionRule::GuardBand {
            consumers_risk: 0.01,
        },
        &["finish"],
    );
    let verdict = |config: &Config, size_mm: f64| {
        let inputs = vec![offsets(0.0), measure("p/1"), strict_result("p/1", size_mm)];
        let mut state = CompensationNode::start(config);
        let mut said = Vec::new();
        for input in inputs {
            let mut out = Outbox::default();
            CompensationNode::step(config, &mut state, Stamp(0), input, &mut out);
            said = out.messages().iter().map(line).collect();
        }
        said[0].clone()
    };
    for (size_mm, by_strict, by_simple, by_guarded) in [
        (19.8079, "qualified", "qualified", "compensable"),
        (19.8081, "compensable", "qualified", "compensable"),
        (19.8076, "qualified", "qualified", "qualified"),
        (19.7919, "indeterminate", "qualified", "indeterminate"),
        (19.7881, "indeterminate", "overcut", "overcut"),
        (19.7879, "overcut", "overcut", "overcut"),
    ] {
        assert_eq!(
            verdict(&strict, size_mm),
            format!("D1 {by_strict}"),
            "{size_mm}"
        );
        assert_eq!(
            verdict(&simple, size_mm),
            format!("D1 {by_simple}"),
            "{size_mm}"
        );
        assert_eq!(
            verdict(&guarded, size_mm),
            format!("D1 {by_guarded}"),
            "{size_mm}"
        );
    }
    check(
        &strict,
        vec![offsets(0.0), measure("p/1"), strict_result("p/1", 19.7919)],
        &["D1 indeterminate", "stop []"],
    );
}

#[test]
fn limits_before_the_last_pass_are_taken_as_they_stand() {
    let config = by_rule(RawDecisionRule::default(), &["rough", "finish"]);
    check(
        &config,
        vec![offsets(0.0), measure("p/1"), strict_result("p/1", 19.7919)],
        &["D1 qualified", "next []"],
    );
}

#[test]
fn a_verdict_and_its_decision_name_rule_and_risk() {
    let config = by_rule(RawDecisionRule::default(), &["finish"]);
    let mut state = CompensationNode::start(&config);
    let mut texts = Vec::new();
    for input in [offsets(0.0), measure("p/1"), strict_result("p/1", 19.8079)] {
        let mut out = Outbox::default();
        CompensationNode::step(&config, &mut state, Stamp(0), input, &mut out);
        for output in out.messages() {
            match output {
                Output::Verdict(one) => texts.push(one.text.clone()),
                Output::Decision(one) => texts.push(one.text.clone()),
                _ => {}
            }
        }
    }
    // 1 − Φ(2.1) = 1.79 %, 1 − Φ(2) = 2.28 %.
    assert_eq!(
        texts,
        [
            "ISO 14253-1:2013, U = 2.0 µm (k = 2.000): accepted within ± 8.0 µm; the probability that the true size is out \
             of tolerance is 1.8 %, at the limit of acceptance 2.3 %",
            "all sizes qualified (ISO 14253-1:2013, consumer's risk at most 2.3 %)",
        ]
    );
    let raw = RawConfig {
        decision_rule: RawDecisionRule::GuardBand {
            consumers_risk: 0.6,
        },
        ..raw(true, false)
    };
    let refused = raw
        .check(&chain(), &["finish"], false)
        .expect_err("no risk")
        .to_string();
    assert!(
        refused.contains("consumers_risk = 0.6 must be above 0 and at most 0.5"),
        "{refused}"
    );
}

/// The same feature as an instrument finds it, U = 6 µm.
fn reference(plan: &str, size_mm: f64) -> Input {
    let Input::Feature(result) = strict_result(plan, size_mm) else {
        unreachable!("a result")
    };
    Input::Reference(FeatureResult {
        standard_uncertainty: 3e-6,
        text: "by CMM".to_owned(),
        ..result
    })
}

#[test]
fn a_reading_that_a_reference_refutes_is_revoked_whichever_comes_first() {
    let config = by_rule(RawDecisionRule::default(), &["finish"]);
    let revoked = ["D1 contradicted", "revoked []"];
    check(
        &config,
        vec![
            offsets(0.0),
            measure("p/1"),
            strict_result("p/1", 19.8),
            reference("p/1", 19.729),
        ],
        &revoked,
    );
    check(
        &config,
        vec![
            offsets(0.0),
            measure("p/1"),
            reference("p/1", 19.729),
            strict_result("p/1", 19.8),
        ],
        &["D1 qualified", "D1 contradicted", "revoked []", "next []"],
    );
    // Of an earlier plan, when the next is measured already.
    check(
        &config,
        vec![
            offsets(0.0),
            measure("p/1"),
            strict_result("p/1", 19.8),
            measure("q/1"),
            strict_result("q/1", 19.8),
            reference("p/1", 19.729),
        ],
        &revoked,
    );
    // √(2² + 6²) = 6.3 µm: no contradiction.
    check(
        &config,
        vec![
            offsets(0.0),
            measure("p/1"),
            strict_result("p/1", 19.8),
            reference("p/1", 19.794),
        ],
        &[],
    );
}
