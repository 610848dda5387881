//! One arm in three series against a laser tracker: the causes must hold over all of them, and on one withheld.

use diagnosis::report::Effect;
use diagnosis::{Options, Session, diagnose_together_with_residuals};

use crate::common;

fn series(name: &str) -> Option<Session> {
    let path = shared_data::path(&format!("data/bags/{name}"))?;
    Some(common::read(&path).expect("the bag holds a session"))
}

#[test]
fn an_arm_over_three_series_is_explained_by_links_transmission_and_sag_but_not_by_joint_zeros() {
    let names = ["ur10_c.mcap", "ur10_b.mcap", "ur10_d.mcap"];
    let Some(series) = names.into_iter().map(series).collect::<Option<Vec<_>>>() else {
        return;
    };
    let report = diagnose_together_with_residuals(&series, &[], &Options::default())
        .expect("it can be diagnosed")
        .0;
    // A family is named by its largest member, and its parameters have the names of all: claimed are those that are not 0.
    let members = |effect: &Effect| -> Vec<String> {
        let all = effect.parameters.iter();
        let all = all.filter(|one| effect.is_family() && one.ci95[0] * one.ci95[1] > 0.0);
        let all = all.map(|one| one.name.clone());
        std::iter::once(effect.effect.clone()).chain(all).collect()
    };
    let named: Vec<String> = report.effects.iter().flat_map(members).collect();
    for effect in [
        "drive.compliance",
        "axis.A1.indexing",
        "axis.A2.indexing",
        "axis.A3.indexing",
    ] {
        assert!(
            named.iter().any(|one| one == effect),
            "{effect} is missing from {named:?}"
        );
    }
    let lengths = |e: &&String| e.starts_with("link.EX") || e.starts_with("link.EA");
    assert!(named.iter().filter(lengths).count() >= 4, "{named:?}");
    assert!(!named.iter().any(|e| e.starts_with("link.EC")), "{named:?}");
    // A least-squares expert who knew the causes reached 80, 74 and 79 µm with all of them.
    let last = report.effects.last().expect("effects are named");
    assert!(last.rms_after < 80e-6, "{}", last.rms_after);
    assert!(
        last.sessions.iter().all(|s| s.rms_after < 88e-6),
        "{:?}",
        last.sessions
    );
}

#[test]
fn a_withheld_series_shrinks_though_it_was_never_fitted() {
    let names = ["ur10_c.mcap", "ur10_b.mcap", "ur10_d.mcap"];
    let Some(mut series) = names.into_iter().map(series).collect::<Option<Vec<_>>>() else {
        return;
    };
    let withheld = series.split_off(2);
    let report = diagnose_together_with_residuals(&series, &withheld, &Options::default())
        .expect("it can be diagnosed")
        .0;
    let last = report.effects.last().expect("effects are named");
    assert_eq!(report.withheld, ["ur10_d.mcap"]);
    assert!(
        last.rms_after < 0.4 * report.effects[0].rms_before,
        "{}",
        last.rms_after
    );
}

/// Fitted to every second pose of all series and judged on the others. A least-squares expert who knew the causes leaves
/// 80, 74 and 79 µm.
#[test]
fn every_second_pose_predicts_the_others() {
    let names = ["ur10_c.mcap", "ur10_b.mcap", "ur10_d.mcap"];
    let Some(series) = names.into_iter().map(series).collect::<Option<Vec<_>>>() else {
        return;
    };
    let (fit, withheld): (Vec<Session>, Vec<Session>) = series.iter().map(common::halves).unzip();
    let report = diagnose_together_with_residuals(&fit, &withheld, &Options::default())
        .expect("it can be diagnosed")
        .0;
    let last = report.effects.last().expect("effects are named");
    for session in &last.sessions {
        assert!(session.rms_after < 88e-6, "{report}");
    }
}

/// Fitted to every second pose of one series and judged on the others. Least squares of links, gravity and transmissions, its sizes
/// and smoothness chosen with the answer in view, leaves 96 and 109 µm of series B and D.
#[test]
fn every_second_pose_of_one_series_predicts_the_others() {
    for name in ["ur10_c.mcap", "ur10_b.mcap", "ur10_d.mcap"] {
        let Some(series) = series(name) else {
            return;
        };
        let (fit, withheld) = common::halves(&series);
        let report = diagnose_together_with_residuals(&[fit], &[withheld], &Options::default())
            .expect("it can be diagnosed")
            .0;
        let last = report.effects.last().expect("effects are named");
        assert!(last.rms_after < 125e-6, "{report}");
    }
}

/// One series alone is explained as several are: where the tracker stands is registered and no cause, and nothing that happens
/// in time is blamed for what links, transmissions and sag do.
#[test]
fn one_series_of_an_arm_is_explained_by_the_arm() {
    for name in ["ur10_c.mcap", "ur10_b.mcap", "ur10_d.mcap"] {
        let Some(series) = series(name) else {
            return;
        };
        let report =
            diagnosis::diagnose(&series, &Options::default()).expect("it can be diagnosed");
        for effect in &report.effects {
            let acts_in_the_arm = ["link.", "axis.", "drive."]
                .iter()
                .any(|family| effect.effect.starts_with(family));
            assert!(acts_in_the_arm, "{}: {report}", effect.effect);
        }
        let (first, last) = (
            &report.effects[0],
            &report.effects[report.effects.len() - 1],
        );
        assert!(last.rms_after < 0.4 * first.rms_before, "{report}");
    }
}
