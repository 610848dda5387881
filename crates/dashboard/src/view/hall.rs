//! The hall: one tile for each cell.

use graph::Stamp;
use maud::{Markup, html};
use probecell_msgs::{MachineState, PartStatus};

use super::gap::unexplained;
use super::numbers::{cell_title, last_word, readable};
use super::page::{Frame, Place, frame};
use super::sizes::worst;
use crate::state::{Attention, CellState, Hall, wording};

/// Effects of a group that are written out on a tile; the rest is counted, and all stand on the page of the cell.
const WRITTEN: usize = 3;

/// Element of the tile of a cell.
pub fn tile_id(name: &str) -> String {
    format!("tile-{}", name.replace('/', "--"))
}

/// Elements of the tiles, those that need a person first.
pub fn order_of(hall: &Hall, now: Stamp) -> Vec<String> {
    let cells = hall.by_attention(now);
    cells.iter().map(|cell| tile_id(&cell.name)).collect()
}

/// Classes of an attention, a sign that does not need colour, and its name.
pub(super) fn attention_of(attention: Attention) -> (&'static str, &'static str, &'static str) {
    match attention {
        Attention::Act => ("act", "■", "Act"),
        Attention::Decide => ("decide", "▲", "Decide"),
        Attention::Look => ("look", "◆", "Look"),
        Attention::Working => ("working", "▶", "Working"),
        Attention::Idle => ("idle", "○", "Idle"),
    }
}

/// What so many cells need, after their number.
fn needs(attention: Attention, name: &str) -> String {
    match attention {
        Attention::Act => "to act on".to_owned(),
        Attention::Decide => "to decide on".to_owned(),
        Attention::Look => "to look at".to_owned(),
        Attention::Working | Attention::Idle => name.to_lowercase(),
    }
}

/// What the cell is doing, in a word.
pub(super) fn doing(cell: &CellState, now: Stamp) -> String {
    if cell.kept {
        return "not live".to_owned();
    }
    if cell.is_stale(now) {
        return "silent".to_owned();
    }
    let machine = cell.machine();
    match machine.map(|one| one.execution) {
        Some(code) if code >= MachineState::EXECUTION_HOLD => wording::execution(code).to_owned(),
        _ if cell.is_making() => PartStatus::word(cell.part.stage).to_owned(),
        Some(code) => wording::execution(code).to_owned(),
        None => "unknown".to_owned(),
    }
}

/// The whole group of causes of the leading effect, in words.
pub(super) fn group(cell: &CellState) -> Vec<String> {
    let report = cell.report.as_ref();
    let Some(first) = report.and_then(|report| report.effects.first()) else {
        return Vec::new();
    };
    let all = if first.group.is_empty() {
        std::slice::from_ref(&first.effect)
    } else {
        &first.group
    };
    all.iter()
        .map(|one| effects::vocabulary::describe(one))
        .collect()
}

/// One tile.
pub fn tile(cell: &CellState, now: Stamp) -> Markup {
    let (attention, why) = cell.attention(now);
    let (class, sign, name) = attention_of(attention);
    let (title, place) = cell_title(&cell.name);
    let machine = cell.machine();
    let waiting = cell.waiting(now).count();
    html! {
        li.tile.(class) id=(tile_id(&cell.name)) data-attention=(class) {
            div.head {
                h2 { a href={ "/cell/" (cell.name) } { (title) } @if !place.is_empty() { small { (place) } } }
                p.badge { span.sign aria-hidden="true" { (sign) } " " span.sr { (name) ": " } (doing(cell, now)) }
            }
            p.why { (why) }
            dl {
                (part(cell))
                @if let Some(machine) = machine.as_ref().filter(|one| !one.program.is_empty()) {
                    div { dt { "Program" } dd { (machine.program) @if machine.line > 0 { " line " (machine.line) } } }
                }
                (verdict(cell))
                @if waiting > 0 { div.mark { dt { "Corrections" } dd { (waiting) " waiting for approval" } } }
                (gap(cell))
                @if let Some(machine) = &machine && !machine.temperatures.is_empty() {
                    div { dt { "Temperature" } dd {
                        @for (index, (name, value)) in machine.temperature_names.iter().zip(&machine.temperatures).enumerate() {
                            @if index > 0 { " · " } (name) " " (format!("{value:.1}"))
                        } " °C"
                    } }
                }
                div.last { dt { "Last message" } dd.age { (last_word(cell, now)) } }
            }
        }
    }
}

