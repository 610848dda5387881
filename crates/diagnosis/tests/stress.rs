//! Sessions at the edge: every one gets an answer with finite numbers, however odd.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use diagnosis::blind::{Content, session};
use diagnosis::{Options, Report, Session, Verdict, diagnose};

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
    let observations = diagnosis::observation::Observations::from_session(&exact).unwrap();
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
