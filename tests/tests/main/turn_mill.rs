//! The turn-mill cell on virtual time against the source's tables (`docs/source_systems.md, A.2`).

use cell_tests::{cell, make_part, messages, session::Session};
use graph::topics;
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, FeatureResult, InspectionPlan, OperationRequest,
    OperatorReply, PartReport, PassDecision, ReferenceMeasurement, Verdict,
};

const SIZES: [&str; 5] = ["D1", "D2", "L1", "L2", "L3"];

/// One finished part: (reading less drawing, true less drawing by the reference) of each size, µm.
fn finished(file: &str, seed: u64) -> Vec<(f64, f64)> {
    let cell = cell(file, |text| {
        text.replace("seed = 1\n", &format!("seed = {seed}\n"))
    });
    let (_, log) = make_part(&cell, "punch");
    // By its readings; what the reference makes of that is another test.
    let mut decisions: Vec<PassDecision> = messages(&log, topics::PASS_DECISIONS.name);
    decisions.retain(|one| one.decision != PassDecision::REVOKED);
    let last = decisions.pop().expect("a decision");
    assert_eq!(
        last.decision,
        PassDecision::NEXT,
        "seed {seed}: {}",
        last.text
    );
    let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS.name);
    let reference = messages::<ReferenceMeasurement>(&log, topics::REFERENCE.name)
        .pop()
        .expect("a reference");
    let plan = messages::<InspectionPlan>(&log, topics::INSPECTION_PLAN.name)
        .pop()
        .expect("a plan");
    assert_eq!(reference.plan_id, plan.plan_id);
    let planes = |size: &str| match size {
        "L1" => vec!["flat_1", "flat_4"],
        "L2" => vec!["flat_2", "flat_5"],
        "L3" => vec!["flat_3", "flat_6"],
        round => vec![if round == "D1" { "D1" } else { "D2" }],
    };
    SIZES
        .iter()
        .map(|size| {
            let read = results
                .iter()
                .rev()
                .find(|result| result.feature_id == *size)
                .expect("a result");
            let carried = planes(size);
            let deviations: Vec<f64> = plan
                .points
                .iter()
                .zip(&reference.deviation)
                .filter(|(point, _)| {
                    carried.contains(&plan.features[point.feature as usize].id.as_str())
                })
                .map(|(_, deviation)| *deviation)
                .collect();
            // Both sides of a diameter or width.
            let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
            (read.size_deviation * 1e6, 2.0 * mean * 1e6)
        })
        .collect()
}

/// Means of three punches, as the tables have them.
fn means(file: &str) -> Vec<(f64, f64)> {
    let parts: Vec<Vec<(f64, f64)>> = (1..=3).map(|seed| finished(file, seed)).collect();
    (0..SIZES.len())
        .map(|size| {
            let mean = |pick: fn(&(f64, f64)) -> f64| {
                parts.iter().map(|part| pick(&part[size])).sum::<f64>() / 3.0
            };
            (mean(|pair| pair.0), mean(|pair| pair.1))
        })
        .collect()
}

#[test]
fn an_uncalibrated_probe_reads_the_gaps_of_table_3() {
    let gaps = [75.0, 65.0, 73.0, 67.0, 75.0];
    for ((size, (read, truth)), gap) in SIZES
        .iter()
        .zip(means("turn_mill_uncalibrated.toml"))
        .zip(gaps)
    {
        assert!(
            (read - truth - gap).abs() <= 2.0,
            "{size}: gap {:.2} µm, the table has {gap}",
            read - truth
        );
        assert!(
            read.abs() <= 10.0,
            "{size}: read {read:.1} µm, but the loop drives the reading to nominal"
        );
        assert!(
            truth < -50.0,
            "{size}: true {truth:.1} µm, the table's punches are undersized by 59 to 73"
        );
    }
}

#[test]
fn a_calibrated_probe_reads_the_gaps_of_table_4() {
    let gaps = [6.0, 6.0, 6.0, 6.0, 7.0];
    for ((size, (read, truth)), gap) in SIZES.iter().zip(means("turn_mill.toml")).zip(gaps) {
        assert!(
            (read - truth - gap).abs() <= 2.0,
            "{size}: gap {:.2} µm, the table has {gap}",
            read - truth
        );
        assert!(
            read.abs() <= 10.0 && truth.abs() <= 10.0,
            "{size}: read {read:.1}, true {truth:.1} µm"
        );
    }
}

