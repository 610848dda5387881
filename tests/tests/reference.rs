//! The turn-mill cell with its CMM, diagnosed from recordings: what the source's section A says of its gaps is found.

use bags::Measurement;
use cell_tests::{bag, cell, make_part};
use diagnosis::{Report, Verdict};

/// What a session of one touch direction cannot part from a constant error of the probe.
const CONSTANT: [&str; 2] = ["probe.ball_radius", "probe.stylus_offset"];

fn diagnosed(file: &str, seed: u64) -> Report {
    let cell = cell(file, |text| {
        text.replace("seed = 1\n", &format!("seed = {seed}\n"))
    });
    let (_, log) = make_part(&cell, "punch");
    bag::diagnosis(&cell, &log, &Measurement::Last)
}

/// The one effect named, which must be of the constant class and neither a scale nor wear.
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
    for wrong in ["scale", "process.", "thermal.part_expansion"] {
        assert!(!class.iter().any(|name| name.contains(wrong)), "{class:?}");
    }
    effect
}

/// `docs/source_systems.md, A.2`: a gap of 71.0 µm on sizes, of which each side holds half; A.4: the registers show
/// phantom wear.
#[test]
fn an_uncalibrated_probe_is_named_and_no_scale_and_no_wear() {
    for seed in 1..=3 {
        let report = diagnosed("turn_mill_uncalibrated.toml", seed);
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
        let report = diagnosed("turn_mill.toml", seed);
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
