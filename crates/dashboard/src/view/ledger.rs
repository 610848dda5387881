//! The ledger of corrections: promised against achieved.

use graph::Stamp;
use maud::{Markup, html};
use probecell_msgs::{Correction, CorrectionAcknowledgement};

use super::csv::number;
use super::deeds::deed;
use super::numbers::{moment, readable, signed_um, um};
use super::save::save;
use crate::state::{CellState, Entry, wording};

/// Corrections that stand open on the page; those before can be unfolded.
const OPEN: usize = 4;

/// The section, newest first.
pub(super) fn ledger(cell: &CellState, takes_acts: bool, now: Stamp) -> Markup {
    let mut entries: Vec<&Entry> = cell.corrections().rev().collect();
    // What waits for a person stands first.
    entries.sort_by_key(|one| !one.is_waiting(now));
    html! {
        @if entries.is_empty() { p.none { "No correction has been proposed." } }
        @let open = entries.iter().filter(|one| one.is_waiting(now)).count().max(OPEN).min(entries.len());
        @let (new, old) = entries.split_at(open);
        @let list = |entries: &[&Entry]| html! { ol.ledger { @for entry in entries { (item(cell, entry, &deeds(cell, takes_acts, entry, now), now)) } } };
        (course(cell))
        (list(new))
        @if !old.is_empty() { details { summary { (old.len()) " earlier" } (list(old)) } }
    }
}

/// The picture, in units of its own: its width, half of its height, room for numbers.
const WIDTH: f64 = 420.0;
const HALF: f64 = 50.0;
const LEFT: f64 = 44.0;

/// The error before and after each correction that has been measured again, in the order of time.
fn course(cell: &CellState) -> Markup {
    let each = |entry: &Entry| Some((entry.correction.clone(), entry.achieved_error()?));
    let made: Vec<_> = cell.corrections().filter_map(each).collect();
    let errors = made
        .iter()
        .flat_map(|(one, after)| [one.measured_error.abs(), after.abs()]);
    let most = errors.filter(|one| one.is_finite()).fold(1e-9, f64::max);
    let y = |error: f64| HALF + 8.0 - error / most * HALF;
    let x = |at: usize| LEFT + (WIDTH - LEFT) * (at as f64 + 0.5) / made.len() as f64;
    let helped = made
        .iter()
        .filter(|(one, after)| after.abs() < one.measured_error.abs());
    let saved = made.iter().map(|(one, after)| {
        let um = |value: f64| number(Some(value), 1e-6);
        let (before, after) = (um(one.measured_error), um(*after));
        vec![one.correction_id.clone(), changed_by(one), before, after]
    });
    html! {
        @if made.len() > 1 {
            figure {
                figcaption { b { "Error before and after, µm" } " · " (helped.count()) " of " (made.len()) " corrections reduced it" }
                svg.run viewBox={ "0 0 " (WIDTH) " " (2.0 * HALF + 16.0) } role="img" aria-label="Error before and after each correction" {
                    line.nominal x1=(LEFT) x2=(WIDTH) y1=(y(0.0)) y2=(y(0.0)) {}
                    @for error in [most, 0.0, -most] { text.axis x=(LEFT - 5.0) y=(y(error) + 4.0) text-anchor="end" { (signed_um(error)) } }
                    @for (at, (one, after)) in made.iter().enumerate() {
                        @let class = if after.abs() < one.measured_error.abs() { "good" } else { "bad" };
                        line.spread x1=(x(at)) x2=(x(at)) y1=(y(one.measured_error)) y2=(y(*after)) {}
                        circle.open cx=(x(at)) cy=(y(one.measured_error)) r="4" {}
                        circle.value.(class) cx=(x(at)) cy=(y(*after)) r="4" { title { (changed_by(one)) ": " (signed_um(one.measured_error)) " → " (signed_um(*after)) " µm" } }
                    }
                }
                (save("corrections", &["correction", "changes", "before/um", "after/um"], saved))
            }
        }
    }
}

