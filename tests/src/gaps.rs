//! The gaps of the source systems (`docs/source_systems.md, F`) in whole cells: what is hidden in the machine, and
//! what the diagnosis of the recording has to say. The errors are in the cell files and in the changes here; no node
//! and no diagnosis knows them.

use bags::Measurement;
use cell::Cell;
use diagnosis::report::Effect;
use diagnosis::{Report, Verdict};
use graph::Published;

use crate::{cell, make_part};

/// The expected diagnosis of a session.
pub enum Expected {
    /// No effect acts.
    NoGap,
    /// A cause outside the vocabulary: no effect is named.
    Unknown,
    /// Exactly these, each named or in the equivalence class of a named effect.
    Effects(&'static [&'static str]),
    /// Exactly one of an equivalence class that contains this one.
    Group(&'static str),
}

/// One scenario in a cell.
pub struct Row {
    /// Its name in the register, and what is special.
    pub scenario: &'static str,
    /// The cell file.
    pub file: &'static str,
    /// What is changed in the cell file: text, and what replaces it.
    pub change: &'static [(&'static str, &'static str)],
    /// The plan whose touches are diagnosed; `PRODUCT/last`: the last one, which the reference instrument measures, too.
    pub plan: &'static str,
    /// The expected diagnosis.
    pub expected: Expected,
}

/// The part jumps in the middle of the measurement; the guideway is straight.
const SLIPPED: &[(&str, &str)] = &[
    (
        "[simulator.machine]\n",
        "[simulator.machine]\nslip = { after_touches = 29, shift_um = [40.0, 25.0, 0.0] }\n",
    ),
    (
        "value_um = -60.1, bow_um = 60.0, slope_um_per_m = 19.2",
        "value_um = 0.0, bow_um = 0.0",
    ),
];
/// The set-up is off by 6.4 µm towards the back face from the first touch on, and the tool does not run out.
const OFF: &[(&str, &str)] = &[
    (
        "[simulator]\nseed = 1\n",
        "[simulator]\nseed = 1\nmachine = { slip = { after_touches = 0, shift_um = [0.0, 6.4, 0.0] } }\n",
    ),
    (
        "machined_on_this_machine = true",
        "machined_on_this_machine = false",
    ),
    ("eccentricity_um = 9.0", "eccentricity_um = 0.0"),
    ("offset_um = 4.0", "offset_um = 0.0"),
    ("tilt_urad = 90.0", "tilt_urad = 0.0"),
];
/// The path follows every reading, noise and all.
const RAW: &[(&str, &str)] = &[("path = \"deterministic\"", "path = \"raw\"")];

/// One slot is probed from above, not at the index at which it was cut: EC0B has turned it there, and a single turned slot
/// looks like a guideway that is not straight as well.
const FROM_ABOVE: &[(&str, &str)] = &[(
    "rotary_deg = [90.0, 90.0, 0.0]\ntouch",
    "rotary_deg = [0.0, 0.0, 0.0]\ntouch",
)];

/// The guideway is straight.
const STRAIGHT: &[(&str, &str)] = &[(
    "value_um = -60.1, bow_um = 60.0, slope_um_per_m = 19.2",
    "value_um = 0.0, bow_um = 0.0",
)];
/// The axes are where the model has them.
const EXACT: &[(&str, &str)] = &[
    ("value_urad = 50.0", "value_urad = 0.0"),
    ("value_urad = -50.0", "value_urad = 0.0"),
    ("value_um = 20.0", "value_um = 0.0"),
];
/// The tool does not run out and has its radius.
const TRUE_TOOL: &[(&str, &str)] = &[
    ("eccentricity_um = 9.0", "eccentricity_um = 0.0"),
    ("offset_um = 4.0", "offset_um = 0.0"),
    ("tilt_urad = 90.0", "tilt_urad = 0.0"),
];
/// The ball is on the spindle axis.
const CENTRED: &[(&str, &str)] = &[("[18.0, -11.0, 0.0]", "[0.0, 0.0, 0.0]")];

/// The scenarios of the register that a cell can live through.
pub const ROWS: &[Row] = &[
    Row {
        scenario: "A-probe-offset",
        file: "turn_mill_uncalibrated.toml",
        change: &[],
        plan: "punch/finish/1",
        expected: Expected::Effects(&["probe.stylus_offset"]),
    },
    // The registers hold the error of the probe: no wear of a tool is named for it.
    Row {
        scenario: "A-phantom-wear",
        file: "turn_mill_uncalibrated.toml",
        change: &[],
        plan: "punch/rough/2",
        expected: Expected::Effects(&["probe.stylus_offset"]),
    },
    Row {
        scenario: "A-deflection",
        file: "turn_mill_bending.toml",
        change: &[],
        plan: "bar/rough/1",
        expected: Expected::Effects(&["process.deflection", "process.tool_radius"]),
    },
    Row {
        scenario: "B-profile",
        file: "free_form.toml",
        change: &[],
        plan: "part/finish/1",
        expected: Expected::Unknown,
    },
    Row {
        scenario: "B-profile, corrected",
        file: "free_form.toml",
        change: &[],
        plan: "part/finish/2",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "B-noise-imprint",
        file: "free_form.toml",
        change: RAW,
        plan: "part/finish/2",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "C-guideway",
        file: "guideway.toml",
        change: &[],
        plan: "part/measure/1",
        expected: Expected::Effects(&["axis.Z.straightness"]),
    },
    Row {
        scenario: "C-slip",
        file: "guideway.toml",
        change: SLIPPED,
        plan: "part/measure/1",
        expected: Expected::Effects(&["process.slip"]),
    },
    Row {
        scenario: "D-link",
        file: "five_axis.toml",
        change: &[],
        plan: "part/uncompensated/1",
        expected: Expected::Effects(&[
            "link.EA0B",
            "link.EC0B",
            "link.EX0C",
            "link.EA0C",
            "link.EB0C",
            "link.EB0Z",
            "link.EA0Y",
            "link.EC0Y",
        ]),
    },
    Row {
        scenario: "D-blind",
        file: "five_axis_slots.toml",
        change: &[],
        plan: "part/slots/1",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "D-blind, one slot from above",
        file: "five_axis_slots.toml",
        change: FROM_ABOVE,
        plan: "part/slots/1",
        expected: Expected::Group("link.EC0B"),
    },
    Row {
        scenario: "E-runout",
        file: "flank_milling.toml",
        change: &[],
        plan: "part/flank/1",
        expected: Expected::Effects(&["process.tool_runout"]),
    },
    Row {
        scenario: "E-setup-bias",
        file: "flank_milling.toml",
        change: OFF,
        plan: "part/flank/1",
        expected: Expected::Effects(&["fixture.shift"]),
    },
];

