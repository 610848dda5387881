//! The hall: a tile for each cell, and the controls above them.

use graph::Stamp;
use maud::{Markup, html};

use super::choice::{ATTENTIONS, Choice, ORDERS};
use super::doing::{attention_of, tile_id};
use super::numbers::readable;
use super::page::{Frame, Place, frame};
use super::sizes::worst;
use super::small::{legend, strip_length};
use super::tile::tile;
use crate::state::{Attention, CellState, Hall, wording};

/// Elements of the tiles that were chosen, in their order.
pub fn order_of(hall: &Hall, now: Stamp, choice: &Choice) -> Vec<String> {
    let cells = choice.cells(hall, now);
    cells.iter().map(|cell| tile_id(&cell.name)).collect()
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

/// The tiles that were chosen.
fn tiles(hall: &Hall, now: Stamp, choice: &Choice) -> Markup {
    let cells = choice.cells(hall, now);
    let length = strip_length(hall, now);
    html! {
        @if hall.cells().next().is_none() {
            p.lead.empty { "No cell is on the bus. Start one with " code { "probecell up" } "; it appears here by itself." }
        }
        ul.tiles #tiles { @for cell in &cells { (tile(cell, now, length)) } }
        @if hall.refused() > 0 { p.mark { (hall.refused()) " further cells are not shown: there are too many." } }
    }
}

/// The form that chooses cells and their order.
fn chooser(choice: &Choice) -> Markup {
    html! {
        form.choose #choose action="/" method="get" role="search" aria-label="Machines shown" {
            input type="search" name="q" value=(choice.q) maxlength="64" placeholder="Machine, part, cause" aria-label="Search" autocomplete="off";
            select name="state" aria-label="State" {
                option value="" { "All states" }
                @for one in ATTENTIONS { @let (class, sign, name) = attention_of(one); option value=(class) selected[choice.state == class] { (sign) " " (name) } }
            }
            select name="sort" aria-label="Order" { @for (name, words) in ORDERS { option value=(name) selected[choice.sort == name] { (words) } } }
            @if choice.is_dense() { input type="hidden" name="dense" value=""; }
            button type="submit" { "Show" }
        }
    }
}

/// The page of all cells at an instant, without controls on a wall. `seen` identifies the state shown, from which the page
/// subscribes to changes; `bus` says what is wrong with the bus, empty if nothing is.
pub fn hall_page(hall: &Hall, now: Stamp, choice: &Choice, seen: &str, bus: &str) -> Markup {
    let body = html! {
        div.title {
            h1 { "Hall" }
            p #sums { (sums(hall, now)) }
            (chooser(choice))
            p.actions {
                button #resort type="button" hidden { "Sort" }
                @if choice.is_dense() { a.button href="/" { "Tiles" } } @else { a.button href="/?dense" { "Dense" } }
                @if choice.is_wall() { a.button href="/" { "Leave wall mode" } } @else { a.button href="/?wall" { "Wall" } }
                a.button href={ "/hall.csv" (choice.query()) } download { "CSV" }
            }
        }
        @if !bus.is_empty() { noscript { p.mark { (bus) } } }
        (tiles(hall, now, choice))
        (legend(strip_length(hall, now)))
    };
    let stream = format!("/events/hall{}", choice.query());
    frame(
        &Frame {
            title: "Hall",
            place: Place::Hall,
            class: choice.class(),
            stream: Some(&stream),
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
            span.sum.(class) { span.sign aria-hidden="true" { (sign) } " " (count) " " (name.to_lowercase()) } " "
        }
    }
}
