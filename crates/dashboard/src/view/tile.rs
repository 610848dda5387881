//! One cell of the hall: what it does, what it needs, how its parts are and why they differ.

use diagnosis::report::{Effect, ParameterEstimate};
use effects::vocabulary;
use graph::Stamp;
use maud::{Markup, html};
use probecell_msgs::PartStatus;

use super::doing::{attention_of, doing, tile_id};
use super::numbers::{cell_title, last_word, readable};
use super::sizes::{Worst, worst};
use super::small::{bar, gaps, sizes, strip};
use crate::state::{CellState, wording};

/// One tile. `length`: what its strip shows, s back from `now`.
pub fn tile(cell: &CellState, now: Stamp, length: f64) -> Markup {
    let (attention, why) = cell.attention(now);
    let (class, sign, name) = attention_of(attention);
    let (title, place) = cell_title(&cell.name);
    let worst = worst(cell);
    html! {
        li.tile.(class) id=(tile_id(&cell.name)) data-attention=(class) {
            div.head {
                span.sign aria-hidden="true" { (sign) }
                h2 { a href={ "/cell/" (cell.name) } { (title) } @if !place.is_empty() { small { (place) } } @if let Some(version) = cell.other_version() { small.version title="version of probecell, another than that of this page" { (version) } } }
                p.badge { span.sr { (name) ": " } (doing(cell, now)) }
            }
            p.why title=(why) { (why) }
            p.line.made {
                span { (part(cell)) }
                @if cell.is_stale(now) { span { (last_word(cell, now)) } }
                @else if let Some(one) = worst.as_ref().filter(|one| one.doubtful > 0) { span.mark title=(one.unjudged) { (one.doubtful) " not judged" } }
            }
            (characteristic(worst.as_ref()))
            div.sparks {
                @if let Some(limits) = worst.as_ref().and_then(|one| one.limits) {
                    figure.of-sizes { (tolerance(worst.as_ref(), limits)) (sizes(cell)) }
                } @else { span {} }
                (gaps(cell))
            }
            (named(cell))
            (strip(cell, now, length))
        }
    }
}

fn part(cell: &CellState) -> Markup {
    let part = &cell.part;
    html! {
        @if let Some(part) = cell.interrupted() { (readable(&part.part_id)) ", interrupted" }
        @else if part.stage != PartStatus::NONE { (readable(&part.part_id)) ", pass " (part.pass_number + 1) }
        @else if let Some(last) = cell.ended.back() { (readable(&last.part_id)) ", " (last.end()) }
        @else { "no part yet" }
    }
}

/// The worst characteristic of the plan measured last.
fn characteristic(worst: Option<&Worst>) -> Markup {
    let Some(worst) = worst else {
        return html! { p.line.none { "nothing measured yet" } };
    };
    html! {
        p.line {
            span.verdict.(worst.class) title={ (worst.feature) " " (worst.word) } { span.sign aria-hidden="true" { (sign_of(worst.class)) } " " (worst.feature) span.word { " " (worst.word) } }
            b { (wording::signed_micrometres(worst.error)) }
        }
    }
}

/// The same on its tolerance.
fn tolerance(worst: Option<&Worst>, limits: (f64, f64)) -> Markup {
    html! { @if let Some(worst) = worst { (bar(worst.class, worst.error, worst.expanded, limits)) } }
}

/// A sign of a class of verdicts that does not need colour.
pub(super) fn sign_of(class: &str) -> &'static str {
    match class {
        "good" => "✓",
        "unsure" => "◆",
        "bad" => "✕",
        _ => "·",
    }
}

/// The leading cause of the gap, and its size or how many others it may be; none where the diagnosis names none.
fn cause_and_size(cell: &CellState) -> Option<(String, String)> {
    let first = cell.report.as_deref()?.effects.first()?;
    let size = match first.group.len() {
        0 | 1 => size(first).unwrap_or_default(),
        2 => "or 1 other".to_owned(),
        count => format!("or {} others", count - 1),
    };
    Some((name_of(first), size))
}

/// The same in one text.
pub(crate) fn cause(cell: &CellState) -> Option<String> {
    cause_and_size(cell).map(|(name, size)| format!("{name} {size}").trim_end().to_owned())
}

fn named(cell: &CellState) -> Markup {
    html! {
        @if let Some((name, size)) = cause_and_size(cell) {
            p.line.named title={ (name) " " (size) } { span { (name) } b { (size) } }
        } @else { p.line.named { (no_cause(cell)) } }
    }
}

/// The cause in the fewest words.
fn name_of(effect: &Effect) -> String {
    vocabulary::short(&effect.words()).to_owned()
}

/// The largest of its fitted parameters that have the unit of the first.
fn size(effect: &Effect) -> Option<String> {
    let is_fitted = |one: &&ParameterEstimate| one.ci95[1] > one.ci95[0];
    let fitted = effect.parameters.iter().filter(is_fitted);
    let unit = &fitted.clone().next()?.unit;
    let alike = fitted.filter(|one| one.unit == *unit);
    let largest = alike.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))?;
    let ci95 = Some(largest.ci95);
    let text = diagnosis::in_display_units(&largest.name, largest.value, &largest.unit, ci95);
    // Rounded by its uncertainty, which stands on the page of the cell.
    let (_, quantity) = text.split_once(" = ")?;
    let (value, rest) = quantity.split_once(" ± ")?;
    let unit = rest.trim_start_matches(|letter: char| letter.is_ascii_digit() || letter == '.');
    Some(format!("{value}{unit}").replace('-', "−"))
}

/// Why no cause stands there.
fn no_cause(cell: &CellState) -> &'static str {
    match &cell.gap {
        None => "not diagnosed yet",
        Some(gap) => wording::gap(gap.verdict),
    }
}
