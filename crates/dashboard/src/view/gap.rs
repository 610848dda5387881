//! The gap report: how large, why, what to do, what to measure next.

use diagnosis::report::Place;
use diagnosis::{Report, Verdict, in_display_units};
use effects::vocabulary;
use maud::{Markup, html};

use super::deeds::deed;
use super::numbers::{minus, probability, um};
use crate::state::{CellState, wording};

/// Places shown of where the gap is.
const PLACES: usize = 4;

/// The section.
pub(super) fn gap(cell: &CellState, takes_acts: bool) -> Markup {
    let Some(gap) = &cell.gap else {
        return html! { p.none { "No measurement has been diagnosed yet." } };
    };
    html! {
        p.headline {
            b { (wording::gap(gap.verdict)) }
            @if let Some(ratio) = cell.gap_ratio() { ", " b { (format!("{ratio:.1}")) " × noise" } }
            small { (um(gap.rms)) " µm rms over a noise of " (um(gap.noise_floor)) " µm, " (gap.samples) " touches of " code { (gap.plan_id) } }
        }
        @if let Some(report) = &cell.report { (in_full(report, &|number| deeds(cell, takes_acts, report, number))) }
    }
}

/// The button that has the touches of a proposal taken.
fn deeds(cell: &CellState, takes_acts: bool, report: &Report, number: usize) -> Markup {
    let asked = &report.next_measurement[number].plan;
    html! { @if takes_acts && asked.is_some() { p.deeds { (deed(cell, "next", &number.to_string(), "Take these touches")) } } }
}

fn in_full(report: &Report, deeds: &dyn Fn(usize) -> Markup) -> Markup {
    html! {
        (what_to_do(report))
        @for (number, effect) in report.effects.iter().enumerate() {
            @let group = if effect.group.is_empty() { std::slice::from_ref(&effect.effect) } else { &effect.group };
            div.cause {
                h3 {
                    @if group.len() > 1 { "One of " (group.len()) " causes" } @else { (capital(&vocabulary::describe(&effect.effect))) }
                    small { "probability " (probability(effect.probability)) ", " (um(effect.rms_before)) " → " (um(effect.rms_after)) " µm on touches not used for the fit" }
                }
                @if group.len() > 1 {
                    p.note { "These touches cannot tell which of them acts, so none of them is to be repaired or adopted yet." }
                }
                ul.group { @for one in group {
                    li {
                        (capital(&vocabulary::describe(one))) " " code { (one) }
                        @for parameter in parameters(report, number, one) {
                            " " small { (parameter) }
                        }
                    }
                } }
            }
        }
        @if report.effects.is_empty() && report.verdict == Verdict::NoGap { p { "The cell does what its model says, as far as this measurement can see." } }
        @if report.unexplained.rms > 0.0 { p { b { (um(report.unexplained.rms)) " µm rms" } " stay unexplained." @if !unexplained(report).is_empty() { " Of that " (unexplained(report)) "." } } }
        @if !report.unexplained.ladder.is_empty() {
            p.note { "Known effects that could explain it, which these touches do not prove:" }
            ul.group { @for rung in &report.unexplained.ladder { li { (capital(&vocabulary::describe(&rung.effect))) " " code { (rung.effect) } " " small { (um(rung.rms_before)) " → " (um(rung.rms_after)) " µm" } } } }
        }
        (place(report))
        (next(report, deeds))
        @for warning in &report.warnings { p.note { "Note: " (minus(warning)) "." } }
    }
}