/// Sessions of the example cells as they are, in addition to the register.
pub const DELIVERED: &[Row] = &[
    Row {
        scenario: "turn_mill, calibrated",
        file: "turn_mill.toml",
        change: &[],
        plan: "punch/last",
        expected: Expected::Effects(&["probe.ball_radius"]),
    },
    Row {
        scenario: "ball_check, stylus or balls",
        file: "ball_check.toml",
        change: &[],
        plan: "balls/check/1",
        expected: Expected::Group("probe.stylus_offset"),
    },
    // What the controller's table lacks of the links, before it is corrected; the four others it has to within 4 µrad.
    Row {
        scenario: "five_axis_calibrate, as found",
        file: "five_axis_calibrate.toml",
        change: &[],
        plan: "balls/calibrate/1",
        expected: Expected::Effects(&["link.EA0B", "link.EC0B", "link.EX0C", "link.EB0C"]),
    },
];

/// The same cells without their errors: nothing to find.
pub const FAULTLESS: &[Row] = &[
    Row {
        scenario: "guideway, straight",
        file: "guideway.toml",
        change: STRAIGHT,
        plan: "part/measure/1",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "five_axis, exact links",
        file: "five_axis.toml",
        change: EXACT,
        plan: "part/uncompensated/1",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "flank_milling, true tool",
        file: "flank_milling.toml",
        change: TRUE_TOOL,
        plan: "part/flank/1",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "ball_check, centred stylus",
        file: "ball_check.toml",
        change: CENTRED,
        plan: "balls/check/1",
        expected: Expected::NoGap,
    },
    Row {
        scenario: "five_axis_calibrate, with the table found",
        file: "five_axis_calibrate.toml",
        change: &[],
        plan: "balls/calibrate/2",
        expected: Expected::NoGap,
    },
];

impl Row {
    /// The session: its cell, and everything that was published while the part was made with that seed.
    pub fn session(&self, seed: u64) -> (Cell, Vec<Published>) {
        let change = |text: &str| {
            let changed = self
                .change
                .iter()
                .fold(text.to_owned(), |text, (from, to)| {
                    assert!(text.contains(from), "{}: no {from:?}", self.file);
                    text.replace(from, to)
                });
            changed.replacen("seed = 1\n", &format!("seed = {seed}\n"), 1)
        };
        let cell = cell(self.file, change);
        let product = self.plan.split('/').next().unwrap_or_default();
        let (_, log) = make_part(&cell, product);
        (cell, log)
    }

    /// Which measurement of the session is diagnosed.
    pub fn measurement(&self) -> Measurement {
        if self.plan.ends_with("/last") {
            Measurement::Last
        } else {
            Measurement::Named(self.plan.to_owned())
        }
    }
}

impl Expected {
    /// True where an answer is right.
    pub fn holds(&self, report: &Report) -> bool {
        let named: Vec<&str> = report.effects.iter().map(|e| e.effect.as_str()).collect();
        let stands_for = |id: &&str| stands_for(report, id);
        match self {
            Expected::NoGap => report.verdict == Verdict::NoGap && named.is_empty(),
            Expected::Unknown => report.verdict == Verdict::Unexplained && named.is_empty(),
            Expected::Effects(hidden) => {
                report.verdict == Verdict::Explained
                    && named.len() <= hidden.len()
                    && hidden.iter().all(stands_for)
            }
            Expected::Group(hidden) => {
                let ambiguous = |effect: &Effect| !effect.indistinguishable_from.is_empty();
                report.verdict == Verdict::Explained
                    && matches!(report.effects.as_slice(), [one] if ambiguous(one))
                    && stands_for(hidden)
            }
        }
    }

    /// The effects that are hidden.
    pub fn hidden(&self) -> &[&'static str] {
        match self {
            Self::NoGap | Self::Unknown => &[],
            Self::Effects(hidden) => hidden,
            Self::Group(hidden) => std::slice::from_ref(hidden),
        }
    }
}

/// Whether a report names the effect or a member of its equivalence class.
pub fn stands_for(report: &Report, id: &str) -> bool {
    report.effects.iter().any(|effect| means(effect, id))
}

/// Whether an effect is that one or indistinguishable from it.
pub fn means(effect: &Effect, id: &str) -> bool {
    effect.effect == id
        || effect
            .indistinguishable_from
            .iter()
            .any(|other| other == id)
}
