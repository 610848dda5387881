//! The node `gap` against the command line: one session, live and from its recording, one answer.

use bags::Measurement;
use cell::Cell;
use cell_tests::{
    bag, cell, factories, make_part, messages, recording, series::series, session::alone,
};
use graph::{
    Published,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{Fault, GapFinding, GapReport, InspectionPlan};

/// A whole part with the node at work.
fn session(file: &str, settings: &str) -> (Cell, Vec<Published>) {
    let cell = cell(file, |text| {
        text.replace("at_end_of_plan = false", settings)
    });
    let (_, log) = make_part(&cell, "punch");
    (cell, log)
}

#[test]
fn the_live_answer_is_that_of_the_recording() {
    for file in ["turn_mill_uncalibrated.toml", "turn_mill.toml"] {
        let (cell, log) = session(file, "at_end_of_plan = true");
        let faults: Vec<Fault> = messages(&log, topics::GAP_FAULTS.name);
        assert!(faults.is_empty(), "{faults:?}");
        let live: Vec<GapReport> = messages(&log, topics::GAP_REPORT.name);
        let plans: Vec<InspectionPlan> = messages(&log, topics::INSPECTION_PLAN.name);
        assert!(!plans.is_empty());
        for plan in plans {
            let last = live
                .iter()
                .rev()
                .find(|report| report.plan_id == plan.plan_id);
            let last = last.unwrap_or_else(|| panic!("no report on {}", plan.plan_id));
            let measurement = Measurement::Named(plan.plan_id.clone());
            let mut recorded = bag::diagnosis(&cell, &log, &measurement);
            recorded.bag = "live".to_owned();
            let recorded = serde_json::to_string(&recorded).expect("JSON");
            assert_eq!(last.json, recorded, "{file}: {}", plan.plan_id);
            assert_eq!(last.samples as usize, plan.points.len());
        }
    }
}

#[test]
fn a_replay_makes_the_same_reports_byte_for_byte() {
    let (cell, log) = session(
        "turn_mill_uncalibrated.toml",
        "at_end_of_plan = true\nevery_touches = 16",
    );
    let reports: Vec<GapReport> = messages(&log, topics::GAP_REPORT.name);
    let plans: Vec<InspectionPlan> = messages(&log, topics::INSPECTION_PLAN.name);
    assert!(
        reports.len() > plans.len(),
        "one in the middle of each plan"
    );
    let made = replay(&recording(&log), &factories(&cell, &["gap"]));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Verdict::Equal, "{made:?}");
    let compared = made
        .topics
        .iter()
        .find(|topic| topic.topic == topics::GAP_REPORT.name);
    assert_eq!(
        compared.map(|topic| topic.equal as usize),
        Some(reports.len())
    );
}

/// Parts that change from the ninth on raise one finding, which names it; parts that do not raise none.
#[test]
fn a_change_while_parts_are_made_is_a_finding() {
    let (cell, log) = session("turn_mill.toml", "at_end_of_plan = true");
    let found = |step: f64| -> Vec<GapFinding> {
        let made = alone(&cell, "gap", &series(&log, 12, 8, step), &[], 0.0);
        let faults: Vec<Fault> = messages(&made, topics::GAP_FAULTS.name);
        assert!(faults.is_empty(), "{faults:?}");
        messages(&made, topics::GAP_FINDINGS.name)
    };
    assert_eq!(found(0.0), []);
    let findings = found(30e-6);
    let [finding] = findings.as_slice() else {
        panic!("{findings:?}");
    };
    assert_eq!(
        (finding.onset_part, finding.onset_plan_id.as_str()),
        (9, "part 8/finish/1")
    );
    assert!(finding.part >= 9 && finding.part <= 12, "{finding:?}");
    assert_eq!(finding.false_alarms, 1.0);
    assert!(
        finding.effects.is_empty() || !finding.remedy.is_empty(),
        "{finding:?}"
    );
    assert!(finding.rms_before > 10e-6, "{finding:?}");
}
