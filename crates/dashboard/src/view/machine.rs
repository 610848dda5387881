//! A machine over its recordings: effects, temperatures, capability of each day, changes and what was done then.

use std::collections::BTreeMap;

use effects::vocabulary;
use graph::Stamp;
use maud::{Markup, html};

use super::effects::{Charted, day, displayed, effects_of};
use super::months::months;
use super::numbers::{counted, mm, signed_um, um, when};
use super::page::{Frame, Place, frame};
use super::runs::{cpk, no_index};
use crate::history::{Adoption, Change, Sized, Summary, adoptions, changes};
use crate::state::Characteristic;
use crate::trends::Months;
use metrology::capability::{Capability, capability};

pub(super) fn whole(title: &str, body: &Markup) -> Markup {
    let page = Frame {
        title,
        place: Place::Sessions,
        class: "machine",
        stream: None,
        seen: "",
    };
    frame(&page, body)
}

pub(super) fn still_reading(unread: usize) -> Markup {
    html! { @if unread > 0 { p.mark { (counted(unread, "recording")) " not read yet: load the page again." } } }
}

/// The page of a machine. `sessions`: in the order of time.
/// `of_lake`: what a lake tells of it, where there is one.
pub(crate) fn machine_page(
    name: &str,
    sessions: &[Summary],
    unread: usize,
    of_lake: Option<Result<&Months, &str>>,
) -> Markup {
    let (changes, adoptions) = (changes(sessions), adoptions(sessions));
    let marks: Vec<_> = (changes.iter())
        .map(|one| (one.of.clone(), one.at))
        .collect();
    let body = html! {
        div.title { h1 { (name) } p { (counted(sessions.len(), "recording")) @if let (Some(first), Some(last)) = (sessions.first(), sessions.last()) { ", " (when(first.begin)) " to " (when(last.begin)) } } p.actions { a.button href="/machines" { "Machines" } } }
        (still_reading(unread))
        section.card aria-labelledby="changes-title" { h2 #changes-title { "Changes" } (change_list(&changes, &adoptions)) }
        section.card aria-labelledby="effects-title" { h2 #effects-title { "Effects" } (effects_of(&Charted { sessions, each: "sessions", changes: &marks, adoptions: &adoptions })) }
        @if let Some(months_of) = of_lake { (months(months_of)) }
        section.card aria-labelledby="days-title" { h2 #days-title { "Capability, over all and per day" } (days(sessions)) }
        section.card aria-labelledby="kept-title" { h2 #kept-title { "Promised and achieved" } (kept(sessions)) }
        section.card aria-labelledby="all-title" { h2 #all-title { "Recordings" } (all(sessions)) }
    };
    whole(name, &body)
}

fn change_list(changes: &[Change], adoptions: &[Adoption]) -> Markup {
    let mut rows: Vec<(Stamp, Markup)> = changes.iter().map(|one| (one.at, change(one))).collect();
    rows.extend(adoptions.iter().map(|one| (one.at, adoption(one))));
    rows.sort_by_key(|(at, _)| *at);
    html! {
        @if rows.is_empty() { p.none { "No parameter of an effect has changed beyond its intervals, and the model is the same throughout." } }
        ul.faults { @for (_, row) in &rows { (row) } }
        p.note { "A change is where the 95 % intervals of two successive sessions that found the effect exclude one another, or where the model of the machine was changed." }
    }
}

pub(super) fn change(one: &Change) -> Markup {
    let [before, after] = one.found.each_ref().map(|found| {
        let name = format!("{} = ", one.of.1);
        let text = displayed(&one.of, found.value, &found.unit, Some(found.ci95));
        text.trim_start_matches(&name).to_owned()
    });
    html! {
        li.unsure { (when(one.at)) " " b { (vocabulary::describe(&one.of.0)) } ": " (one.of.1) " = " (before) " → " (after)
            @if one.done.is_empty() { small { "The recordings do not tell of anything that was done between: service, collision, temperature?" } }
            @else { small { "Done since the session before:" } }
            @for done in &one.done { small { (done) } }
        }
    }
}

fn adoption(one: &Adoption) -> Markup {
    html! {
        li.good { (when(one.at)) " " b { (one.description()) }
            @if let [Some(before), Some(after)] = one.ratios { ": gap " (format!("{before:.1} → {after:.1}")) " × noise" }
            @if !one.kept.is_empty() { small { (one.kept) } }
        }
    }
}

/// Sizes of each characteristic, by day.
type Days<'a> = BTreeMap<String, Vec<&'a Sized>>;

fn days(sessions: &[Summary]) -> Markup {
    let mut all: BTreeMap<&Characteristic, Days<'_>> = BTreeMap::new();
    for session in sessions {
        for (key, made) in &session.sizes {
            let of_day = all.entry(key).or_default().entry(day(session)).or_default();
            of_day.extend(made);
        }
    }
    html! {
        @if all.is_empty() { p.none { "No size was measured." } }
        @for (key, days) in &all {
            @let whole: Vec<&Sized> = days.values().flatten().copied().collect();
            details open[all.len() == 1] {
                summary { b { (key.1) } " " small { (key.0) ", nominal " (mm(key.2 as f64 * 1e-9)) " mm:" } " " (in_words(&whole)) }
                div.scroll tabindex="0" role="group" aria-label={ "Table of days of " (key.1) } { table {
                    thead { tr { th scope="col" { "Day" } th.number scope="col" { "Parts" } th.number scope="col" { "Mean, µm" } th.number scope="col" { "s, µm" } th.number scope="col" { "Cpk (95 %)" } } }
                    tbody { @for (day, made) in days {
                        @let index = capable(made);
                        @let sound = sound(made);
                        tr { th scope="row" { (day) } td.number { (made.len()) @if made.len() > sound.len() { small { (made.len() - sound.len()) " contradicted" } } } td.number { (signed_um(mean(if sound.is_empty() { made } else { &sound }))) }
                            @if let Some(one) = index { td.number { (um(one.deviation)) } td.number { (cpk(&one)) } } @else { td.number { "–" } td { (no_index(sound.len(), limits_of(made).is_some())) } }
                        }
                    } }
                } }
            }
        }
    }
}

/// All parts of a characteristic.
fn in_words(made: &[&Sized]) -> String {
    let sound = sound(made);
    let doubted = match made.len() - sound.len() {
        0 => String::new(),
        1 => ", of which 1 is not counted: a reference contradicts the readings".to_owned(),
        count => {
            format!(", of which {count} are not counted: a reference contradicts the readings")
        }
    };
    let parts = counted(made.len(), "part");
    if sound.is_empty() {
        return format!("{parts}{doubted}");
    }
    let what = format!("{parts}{doubted}, mean {} µm", signed_um(mean(&sound)));
    capable(made).map_or_else(
        || {
            let why = no_index(sound.len(), limits_of(made).is_some());
            format!("{what}, no Cpk: {why}")
        },
        |one| format!("{what}, s {} µm, Cpk {}", um(one.deviation), cpk(&one)),
    )
}

/// Those whose readings no reference contradicts.
fn sound<'a>(made: &[&'a Sized]) -> Vec<&'a Sized> {
    let all = made.iter().copied();
    all.filter(|one| !one.contradicted).collect()
}

fn mean(made: &[&Sized]) -> f64 {
    made.iter().map(|one| one.deviation).sum::<f64>() / made.len() as f64
}

/// By which the newest part was judged.
fn limits_of(made: &[&Sized]) -> Option<(f64, f64)> {
    made.last().and_then(|one| one.limits)
}

fn capable(made: &[&Sized]) -> Option<Capability> {
    let values: Vec<f64> = sound(made).iter().map(|one| one.deviation).collect();
    let (lower, upper) = limits_of(made)?;
    capability(&values, lower, upper)
}

fn kept(sessions: &[Summary]) -> Markup {
    let any = sessions
        .iter()
        .any(|one| !one.applied.is_empty() || !one.declared.is_empty());
    html! {
        @if !any { p.none { "No correction was applied, and no effect is declared." } }
        ul.faults { @for session in sessions {
            @for one in &session.applied { li { (when(session.begin)) " " (one) } }
            @for (effect, text) in &session.declared { li { (when(session.begin)) " Declared: " (vocabulary::describe(effect)) ", " (text) } }
        } }
    }
}

fn all(sessions: &[Summary]) -> Markup {
    html! { div.scroll tabindex="0" role="group" aria-label="Table of recordings" { table.upright {
        thead { tr { th scope="col" { "Recording" } th scope="col" { "Begin" } th.number scope="col" { "Gap / noise" } th scope="col" { "Offsets at the end, µm" } th scope="col" { "Temperatures at the end, °C" } } }
        tbody { @for one in sessions { tr {
            th scope="row" { a href={ "/session/" (one.recording) } { (one.recording) } }
            td data-label="Begin" { (when(one.begin)) }
            td.number data-label="Gap / noise" { (one.ratio.map_or("–".to_owned(), |ratio| format!("{ratio:.1}"))) }
            td data-label="Offsets at the end, µm" { (one.offsets.iter().map(|(name, value)| format!("{name} {}", signed_um(*value))).collect::<Vec<_>>().join(" · ")) }
            td data-label="Temperatures at the end, °C" { (one.temperatures.iter().map(|(name, value)| format!("{name} {value:.1}")).collect::<Vec<_>>().join(" · ")) }
        } } }
    } } }
}
