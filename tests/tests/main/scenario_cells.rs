//! The cells of `docs/source_systems.md, B to E`, whole: what is cut, measured, corrected and found at the end.
//!
//! The figures are those of that document; the machines' errors are in the cell files and known to no node but the
//! simulated machine.

use std::collections::BTreeMap;

use cell_tests::{cell, factories, make_part, messages, recording};
use graph::{
    Published,
    replay::{Verdict, replay},
    topics,
};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, FeatureResult, InspectionPlan, PartReport,
    TouchDeviation,
};

fn made(file: &str) -> (PartReport, Vec<Published>) {
    make_part(&cell(file, str::to_owned), "part")
}

fn deviations(log: &[Published], plan: &str) -> Vec<TouchDeviation> {
    let mut all = messages::<TouchDeviation>(log, topics::TOUCH_DEVIATIONS.name);
    all.retain(|touch| touch.plan_id == plan);
    all.sort_by_key(|touch| touch.point_index);
    all
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn a_bar_bends_under_the_rough_cut_and_is_finished_within_tolerance() {
    let (report, log) = make_part(&cell("turn_mill_bending.toml", str::to_owned), "bar");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let plan = messages::<InspectionPlan>(&log, topics::INSPECTION_PLAN.name).remove(0);
    // Error of diameter or width by height, µm: twice the mean of the radial deviations there.
    let along = |plan_id: &str, turned: bool| -> Vec<(f64, f64)> {
        let mut by_height: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        for touch in deviations(&log, plan_id) {
            let point = &plan.points[touch.point_index as usize];
            if (point.operation == 0) == turned {
                let height = (point.position.z * 1e6).round() as i64;
                by_height.entry(height).or_default().push(touch.deviation);
            }
        }
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let errors = by_height.iter();
        errors
            .map(|(height, all)| (*height as f64 * 1e-6, 2e6 * mean(all)))
            .collect()
    };
    // A.6: 35 µm at the free end, cubic from 8 µm at the chuck; milled, the same at both ends.
    let turned = along("bar/rough/1", true);
    assert_eq!(turned.len(), 8);
    for (height, error) in turned {
        let law = 8.0 + 27.0 * (height / 0.09_f64).powi(3);
        assert!(
            (error - law).abs() < 2.0,
            "{error:.1} µm at {height} m, {law:.1} µm by A.6"
        );
    }
    let milled = along("bar/rough/1", false);
    assert!((milled[1].1 - milled[0].1).abs() < 2.0, "{milled:?}");
    // F: both finish within ±0.010, though the rough pass was corrected by more than that.
    for (height, error) in [along("bar/finish/1", true), along("bar/finish/1", false)].concat() {
        assert!(error.abs() < 10.0, "{error:.1} µm at {height} m");
    }
    let corrections = messages::<Correction>(&log, topics::CORRECTIONS.name);
    let [only] = corrections.as_slice() else {
        panic!("one correction, of the rough pass: {corrections:?}");
    };
    assert_eq!(
        (only.tool_number, only.plan_id.as_str()),
        (2, "bar/rough/1")
    );
    assert!(only.new_value < -10e-6, "{:e}", only.new_value);
}

#[test]
fn one_register_for_both_passes_cuts_the_bending_bar_below_size() {
    let shared = |text: &str| {
        // The limits themselves, as the source takes them.
        let simple = "max_corrections = 5\ndecision_rule = \"simple_acceptance\"";
        let text = text.replace("tool_number = 12", "tool_number = 2");
        let text = text.replace("max_corrections = 5", simple);
        text.replace("[[simulator.tools]]                   # of the finish turning\nnumber = 12\nerror_um = 0.0\n", "")
    };
    let (report, _) = make_part(&cell("turn_mill_bending.toml", shared), "bar");
    assert_eq!(report.verdict, PartReport::SCRAP, "{}", report.text);
}

#[test]
fn a_free_form_profile_is_corrected_through_its_tool_path() {
    let (report, log) = made("free_form.toml");
    assert_eq!((report.verdict, report.passes), (PartReport::QUALIFIED, 2));
    let results = messages::<FeatureResult>(&log, topics::FEATURE_RESULTS.name);
    let [before, after] = [&results[0].deviations, &results[1].deviations].map(|deviations| {
        let largest = deviations
            .iter()
            .fold(0.0, |most: f64, t| most.max(t.abs()));
        let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
        (2.0 * largest, mean)
    });
    // B.2, first column: form 0.2712, mean -0.0607; noise of 3 µm on 200 points widens the form.
    assert!(
        (before.0 - 0.2712e-3).abs() < 20e-6,
        "form before {:e}",
        before.0
    );
    assert!(
        (before.1 + 60.7e-6).abs() < 1e-6,
        "mean before {:e}",
        before.1
    );
    // F, B-profile: form at most 0.042, reduction at least 84 %, mean within 3 µm.
    assert!(after.0 <= 42e-6, "form after {:e}", after.0);
    assert!(1.0 - after.0 / before.0 >= 0.84);
    assert!(after.1.abs() <= 3e-6, "mean after {:e}", after.1);
    let corrections = messages::<Correction>(&log, topics::CORRECTIONS.name);
    assert_eq!(corrections.len(), 1);
    assert_eq!(corrections[0].kind, Correction::TOOL_PATH);
    assert_eq!(corrections[0].path.len(), 200);
    let answers =
        messages::<CorrectionAcknowledgement>(&log, topics::CORRECTION_ACKNOWLEDGEMENTS.name);
    assert_eq!(answers[0].outcome, CorrectionAcknowledgement::APPLIED);
}

#[test]
fn a_tool_path_beyond_its_bounds_never_reaches_the_machine() {
    let tight = |text: &str| {
        text.replace(
            "[driver]\n",
            "[machine_state]\npath_limit_mm = 0.1\n\n[driver]\n",
        )
    };
    let (report, log) = make_part(&cell("free_form.toml", tight), "part");
    assert_eq!((report.verdict, report.passes), (PartReport::STOPPED, 1));
    let answers =
        messages::<CorrectionAcknowledgement>(&log, topics::CORRECTION_ACKNOWLEDGEMENTS.name);
    assert_eq!(
        answers[0].outcome,
        CorrectionAcknowledgement::REFUSED_OUT_OF_BOUNDS
    );
    assert!(
        answers[0].text.contains("beyond 100.0 µm"),
        "{}",
        answers[0].text
    );
}

#[test]
fn a_guideway_is_read_as_form_of_the_shaft() {
    let (report, log) = made("guideway.toml");
    assert_eq!(report.verdict, PartReport::QUALIFIED);
    let touches = deviations(&log, "part/measure/1");
    assert_eq!(touches.len(), 48);
    // The bow of 60 µm over the travel of 0.5 m: sagitta 60 (0.22/0.5)² = 11.6 µm over the shaft, convex towards the
    // probe, so that the middle of the shaft reads too small there. Four generatrices of 1 µm noise each.
    let at = |height: usize| {
        let own = touches[4 * height..4 * height + 4].iter();
        own.map(|touch| touch.deviation).sum::<f64>() / 4.0
    };
    let middle = f64::midpoint(at(5), at(6));
    let sagitta = f64::midpoint(at(0), at(11)) - middle;
    assert!(
        (sagitta.abs() - 11.6e-6).abs() < 2.0e-6,
        "sagitta {sagitta:e}"
    );
}

#[test]
fn a_five_axis_machine_shows_its_link_errors_where_cuts_meet() {
    let (report, log) = made("five_axis.toml");
    assert_eq!((report.verdict, report.passes), (PartReport::QUALIFIED, 2));
    let results = messages::<FeatureResult>(&log, topics::FEATURE_RESULTS.name);
    let mismatch = |plan: &str| -> Vec<f64> {
        let steps = results
            .iter()
            .filter(|result| result.plan_id == plan && !result.feature_id.contains('_'));
        steps.map(|result| result.size_deviation).collect()
    };
    let [uncompensated, compensated] = ["part/uncompensated/1", "part/compensated/1"].map(mismatch);
    assert_eq!((uncompensated.len(), compensated.len()), (14, 14));
    // D.4, case E1: rms U 21.7, largest 42.4; noise of 1.5 µm a point and four points a half here.
    assert!(
        (rms(&uncompensated) - 21.7e-6).abs() < 2.0e-6,
        "{:e}",
        rms(&uncompensated)
    );
    // F, D-link: rms C at most 0.30 U and at most 6 µm.
    assert!(rms(&compensated) <= 6e-6, "{:e}", rms(&compensated));
    assert!(rms(&compensated) <= 0.30 * rms(&uncompensated));
}

#[test]
fn a_flank_shows_the_run_out_of_its_tool() {
    let (report, log) = made("flank_milling.toml");
    assert_eq!(report.verdict, PartReport::QUALIFIED);
    let touches = deviations(&log, "part/flank/1");
    assert_eq!(touches.len(), 90);
    // E.2: ΔR at Z = 3, 6, … 45 mm, in µm; each height was touched at three places of both faces.
    let published = [
        14.1, 15.5, 15.9, 15.4, 14.0, 11.8, 10.0, 12.3, 13.8, 14.6, 14.5, 13.6, 12.1, 9.9, 10.5,
    ];
    for (height, expected) in published.into_iter().enumerate() {
        let own: Vec<f64> = (0..6)
            .map(|place| touches[15 * place + height].deviation)
            .collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        // Four standard deviations of a mean of six touches of 1.5 µm.
        assert!(
            (-mean * 1e6 - expected).abs() < 2.5,
            "height {height}: {:.1} µm instead of {expected}",
            -mean * 1e6
        );
    }
}

#[test]
fn every_session_replays_to_the_same_bytes() {
    for file in [
        "free_form.toml",
        "guideway.toml",
        "five_axis.toml",
        "flank_milling.toml",
    ] {
        let cell = cell(file, str::to_owned);
        let (_, log) = make_part(&cell, "part");
        let nodes = cell.node_names();
        let report = replay(&recording(&log), &factories(&cell, &nodes))
            .unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_eq!(report.verdict, Verdict::Equal, "{file}");
    }
}
