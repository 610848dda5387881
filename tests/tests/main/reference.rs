//! The turn-mill cell with its CMM, diagnosed from recordings: what the source's section A says of its gaps is found.

use bags::Measurement;
use cell_tests::{bag, cell, make_part};
use diagnosis::{Options, Report, Session, Verdict};
use effects::Observations;

/// What a session of one touch direction cannot part from a constant error of the probe.
const CONSTANT: [&str; 2] = ["probe.ball_radius", "probe.stylus_offset"];

fn diagnosed(file: &str, seed: u64) -> (Report, Session) {
    let cell = cell(file, |text| {
        text.replace("seed = 1\n", &format!("seed = {seed}\n"))
    });
    let (_, log) = make_part(&cell, "punch");
    let folder = tempfile::tempdir().expect("a folder");
    bag::write(&cell, &log, &folder.path().join("session"));
    let session = bag::session(&cell, &folder.path().join("session"), &Measurement::Last);
    let report = diagnosis::diagnose(&session, &Options::default()).expect("a report");
    (report, session)
}

/// The source's test of its sizes (`docs/source_systems.md, A.2`): a gap that is proportional to the size leaves more of the
/// readings minus references than a constant one. Returned is the ratio of the sums of squares.
fn proportional_over_constant(session: &Session) -> f64 {
    let rows = Observations::from_session(session).expect("rows");
    let touches = rows.touches();
    let of_reference = |point: usize| {
        (touches..rows.rows.len())
            .find(|&row| rows.rows[row].point == point)
            .map(|row| rows.deviations[row])
    };
    // Distance of the surface from the axis of the part, and reading minus reference.
    let pairs: Vec<(f64, f64)> = (0..touches)
        .filter_map(|row| {
            let touched = &rows.rows[row];
            let radius = touched.normal.dot(&touched.position.coords);
            Some((radius, rows.deviations[row] - of_reference(touched.point)?))
        })
        .collect();
    assert!(pairs.len() > 20, "{}", pairs.len());
    let mean = pairs.iter().map(|pair| pair.1).sum::<f64>() / pairs.len() as f64;
    let slope = pairs.iter().map(|(size, gap)| size * gap).sum::<f64>()
        / pairs.iter().map(|(size, _)| size * size).sum::<f64>();
    let squares = |law: &dyn Fn(f64) -> f64| -> f64 {
        pairs
            .iter()
            .map(|(size, gap)| (gap - law(*size)).powi(2))
            .sum()
    };
    squares(&|size| slope * size) / squares(&|_| mean)
}

/// The one effect named, which must be of the constant class and neither wear nor growth of the part. Reading minus reference holds
/// what the machine does while it probes: a constant offset of the axis that approaches, by a link error or by its scale far
/// from its zero, is the same number there and may stand beside it. That no law of the size holds, as the source tests, is
/// [`proportional_over_constant`].
fn the_constant(report: &Report) -> &diagnosis::report::Effect {
    let [effect] = &report.effects[..] else {
        panic!("not one effect:\n{report}")
    };
    let class: Vec<&str> = std::iter::once(&effect.effect)
        .chain(&effect.indistinguishable_from)
        .map(String::as_str)
        .collect();
    assert!(
        CONSTANT.iter().all(|name| class.contains(name)),
        "{class:?}"
    );
    assert!(CONSTANT.contains(&effect.effect.as_str()), "{report}");
    for wrong in ["process.", "thermal.part_expansion"] {
        assert!(!class.iter().any(|name| name.contains(wrong)), "{class:?}");
    }
    effect
}

/// `docs/source_systems.md, A.2`: a gap of 71.0 µm on sizes, of which each side holds half; A.4: the registers show
/// phantom wear.
#[test]
fn an_uncalibrated_probe_is_named_and_no_growth_and_no_wear() {
    for seed in 1..=3 {
        let (report, session) = diagnosed("turn_mill_uncalibrated.toml", seed);
        assert!(
            proportional_over_constant(&session) > 2.0,
            "seed {seed}: a law of the size"
        );
        assert_eq!(report.verdict, Verdict::Explained, "{report}");
        assert!(
            (2.0 * report.gap.rms - 71.0e-6).abs() < 2e-6,
            "seed {seed}: {report}"
        );
        let effect = the_constant(&report);
        assert!(effect.rms_after < 3e-6, "beyond the CMM's 3 µm: {report}");
        assert!(
            report
                .warnings
                .iter()
                .any(|warning| warning.contains("tool 2") && warning.ends_with("not wear")),
            "{report}"
        );
    }
}

/// `docs/source_systems.md, A.2`: a gap of 6.2 µm on sizes remains, which the CMM's 3 µm hold.
#[test]
fn a_calibrated_probe_leaves_what_the_reference_cannot_tell() {
    for seed in 1..=3 {
        let (report, _) = diagnosed("turn_mill.toml", seed);
        assert!(
            (2.0 * report.gap.rms - 6.2e-6).abs() < 1e-6,
            "seed {seed}: {report}"
        );
        assert_eq!(report.verdict, Verdict::Explained, "{report}");
        let effect = the_constant(&report);
        // The gap is as small as the CMM's 3 µm; no noise is told that is larger than what is left.
        assert!(report.gap.noise_floor <= effect.rms_after, "{report}");
        assert!(report.gap.rms < 1.2 * 3e-6, "{report}");
    }
}
