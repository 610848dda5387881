//! A machine finds its own volumetric table: balls touched, links estimated, table proposed, approved, checked, written,
//! read back, and the balls touched again.
//!
//! The hidden errors are in the cell files and in what is drawn here; no node but the simulated machine knows them. What
//! is left is judged by composed errors at poses that were not touched.

use cell::Cell;
use cell_tests::{
    cell, factories, make_part, messages, recording,
    session::{Session, Spoilt, approved, refuses_all_but_the_sound, with_fault},
};
use graph::{
    replay::{Verdict as Replayed, replay},
    topics,
};
use machine::{Chain, ChainErrors, LinkError, Volumetric, models::WCBXFZYST};
use nalgebra::{Isometry3, Point3};
use probecell_msgs::{
    ControllerCommand, Correction, CorrectionAcknowledgement as Ack, FeatureResult, PartReport,
    ToolOffsets, Verdict,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const LINKS: [&str; 8] = [
    "EA0B", "EC0B", "EX0C", "EA0C", "EB0C", "EB0Z", "EA0Y", "EC0Y",
];
/// The truth of the cell as it is delivered, µrad and µm.
const DELIVERED: [f64; 8] = [-67.3, 41.9, -31.4, 22.8, 88.6, -15.2, 54.1, -36.7];

fn calibrate(edit: impl Fn(&str) -> String) -> Cell {
    cell("five_axis_calibrate.toml", edit)
}

fn turns(name: &str) -> bool {
    !name.starts_with("EX")
}

/// Lines of `[simulator.machine]` with these sizes (µrad, µm) of the links.
fn links(sizes: &[f64]) -> String {
    let named = LINKS.iter().zip(sizes);
    let lines = named.map(|(name, size)| {
        let key = if turns(name) {
            "value_urad"
        } else {
            "value_um"
        };
        format!("    {{ name = \"{name}\", {key} = {size:?} }},\n")
    });
    lines.collect()
}

/// The cell with another machine, another table in its controller, and another seed.
fn drawn(text: &str, seed: u64) -> (String, Vec<f64>) {
    let mut random = Pcg64::seed_from_u64(seed);
    let mut draw = |turn: f64, shift: f64| -> Vec<f64> {
        let sizes = LINKS.iter().map(|name| {
            let size = if turns(name) { turn } else { shift };
            (random.random_range(-size..size) * 10.0_f64).round() / 10.0
        });
        sizes.collect()
    };
    let (truth, table) = (draw(90.0, 45.0), draw(30.0, 12.0));
    let end = text.find("errors = [").expect("the errors");
    let text = format!(
        "{}errors = [\n{}]\ntable = [\n{}]\n",
        &text[..end],
        links(&truth),
        links(&table)
    );
    // What the harness adds behind stays out of `[simulator.machine]`.
    let text = format!("{text}\n[gap]\nat_end_of_plan = false\n");
    (
        text.replacen("seed = 1\n", &format!("seed = {seed}\n"), 1),
        truth,
    )
}

/// The table that the controller holds.
fn held(session: &Session) -> Vec<f64> {
    session
        .last::<ToolOffsets>(topics::TOOL_OFFSETS)
        .volumetric_values
}

fn written(session: &Session) -> Vec<ControllerCommand> {
    let mut commands: Vec<ControllerCommand> = session.all(topics::CONTROLLER_COMMANDS);
    commands.retain(|command| command.kind == ControllerCommand::SET_VOLUMETRIC);
    commands
}

/// Largest distance (m) of the tip from where the model has it, over poses that nobody touched, with composed errors.
fn left(truth: &[f64], table: &[f64]) -> f64 {
    let chain = Chain::from_urdf(WCBXFZYST).expect("a chain");
    let errors = |values: &[f64], unit: f64| {
        let named = LINKS.iter().zip(values);
        let links = named.map(|(name, value)| LinkError::named(&chain, name, value * unit));
        let links: Vec<LinkError> = links.collect::<Result<_, _>>().expect("links");
        ChainErrors::of_links(&chain, &links)
    };
    let (pose, tip) = (Isometry3::identity(), Point3::origin());
    let controller = Volumetric::new(chain.clone(), pose, tip, errors(table, 1.0)).expect("fits");
    let truth = errors(truth, 1e-6);
    let mut worst = 0.0_f64;
    for b in [-85.0, -55.0, -15.0, 20.0, 60.0_f64] {
        for c in [20.0, 110.0, 165.0, 250.0, 345.0_f64] {
            for [x, y, z] in [[0.05, 0.05, 0.15], [-0.06, 0.06, 0.11], [0.0, -0.06, 0.02]] {
                let at = [x, b.to_radians(), c.to_radians(), z, y, 0.0];
                let more = controller.corrections(&at).expect("a pose").axes;
                let led: Vec<f64> = at.iter().zip(more).map(|(q, more)| q + more).collect();
                let off = chain.ball_in_part_with(&led, &pose, &tip, &truth)
                    - chain.ball_in_part(&at, &pose, &tip);
                worst = worst.max(off.norm());
            }
        }
    }
    worst
}

#[test]
fn machines_drawn_at_random_find_their_tables_and_compensate_where_nobody_touched() {
    let (mut squares, mut most) = (0.0, 0.0_f64);
    let seeds = 1..=6;
    for seed in seeds.clone() {
        let mut truth = Vec::new();
        let original =
            std::fs::read_to_string(cell_tests::launch_scripts().join("five_axis_calibrate.toml"))
                .expect("the cell file");
        truth.clone_from(&drawn(&original, seed).1);
        let cell = calibrate(|text| drawn(text, seed).0);
        let mut session = Session::new(&cell);
        let before = held(&session);
        let report = session.make("balls");
        assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
        assert_eq!(report.passes, 0, "nothing was cut");
        session.run_s(0.1);
        let corrections: Vec<Correction> = session.all(topics::CORRECTIONS);
        let [only] = corrections.as_slice() else {
            panic!("seed {seed}: {} corrections", corrections.len());
        };
        assert_eq!(only.entries, LINKS);
        assert_eq!(only.previous_values, before);
        assert_eq!(held(&session), only.new_values);
        for (place, truth) in truth.iter().enumerate() {
            let off = (only.new_values[place] - truth * 1e-6) / only.value_uncertainties[place];
            squares += off * off;
            most = most.max(off.abs());
        }
        // The errors of up to 90 µrad move the tip by 20 to 70 µm at these poses.
        let (as_found, compensated) = (left(&truth, &before), left(&truth, &only.new_values));
        assert!(
            compensated < 2.5e-6,
            "seed {seed}: {compensated:e} m are left"
        );
        assert!(
            as_found > 8.0 * compensated,
            "{as_found:e}, {compensated:e}"
        );
    }
    // 48 estimates: none beyond four standard uncertainties, and their mean square between the 0.1 % quantiles of
    // chi-square over 48.
    assert!(most < 4.0, "{most}");
    let mean = squares / 48.0;
    assert!((0.46..1.80).contains(&mean), "{mean}");
}

#[test]
fn the_delivered_cell_corrects_once_and_says_what_it_read_back() {
    let cell = calibrate(str::to_owned);
    let (report, log) = make_part(&cell, "balls");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let verdicts: Vec<Verdict> = messages(&log, topics::VERDICTS.name);
    let kinds: Vec<(u8, bool)> = (verdicts.iter())
        .map(|one| (one.verdict, one.error < 3e-6))
        .collect();
    assert_eq!(
        kinds,
        [(Verdict::COMPENSABLE, false), (Verdict::QUALIFIED, true)]
    );
    let correction = messages::<Correction>(&log, topics::CORRECTIONS.name).remove(0);
    let answer = messages::<Ack>(&log, topics::CORRECTION_ACKNOWLEDGEMENTS.name).remove(0);
    assert_eq!(
        (answer.outcome, &answer.values_after),
        (Ack::APPLIED, &correction.new_values)
    );
    assert_eq!(answer.values_before, correction.previous_values);
    assert_eq!(answer.value_after, correction.new_value);
    assert!(left(&DELIVERED, &answer.values_after) < 2.5e-6);
    // A replay makes the same bytes, and one that could reach a machine tells it nothing.
    let nodes = cell.node_names();
    let made = replay(&recording(&log), &factories(&cell, &nodes));
    let made = made.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.verdict, Replayed::Equal);
    let mut session = Session::replayed(&cell);
    assert_eq!(session.make("balls").verdict, PartReport::STOPPED);
    session.send(
        topics::CORRECTIONS,
        &Correction {
            replayed: false,
            ..correction
        },
    );
    session.run_s(0.2);
    assert_eq!(
        session
            .last::<Ack>(topics::CORRECTION_ACKNOWLEDGEMENTS)
            .outcome,
        Ack::REFUSED_REPLAY
    );
    assert!(
        session
            .all::<ControllerCommand>(topics::CONTROLLER_COMMANDS)
            .is_empty()
    );
}

