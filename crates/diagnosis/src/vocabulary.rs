//! The effect vocabulary of the interface contract for one machine: every identifier a report could hold.

use machine::Chain;

/// Effects that belong to no axis.
const COMMON: [&str; 28] = [
    "probe.stylus_offset",
    "probe.stylus_length",
    "probe.ball_radius",
    "probe.pretravel_lobing",
    "probe.trigger_latency",
    "thermal.spindle_growth",
    "thermal.part_expansion",
    "thermal.drift",
    "fixture.shift",
    "fixture.tilt",
    "process.tool_radius",
    "process.tool_wear",
    "process.tool_runout",
    "process.deflection",
    "process.slip",
    "data.outliers",
    "data.quantisation",
    "time.clock_offset",
    "drive.viscous_friction",
    "drive.coulomb_friction",
    "drive.friction_offset",
    "drive.stribeck",
    "drive.inertia",
    "drive.gravity",
    "drive.compliance",
    "drive.cogging",
    "drive.backlash",
    "drive.delay",
];
/// What an axis can do, behind `axis.<A>.`.
const OF_AXIS: [&str; 8] = [
    "scale",
    "straightness",
    "angular",
    "backlash",
    "cyclic",
    "lag",
    "indexing",
    "error_motion",
];

/// All identifiers for the axes of a machine.
pub fn of(chain: &Chain) -> Vec<String> {
    let mut names: Vec<String> = COMMON.map(str::to_owned).into();
    for axis in chain.axis_names() {
        names.extend(OF_AXIS.map(|kind| format!("axis.{axis}.{kind}")));
        let location = ["X", "Y", "Z", "A", "B", "C"];
        names.extend(location.map(|component| format!("link.E{component}0{axis}")));
    }
    names
}

/// The known name that is most like another.
pub fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a str> {
    let likeness = |known: &&String| strsim::jaro_winkler(name, known);
    known
        .iter()
        .max_by(|one, other| likeness(one).total_cmp(&likeness(other)))
        .map(String::as_str)
}
