//! The source systems' gaps through whole cells: what is hidden in the machine, and what the diagnosis of the recording says.
//!
//! One row per scenario of the register that a cell can live through: the cell file with its hidden error, the plan that
//! was measured, and the effects that have to come out, each by name or among those a session cannot tell from one that
//! is named, nothing besides. The recording is what a stranger would get: no node and no diagnosis knows the truth.

use std::collections::BTreeMap;

use bags::Measurement;
use cell_tests::{bag, cell, make_part};
use diagnosis::report::Effect;
use diagnosis::{Report, Verdict};
use graph::Published;

/// What a session has to say.
enum Expected {
    /// Nothing acts.
    NoGap,
    /// Something acts that the vocabulary does not know, and nobody is blamed.
    Unknown,
    /// Exactly these, by name or among the equals of a name.
    Effects(&'static [&'static str]),
    /// Exactly one of several that this session cannot tell apart, this one among them.
    Group(&'static str),
}

/// One scenario in a cell.
struct Row {
    scenario: &'static str,
    file: &'static str,
    /// What is changed in the cell file: text, and what replaces it.
    change: &'static [(&'static str, &'static str)],
    plan: &'static str,
    expected: Expected,
}

/// The part jumps in the middle of the measurement; the guideway is straight.
const SLIPPED: &[(&str, &str)] = &[
    (
        "[simulator.machine]\n",
        "[simulator.machine]\nslip = { after_touches = 29, shift_um = [40.0, 25.0, 0.0] }\n",
    ),
    (
        "value_um = -56.0, bow_um = 60.0",
        "value_um = 0.0, bow_um = 0.0",
    ),
];
/// Over the part of the travel that the shaft takes, a bow is also a slope, which is the squareness of the axis: here it
/// is taken off, so that nothing but straightness is left.
const BOWED: &[(&str, &str)] = &[(
    "value_um = -56.0, bow_um = 60.0",
    "value_um = -60.1, bow_um = 60.0, slope_um_per_m = 19.2",
)];
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

const ROWS: &[Row] = &[
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
        change: BOWED,
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

fn log<'a>(
    made: &'a mut BTreeMap<(&'static str, usize), (cell::Cell, Vec<Published>)>,
    row: &Row,
) -> &'a (cell::Cell, Vec<Published>) {
    let key = (row.file, row.change.as_ptr() as usize);
    made.entry(key).or_insert_with(|| {
        let change = |text: &str| {
            row.change.iter().fold(text.to_owned(), |text, (from, to)| {
                assert!(text.contains(from), "{}: no {from:?}", row.file);
                text.replace(from, to)
            })
        };
        let cell = cell(row.file, change);
        let product = row.plan.split('/').next().unwrap_or_default();
        let (_, log) = make_part(&cell, product);
        (cell, log)
    })
}

/// What is wrong with an answer; `None` where it is right.
fn fault(expected: &Expected, report: &Report) -> Option<String> {
    let named: Vec<&str> = report.effects.iter().map(|e| e.effect.as_str()).collect();
    let stands_for = |id: &&str| {
        (report.effects.iter())
            .any(|e| e.effect == **id || e.indistinguishable_from.iter().any(|other| other == *id))
    };
    let right = match expected {
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
    };
    (!right).then(|| format!("{:?}, named {named:?}\n{report}", report.verdict))
}

#[test]
fn every_scenario_of_a_cell_is_found_in_its_recording() {
    let mut made = BTreeMap::new();
    let mut faults = Vec::new();
    for row in ROWS {
        let (cell, log) = log(&mut made, row);
        let report = bag::diagnosis(cell, log, &Measurement::Named(row.plan.to_owned()));
        if let Some(fault) = fault(&row.expected, &report) {
            faults.push(format!("{}: {fault}", row.scenario));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
