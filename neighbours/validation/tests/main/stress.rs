//! Sessions at the edge: every one gets an answer with finite numbers, however odd.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use diagnosis::{Options, Report, Session, Verdict, diagnose};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use validation::blind::{Content, session};

/// Diagnoses and checks that every number of the answer is finite and every probability one.
fn check(session: &Session) -> Report {
    let report = diagnose(session, &Options::default()).unwrap();
    let text = serde_json::to_string(&report).unwrap();
    assert!(!text.contains("null,\"ci95"), "{}: {text}", session.name);
    let finite = |value: f64| assert!(value.is_finite(), "{}: {text}", session.name);
    for value in [report.gap.rms, report.gap.noise_floor, report.gap.ratio] {
        finite(value);
    }
    for effect in &report.effects {
        assert!((0.0..=1.0).contains(&effect.probability), "{text}");
        finite(effect.rms_before);
        finite(effect.rms_after);
        for parameter in &effect.parameters {
            finite(parameter.value);
            finite(parameter.ci95[0]);
            finite(parameter.ci95[1]);
            assert!(parameter.ci95[0] <= parameter.ci95[1], "{text}");
        }
    }
    report
}

fn linear(name: &str) -> bool {
    ["X", "Y", "Z"].contains(&name)
}

#[test]
fn few_touches_get_a_modest_answer() {
    for (seed, count) in [(1, 6), (2, 8), (3, 10), (4, 15), (5, 22), (6, 30)] {
        let (mut few, truth) = session(7_000 + seed, Content::Known(1));
        few.events.truncate(count);
        let report = check(&few);
        assert!(
            report.effects.len() <= 2,
            "{count} touches, {:?}: {report}",
            truth.effects
        );
    }
}

/// Adds noise to the touches that are `noisier`, so that theirs is `times` as large as before.
fn uneven(
    session: &mut Session,
    noise: f64,
    times: f64,
    noisier: impl Fn(&probecell_msgs::ProbeEvent) -> bool,
) {
    let mut random = Pcg64Mcg::seed_from_u64(4);
    let more = noise * (times * times - 1.0).sqrt();
    for event in session.events.iter_mut().filter(|event| noisier(event)) {
        for (name, position) in event.axis_names.iter().zip(&mut event.axis_positions) {
            if linear(name) {
                *position += more * random.sample::<f64, _>(StandardNormal);
            }
        }
    }
}

/// A probe that is three times as noisy along z, or at its slower feed, is noise and nothing unknown; what is hidden is
/// found all the same, and a person is told.
#[test]
fn noise_that_depends_on_direction_or_feed_is_no_gap() {
    let slow = |session: &Session| {
        let feeds = session.events.iter().map(|event| event.feed);
        feeds.fold(f64::INFINITY, f64::min)
    };
    let (mut told, mut sessions) = (0, 0);
    for seed in 0..6 {
        for (content, verdict) in [
            (Content::Clean, Verdict::NoGap),
            (Content::Known(1), Verdict::Explained),
        ] {
            let (even, truth) = session(7_300 + seed, content);
            let (mut along_z, mut at_a_feed) = (even.clone(), even.clone());
            uneven(&mut along_z, truth.noise, 3.0, |event| {
                event.approach.z.abs() > 0.8
            });
            let slow = slow(&even);
            uneven(&mut at_a_feed, truth.noise, 3.0, |event| event.feed <= slow);
            for one in [along_z, at_a_feed] {
                let report = check(&one);
                assert_eq!(
                    report.verdict, verdict,
                    "seed {seed}, {:?}: {report}",
                    truth.effects
                );
                for id in &truth.effects {
                    let [only] = report.effects.as_slice() else {
                        panic!("seed {seed}, {id}: {report}");
                    };
                    assert!(only.effect == *id || only.indistinguishable_from.contains(id));
                }
                let differs = |warning: &String| warning.starts_with("the noise differs");
                told += usize::from(report.warnings.iter().any(differs));
                sessions += 1;
            }
        }
    }
    // With one feed alone all touches are alike.
    assert!(told * 4 >= sessions * 3, "{told} of {sessions}");
}

/// Two location errors of one direction, which several other pairs replace: none is sure, but the gap is twenty times the
/// noise, and an answer names a pair and says what it cannot be told from.
#[test]
fn a_gap_of_which_every_explanation_is_unsure_is_not_called_none() {
    let (session, truth) = session(27_182_818_310_047, Content::Known(2));
    let report = check(&session);
    assert!(report.gap.ratio > 10.0, "{report}");
    assert_eq!(report.verdict, Verdict::Explained, "{report}");
    for id in &truth.effects {
        let told = report
            .effects
            .iter()
            .any(|effect| effect.effect == *id || effect.indistinguishable_from.contains(id));
        assert!(told, "{id}: {report}");
    }
}