fn part(cell: &CellState) -> Markup {
    let part = &cell.part;
    let ended = cell.ended.back();
    html! {
        div { dt { "Part" } dd {
            @if let Some(part) = cell.interrupted() {
                (readable(&part.part_id)) ", interrupted"
            } @else if part.stage == PartStatus::NONE {
                @if let Some(last) = ended { (readable(&last.part_id)) ", " (last.end()) }
                @else { "none yet" }
            } @else {
                (readable(&part.part_id)) ", pass " (part.pass_number + 1)
                @if !part.operation.is_empty() { ", " (part.operation.replace('_', " ")) }
            }
        } }
    }
}

/// The worst of the plan measured last, features without a verdict included, which need not be of the part that is being made.
pub(super) fn verdict(cell: &CellState) -> Markup {
    let Some(worst) = worst(cell) else {
        return html! {};
    };
    html! {
        div { dt { "Worst verdict" } dd {
            span.verdict.(worst.class) { (worst.feature) " " (worst.word) ", " (wording::signed_micrometres(worst.error)) }
            small { (readable(&worst.by)) }
            @if !worst.unjudged.is_empty() { small.mark { (worst.unjudged) } }
        } }
    }
}

/// The gap over its noise, and the leading group of causes.
pub(super) fn gap(cell: &CellState) -> Markup {
    let Some(gap) = &cell.gap else {
        return html! {};
    };
    let names = group(cell);
    html! {
        div { dt { "Gap" } dd {
            @if let Some(ratio) = cell.gap_ratio() { (format!("{ratio:.1}")) " × noise, " }
            (wording::gap(gap.verdict))
            @if !names.is_empty() {
                small title=(names.join("; ")) {
                    @if names.len() > 1 { "one of " }
                    (names.iter().take(WRITTEN).cloned().collect::<Vec<_>>().join("; "))
                    @if names.len() > WRITTEN { "; and " (names.len() - WRITTEN) " more" }
                }
            } @else if let Some(report) = cell.report.as_ref().filter(|one| one.verdict == diagnosis::Verdict::Unexplained) {
                small { "no known cause fits" @let most = unexplained(report); @if !most.is_empty() { "; " (most) } }
            }
        } }
    }
}

/// Sums over the hall and the tiles.
pub(super) fn whole(hall: &Hall, now: Stamp) -> Markup {
    let cells = hall.by_attention(now);
    html! {
        @if cells.is_empty() {
            p.lead.empty { "No cell is on the bus. Start one with " code { "probecell up" } "; it appears here by itself." }
        }
        ul.tiles #tiles { @for cell in &cells { (tile(cell, now)) } }
        @if hall.refused() > 0 { p.mark { (hall.refused()) " further cells are not shown: there are too many." } }
    }
}

/// The page of all cells at an instant, without controls on a `wall`. `seen` identifies the state shown, from which the page
/// subscribes to changes; `bus` says what is wrong with the bus, empty if nothing is.
pub fn hall_page(hall: &Hall, now: Stamp, wall: bool, seen: &str, bus: &str) -> Markup {
    let body = html! {
        div.title {
            h1 { "Hall" }
            p #sums { (sums(hall, now)) }
            p.actions {
                button #resort type="button" hidden { "Sort by urgency" }
                @if wall { a.button href="/" { "Leave wall mode" } } @else { a.button href="/?wall" { "Wall mode" } }
            }
        }
        @if !bus.is_empty() { noscript { p.mark { (bus) } } }
        (whole(hall, now))
    };
    let class = if wall { "hall wall" } else { "hall" };
    frame(
        &Frame {
            title: "Hall",
            place: Place::Hall,
            class,
            stream: Some("/events/hall"),
            seen,
        },
        &body,
    )
}

/// How many cells need what.
pub(crate) fn sums(hall: &Hall, now: Stamp) -> Markup {
    let mut counts = std::collections::BTreeMap::<Attention, usize>::new();
    for cell in hall.cells() {
        *counts.entry(cell.attention(now).0).or_default() += 1;
    }
    html! {
        @for (attention, count) in counts {
            @let (class, sign, name) = attention_of(attention);
            span.sum.(class) { span.sign aria-hidden="true" { (sign) } " " (count) " " (needs(attention, name)) } " "
        }
    }
}