/// Of the part's features only those whose name holds the text.
fn only(text: &str, kept: &str) -> String {
    let (head, rest) = text.split_once("\n[[part.features]]\n").expect("features");
    let (features, tail) = rest.split_once("\n[path_planning]\n").expect("planning");
    let features = features.split("\n[[part.features]]\n");
    let features = features.filter(|feature| feature.contains(kept));
    let features = features.map(|feature| format!("\n[[part.features]]\n{feature}"));
    format!(
        "{head}{}\n[path_planning]\n{tail}",
        features.collect::<String>()
    )
}

/// How a part ends, and what was found of the machine; no table is ever proposed.
fn refused(edit: impl Fn(&str) -> String) -> (PartReport, Verdict) {
    let mut session = Session::new(&calibrate(edit));
    let before = held(&session);
    let report = session.make("balls");
    session.run_s(1.0);
    assert!(written(&session).is_empty());
    assert_eq!(held(&session), before);
    assert!(session.all::<Correction>(topics::CORRECTIONS).is_empty());
    assert_eq!(report.verdict, PartReport::STOPPED, "{}", report.text);
    (report, session.last(topics::VERDICTS))
}

#[test]
fn links_that_the_balls_do_not_determine_are_named_with_the_indexations_that_would() {
    let (report, verdict) = refused(|text| only(text, "_b+0_"));
    assert_eq!(verdict.verdict, Verdict::MEASUREMENT_INVALID);
    assert!(
        report.text.starts_with(
            "volumetric table could not be measured: the touches of the balls do not determine "
        ),
        "{}",
        report.text
    );
    for named in ["EA0B (u infinite", "EC0B (u infinite", "touch them at B "] {
        assert!(verdict.text.contains(named), "{named}: {}", verdict.text);
    }
    // A link that no indexation distinguishes from the positions of the balls.
    let (_, verdict) = refused(|text| {
        text.replace("\"EC0Y\"]", "\"EC0Y\", \"EC0C\"]").replace(
            "table = [\n",
            "table = [\n    { name = \"EC0C\", value_urad = 0.0 },\n",
        )
    });
    for named in [
        "do not determine EC0C (u infinite",
        "no few further indexations of these balls would",
    ] {
        assert!(verdict.text.contains(named), "{named}: {}", verdict.text);
    }
    // A noisy probe: determined, but not well enough.
    let (_, verdict) = refused(|text| text.replace("touch_sd_um = 0.5", "touch_sd_um = 4.0"));
    assert!(
        verdict.text.contains("EA0B (u ") && !verdict.text.contains("u infinite"),
        "{}",
        verdict.text
    );
}

