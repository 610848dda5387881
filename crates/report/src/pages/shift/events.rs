//! What happened besides the parts of a shift: faults and stops, corrections, the gap.

use std::collections::BTreeMap;

use probecell_msgs::{
    Correction, CorrectionAcknowledgement as Ack, Fault, GapReport, PartReport, Verdict,
    builtin_interfaces::Time,
};

use super::super::conclusion::short_name;
use super::super::part::{PartSession, subject, um, um_size};
use super::{clock, is_of, run_of, short, span};
use crate::kit::{Page, Table};

/// Corrections that did not help, each named.
const NAMED: usize = 10;

/// Adds what went wrong; `link` gives the address of the page of a part.
pub(super) fn troubles(
    page: &mut Page,
    session: &PartSession,
    parts: &[&PartReport],
    link: &dyn Fn(usize) -> Option<String>,
) {
    page.heading("Faults and stops");
    let table = table_of(session, parts, link);
    if table.rows.is_empty() {
        page.paragraph("No fault, and every part is qualified.");
    } else {
        page.table(&table);
    }
    let mut lacks: Vec<String> = (session.losses.iter())
        .map(|(topic, count)| format!("Messages of {topic} missing from the recording: {count}."))
        .collect();
    lacks.extend(session.damage.iter().map(|damage| format!("{damage}.")));
    page.list(&lacks);
}

/// How many corrections helped, a sentence after a blank; nothing without any.
pub(super) fn in_short(session: &PartSession) -> String {
    let all = written(session);
    let helped = all.iter().filter(|one| one.helped() == Some(true)).count();
    match all.len() {
        0 => String::new(),
        1 => format!(" Of one correction {helped} helped."),
        count => format!(" Of {count} corrections {helped} helped."),
    }
}

/// What a correction that was written has achieved.
struct Achieved<'a> {
    correction: &'a Correction,
    /// Mean error of its features in the next measurement, m; none before that.
    became: Option<f64>,
}

impl Achieved<'_> {
    fn helped(&self) -> Option<bool> {
        let before = self.correction.measured_error.abs();
        self.became.map(|became| became.abs() < before)
    }
}

fn written(session: &PartSession) -> Vec<Achieved<'_>> {
    let mut all: Vec<Achieved<'_>> = Vec::new();
    for correction in &session.corrections {
        let id = &correction.correction_id;
        let is_applied = (session.acknowledgements.iter())
            .any(|one| one.correction_id == *id && one.outcome == Ack::APPLIED);
        if !is_applied || all.iter().any(|one| one.correction.correction_id == *id) {
            continue;
        }
        let stamp = |one: &Verdict| one.header.stamp.nanos();
        let next = correction.feature_ids.iter().filter_map(|feature| {
            let later = session.verdicts.iter().filter(|one| {
                one.feature_id == *feature
                    && one.plan_id != correction.plan_id
                    && stamp(one) > correction.header.stamp.nanos()
            });
            later.min_by_key(|one| stamp(one)).map(|one| one.error)
        });
        let errors: Vec<f64> = next.collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        all.push(Achieved {
            correction,
            became: mean.is_finite().then_some(mean),
        });
    }
    all
}

/// Adds what was corrected, how large the error was on average, and whether it was smaller in the next measurement.
pub(super) fn corrections(page: &mut Page, session: &PartSession) {
    let all = written(session);
    if all.is_empty() {
        return;
    }
    let mut by_subject: BTreeMap<String, Vec<&Achieved<'_>>> = BTreeMap::new();
    for one in &all {
        by_subject
            .entry(subject(one.correction))
            .or_default()
            .push(one);
    }
    let mut table = Table::new(
        "",
        &[
            "corrected",
            "times",
            "error before",
            "promised",
            "became",
            "helped",
        ],
    );
    for (what, own) in by_subject {
        let verified = own.iter().filter(|one| one.became.is_some()).count();
        let helped = own.iter().filter(|one| one.helped() == Some(true)).count();
        let mean = |value: fn(&Achieved<'_>) -> Option<f64>| {
            let values: Vec<f64> = own.iter().filter_map(|one| value(one)).collect();
            let sum: f64 = values.iter().map(|one| one.abs()).sum();
            um_size(sum / values.len() as f64)
        };
        table.row(vec![
            what,
            own.len().to_string(),
            mean(|one| Some(one.correction.measured_error)),
            "0.0 µm".to_owned(),
            mean(|one| one.became),
            format!("{helped} of {verified}"),
        ]);
    }
    page.heading("Corrections").table(&table);
    page.paragraph(
        "Errors are means of magnitudes, before and in the next measurement of the same sizes; a correction promises that none remains.",
    );
    let mut without = all.iter().filter(|one| one.helped() == Some(false));
    let named: Vec<String> = (without.by_ref().take(NAMED))
        .map(|one| {
            let (id, before) = (
                &one.correction.correction_id,
                um(one.correction.measured_error),
            );
            let became = um(one.became.unwrap_or(f64::NAN));
            format!("{id} did not help: {before} became {became}.")
        })
        .collect();
    page.list(&named);
    let more = without.count();
    if more > 0 {
        page.paragraph(&format!("{more} further corrections did not help."));
    }
}