/// What a correction changes.
pub(crate) fn changed_by(correction: &Correction) -> String {
    let features = correction.feature_ids.join(", ");
    match correction.kind {
        Correction::TOOL_WEAR => format!("Wear of tool {} for {features}", correction.tool_number),
        Correction::WORK_OFFSET => format!("Work offset {} for {features}", correction.axis),
        Correction::TOOL_PATH => {
            format!("Tool path of {features}, tool {}", correction.tool_number)
        }
        _ => format!("Volumetric table, {} entries", correction.entries.len()),
    }
}

/// A value of the correction: m unless the axis turns, which only a work offset could.
fn value(metres: f64) -> Markup {
    html! { span.q { (signed_um(metres)) " µm" } }
}

fn item(cell: &CellState, entry: &Entry, deeds: &Markup, now: Stamp) -> Markup {
    let one = &entry.correction;
    let waiting = entry.is_waiting(now);
    let class = state_of(entry, now);
    html! {
        li.(class) {
            h3 { (changed_by(one)) }
            p.change { b { (value(one.previous_value)) " → " (value(one.new_value)) } " within " (value(one.lower_bound)) " to " (value(one.upper_bound)) }
            ol.steps {
                li.done { b { "Proposed" } " " (moment(entry.proposed)) " from " code { (one.plan_id) } ", " (one.sequences.len()) " touches: error " (value(one.measured_error)) ", standard uncertainty " span.q { (um(one.standard_uncertainty)) " µm" } }
                li.(if waiting || one.approval == Correction::APPROVAL_NONE { "open" } else { "done" }) {
                    b { "Approval" } " "
                    @if waiting { "waits: " code { "probecell approve " (one.correction_id) " " span.q { "--operator NAME" } " " span.q { "--cell CELL.toml" } } }
                    @else if one.approval == Correction::APPROVAL_NONE && entry.acknowledgement.is_none() { "expired without one" }
                    @else { (wording::approval(one)) }
                }
                @if let Some(answer) = &entry.acknowledgement {
                    li.(if class == "bad" { "failed" } else { "done" }) {
                        b { "Machine" } " " (wording::outcome(answer.outcome)) ", read back " (value(answer.value_after))
                        @if !answer.text.is_empty() { ": " (answer.text) }
                    }
                }
                (achieved(entry))
            }
            @if let Some(doubt) = cell.doubt().filter(|_| waiting) { p.mark { "Warning: " (doubt) "." } }
            (deeds)
        }
    }
}

/// Buttons of a correction that waits.
fn deeds(cell: &CellState, takes_acts: bool, entry: &Entry, now: Stamp) -> Markup {
    let id = &entry.correction.correction_id;
    html! {
        @if takes_acts && entry.is_waiting(now) {
            p.deeds {
                (deed(cell, "approve", id, "Approve"))
                (deed(cell, "reject", id, "Reject"))
            }
        }
    }
}

fn state_of(entry: &Entry, now: Stamp) -> &'static str {
    let answered = entry.acknowledgement.as_ref().map(|one| one.outcome);
    match answered {
        _ if entry.is_waiting(now) => "unsure",
        Some(CorrectionAcknowledgement::APPLIED | CorrectionAcknowledgement::ALREADY_APPLIED) => {
            "good"
        }
        Some(_) => "bad",
        None if entry.correction.approval == Correction::APPROVAL_REJECTED => "bad",
        None => "",
    }
}

/// A correction promises the error of its source to vanish; the next measurement of the same features says what came of it.
fn achieved(entry: &Entry) -> Markup {
    let one = &entry.correction;
    let refuted = entry.is_refuted();
    let each = html! {
        @for (index, one) in entry.achieved.iter().enumerate() { @if index > 0 { ", " } (one.feature_id) " " (value(one.error)) }
    };
    html! {
        @if let Some(mean) = entry.achieved_error() {
            li.(if refuted { "failed" } else { "done" }) {
                b { "Promised" } " " (value(one.measured_error)) " → 0 µm, " b { "achieved" } " → " b { (value(mean)) } " (" (each) ")"
                @if let Some(first) = entry.achieved.first() { " in " code { (readable(&first.plan_id)) } }
                @if refuted { ", " b { "by readings that the reference contradicts" } ": do not rely on it" }
            }
        } @else if entry.acknowledgement.is_some() {
            li.open { b { "Promised" } " " (value(one.measured_error)) " → 0 µm; the next measurement will tell" }
        }
    }
}
