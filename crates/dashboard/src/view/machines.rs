//! Machines that have recordings, and the causes that they share.

use std::collections::{BTreeMap, BTreeSet};

use effects::vocabulary;
use graph::Stamp;
use maud::{Markup, html};

use super::effects::displayed;
use super::machine::{change, still_reading, whole};
use super::months::finding;
use super::numbers::{counted, when};
use super::save::save;
use crate::history::{Found, Summary, changes};
use crate::trends::Months;

/// Machines by name, each with what its recordings say in the order of time.
type Machines = BTreeMap<String, Vec<Summary>>;

/// Causes that have a column: those of most machines.
const COLUMNS: usize = 12;

/// Machines that have recordings, and what changed on each last: those that changed last first. Then which causes were
/// found on which. `of_lake`: what a lake tells of machines, by name.
pub(crate) fn machines_page(
    machines: &Machines,
    of_lake: &BTreeMap<String, Months>,
    unread: usize,
) -> Markup {
    let mut changed: Vec<_> = (machines.iter())
        .map(|(name, sessions)| (name, sessions, last_change(sessions, of_lake.get(name))))
        .collect();
    changed.sort_by_key(|(.., last)| std::cmp::Reverse(last.as_ref().map(|(at, _)| *at)));
    let body = html! {
        div.title { h1 { "Machines over time" } }
        (still_reading(unread))
        @if machines.is_empty() && unread == 0 { p.lead.empty { "No recording tells of a machine." } }
        ul.listing { @for (name, sessions, last) in &changed {
            li {
                h2 { a href={ "/machine/" (name) } { (name) } }
                p { (counted(sessions.len(), "recording")) @if let Some(last) = sessions.last() { ", the newest of " (when(last.begin)) } }
                @if let Some((_, last)) = last { ul.faults { (last) } } @else { p.none { "No cause has changed beyond its intervals." } }
            }
        } }
        (causes(machines))
    };
    whole("Machines over time", &body)
}

/// What changed last on a machine, and when: as a lake of its sessions tells it, or its recordings.
fn last_change(sessions: &[Summary], of_lake: Option<&Months>) -> Option<(Stamp, Markup)> {
    let newest = of_lake.and_then(|of| of.findings.last());
    let newest = newest.map(|one| (one.onset()[0], finding(one)));
    let changes = changes(sessions);
    let recorded = changes.last().map(|one| (one.at, change(one)));
    [newest, recorded]
        .into_iter()
        .flatten()
        .max_by_key(|(at, _)| *at)
}

/// What the sessions of a machine have found of an effect.
struct Share<'a> {
    /// Sessions that have found it, and all that have a gap report.
    sessions: (usize, usize),
    /// Its parameters in the newest of them.
    newest: Vec<(&'a (String, String), &'a Found)>,
    /// It was found in the newest session that has a gap report.
    is_present: bool,
}

impl<'a> Share<'a> {
    fn of(effect: &str, sessions: &'a [Summary]) -> Option<Self> {
        let found = |one: &'a Summary| -> Vec<(&'a (String, String), &'a Found)> {
            let is_of = |of: &(String, String), one: &Found| {
                of.0 == effect || one.group.iter().any(|other| other == effect)
            };
            let all = one.effects.iter();
            all.filter(|(of, one)| is_of(of, one)).collect()
        };
        let judged: Vec<_> = (sessions.iter())
            .filter(|one| one.ratio.is_some())
            .map(found)
            .collect();
        let newest = judged.iter().rfind(|one| !one.is_empty())?.clone();
        Some(Self {
            sessions: (
                judged.iter().filter(|one| !one.is_empty()).count(),
                judged.len(),
            ),
            is_present: judged.last().is_some_and(|one| !one.is_empty()),
            newest,
        })
    }

    /// Its size; of one that is only in the group of another, that it is possible.
    fn sizes(&self, effect: &str) -> String {
        // What was not estimated, as the place of a bow on its axis, says nothing of its size.
        let own = (self.newest.iter())
            .filter(|(of, one)| of.0 == effect && one.ci95[0] < one.ci95[1])
            .map(|(of, one)| displayed(of, one.value, &one.unit, Some(one.ci95)));
        let own: Vec<String> = own.collect();
        if own.is_empty() {
            return "possible".to_owned();
        }
        own.join(" · ")
    }

    /// Causes that the newest session cannot distinguish.
    fn group(&self) -> usize {
        self.newest
            .iter()
            .map(|(_, one)| one.group.len())
            .max()
            .unwrap_or(1)
            .max(1)
    }
}

