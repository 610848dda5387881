//! The gap report in full: every cause, where, what to measure next; and what to do.

use diagnosis::report::{Effect, NextMeasurement, Place};
use diagnosis::{Report, Verdict, in_display_units};
use effects::vocabulary;
use maud::{Markup, html};

use super::deeds::deed;
use super::numbers::{minus, probability, um};
use crate::state::CellState;

/// Places shown of where the gap is.
const PLACES: usize = 4;

/// The section.
pub(super) fn gap(cell: &CellState, takes_acts: bool) -> Markup {
    html! {
        @if let Some(report) = &cell.report { (in_full(report, &|number| deeds(cell, takes_acts, report, number))) }
        @else { p.none { "No measurement has been diagnosed yet." } }
    }
}

/// The button that has the touches of a proposal taken.
fn deeds(cell: &CellState, takes_acts: bool, report: &Report, number: usize) -> Markup {
    let asked = &report.next_measurement[number].plan;
    html! { @if takes_acts && asked.is_some() { p.deeds { (deed(cell, "next", &number.to_string(), "Take these touches")) } } }
}

fn in_full(report: &Report, deeds: &dyn Fn(usize) -> Markup) -> Markup {
    html! {
        @for (number, effect) in report.effects.iter().enumerate() {
            @let group = if effect.group.is_empty() { std::slice::from_ref(&effect.effect) } else { &effect.group };
            div.cause {
                h3 {
                    @if group.len() > 1 { "One of " (group.len()) " causes" } @else { (capital(&effect.words())) }
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

/// A step that a diagnosis asks for, with the square of the gap that it is about.
struct Step {
    energy: f64,
    text: Markup,
}

/// The next steps, those first that are about most of the gap: the remedy where a single cause is left, else the touches that part
/// the causes.
pub(super) fn what_to_do(report: &Report) -> Markup {
    let mut steps = steps(report);
    steps.sort_by(|a, b| b.energy.total_cmp(&a.energy));
    html! {
        @if !steps.is_empty() {
            div.todo {
                h3 { "What to do" }
                @for step in &steps { p { (step.text) } }
            }
        }
    }
}

fn steps(report: &Report) -> Vec<Step> {
    let touches = (report.next_measurement.iter()).find(|one| !one.points.is_empty());
    let energy = |one: &Effect| one.rms_before.powi(2) - one.rms_after.powi(2);
    let whole: f64 = report.effects.iter().map(|one| energy(one).max(0.0)).sum();
    let whole = whole + report.unexplained.rms.powi(2);
    let share = |part: f64| match 100.0 * part.max(0.0) / whole {
        percent if percent.is_finite() => format!("{percent:.0} % of the gap"),
        _ => "part of the gap".to_owned(),
    };
    let mut steps: Vec<Step> = Vec::new();
    for one in report.effects.iter().filter(|one| one.group.len() <= 1) {
        let remedy = match &one.joint_zero {
            Some(_) => one.remedy(),
            None => vocabulary::remedy(&one.effect).map(str::to_owned),
        };
        let Some(remedy) = remedy else {
            continue;
        };
        let name = capital(&one.words());
        steps.push(Step {
            energy: energy(one),
            text: html! { (name) ", " (share(energy(one))) ". Remedy: " b { (remedy) } },
        });
    }
    let rivals = || report.effects.iter().filter(|one| one.group.len() > 1);
    let of_rivals: f64 = rivals().map(energy).sum();
    let is_ambiguous = rivals().next().is_some();
    if is_ambiguous {
        let text = if let Some(next) = touches {
            html! {
                b { "Take the " (next.points.len()) " touches below" } ": " (format!("{:.0} %", next.chance * 100.0)) " chance that one cause remains of those that make " (share(of_rivals)) "."
            }
        } else {
            html! {
                b { "Repair nothing of a group yet" } ": no touch in reach decides between causes of " (share(of_rivals)) "."
            }
        };
        steps.push(Step {
            energy: of_rivals,
            text,
        });
    }
    let unknown = matches!(
        report.verdict,
        Verdict::Unexplained | Verdict::PartlyExplained
    );
    if unknown {
        let text = match touches {
            Some(next) if !is_ambiguous => Some(html! {
                b { "Take the " (next.points.len()) " touches below" } ": they tell more of what no known cause explains."
            }),
            _ if !is_ambiguous => Some(html! {
                b { "Measure this part again" } ": what comes back at the same touches is no scatter. Then look at what touches it" @if let Some(first) = report.unexplained.place.first() { ", at " (where_is(first)) " first" } ": chips, clamping, surface."
            }),
            _ => None,
        };
        steps.extend(text.map(|text| Step {
            energy: report.unexplained.rms.powi(2),
            text,
        }));
    }
    steps
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
    // Where there is no gap nothing has to be measured.
    let no_gap = report.verdict == Verdict::NoGap;
    html! {
        @for (number, next) in report.next_measurement.iter().enumerate() {
            details.next open[!no_gap] {
                summary { b { (if no_gap { "To be surer still, measure next" } else { "Measure next" }) } " " (counted_touches(next.points.len())) ": " (format!("{:.0} %", next.chance * 100.0)) " chance that one cause remains" }
                (points(next))
                @if !next.inseparable.is_empty() {
                    p.note { "No reachable touch tells these apart:" }
                    ul.group { @for pair in &next.inseparable { li { (capital(&pair.iter().map(|one| vocabulary::describe(one)).collect::<Vec<_>>().join(" and "))) } } }
                }
                (deeds(number))
            }
        }
    }
}

fn counted_touches(count: usize) -> String {
    format!("{count} {}", if count == 1 { "touch" } else { "touches" })
}

/// The touches of a proposal. Rotary axes have the names of its plan; a machine without them has no column.
fn points(next: &NextMeasurement) -> Markup {
    let names = next
        .plan
        .as_ref()
        .map_or(&[][..], |plan| &plan.rotary_names);
    let turned = (next.points.iter()).any(|point| !point.rotary_positions.is_empty());
    let angles = |positions: &[f64]| {
        let each = positions.iter().enumerate().map(|(index, one)| {
            let name = names
                .get(index)
                .map_or(String::new(), |name| format!("{name} "));
            format!("{name}{:.1}", one.to_degrees())
        });
        each.collect::<Vec<_>>().join(", ").replace('-', "−")
    };
    html! {
        table.points {
            thead { tr { th scope="col" { "Feature" } th.number scope="col" { "Position x, y, z" br; small { "mm" } } @if turned { th.number scope="col" { "Rotary axes" br; small { "°" } } } th.number scope="col" { "Feed" br; small { "mm/min" } } th scope="col" { "Why" } } }
            tbody { @for point in &next.points {
                tr {
                    th scope="row" { (point.feature) }
                    td.number data-label="x, y, z / mm" { (point.position.map(|one| format!("{:.2}", one * 1e3)).join(", ").replace('-', "−")) }
                    @if turned { td.number data-label="Rotary axes / °" { (angles(&point.rotary_positions)) } }
                    td.number data-label="Feed / mm/min" { (format!("{:.0}", point.feed * 6e4)) }
                    td data-label="Why" { (point.why) }
                }
            } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        let effect = |name: &str, before: f64, after: f64, group: &[&str]| {
            serde_json::json!({
                "effect": name, "probability": 0.99, "parameters": [], "rms_before": before, "rms_after": after,
                "ci95_after": [after, after], "held_out": true, "indistinguishable_from": [], "group": group,
            })
        };
        let report = serde_json::json!({
            "schema": "probecell/gap-report/1", "bag": "b", "samples": 20, "verdict": "explained",
            "gap": { "unit": "m", "rms": 20e-6, "noise_floor": 1e-6, "ratio": 20.0 }, "where": [],
            "effects": [
                effect("axis.Z.straightness", 4e-6, 1e-6, &[]),
                effect("axis.X.scale", 20e-6, 4e-6, &[]),
            ],
            "unexplained": { "rms": 0.0, "where": [] }, "rejected": [], "next_measurement": [], "warnings": [],
        });
        serde_json::from_value(report).unwrap()
    }

    #[test]
    fn what_to_do_begins_with_the_cause_of_most_of_the_gap() {
        let page = what_to_do(&report()).into_string();
        let place = |effect: &str| page.find(&capital(&vocabulary::describe(effect))).unwrap();
        assert!(
            place("axis.X.scale") < place("axis.Z.straightness"),
            "{page}"
        );
        assert!(
            page.contains("96 % of the gap") && page.contains("4 % of the gap"),
            "{page}"
        );
        // Causes that cannot be told apart stand before the remedy of a minor one as well.
        let mut ambiguous = report();
        ambiguous.effects[1].group = vec!["axis.X.scale".to_owned(), "axis.X.lag".to_owned()];
        let page = what_to_do(&ambiguous).into_string();
        assert!(
            page.find("Repair nothing of a group").unwrap() < page.find("Remedy").unwrap(),
            "{page}"
        );
    }
}
