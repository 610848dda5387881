//! Arms in motion that others recorded: fitted on one motion, judged on another, beside an expert's least squares.

use std::collections::BTreeMap;

use diagnosis::report::Report;
use diagnosis::{Options, Verdict, diagnose_together_with_residuals};

use crate::common;

#[derive(serde::Deserialize)]
struct Pair {
    fit: String,
    held: String,
    /// Rms that the expert leaves of the withheld motion, N m or rad.
    expert: f64,
}

fn pairs() -> BTreeMap<String, Pair> {
    let Some(path) = shared_data::path("trials/motion/truth.json") else {
        return BTreeMap::new();
    };
    let text = std::fs::read_to_string(path).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn diagnosed(fit: &[&str], withheld: &[&str]) -> Option<Report> {
    let read = |names: &[&str]| {
        let one = |name: &&str| shared_data::path(&format!("trials/motion/{name}"));
        let paths: Option<Vec<_>> = names.iter().map(one).collect();
        let sessions = paths?.into_iter().map(|path| common::read(&path).unwrap());
        Some(sessions.collect::<Vec<_>>())
    };
    let (fit, withheld) = (read(fit)?, read(withheld)?);
    let found = diagnose_together_with_residuals(&fit, &withheld, &Options::default());
    Some(found.unwrap().0)
}

fn left(report: &Report) -> f64 {
    report
        .effects
        .last()
        .map_or(report.gap.rms, |last| last.rms_after)
}

/// Never called explained with more than twice what the expert leaves, and a chain that begins at the gap.
#[test]
fn efforts_are_explained_as_well_as_by_an_expert_and_nothing_is_claimed_beyond() {
    for (name, pair) in pairs() {
        let report = diagnosed(&[&pair.fit], &[&pair.held]).unwrap();
        let (left, first) = (left(&report), report.effects.first().unwrap());
        assert!(
            (first.rms_before - report.gap.rms).abs() < 1e-9 * report.gap.rms,
            "{name}"
        );
        assert!(
            left < 0.7 * report.gap.rms,
            "{name}: {left} of {}",
            report.gap.rms
        );
        assert!(
            report.verdict != Verdict::Explained || left < 2.0 * pair.expert,
            "{name}: {left}"
        );
        if name.starts_with("ur_") {
            assert_eq!(report.channel, "effort");
            assert!(left < 1.15 * pair.expert, "{name}: {left} N m");
            let loaded = report
                .effects
                .iter()
                .any(|one| one.effect == "drive.payload");
            assert_eq!(loaded, name.contains("load"), "{name}");
        } else {
            // Its gripper, which is beside the chain, is among the joint states.
            assert_eq!(report.channel, "motion");
            assert!(
                first.group.contains(&"drive.backlash".to_owned()),
                "{name}: {:?}",
                first.group
            );
        }
    }
}

/// A motion without and one with a load tell its mass from errors of the links: about 2.6 kg.
#[test]
fn a_motion_without_and_one_with_a_load_tell_its_mass() {
    let Some(report) = diagnosed(&["ur_free_fit.mcap", "ur_load_a_fit.mcap"], &[]) else {
        return;
    };
    let load = report
        .effects
        .iter()
        .find(|one| one.effect == "drive.payload")
        .unwrap();
    let mass = &load.parameters[0];
    assert_eq!((mass.name.as_str(), mass.unit.as_str()), ("mass", "kg"));
    assert!((mass.value - 2.6).abs() < 0.2, "{mass:?}");
}

/// With two motions that carry it the load acts in these, and is no load of less than no mass in the third.
#[test]
fn a_load_acts_in_the_motions_that_carry_it() {
    let fitted = [
        "ur_free_fit.mcap",
        "ur_load_a_fit.mcap",
        "ur_load_a_held.mcap",
    ];
    let Some(report) = diagnosed(&fitted, &[]) else {
        return;
    };
    let loads = report
        .effects
        .iter()
        .filter(|one| one.effect == "drive.payload");
    let masses: Vec<f64> = loads.map(|load| load.parameters[0].value).collect();
    assert_eq!(masses.len(), 1, "{masses:?}");
    assert!((masses[0] - 2.6).abs() < 0.3, "{masses:?}");
}

/// From one motion a load is not told from heavier links, and its interval says so.
#[test]
fn the_interval_of_a_load_from_one_motion_holds_its_mass() {
    for (fit, held) in [("fit", "held"), ("held", "fit")] {
        let name = |half: &str| format!("ur_load_a_{half}.mcap");
        let Some(report) = diagnosed(&[&name(fit)], &[&name(held)]) else {
            return;
        };
        let mut effects = report.effects.iter();
        let load = effects.find(|one| one.effect == "drive.payload").unwrap();
        let [low, high] = load.parameters[0].ci95;
        assert!(low < 2.6 && 2.6 < high, "{low} to {high} kg");
    }
}