#[test]
fn a_table_beyond_its_bounds_or_without_corrections_left_is_not_proposed() {
    let (report, verdict) = refused(|text| text.replace("limit_um = 80.0", "limit_um = 25.0"));
    assert_eq!(verdict.verdict, Verdict::NOT_CONVERGED);
    assert!(
        report.text.contains("EX0C would be -31.") && report.text.ends_with("beyond ±25.0 µm"),
        "{}",
        report.text
    );
    let tight = "uncertainty_um = 1.0\ndisplacement_limit_mm = 0.02";
    let (report, _) = refused(|text| text.replace("uncertainty_um = 1.0", tight));
    assert!(report.text.ends_with("beyond 20.0 µm"), "{}", report.text);
    let (report, verdict) =
        refused(|text| text.replace("max_corrections = 2", "max_corrections = 0"));
    assert_eq!(verdict.verdict, Verdict::NOT_CONVERGED);
    assert!(
        report
            .text
            .ends_with("still out of tolerance after 0 corrections"),
        "{}",
        report.text
    );
    let (report, _) = refused(|text| {
        text.replace(
            "max_corrections = 2",
            "max_corrections = 2\nliteral_macro = true",
        )
    });
    assert!(
        report.text.contains("the policy is to stop"),
        "{}",
        report.text
    );
}

