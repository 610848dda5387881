//! A diagnosis in one line: how large the gap is, why, and what would tell more.

use diagnosis::{Report, report::Level};
use effects::vocabulary;

/// `gap 3.1 µm rms, 4.3 × the noise: one of 12 causes; 8 touches would tell them apart`.
pub(crate) fn of(report: &Report) -> String {
    let gap = format!("gap {} µm rms", micro(report.gap.rms));
    if report.level == Level::NoGap {
        return format!("{gap}: no more than the noise");
    }
    let is_group = report.effects.iter().any(|one| one.group.len() > 1);
    let touches = report.next_measurement.iter().map(|next| next.points.len());
    let more = match touches.max().filter(|_| is_group) {
        None | Some(0) => String::new(),
        Some(1) => "; 1 touch would tell them apart".to_owned(),
        Some(touches) => format!("; {touches} touches would tell them apart"),
    };
    let (ratio, causes) = (report.gap.ratio, causes(report));
    format!("{gap}, {ratio:.1} × the noise: {causes}{more}")
}

/// What may act, in words, and whether it is all.
pub(crate) fn causes(report: &Report) -> String {
    let known = match report.effects.as_slice() {
        [] => return "no known cause".to_owned(),
        [one] if one.group.len() > 1 => format!("one of {} causes", one.group.len()),
        [one] => vocabulary::short(&one.words()).to_owned(),
        all => format!("{} causes together", all.len()),
    };
    match report.level {
        Level::MainCause => format!("{known}, and a remainder"),
        Level::Pattern => format!("{known} in a small part, the rest unknown"),
        Level::NoGap | Level::Cause | Level::Unknown => known,
    }
}

/// µm of a length in m, µrad of an angle in rad.
pub(crate) fn micro(value: f64) -> String {
    format!("{:.1}", value * 1e6)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bags::Measurement;
    use diagnosis::{Options, diagnose};

    use super::*;

    /// The words of samples whose whole report is kept beside them.
    #[test]
    fn a_sample_in_a_line() {
        let of_sample = |name: &str| {
            let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../bags/samples"));
            let bag = folder.join(format!("{name}.mcap"));
            let session = session_io::measured(&bag, &Measurement::Last, None).expect("a session");
            of(&diagnose(&session.session, &Options::default()).expect("a report"))
        };
        assert_eq!(
            of_sample("ball_check"),
            "gap 12.1 µm rms, 19.8 × the noise: one of 4 causes; 8 touches would tell them apart"
        );
        assert_eq!(
            of_sample("guideway"),
            "gap 4.1 µm rms, 3.6 × the noise: straightness of axis Z"
        );
        assert!(of_sample("guideway_straight").ends_with("no more than the noise"));
    }
}