/// Adds the gap of each part's last measurement by its cause, as the cell diagnosed it.
pub(super) fn gaps(page: &mut Page, session: &PartSession, parts: &[&PartReport]) {
    let mut by_cause: BTreeMap<String, Vec<&GapReport>> = BTreeMap::new();
    for part in parts {
        let mut reports = session.gaps.iter();
        let own = reports.rfind(|one| is_of(&one.plan_id, run_of(part)));
        let Some(gap) = own else { continue };
        let effects: Vec<String> = (gap.effects.iter())
            .map(|one| short_name(&one.effect))
            .collect();
        let cause = match gap.verdict {
            GapReport::NO_GAP => "no gap".to_owned(),
            GapReport::UNEXPLAINED => "no known cause".to_owned(),
            GapReport::PARTLY_EXPLAINED => format!("{}, and no known cause", effects.join(", ")),
            _ => effects.join(", "),
        };
        by_cause.entry(cause).or_default().push(gap);
    }
    if by_cause.is_empty() {
        return;
    }
    let mut table = Table::new("", &["parts", "largest gap", "noise", "cause"]);
    for (cause, own) in by_cause {
        let largest = |of: fn(&GapReport) -> f64| own.iter().map(|one| of(one)).fold(0.0, f64::max);
        let effects = own.iter().flat_map(|one| &one.effects);
        let others = effects.map(|one| one.indistinguishable_from.len()).max();
        let others = match others {
            None | Some(0) => String::new(),
            Some(count) => format!(", or one of up to {count} that look the same"),
        };
        table.row(vec![
            own.len().to_string(),
            um_size(largest(|one| one.rms)),
            um_size(largest(|one| one.noise_floor)),
            format!("{cause}{others}"),
        ]);
    }
    page.heading("Gap between machine and model").table(&table);
}

/// Something that went wrong.
struct Trouble {
    /// ns since 1970.
    at: i64,
    what: String,
    cause: String,
    /// It stopped something.
    is_error: bool,
    link: Option<String>,
}

/// Parts that did not end well and faults, each with the time until the next part began.
fn table_of(
    session: &PartSession,
    parts: &[&PartReport],
    link: &dyn Fn(usize) -> Option<String>,
) -> Table {
    let bad = parts.iter().enumerate();
    let bad = bad.filter(|(_, one)| one.verdict != PartReport::QUALIFIED);
    let texts: Vec<&str> = bad.clone().map(|(_, one)| one.text.as_str()).collect();
    let mut all: Vec<Trouble> = bad
        .map(|(index, part)| Trouble {
            at: part.header.stamp.nanos(),
            what: format!("{} {}", short(run_of(part)), part.end()),
            cause: part.text.clone(),
            is_error: true,
            link: link(index),
        })
        .collect();
    // Of one kind the first, and how many there were.
    let mut faults: BTreeMap<(&str, &str), (usize, &Fault)> = BTreeMap::new();
    for fault in &session.faults {
        if !texts.iter().any(|text| text.contains(&fault.text)) {
            let kind = (fault.node.as_str(), fault.code.as_str());
            faults.entry(kind).or_insert((0, fault)).0 += 1;
        }
    }
    for ((node, _), (count, first)) in faults {
        let is_error = first.severity == Fault::ERROR;
        let word = if is_error { "error" } else { "warning" };
        let times = match count {
            1 => String::new(),
            _ => format!(", {count} times"),
        };
        all.push(Trouble {
            at: first.header.stamp.nanos(),
            what: format!("{word} of {node}{times}"),
            cause: first.text.clone(),
            is_error,
            link: None,
        });
    }
    all.sort_by_key(|one| one.at);
    let mut table = Table::new("", &["what", "when", "next part after", "cause"]);
    let first = parts.first().map(|one| one.header.stamp.nanos());
    for (row, one) in all.into_iter().enumerate() {
        if one.is_error {
            table.marked.insert(row);
        }
        table.links.extend(one.link.map(|address| (row, address)));
        let stood = if one.is_error {
            stood(session, one.at)
        } else {
            "–".to_owned()
        };
        let at = clock(Time::from_nanos(one.at), first);
        table.row(vec![one.what, at, stood, one.cause]);
    }
    table
}

/// How long after an instant (ns since 1970) the next part began.
fn stood(session: &PartSession, at: i64) -> String {
    let begins = session.operations.iter();
    let later = begins
        .map(|one| one.header.stamp.nanos())
        .filter(|begin| *begin > at);
    let stops = later.min();
    stops.map_or("none".to_owned(), |next| span((next - at) as f64 * 1e-9))
}