#[test]
fn a_touch_that_is_missing_or_a_tolerance_below_what_is_known_is_no_measurement() {
    let (report, verdict) = refused(|text| {
        // The fault is of the probe, the rest of the file of the machine.
        format!("{}touches = 1\n", with_fault(text, "dead_probe", 20))
    });
    assert_eq!(verdict.verdict, Verdict::MEASUREMENT_INVALID);
    assert!(
        report
            .text
            .contains("1 of 5 probing moves gave no usable touch"),
        "{}",
        report.text
    );
    let (report, _) = refused(|text| text.replace("tolerance_mm = 0.003", "tolerance_mm = 0.0002"));
    assert!(
        report.text.ends_with("its tolerance is 0.2 µm"),
        "{}",
        report.text
    );
}

fn asking() -> Cell {
    calibrate(|text| {
        text.replace(
            "automatic_approval = true",
            "automatic_approval = false\napproval_limit_s = 45",
        )
    })
}

/// A session whose measurement has proposed a table, which waits.
fn proposed() -> (Session, Correction) {
    let mut session = Session::new(&asking());
    session.ask_for("balls");
    session.run_to(topics::PASS_DECISIONS);
    session.run_s(5.0);
    let correction: Correction = session.last(topics::CORRECTIONS);
    assert_eq!(correction.kind, Correction::VOLUMETRIC);
    (session, correction)
}

#[test]
fn a_table_waits_for_an_operator_who_may_approve_reject_or_stay_away() {
    let (mut session, correction) = proposed();
    session.run_s(20.0);
    assert!(written(&session).is_empty());
    session.answer(&correction, true);
    session.run_s(0.2);
    let answer: Ack = session.last(topics::CORRECTION_ACKNOWLEDGEMENTS);
    assert_eq!(answer.outcome, Ack::APPLIED, "{}", answer.text);
    assert_eq!(written(&session).len(), 1);
    assert_eq!(held(&session), correction.new_values);
    // Told again it is not written again.
    session.send(
        topics::CORRECTIONS,
        &session.last::<Correction>(topics::CORRECTIONS),
    );
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    assert_eq!(written(&session).len(), 1);

    let (mut session, correction) = proposed();
    session.answer(&correction, false);
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert_eq!(report.verdict, PartReport::STOPPED);
    session.run_s(5.0);
    assert!(written(&session).is_empty());

    let (mut session, correction) = proposed();
    let report = session.wait_for_report();
    assert!(
        report.text.starts_with("nobody approved or rejected"),
        "{}",
        report.text
    );
    session.answer(&correction, true);
    session.run_s(5.0);
    assert!(written(&session).is_empty());
}