/// The next step in a sentence: the remedy where a single cause is left, else the touches that part the causes.
fn what_to_do(report: &Report) -> Markup {
    let single = (report.effects.iter()).filter(|one| one.group.len() <= 1);
    let remedies: Vec<(String, &str)> = single
        .filter_map(|one| {
            let name = capital(&vocabulary::describe(&one.effect));
            Some((name, vocabulary::remedy(&one.effect)?))
        })
        .collect();
    let rivals = report.effects.iter().any(|one| one.group.len() > 1);
    let touches = (report.next_measurement.iter()).find(|one| !one.points.is_empty());
    let unknown = matches!(
        report.verdict,
        Verdict::Unexplained | Verdict::PartlyExplained
    );
    html! {
        @if !remedies.is_empty() || rivals || unknown {
            div.todo {
                h3 { "What to do" }
                @for (name, remedy) in &remedies { p { (name) ". Remedy: " b { (remedy) } } }
                @if rivals {
                    @if let Some(next) = touches { p { b { "Take the " (next.points.len()) " touches below" } ": they tell causes apart that those made so far cannot." } }
                    @else { p { b { "Repair nothing of a group yet" } ": these touches cannot tell its causes apart, and no reachable touch would." } }
                }
                @if unknown {
                    @if let (false, Some(next)) = (rivals, touches) { p { b { "Take the " (next.points.len()) " touches below" } ": they tell more of what no known cause explains." } }
                    @else if !rivals { p { b { "Measure this part again" } ": what comes back at the same touches is no scatter. Then look at what touches it" @if let Some(first) = report.unexplained.place.first() { ", at " (where_is(first)) " first" } ": chips, clamping, surface." } }
                }
            }
        }
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// The parameters as if member `one` of the group of effect number `effect` were the cause.
fn parameters(report: &Report, effect: usize, one: &str) -> Vec<String> {
    let effect = &report.effects[effect];
    let alternative = effect.alternatives.iter().find(|other| other.effect == one);
    let own = (effect.effect == one).then_some(&effect.parameters);
    let all = own.or(alternative.map(|other| &other.parameters));
    let all = all.into_iter().flatten();
    all.map(|one| {
        in_display_units(&one.name, one.value, &one.unit, Some(one.ci95)).replace("= -", "= −")
    })
    .collect()
}

fn place(report: &Report) -> Markup {
    let shares = shares(&report.place, PLACES);
    html! { @if !shares.is_empty() { p { b { "Where" } " " (shares) } } }
}

/// Where the largest shares of a gap are.
fn shares(places: &[Place], most: usize) -> String {
    let places = places.iter().filter(|one| one.share > 0.0).take(most);
    let shares = places.map(|one| format!("{:.0} % at {}", one.share * 100.0, where_is(one)));
    shares.collect::<Vec<_>>().join(", ")
}

/// Where most of what no known cause explains is; empty where the report does not say.
pub(super) fn unexplained(report: &Report) -> String {
    shares(&report.unexplained.place, 2)
}

/// A place as people call it. Of a range on the part its ends; the unit of an axis is not known here.
fn where_is(place: &Place) -> String {
    let key = match place.dimension.as_str() {
        "feature" => place.key.clone(),
        "region" if place.key.starts_with("part ") => {
            let ends = place.from.zip(place.to);
            let ends = ends.map(|(from, to)| format!(" {:.0} to {:.0} mm", from * 1e3, to * 1e3));
            format!("{}{}", place.key, ends.unwrap_or_default())
        }
        dimension => format!("{dimension} {}", place.key),
    };
    key.replace(" -", " −")
}

fn next(report: &Report, deeds: &dyn Fn(usize) -> Markup) -> Markup {
    html! {
        @for (number, next) in report.next_measurement.iter().enumerate() {
            details.next open {
                summary { b { "Measure next" } " " (next.points.len()) " touches: " (format!("{:.0} %", next.chance * 100.0)) " chance that one explanation remains" }
                table.points {
                    thead { tr { th scope="col" { "Feature" } th.number scope="col" { "Position" br; small { "mm" } } th.number scope="col" { "Rotary axes" br; small { "°" } } th.number scope="col" { "Feed" br; small { "mm/min" } } th scope="col" { "Why" } } }
                    tbody { @for point in &next.points {
                        tr {
                            th scope="row" { (point.feature) }
                            td.number { (point.position.map(|one| format!("{:.2}", one * 1e3)).join(", ").replace('-', "−")) }
                            td.number { (point.rotary_positions.iter().map(|one| format!("{:.1}", one.to_degrees())).collect::<Vec<_>>().join(", ").replace('-', "−")) }
                            td.number { (format!("{:.0}", point.feed * 6e4)) }
                            td { (point.why) }
                        }
                    } }
                }
                @if !next.inseparable.is_empty() {
                    p.note { "No reachable touch tells these apart:" }
                    ul.group { @for pair in &next.inseparable { li { (capital(&pair.iter().map(|one| vocabulary::describe(one)).collect::<Vec<_>>().join(" and "))) } } }
                }
                (deeds(number))
            }
        }
    }
}
