//! Two sessions side by side, and their touches over one another.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::csv::number;
use super::hall::group;
use super::numbers::{readable, signed_um, span, um, when};
use super::page::{Frame, Place, frame};
use super::save::save;
use super::sessions::Listed;
use super::sizes::{Size, judged};
use crate::state::{CellState, wording};

/// The picture of the touches, in units of its own: its width, half of its height, room for numbers.
const WIDTH: f64 = 840.0;
const MIDDLE: f64 = 90.0;
const LEFT: f64 = 44.0;
const LETTER: f64 = 8.0;

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
                thead { tr { td {} @for (side, one) in [("A", a), ("B", b)] { th scope="col" { (side) " " a href={ "/session/" (one.listed.name) } { (readable(&one.listed.name)) } } } } }
                tbody {
                    tr { th scope="row" { "Begin" } @for one in [a, b] { td { (begin(one)) } } }
                    tr { th scope="row" { "Duration" } @for one in [a, b] { td { (length(one)) } } }
                    tr { th scope="row" { "Parts" } @for one in [a, b] { td { (parts(one.cell)) } } }
                    tr { th scope="row" { "Touches" } @for one in [a, b] { td { (one.cell.touch_count) } } }
                    tr { th scope="row" { "Gap" } @for one in [a, b] { td { (gap(one.cell)) } } }
                    tr { th scope="row" { "Causes" } @for (one, other) in [(a, b), (b, a)] { td { (causes(one.cell, other.cell)) } } }
                    tr { th scope="row" { "Corrections" } @for one in [a, b] { td { (one.cell.corrections().count()) } } }
                    tr { th scope="row" { "Faults" } @for one in [a, b] { td { (one.cell.faults.len()) } } }
                }
            } }
        }
        (touches(a.cell, b.cell))
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

/// A touch by its feature, and its place among the points of that feature.
type Point = (String, usize);

/// Deviation of each touch of the plan measured last, m.
fn deviations(cell: &CellState) -> Vec<(Point, f64)> {
    let Some(plan) = &cell.plan else {
        return Vec::new();
    };
    let mut made = BTreeMap::<usize, usize>::new();
    let each = plan.points.iter().enumerate().filter_map(|(index, point)| {
        let feature = point.feature as usize;
        let place = made.entry(feature).or_default();
        *place += 1;
        let touch = cell.touches.get(&(index as u32))?;
        let name = &plan.features.get(feature)?.id;
        Some(((name.clone(), *place), touch.deviation))
    });
    each.filter(|(_, value)| value.is_finite()).collect()
}

/// The touches that both sessions have, drawn over one another.
fn touches(a: &CellState, b: &CellState) -> Markup {
    let of_b: BTreeMap<Point, f64> = deviations(b).into_iter().collect();
    let both: Vec<_> = (deviations(a).into_iter())
        .filter_map(|(place, value)| {
            let other = *of_b.get(&place)?;
            Some((place, [value, other]))
        })
        .collect();
    let most = both
        .iter()
        .flat_map(|(_, two)| two)
        .fold(1e-9, |most: f64, one| most.max(one.abs()));
    let y = |value: f64| MIDDLE - value / most * (MIDDLE - 10.0);
    let x = |at: usize| LEFT + (WIDTH - LEFT) * (at as f64 + 0.5) / both.len() as f64;
    // A name stands where its feature begins, if the one before leaves room.
    let mut features: Vec<(usize, &str)> = Vec::new();
    for (at, (point, _)) in both.iter().enumerate() {
        let room = |(last, name): &(usize, &str)| x(at) - x(*last) > LETTER * name.len() as f64;
        let begins = at == 0 || both[at - 1].0.0 != point.0;
        if begins && features.last().is_none_or(room) {
            features.push((at, &point.0));
        }
    }
    let saved = both.iter().map(|((feature, place), two)| {
        let [a, b] = two.map(|one| number(Some(one), 1e-6));
        vec![feature.clone(), place.to_string(), a, b]
    });
    html! {
        @if !both.is_empty() {
            section.card aria-labelledby="touches-title" {
                h2 #touches-title { "Deviation of each touch" }
                figure {
                    figcaption { "○ A, ● B · " (both.len()) " touches that both have, µm" }
                    svg.run viewBox={ "0 0 " (WIDTH) " " (2.0 * MIDDLE + 16.0) } role="img" aria-label="Deviation of each touch in both sessions" {
                        line.nominal x1=(LEFT) x2=(WIDTH) y1=(y(0.0)) y2=(y(0.0)) {}
                        @for value in [most, 0.0, -most] { text.axis x=(LEFT - 5.0) y=(y(value) + 4.0) text-anchor="end" { (signed_um(value)) } }
                        @for (at, name) in &features {
                            line.nominal x1=(x(*at) - 4.0) x2=(x(*at) - 4.0) y1="0" y2=(2.0 * MIDDLE) {}
                            text.axis x=(x(*at)) y=(2.0 * MIDDLE + 12.0) { (name) }
                        }
                        @for (at, (place, [a, b])) in both.iter().enumerate() {
                            line.spread x1=(x(at)) x2=(x(at)) y1=(y(*a)) y2=(y(*b)) {}
                            circle.open cx=(x(at)) cy=(y(*a)) r="5" {}
                            circle.value cx=(x(at)) cy=(y(*b)) r="3" { title { (place.0) " " (place.1) ": " (signed_um(*a)) " → " (signed_um(*b)) " µm" } }
                        }
                    }
                    (save("touches", &["feature", "point", "A/um", "B/um"], saved))
                }
            }
        }
    }
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

/// Causes of a gap; bold what the other session does not name.
fn causes(cell: &CellState, other: &CellState) -> Markup {
    let (names, others) = (group(cell), group(other));
    html! {
        @match names.as_slice() {
            [] => "none",
            [one] => (one),
            several => { "one of " (several.len()) ul.group { @for one in several { li { @if others.contains(one) { (one) } @else { b { (one) } small { "only here" } } } } } }
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
