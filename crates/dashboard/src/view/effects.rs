//! Charts and tables of the parameters of effects over time.

use std::collections::BTreeMap;

use diagnosis::in_display_units;
use effects::vocabulary;
use graph::Stamp;
use maud::{Markup, html};

use super::numbers::{date, when};
use super::save::save;
use crate::history::{Adoption, Found, Summary};

const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 130.0;
const LEFT: f64 = 12.0;
const EDGE: f64 = 14.0;
/// Below the chart, for its dates.
const FOOT: f64 = 16.0;
/// Sizes of an effect that stand open below its chart.
const UNFOLDED: usize = 4;

/// The size of a parameter of an effect as a person reads it.
pub(super) fn displayed(
    of: &(String, String),
    value: f64,
    unit: &str,
    ci95: Option<[f64; 2]>,
) -> String {
    let text = in_display_units(&of.1, value, unit, ci95).replace("= -", "= −");
    match text.split_once(" = ") {
        // A quantity is not parted at the end of a line.
        Some((name, quantity)) => format!("{name} = {}", quantity.replace(' ', "\u{a0}")),
        None => text,
    }
}

/// The end of an axis: to two digits of what the axis spans.
fn tick(of: &(String, String), value: f64, span: f64, unit: &str) -> String {
    let step = 10_f64.powf(span.log10().floor() - 1.0);
    let text = displayed(of, (value / step).round() * step, unit, None);
    let quantity = text.split_once(" = ").map(|(_, quantity)| quantity);
    quantity.unwrap_or(&text).to_owned()
}

/// What the charts of effects show.
pub(super) struct Charted<'a> {
    /// In the order of time.
    pub(super) sessions: &'a [Summary],
    /// What each of them is, as a plural.
    pub(super) each: &'a str,
    /// Parameters of effects that have changed, and when.
    pub(super) changes: &'a [((String, String), Stamp)],
    pub(super) adoptions: &'a [Adoption],
}

/// A chart and a table of each parameter of an effect.
pub(super) fn effects_of(charted: &Charted<'_>) -> Markup {
    let mut series: BTreeMap<&(String, String), Vec<(&Summary, &Found)>> = BTreeMap::new();
    for session in charted.sessions {
        for (of, found) in &session.effects {
            series.entry(of).or_default().push((session, found));
        }
    }
    html! {
        @if series.is_empty() { p.none { "No session has found an effect." } }
        div.charts { @for (of, found) in &series { figure {
            figcaption { b { (vocabulary::describe(&of.0)) } " " code { (of.0) } }
            (chart(of, charted, found))
            (save(&of.0, &["begin/UTC", "parameter", "value", "unit", "low", "high"], found.iter().map(|(session, one)| saved(of, session, one))))
            details open[found.len() <= UNFOLDED] { summary { "Sizes in " (found.len()) " " (charted.each) } table { thead { tr { th scope="col" { "Begin" } th scope="col" { "Size with 95 % interval" } } } tbody { @for (session, one) in found {
                tr { th scope="row" { (when(session.begin)) } td { (displayed(of, one.value, &one.unit, Some(one.ci95))) @if one.group.len() > 1 { small { "one of " (one.group.len()) " causes" } } } }
            } } } }
        } } }
    }
}

fn saved(of: &(String, String), session: &Summary, one: &Found) -> Vec<String> {
    let [low, high] = one.ci95.map(|end| end.to_string());
    let (begin, value) = (date(session.begin), one.value.to_string());
    vec![begin, of.1.clone(), value, one.unit.clone(), low, high]
}

/// Sizes over time with their intervals; changes as lines.
fn chart(of: &(String, String), charted: &Charted<'_>, found: &[(&Summary, &Found)]) -> Markup {
    let Charted {
        sessions,
        each,
        changes,
        adoptions,
    } = charted;
    let begin = sessions.first().map_or(0, |one| one.begin.0);
    let end = sessions.last().map_or(0, |one| one.begin.0);
    let x = |at: i64| {
        LEFT + (at - begin) as f64 / ((end - begin) as f64).max(1.0) * (WIDTH - 2.0 * LEFT)
    };
    let ends = found.iter().flat_map(|(_, one)| one.ci95);
    let (low, high) = ends
        .filter(|one| one.is_finite())
        .fold((0.0_f64, 0.0_f64), |(low, high), one| {
            (low.min(one), high.max(one))
        });
    let y = |value: f64| {
        EDGE + (high - value) / (high - low).max(f64::MIN_POSITIVE) * (HEIGHT - 2.0 * EDGE)
    };
    html! {
        svg.run viewBox={ "0 0 " (WIDTH) " " (HEIGHT + FOOT) } role="img" aria-label={ (vocabulary::describe(&of.0)) " in " (found.len()) " " (each) "; table below" } {
            line.nominal x1=(LEFT) x2=(WIDTH - LEFT) y1=(y(0.0)) y2=(y(0.0)) {}
            text.axis x=(LEFT - 3.0) y=(y(0.0) + 4.0) text-anchor="end" { "0" }
            @if let (Some(first), Some(last)) = (sessions.first(), sessions.last()) {
                text.axis x=(LEFT) y=(HEIGHT + FOOT - 3.0) { (day(first)) }
                @if day(first) != day(last) { text.axis x=(WIDTH - LEFT) y=(HEIGHT + FOOT - 3.0) text-anchor="end" { (day(last)) } }
            }
            @if let Some((_, one)) = found.first() {
                @if high > 0.0 { text.axis x=(LEFT + 6.0) y=(EDGE - 3.0) { (tick(of, high, high - low, &one.unit)) } }
                @if low < 0.0 { text.axis x=(LEFT + 6.0) y=(HEIGHT - 2.0) { (tick(of, low, high - low, &one.unit)) } }
            }
            @for (_, at) in changes.iter().filter(|one| one.0 == *of) { line.limit x1=(x(at.0)) x2=(x(at.0)) y1="0" y2=(HEIGHT) { title { (date(*at)) ": changed" } } }
            @for one in adoptions.iter().filter(|one| one.effect == of.0) {
                line.done x1=(x(one.at.0)) x2=(x(one.at.0)) y1="0" y2=(HEIGHT) { title { (date(one.at)) ": " (one.description()) } }
                text.axis x=(x(one.at.0) - 4.0) y=(HEIGHT / 2.0) text-anchor="end" { (if one.adopted { "adopted" } else { "taken back" }) }
            }
            @for (session, one) in found {
                line.spread x1=(x(session.begin.0)) x2=(x(session.begin.0)) y1=(y(one.ci95[0])) y2=(y(one.ci95[1])) {}
                circle.value cx=(x(session.begin.0)) cy=(y(one.value)) r="3.5" { title { (date(session.begin)) ": " (displayed(of, one.value, &one.unit, Some(one.ci95))) } }
            }
        }
    }
}

/// UTC day.
pub(super) fn day(session: &Summary) -> String {
    date(session.begin).get(..10).unwrap_or_default().to_owned()
}