#[test]
fn five_effects_at_once_are_found_or_their_equals() {
    let (mut found, mut hidden) = (0, 0);
    for seed in 0..4 {
        let (session, truth) = session(7_100 + seed, Content::Known(5));
        let report = check(&session);
        hidden += truth.effects.len();
        found += (truth.effects.iter())
            .filter(|id| {
                report.effects.iter().any(|effect| {
                    effect.effect == **id || effect.indistinguishable_from.contains(id)
                })
            })
            .count();
    }
    assert!(found * 10 >= hidden * 8, "{found} of {hidden}");
}

#[test]
fn coarse_readings_are_named_as_such() {
    let (mut coarse, _) = session(7_200, Content::Clean);
    for event in &mut coarse.events {
        for (name, position) in event.axis_names.iter().zip(&mut event.axis_positions) {
            if linear(name) {
                *position = (*position / 1e-5).round() * 1e-5;
            }
        }
    }
    let report = check(&coarse);
    let named: Vec<&str> = report.effects.iter().map(|e| e.effect.as_str()).collect();
    assert_eq!(named, ["data.quantisation"], "{report}");
}

#[test]
fn a_session_without_any_deviation_has_no_gap() {
    let (mut perfect, _) = session(7_300, Content::Clean);
    let (exact, _) = session(7_300, Content::Clean);
    // The reading of a perfect cell: the nominal contact, which the tip of a session with tiny noise approaches.
    let observations = effects::observe(&exact).unwrap();
    for (event, row) in perfect.events.iter_mut().zip(&observations.rows) {
        event.axis_positions = event
            .axis_names
            .iter()
            .map(|name| {
                let axis = observations.chain.axis_index(name).unwrap();
                row.pose.as_ref().unwrap().positions[axis]
            })
            .collect();
    }
    let report = check(&perfect);
    assert!(report.gap.rms < 1e-8, "{report}");
    assert_eq!(report.verdict, Verdict::NoGap, "{report}");
}

#[test]
fn missing_temperatures_clocks_and_repeated_points_are_no_obstacle() {
    let (mut bare, _) = session(7_400, Content::Known(2));
    bare.machine_states.clear();
    bare.joint_states.clear();
    check(&bare);
    let (mut still, _) = session(7_401, Content::Known(1));
    let instant = still.events[0].header.stamp;
    for event in &mut still.events {
        event.header.stamp = instant;
    }
    check(&still);
    let (mut same, _) = session(7_402, Content::Known(1));
    let first = same.events[0].clone();
    for event in &mut same.events {
        event.point_index = first.point_index;
        event.axis_positions = first.axis_positions.clone();
    }
    check(&same);
}

#[test]
fn points_in_the_order_of_an_axis_blame_neither_drift_nor_time() {
    let (mut ordered, _) = session(7_500, Content::Clean);
    let mut stamps: Vec<_> = ordered.events.iter().map(|e| e.header.stamp).collect();
    stamps.sort_by_key(|stamp| (stamp.sec, stamp.nanosec));
    let place = ordered.events[0]
        .axis_names
        .iter()
        .position(|name| name == "X")
        .unwrap();
    ordered
        .events
        .sort_by(|one, other| one.axis_positions[place].total_cmp(&other.axis_positions[place]));
    for (number, (event, stamp)) in ordered.events.iter_mut().zip(stamps).enumerate() {
        event.header.stamp = stamp;
        event.sequence = number as u64;
    }
    assert_eq!(check(&ordered).verdict, Verdict::NoGap);
}

#[test]
fn hundreds_of_micrometres_are_still_one_effect() {
    let (mut moved, _) = session(7_600, Content::Clean);
    let place = moved.events[0]
        .axis_names
        .iter()
        .position(|name| name == "Z")
        .unwrap();
    for event in &mut moved.events {
        event.axis_positions[place] += 4e-4;
    }
    // A ball half a millimetre off in z, read on bores, bosses and planes alike.
    let report = check(&moved);
    let stands = |id: &str| {
        report.effects.len() == 1
            && (report.effects[0].effect == id
                || report.effects[0]
                    .indistinguishable_from
                    .iter()
                    .any(|e| e == id))
    };
    assert!(
        stands("probe.stylus_length") || stands("link.EZ0Z"),
        "{report}"
    );
}