/// Machines by causes: who shares a fault.
fn causes(machines: &Machines) -> Markup {
    let effects = || (machines.values().flatten()).flat_map(|one| &one.effects);
    let all: BTreeSet<&str> = (effects().map(|(of, _)| &of.0))
        .chain(effects().flat_map(|(_, one)| &one.group))
        .map(String::as_str)
        .collect();
    let mut columns: Vec<(&str, Vec<Option<Share<'_>>>)> = (all.into_iter())
        .map(|effect| {
            let shares = machines.values().map(|one| Share::of(effect, one));
            (effect, shares.collect())
        })
        .collect();
    let count = |column: &[Option<Share<'_>>]| column.iter().flatten().count();
    let alone = |column: &[Option<Share<'_>>]| {
        let shares = column.iter().flatten();
        shares.filter(|one| one.group() == 1).count()
    };
    // Those that are sure on some machine, then those of most machines.
    columns.sort_by_key(|(_, column)| std::cmp::Reverse((alone(column), count(column))));
    let rare = columns.len().saturating_sub(COLUMNS);
    columns.truncate(COLUMNS);
    html! {
        @if !columns.is_empty() {
            section.card aria-labelledby="causes-title" {
                h2 #causes-title { "Causes by machine" }
                p.note { "Size in the newest session that found the cause, and in how many sessions it was found; bold where the newest session found it and nothing else can be it." @if rare > 0 { " " (counted(rare, "cause")) " of fewer machines: see their pages." } }
                div.scroll tabindex="0" role="group" aria-label="Table of causes by machine" { table.matrix {
                    thead { tr { th scope="col" { "Machine" } @for (effect, column) in &columns { th scope="col" { (vocabulary::describe(effect)) br; small { (counted(count(column), "machine")) ", sure on " (alone(column)) } } } } }
                    tbody { @for (row, name) in machines.keys().enumerate() { tr {
                        th scope="row" { a href={ "/machine/" (name) } { (name) } }
                        @for (effect, column) in &columns { td { @if let Some(one) = &column[row] { (cell(effect, one)) } @else { span aria-label="not found" { "–" } } } }
                    } } }
                } }
                (save("causes", &["machine", "effect", "parameter", "value", "unit", "low", "high", "found in sessions", "of sessions"], rows(machines, &columns)))
            }
        }
    }
}

fn cell(effect: &str, one: &Share<'_>) -> Markup {
    let (found, of) = one.sessions;
    html! {
        @if one.is_present && one.group() == 1 { b { (one.sizes(effect)) } } @else { (one.sizes(effect)) }
        small { (found) " of " (counted(of, "session")) @if one.group() > 1 { ", one of " (one.group()) " causes" } }
    }
}

fn rows<'a>(
    machines: &'a Machines,
    columns: &'a [(&str, Vec<Option<Share<'a>>>)],
) -> impl Iterator<Item = Vec<String>> {
    columns.iter().flat_map(|(effect, column)| {
        machines.keys().zip(column).flat_map(|(name, share)| {
            share.iter().flat_map(|share| {
                let own = share.newest.iter().filter(|(of, _)| of.0 == *effect);
                own.map(|(of, one)| {
                    let [low, high] = one.ci95.map(|end| end.to_string());
                    let (found, all) = share.sessions;
                    vec![
                        name.clone(),
                        (*effect).to_owned(),
                        of.1.clone(),
                        one.value.to_string(),
                        one.unit.clone(),
                        low,
                        high,
                        found.to_string(),
                        all.to_string(),
                    ]
                })
            })
        })
    })
}
