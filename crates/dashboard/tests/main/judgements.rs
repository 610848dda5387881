//! What the pages say of features, parts and cells where a wrong judgement would be believed.

use std::path::Path;

use bags::Bag;
use dashboard::state::{Attention, CellState, Hall, Section};
use dashboard::view::{Compared, Listed, View, compare_page, section, tile};
use graph::Stamp;
use probecell_msgs::{
    FeatureResult, InspectionFeature, InspectionPlan, MachineState, Verdict, to_cdr,
};

fn sample(name: &str, until_s: f64) -> (Hall, Stamp) {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples");
    let bag = Bag::open(samples.join(format!("{name}.mcap"))).expect("a sample");
    let begin = Stamp(bag.bounds().expect("messages").0 as i64);
    let (mut hall, mut last) = (Hall::default(), begin);
    for message in bag.messages() {
        let message = message.expect("a message");
        let at = Stamp(message.log_time as i64);
        if at.since_s(begin) <= until_s {
            hall.apply(&message.channel.topic, &message.payload, at);
            last = at;
        }
    }
    (hall, last)
}

fn of(hall: &Hall) -> &CellState {
    hall.cells().next().expect("a cell")
}

fn shown(hall: &Hall, now: Stamp, which: Section) -> String {
    section(which, of(hall), hall, now, View::default(), "/cell/x").into_string()
}

/// The row of a feature.
fn row<'a>(page: &'a str, feature: &str) -> &'a str {
    let head = format!("<th scope=\"row\">{feature}</th>");
    let rows = page.split("<tr").filter(|row| row.contains(&head));
    rows.last().unwrap_or_else(|| panic!("{feature} in {page}"))
}

/// A size that was judged by a tolerance that is not the plan's, and one that no verdict judges.
fn measured() -> (Hall, Stamp) {
    let mut hall = Hall::default();
    let at = Stamp(1_000_000_000);
    let feature = |id: &str| InspectionFeature {
        id: id.to_owned(),
        lower_tolerance: -20e-6,
        upper_tolerance: 20e-6,
        ..InspectionFeature::default()
    };
    let plan = InspectionPlan {
        plan_id: "a/finish/1".to_owned(),
        features: vec![feature("D1"), feature("flat")],
        ..InspectionPlan::default()
    };
    let result = |id: &str, decision: u8, deviation: f64| FeatureResult {
        plan_id: "a/finish/1".to_owned(),
        feature_id: id.to_owned(),
        decision,
        size_deviation: deviation,
        standard_uncertainty: 1e-6,
        coverage_factor: 2.0,
        ..FeatureResult::default()
    };
    let verdict = Verdict {
        plan_id: "a/finish/1".to_owned(),
        feature_id: "D1".to_owned(),
        verdict: Verdict::QUALIFIED,
        error: 3e-6,
        tolerance: 10e-6,
        ..Verdict::default()
    };
    hall.apply("/mill/machine_state", &to_cdr(&MachineState::default()), at);
    hall.apply("/mill/inspection_plan", &to_cdr(&plan), at);
    let d1 = result("D1", FeatureResult::CONFORMS, 3e-6);
    hall.apply("/mill/feature_results", &to_cdr(&d1), at);
    let flat = result("flat", FeatureResult::DOES_NOT_CONFORM, 40e-6);
    hall.apply("/mill/feature_results", &to_cdr(&flat), at);
    hall.apply("/mill/verdicts", &to_cdr(&verdict), at);
    (hall, at)
}

#[test]
fn a_size_is_drawn_on_the_tolerance_by_which_it_was_judged() {
    let (hall, now) = measured();
    let page = shown(&hall, now, Section::Sizes);
    assert!(
        row(&page, "D1").contains("limits −10.0 to +10.0 µm"),
        "{page}"
    );
    assert!(
        row(&page, "flat").contains("limits −20.0 to +20.0 µm"),
        "{page}"
    );
}

#[test]
fn a_feature_without_a_verdict_is_told_beside_the_worst_verdict() {
    let (hall, now) = measured();
    let page = tile(of(&hall), now, 600.0).into_string();
    assert!(
        page.contains("title=\"D1 qualified\"") && page.contains("+3.0 µm"),
        "{page}"
    );
    assert!(
        page.contains("not part of the decision: flat: does not conform"),
        "{page}"
    );
    let page = shown(&hall, now, Section::Sizes);
    assert!(row(&page, "flat").contains("does not conform"), "{page}");
    assert!(row(&page, "flat").contains("not judged"), "{page}");
}

#[test]
fn a_feature_without_a_verdict_that_a_reference_contradicts_is_none_that_conforms() {
    let (hall, now) = sample("punch_uncalibrated", f64::INFINITY);
    let page = shown(&hall, now, Section::Sizes);
    for feature in ["D1", "L3", "flat_1", "flat_6"] {
        let row = row(&page, feature);
        assert!(
            row.contains("class=\"verdict bad\">contradicted by the reference"),
            "{feature}: {row}"
        );
    }
    let listed = Listed {
        name: "punch_uncalibrated.mcap".to_owned(),
        bounds: None,
        bytes: 0,
        under_way: false,
        trouble: String::new(),
        files: Vec::new(),
    };
    let compared = Compared {
        listed: &listed,
        cell: of(&hall),
    };
    let page = compare_page(&compared, &compared).into_string();
    assert!(!page.contains("verdict good"), "{page}");
    // It was not stopped: it was qualified, and is not any more.
    assert!(
        page.contains("1 not qualified any more") && !page.contains("1 stopped"),
        "{page}"
    );
    let page = tile(of(&hall), now, 600.0).into_string();
    assert!(page.contains("punch, not qualified any more"), "{page}");
}

#[test]
fn a_cell_whose_diagnosis_asks_for_something_does_not_say_that_nothing_is_needed() {
    for name in ["punch", "ball_check", "guideway"] {
        let (hall, now) = sample(name, f64::INFINITY);
        let (attention, why) = of(&hall).attention(now);
        assert_eq!(attention, Attention::Look, "{name}: {why}");
        assert!(
            why.contains("touches would decide") || why.contains("check the levelling"),
            "{name}: {why}"
        );
    }
    let (hall, now) = sample("guideway_straight", f64::INFINITY);
    assert_eq!(of(&hall).attention(now).1, "nothing to do");
    let page = shown(&hall, now, Section::Gap);
    assert!(!page.contains("<b>Measure next"), "{page}");
}