#[test]
fn each_thing_that_a_table_may_lack_has_its_own_refusal() {
    let (mut session, correction) = proposed();
    let before = held(&session);
    let good = approved(correction, "Ada", session.now());
    let past = session.now().after_s(-0.001);
    let bounds = Ack::REFUSED_OUT_OF_BOUNDS;
    let variants: Vec<Spoilt> = vec![
        (
            "another run",
            Ack::REFUSED_STALE,
            Box::new(|c| c.session = "simulator-0".to_owned()),
        ),
        (
            "expired",
            Ack::REFUSED_STALE,
            Box::new(move |c| c.expires = past.time()),
        ),
        (
            "another table before",
            Ack::REFUSED_STALE,
            Box::new(|c| c.previous_values[5] += 1e-7),
        ),
        (
            "no number before",
            Ack::REFUSED_STALE,
            Box::new(|c| c.previous_values[0] = f64::NAN),
        ),
        (
            "an entry beyond its bound",
            bounds,
            Box::new(|c| c.value_limits[4] = 90e-6),
        ),
        (
            "a bound that is no number",
            bounds,
            Box::new(|c| c.value_limits[2] = f64::NAN),
        ),
        (
            "beyond the machine's bound of lengths",
            bounds,
            Box::new(|c| {
                (c.value_limits[2], c.new_values[2]) = (1.0, 100.2e-6);
            }),
        ),
        (
            "beyond the machine's bound of angles",
            bounds,
            Box::new(|c| {
                (c.value_limits[7], c.new_values[7]) = (1.0, -250.2e-6);
            }),
        ),
        (
            "an entry that is no number",
            bounds,
            Box::new(|c| c.new_values[1] = f64::NAN),
        ),
        (
            "an infinite entry",
            bounds,
            Box::new(|c| c.new_values[1] = f64::INFINITY),
        ),
        (
            "half a table",
            Ack::FAILED,
            Box::new(|c| c.entries.truncate(4)),
        ),
        (
            "entries in another order",
            Ack::FAILED,
            Box::new(|c| c.entries.swap(0, 1)),
        ),
        (
            "a value too few",
            bounds,
            Box::new(|c| c.new_values.truncate(7)),
        ),
        (
            "a bound too few",
            bounds,
            Box::new(|c| c.value_limits.truncate(7)),
        ),
        (
            "no entries at all",
            Ack::FAILED,
            Box::new(|c| c.entries.clear()),
        ),
        (
            "more displacement than it may",
            bounds,
            Box::new(|c| c.upper_bound = 1e-6),
        ),
        (
            "displacement that is no number",
            bounds,
            Box::new(|c| c.new_value = f64::NAN),
        ),
        (
            "no features",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.feature_ids.clear()),
        ),
        (
            "no touches",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.sequences.clear()),
        ),
        (
            "a plan never measured",
            Ack::REFUSED_NO_SOURCE,
            Box::new(|c| c.plan_id.push('9')),
        ),
        (
            "approved by nobody",
            Ack::REFUSED_NOT_APPROVED,
            Box::new(|c| c.approved_by.clear()),
        ),
        (
            "a replay",
            Ack::REFUSED_REPLAY,
            Box::new(|c| c.replayed = true),
        ),
    ];
    refuses_all_but_the_sound(&mut session, &good, variants, |session, what| {
        assert!(written(session).is_empty(), "{what}");
        assert_eq!(held(session), before, "{what}");
    });
}

#[test]
fn a_table_that_somebody_changed_meanwhile_is_not_written_over() {
    let (mut session, correction) = proposed();
    let mut values = held(&session);
    values[3] += 10e-6;
    let by_hand = ControllerCommand {
        session: correction.session.clone(),
        command_id: 1,
        kind: ControllerCommand::SET_VOLUMETRIC,
        entries: correction.entries.clone(),
        values: values.clone(),
        ..ControllerCommand::default()
    };
    session.send(topics::CONTROLLER_COMMANDS, &by_hand);
    session.run_s(0.1);
    assert_eq!(held(&session), values);
    session.answer(&correction, true);
    session.run_s(0.2);
    let report: PartReport = session.last(topics::PART_REPORTS);
    assert!(
        report.text.contains(
            "it was computed from EA0C = 19.0 µrad, but the controller holds EA0C = 29.0 µrad"
        ),
        "{}",
        report.text
    );
    assert_eq!(held(&session), values);
}

#[test]
fn a_table_that_changes_under_the_touches_gives_no_measurement() {
    let mut session = Session::new(&calibrate(str::to_owned));
    session.ask_for("balls");
    session.run_to(topics::PROBE_EVENTS);
    // The machine refuses it while it measures; a hand at its panel would not be asked.
    let offsets: ToolOffsets = session.last(topics::TOOL_OFFSETS);
    let changed = ToolOffsets {
        header: probecell_msgs::std_msgs::Header {
            stamp: session.now().after_s(1.0).time(),
            ..offsets.header.clone()
        },
        ..offsets
    };
    session.send(topics::TOOL_OFFSETS, &changed);
    let report = session.wait_for_report();
    assert!(
        report
            .text
            .ends_with("the controller's offsets have changed since the first touch"),
        "{}",
        report.text
    );
}