#[test]
fn each_correction_is_bounded_sourced_approved_and_acknowledged() {
    let (_, log) = make_part(&cell("turn_mill.toml", str::to_owned), "punch");
    let corrections: Vec<Correction> = messages(&log, topics::CORRECTIONS.name);
    let answers: Vec<CorrectionAcknowledgement> =
        messages(&log, topics::CORRECTION_ACKNOWLEDGEMENTS.name);
    assert!(
        !corrections.is_empty(),
        "tools that leave 20 µm must be corrected"
    );
    assert_eq!(corrections.len(), answers.len());
    for (correction, answer) in corrections.iter().zip(&answers) {
        assert_eq!(correction.correction_id, answer.correction_id);
        assert_eq!(
            answer.outcome,
            CorrectionAcknowledgement::APPLIED,
            "{}",
            answer.text
        );
        assert!((correction.lower_bound..=correction.upper_bound).contains(&correction.new_value));
        assert!(!correction.sequences.is_empty() && !correction.approved_by.is_empty());
        assert!((answer.value_after - correction.new_value).abs() < 1e-9);
    }
    let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS.name);
    assert!(
        verdicts
            .iter()
            .any(|verdict| verdict.verdict == Verdict::COMPENSABLE)
    );
    assert!(
        verdicts
            .iter()
            .rev()
            .take(5)
            .all(|verdict| verdict.verdict == Verdict::QUALIFIED)
    );
}

/// The reference finds every size 71 µm off: the part is not qualified, and the series ends with it. A calibrated cell,
/// whose reference differs by 6 µm, goes on.
#[test]
fn a_reference_that_contradicts_the_readings_stops_the_series() {
    let cuts = |session: &Session| {
        let requests: Vec<OperationRequest> = session.all(topics::OPERATION_REQUESTS);
        let cuts = requests
            .iter()
            .filter(|one| one.kind == OperationRequest::CUT);
        cuts.count()
    };
    let mut session = Session::new(&cell("turn_mill_uncalibrated.toml", str::to_owned));
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    assert!(report.text.contains("by CMM"), "{}", report.text);
    let verdicts: Vec<Verdict> = session.all(topics::VERDICTS);
    for size in SIZES {
        let last = verdicts
            .iter()
            .rfind(|one| one.feature_id == size)
            .expect("a verdict");
        assert_eq!(last.verdict, Verdict::CONTRADICTED, "{size}: {}", last.text);
    }
    let before = cuts(&session);
    session.ask_for("second");
    session.run_s(60.0);
    let reply: OperatorReply = session.last(topics::RUN_REPLIES);
    assert!(
        !reply.accepted && reply.text.starts_with("no part is made"),
        "{}",
        reply.text
    );
    assert_eq!(cuts(&session), before);

    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    let report = session.make("punch");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    assert!(report.text.contains("ISO 14253-1:2013"), "{}", report.text);
    session.ask_for("second");
    session.run_s(1.0);
    let reply: OperatorReply = session.last(topics::RUN_REPLIES);
    assert!(reply.accepted, "{}", reply.text);
}

/// The instrument's readings come when the next part is in the machine.
#[test]
fn a_reference_that_comes_late_stops_the_part_that_is_being_made() {
    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    assert_eq!(session.make("punch").verdict, PartReport::QUALIFIED);
    let mut late: ReferenceMeasurement = session.last(topics::REFERENCE);
    for deviation in &mut late.deviation {
        *deviation -= 35e-6;
    }
    session.ask_for("second");
    session.run_s(3.0);
    session.send(topics::REFERENCE, &late);
    session.run_s(1.0);
    let reports: Vec<PartReport> = session.all(topics::PART_REPORTS);
    let ends: Vec<(&str, u8)> = reports
        .iter()
        .map(|one| (one.part_id.as_str(), one.verdict))
        .collect();
    let expected = [
        ("punch", PartReport::QUALIFIED),
        ("punch", PartReport::STOPPED),
        ("second", PartReport::STOPPED),
    ];
    assert_eq!(ends, expected);
}
