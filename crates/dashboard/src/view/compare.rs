//! Two sessions side by side.

use maud::{Markup, html};

use super::hall::group;
use super::numbers::{readable, signed_um, span, um, when};
use super::page::{Frame, Place, frame};
use super::sessions::Listed;
use super::sizes::{Size, judged};
use crate::state::{CellState, wording};

/// A session at its end.
pub struct Compared<'a> {
    /// The recording.
    pub listed: &'a Listed,
    /// Its cell.
    pub cell: &'a CellState,
}

/// The page.
pub fn compare_page(a: &Compared<'_>, b: &Compared<'_>) -> Markup {
    let (sizes_a, sizes_b) = (judged(a.cell), judged(b.cell));
    let mut names: Vec<&str> = sizes_a
        .iter()
        .chain(&sizes_b)
        .map(|one| one.result.feature_id.as_str())
        .collect();
    let mut seen = std::collections::BTreeSet::new();
    names.retain(|name| seen.insert(*name));
    let find =
        |sizes: &[Size<'_>], name: &str| sizes.iter().position(|one| one.result.feature_id == name);
    let body = html! {
        div.title { h1 { "Two sessions" } p.actions { a.button href="/sessions" { "To the sessions" } } }
        section.card aria-labelledby="summary-title" {
            h2 #summary-title { "Summary" }
            div.scroll tabindex="0" role="region" aria-label="Summary of both sessions" { table.compare {
                thead { tr { td {} @for one in [a, b] { th scope="col" { a href={ "/session/" (one.listed.name) } { (readable(&one.listed.name)) } } } } }
                tbody {
                    tr { th scope="row" { "Begin" } @for one in [a, b] { td { (begin(one)) } } }
                    tr { th scope="row" { "Duration" } @for one in [a, b] { td { (length(one)) } } }
                    tr { th scope="row" { "Parts" } @for one in [a, b] { td { (parts(one.cell)) } } }
                    tr { th scope="row" { "Touches" } @for one in [a, b] { td { (one.cell.touch_count) } } }
                    tr { th scope="row" { "Gap" } @for one in [a, b] { td { (gap(one.cell)) } } }
                    tr { th scope="row" { "Causes" } @for one in [a, b] { td { (causes(one.cell)) } } }
                    tr { th scope="row" { "Corrections" } @for one in [a, b] { td { (one.cell.corrections().count()) } } }
                    tr { th scope="row" { "Faults" } @for one in [a, b] { td { (one.cell.faults.len()) } } }
                }
            } }
        }
        section.card aria-labelledby="sizes-title" {
            h2 #sizes-title { "Sizes" }
            div.scroll tabindex="0" role="region" aria-label="Sizes of both sessions" { table.compare {
                thead { tr { th scope="col" { "Feature" } th.number scope="col" { "A: deviation ± U" br; small { "µm" } } th scope="col" { "A: verdict" } th.number scope="col" { "B: deviation ± U" br; small { "µm" } } th scope="col" { "B: verdict" } th.number scope="col" { "B − A" br; small { "µm" } } } }
                tbody { @for name in names {
                    @let left = find(&sizes_a, name).map(|i| &sizes_a[i]);
                    @let right = find(&sizes_b, name).map(|i| &sizes_b[i]);
                    tr { th scope="row" { (name) } (side(left)) (side(right)) td.number { (difference(left, right)) } }
                } }
            } }
            p.note { "B − A with the expanded uncertainty of the difference, the readings taken as independent (GUM, 5.1.2)." }
        }
    };
    frame(
        &Frame {
            title: "Two sessions",
            place: Place::Sessions,
            class: "compare",
            stream: None,
            seen: "",
        },
        &body,
    )
}

fn begin(one: &Compared<'_>) -> Markup {
    html! { @if let Some((begin, _)) = one.listed.bounds { (when(begin)) } }
}

fn length(one: &Compared<'_>) -> String {
    one.listed
        .bounds
        .map_or_else(String::new, |(begin, end)| span(end.since_s(begin)))
}

fn parts(cell: &CellState) -> String {
    let all: Vec<String> = (cell.ended_counts().into_iter())
        .map(|(end, count)| format!("{count} {end}"))
        .collect();
    if all.is_empty() {
        "none ended".to_owned()
    } else {
        all.join(", ")
    }
}

fn gap(cell: &CellState) -> String {
    cell.gap.as_ref().map_or_else(
        || "not diagnosed".to_owned(),
        |gap| {
            let ratio = cell.gap_ratio().map_or_else(String::new, |ratio| {
                format!(", {ratio:.1}\u{a0}×\u{a0}noise")
            });
            format!(
                "{}, {}\u{a0}µm rms{ratio}",
                wording::gap(gap.verdict),
                um(gap.rms)
            )
        },
    )
}

fn causes(cell: &CellState) -> Markup {
    let names = group(cell);
    html! {
        @match names.as_slice() {
            [] => "none",
            [one] => (one),
            several => { "one of " (several.len()) ul.group { @for one in several { li { (one) } } } }
        }
    }
}

fn side(size: Option<&Size<'_>>) -> Markup {
    html! {
        @if let Some(one) = size {
            td.number { (signed_um(one.result.size_deviation)) " ± " (um(one.expanded())) }
            td { span.verdict.(one.class) { (one.says()) } @if let Some(reference) = one.reference() { small { (reference) } } }
        } @else { td.number { "–" } td { "not measured" } }
    }
}

fn difference(a: Option<&Size<'_>>, b: Option<&Size<'_>>) -> String {
    let (Some(a), Some(b)) = (a, b) else {
        return "–".to_owned();
    };
    if (a.result.nominal_size - b.result.nominal_size).abs() > 1e-9 {
        return "other nominal".to_owned();
    }
    let value = b.result.size_deviation - a.result.size_deviation;
    format!(
        "{} ± {}",
        signed_um(value),
        um(a.expanded().hypot(b.expanded()))
    )
}
