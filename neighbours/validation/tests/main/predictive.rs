//! Against the blind plant, which shares no code with the signatures, and against sessions of the model itself.

use bags::Measurement;
use diagnosis::{Options, Report, Residuals, diagnose_with_residuals};
use effects::{Observations, Session};

use report::predictive::{Check, Predictive, USUAL_DRAWS};
use validation::blind::{Content, Outsider, session};

fn diagnosed(seed: u64, content: Content) -> (Session, Report, Residuals) {
    let (session, _) = session(seed, content);
    let (report, residuals) =
        diagnose_with_residuals(&session, &Options::default()).expect("a report");
    (session, report, residuals)
}

fn check(seed: u64, content: Content) -> Check {
    let (session, report, residuals) = diagnosed(seed, content);
    let model = Predictive::new(&session, &report, &residuals).expect("a model");
    model.check(USUAL_DRAWS, seed).expect("a check")
}

/// One effect of the vocabulary: the declared model contradicts the session, the explained one measures such sessions.
#[test]
fn an_explained_session_is_one_that_the_model_would_measure() {
    for seed in 1..=6 {
        let check = check(seed, Content::Known(1));
        assert!(
            check.before.contradictions > 0,
            "{seed}: {}",
            check.conclusion()
        );
        assert_eq!(
            check.after.contradictions,
            0,
            "{seed}: {}",
            check.conclusion()
        );
        assert!(check.not_simulated.is_empty());
    }
}

/// A cause outside the vocabulary: no model of the vocabulary measures such sessions.
#[test]
fn an_unexplained_session_contradicts_every_model() {
    for seed in 1..=3 {
        let check = check(seed, Content::Beside(0, Outsider::LooseStylus));
        assert!(
            check.after.contradictions > 0,
            "{seed}: {}",
            check.conclusion()
        );
    }
}

/// The touches of a simulated session are read as the deviations that were drawn, and the model that made them measures such
/// sessions: no more of 20 contradict it than the bound allows.
#[test]
fn a_session_of_the_model_itself_does_not_contradict_it() {
    let (session, report, residuals) = diagnosed(2, Content::Known(1));
    let model = Predictive::new(&session, &report, &residuals).expect("a model");
    let mut contradicted = 0;
    for seed in 0..20 {
        let again = model.again(seed);
        let read = Observations::from_session(&again.session).expect("rows");
        assert_eq!(read.touches(), again.deviations.len());
        for (read, drawn) in read.deviations.iter().zip(&again.deviations) {
            assert!((read - drawn).abs() < 1e-9, "{read} is not {drawn}");
        }
        let simulated = Predictive::new(&again.session, &report, &residuals).expect("a model");
        let check = simulated.check(USUAL_DRAWS, seed).expect("a check");
        contradicted += u32::from(check.after.contradictions > 0);
    }
    // Binomial(20, 0.05): more than 4 happen once in 400 times.
    assert!(contradicted <= 4, "{contradicted} of 20");
}

/// The same seed gives the same answer.
#[test]
fn it_is_deterministic() {
    let text = || serde_json::to_string(&check(4, Content::Known(2))).expect("JSON");
    assert_eq!(text(), text());
}

/// A part that a reference has measured: its touches are compared as they were diagnosed, reading minus reference.
#[test]
fn a_session_with_a_reference_is_compared_with_it() {
    let bag = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bags/samples/punch.mcap");
    let measured = session_io::measured(bag.as_ref(), &bags::Measurement::Last, None);
    let session = measured.expect("a session").session;
    let (report, residuals) =
        diagnose_with_residuals(&session, &Options::default()).expect("a report");
    let model = Predictive::new(&session, &report, &residuals).expect("a model");
    let check = model.check(USUAL_DRAWS, 1).expect("a check");
    assert!(check.before.contradictions > 10, "{}", check.conclusion());
    assert_eq!(check.after.contradictions, 0, "{}", check.conclusion());
}

/// An arm is registered before its gap: the touches of the session are compared in the pose that was fitted to them, so that the
/// declared model misses them by the gap of the report, and its effects close most of it.
#[test]
fn the_pose_of_an_arm_is_no_part_of_what_contradicts() {
    let Some(bag) = shared_data::path("trials/real/fanuc_n1.mcap") else {
        return;
    };
    let session = session_io::measured(&bag, &Measurement::Last, None)
        .expect("a session")
        .session;
    let (report, residuals) =
        diagnose_with_residuals(&session, &Options::default()).expect("a report");
    let model = Predictive::new(&session, &report, &residuals).expect("a model");
    let check = model.check(USUAL_DRAWS, 1).expect("a check");
    let real = |compared: &report::predictive::Compared| {
        let all = compared.statistics.iter();
        all.filter(|one| one.dimension == "all" && one.statistic == "rms")
            .map(|one| one.real)
            .sum::<f64>()
    };
    let gap = report.gap.rms;
    assert!((real(&check.before) / gap - 1.0).abs() < 0.02, "{gap}");
    assert!(real(&check.after) < 0.5 * gap, "{}", check.conclusion());
}