#[test]
fn a_probe_that_is_out_is_told_from_the_links_when_the_cell_file_asks_for_it() {
    let out = |text: &str| {
        text.replace(
            "center_error_um = [0.0, 0.0, 0.0], radius_error_um = 0.0",
            "center_error_um = [9.0, -6.0, 12.0], radius_error_um = 2.0",
        )
    };
    let beside = "beside = [\"probe.stylus_offset\", \"probe.stylus_length\", \"probe.ball_radius\"]\n\
                  uncertainty_um = 2.0\nuncertainty_urad = 15.0\n";
    let cell = calibrate(|text| {
        out(text)
            .replace("uncertainty_um = 1.0\nuncertainty_urad = 5.0\n", beside)
            .replace("touch_sd_um = 0.5", "touch_sd_um = 0.2")
    });
    let (report, log) = make_part(&cell, "balls");
    assert_eq!(report.verdict, PartReport::QUALIFIED, "{}", report.text);
    let correction = messages::<Correction>(&log, topics::CORRECTIONS.name).remove(0);
    for (place, truth) in DELIVERED.iter().enumerate() {
        let off =
            (correction.new_values[place] - truth * 1e-6) / correction.value_uncertainties[place];
        assert!(off.abs() < 4.0, "{}: {off}", LINKS[place]);
    }
    assert!(left(&DELIVERED, &correction.new_values) < 3e-6);
}

/// Five-axis patterns cut with a table that the machine has just found by the balls beside them.
#[test]
fn patterns_cut_with_the_table_just_found_meet() {
    let cell = cell("five_axis.toml", |text| {
        let table = text.find("table = [").expect("a table");
        let end = table + text[table..].find("]\n").expect("its end") + 2;
        let passes = text.find("passes = [").expect("passes");
        let after = passes + text[passes..].find("\n]").expect("their end") + 2;
        let own = "\n[compensation.volumetric]\nlinks = [\"EA0B\", \"EC0B\", \"EX0C\", \"EA0C\", \"EB0C\", \"EB0Z\", \
                   \"EA0Y\", \"EC0Y\"]\ntolerance_mm = 0.004\nlimit_um = 50.0\nlimit_urad = 100.0\npasses = [\"calibrate\"]\n";
        format!(
            "{}passes = [\n    {{ name = \"calibrate\" }},\n    {{ name = \"compensated\", operations = [\"mill_compensated\"] }},\n]{}table = [\n{}]\n{}{own}",
            &text[..passes],
            &text[after..table],
            links(&[0.0; 8]),
            &text[end..]
        )
        .replace(
            "max_corrections = 1\n",
            "max_corrections = 1\nautomatic_approval = true\n",
        )
        .replace(
            "tolerance_mm = 0.010 }",
            "tolerance_mm = 0.010, passes = [\"compensated\"] }",
        )
    });
    let (report, log) = make_part(&cell, "block");
    assert_eq!(
        (report.verdict, report.passes),
        (PartReport::QUALIFIED, 1),
        "{}",
        report.text
    );
    let results: Vec<FeatureResult> = messages(&log, topics::FEATURE_RESULTS.name);
    let mismatch: Vec<f64> = (results.iter())
        .filter(|one| one.plan_id == "block/compensated/1" && one.feature_id.starts_with('P'))
        .filter(|one| !one.feature_id.contains('_'))
        .map(|one| one.size_deviation)
        .collect();
    assert_eq!(mismatch.len(), 14);
    let rms = (mismatch.iter().map(|m| m * m).sum::<f64>() / 14.0).sqrt();
    // D.4, case E1: 21.7 µm without compensation, 2.8 µm with; F: at most 6 µm.
    assert!(rms < 3.5e-6, "{rms:e}");
}
