//! Every cause of a report, by what it can be mended, and how much of the gap goes.

use diagnosis::Report;

use crate::CureError;
use crate::cause::{Cause, Judged, Refused, causes, kind};
use crate::formats::FORMATS;

/// One cause in the list.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Root mean square of the gap without and with it, in the unit of the report, on what was not fitted.
    pub gap: [f64; 2],
    /// What mends it: a file, a parameter, a hand on the machine.
    pub by: &'static str,
    /// Formats that hold it.
    pub formats: Vec<&'static str>,
    /// Why it is not written; `None` where it may be.
    pub refused: Option<String>,
}

/// The causes of a report in its order.
///
/// # Errors
/// [`CureError::Report`] for a report that is neither of touches nor of efforts, and for a member of no group.
pub fn lines(report: &Report, members: &[String]) -> Result<Vec<Line>, CureError> {
    let judged = causes(report, members)?;
    let of = |(effect, judged): (&diagnosis::report::Effect, Judged)| {
        let (name, refused) = match judged {
            Ok(Cause { name, .. }) => (name, None),
            Err(Refused { effect, why }) => (effect, Some(why)),
        };
        let holds = FORMATS
            .iter()
            .filter(|format| format.holds.contains(&kind(&name)));
        Line {
            gap: [effect.rms_before, effect.rms_after],
            by: mended_by(kind(&name)),
            formats: holds.map(|format| format.name).collect(),
            effect: name,
            refused,
        }
    };
    Ok(report.effects.iter().zip(judged).map(of).collect())
}

/// What mends a kind of effect.
fn mended_by(kind: &str) -> &'static str {
    match kind {
        "axis.<A>.scale" => "steps or counts per mm, or a pitch table",
        "axis.<A>.positioning" | "axis.<A>.cyclic" => "a pitch table",
        "axis.<A>.backlash" => "backlash parameter, or preload by hand",
        "axis.<A>.indexing" => "a pitch table of the rotary axis",
        "axis.<A>.straightness" | "axis.<A>.angular" => "levelling by hand, or a table of its kind",
        "axis.<A>.error_motion" => "bearing or seat, by hand",
        "axis.<A>.lag" => "velocity gain of the position loop",
        "link.E<c>0<A>" => "kinematics of the control or robot, or alignment by hand",
        "drive.payload" => "load of the description and of the controller",
        "drive.link_inertia" => "masses of the description",
        "drive.coulomb_friction" | "drive.viscous_friction" => {
            "friction of the description, or lubrication by hand"
        }
        "drive.inertia" => "rotor inertia of the model (armature)",
        "drive.effort_gain" => "unit or torque constant of the driver",
        "probe.stylus_length" => "length in the tool table",
        "probe.ball_radius" => "radius in the tool table, or qualify the probe",
        "probe.stylus_offset" | "probe.pretravel_lobing" | "probe.trigger_latency" => {
            "qualify the probe"
        }
        "fixture.shift" | "fixture.tilt" => "work offset, or clamp again",
        _ => "by hand",
    }
}

/// The list as text of at most 100 columns.
pub fn table(report: &Report, lines: &[Line]) -> String {
    let (unit, of) = (unit(report), |size| number(size, report));
    let mut text = vec![format!(
        "{:<23} {:<54} {:>9} {:>10}",
        "cause",
        "mended by",
        format!("gap, {unit}"),
        format!("left, {unit}")
    )];
    for line in lines {
        let [before, after] = line.gap.map(of);
        text.push(format!(
            "{:<23} {:<54} {before:>9} {after:>10}",
            line.effect, line.by
        ));
        let remark = match (&line.refused, line.formats.is_empty()) {
            (Some(why), _) => format!("not written: {why}"),
            (None, false) => format!("--as {}", line.formats.join(", ")),
            (None, true) => "no file holds it".to_owned(),
        };
        text.push(wrapped(&remark));
    }
    text.push(format!(
        "of a gap of {} {unit}, {} {unit} stay when all that can be written is; the noise is {} {unit}",
        of(report.gap.rms),
        of(remains(report, lines)),
        of(report.gap.noise_floor)
    ));
    text.join("\n")
}

/// Gap that stays when all that can be written is.
pub(crate) fn remains(report: &Report, lines: &[Line]) -> f64 {
    let written = (lines.iter()).filter(|line| line.refused.is_none() && !line.formats.is_empty());
    let gone: f64 = written
        .map(|line| line.gap[0].powi(2) - line.gap[1].powi(2))
        .sum();
    (report.gap.rms.powi(2) - gone).max(0.0).sqrt()
}

/// Unit in which a person reads the sizes of a report.
pub(crate) fn unit(report: &Report) -> &str {
    match report.gap.unit.as_str() {
        "m" => "µm",
        unit => unit,
    }
}

/// A size of a report in that unit.
pub(crate) fn number(size: f64, report: &Report) -> String {
    match report.gap.unit.as_str() {
        "m" => format!("{:.1}", size * 1e6),
        _ => format!("{size:.3}"),
    }
}

/// Words below a line, indented.
pub(crate) fn wrapped(text: &str) -> String {
    let mut lines = vec![String::from("   ")];
    for word in text.split(' ') {
        let full = lines
            .last()
            .is_none_or(|line| line.chars().count() + word.chars().count() + 1 > 99);
        if full {
            lines.push(String::from("   "));
        }
        if let Some(line) = lines.last_mut() {
            line.push(' ');
            line.push_str(word);
        }
    }
    lines.join("\n")
}
