//! The list of recordings: what each is of, how it ended, and why it differs.

use graph::Stamp;
use maud::{Markup, html};
use serde::Deserialize;

use super::csv::{number, row};
use super::numbers::{cell_title, counted, readable, span, when};
use super::page::{Frame, Place, frame};
use super::sessions::links;
use super::tile::sign_of;
use crate::history::{Made, Summary};
use crate::recordings::Recorded;

/// Letters of a search that are looked at.
const WORDS: usize = 64;
/// Ends of a part by which the list is filtered: name and words.
const ENDS: [(&str, &str); 4] = [
    ("", "All verdicts"),
    ("good", "Qualified"),
    ("unsure", "Measured only, not ended"),
    ("bad", "Scrap, stopped, revoked"),
];

/// What the address of the list asks for.
#[derive(Clone, Debug, Default, Deserialize)]
pub(crate) struct Listing {
    /// Words of which each must stand in the name, cell, part, verdict or cause.
    #[serde(default)]
    q: String,
    /// A cell; all where it is empty.
    #[serde(default)]
    cell: String,
    /// `good`, `unsure` or `bad`; all where it is empty.
    #[serde(default)]
    verdict: String,
}

impl Listing {
    fn takes(&self, one: &Recorded) -> bool {
        let of_cell = |(name, _): &(String, Summary)| *name == self.cell;
        let made = parts(one);
        let of_verdict = |made: &&Made| made.class == self.verdict;
        let known = ENDS.iter().any(|(name, _)| *name == self.verdict);
        if !self.cell.is_empty() && !one.cells.iter().flatten().any(of_cell)
            || known && !self.verdict.is_empty() && !made.iter().any(of_verdict)
        {
            return false;
        }
        let mut said = one.listed.name.to_lowercase();
        for (name, summary) in one.cells.iter().flatten() {
            let made = summary.part.as_ref().map_or("", |made| made.name.as_str());
            let end = summary.part.as_ref().map_or("", |made| made.end);
            for text in [
                name,
                made,
                end,
                summary.cause.as_deref().unwrap_or_default(),
            ] {
                said.push(' ');
                said.push_str(&text.to_lowercase());
            }
        }
        let words: String = self.q.chars().take(WORDS).collect();
        words
            .split_whitespace()
            .all(|word| said.contains(&word.to_lowercase()))
    }
}

fn parts(one: &Recorded) -> Vec<&Made> {
    let cells = one.cells.iter().flatten();
    cells
        .filter_map(|(_, summary)| summary.part.as_ref())
        .collect()
}

/// The page: `folders` are looked through.
pub(crate) fn sessions_page(all: &[Recorded], folders: usize, listing: &Listing) -> Markup {
    let chosen: Vec<&Recorded> = all.iter().filter(|one| listing.takes(one)).collect();
    let unread = all
        .iter()
        .filter(|one| one.cells.is_none() && one.listed.bounds.is_some())
        .count();
    let body = html! {
        div.title {
            h1 { "Sessions" }
            p #count { @if chosen.len() < all.len() { (chosen.len()) " of " } (counted(all.len(), "recording")) " in " (counted(folders, "folder")) }
            (chooser(all, listing))
            p.actions { a.button href="/machines" { "Machines over time" } a.button href="/sessions.csv" download { "CSV" } }
        }
        @if all.is_empty() { p.lead.empty { "No recording is in the folder. " code { "probecell up" } " records each session; name other folders with " code { "--recordings DIR" } "." } }
        @else { (table(&chosen, unread)) }
        @if all.len() > 1 { (comparison(all)) }
    };
    frame(
        &Frame {
            title: "Sessions",
            place: Place::Sessions,
            class: "sessions",
            stream: None,
            seen: "",
        },
        &body,
    )
}

fn chooser(all: &[Recorded], listing: &Listing) -> Markup {
    let named = all.iter().flat_map(|one| one.cells.iter().flatten());
    let names: std::collections::BTreeSet<&str> = named.map(|(name, _)| name.as_str()).collect();
    html! {
        form.choose #choose action="/sessions" method="get" role="search" aria-label="Recordings shown" {
            input type="search" name="q" value=(listing.q) maxlength="64" placeholder="Part, cell, cause" aria-label="Search" autocomplete="off";
            select name="cell" aria-label="Cell" {
                option value="" { "All cells" }
                @for name in names { option value=(name) selected[listing.cell == name] { (name) } }
            }
            select name="verdict" aria-label="Verdict" { @for (name, words) in ENDS { option value=(name) selected[listing.verdict == name] { (words) } } }
            button type="submit" { "Show" }
        }
    }
}

fn table(chosen: &[&Recorded], unread: usize) -> Markup {
    html! {
        div.card #listed data-unread=[(unread > 0).then_some(unread)] {
            @if unread > 0 { p.note { (counted(unread, "recording")) " still to be read: " a href="/sessions" { "load the page again" } "." } }
            @if chosen.is_empty() { p.none { "No recording fits." } } @else {
                table.recordings {
                    thead { tr { th scope="col" { "Cell" } th scope="col" { "Part" } th scope="col" { "Verdict" } th scope="col" { "When" } th.number scope="col" { "Length" } th.number scope="col" { "Gap " small { "× noise" } } th scope="col" { "Cause" } th scope="col" { span.sr { "Pages and file" } } } }
                    tbody { @for one in chosen { (recorded(one)) } }
                }
            }
        }
    }
}

fn recorded(one: &Recorded) -> Markup {
    let listed = &one.listed;
    let first = one.cells.iter().flatten().next();
    let others = one
        .cells
        .as_ref()
        .map_or(0, |cells| cells.len().saturating_sub(1));
    let summary = first.map(|(_, summary)| summary);
    let made = summary.and_then(|summary| summary.part.as_ref());
    let title = first.map_or(listed.name.as_str(), |(name, _)| cell_title(name).0);
    html! {
        tr {
            th scope="row" {
                a href={ "/session/" (listed.name) } title=(listed.name) { (title) @if others > 0 { " and " (others) " more" } span.sr { ", recording " (readable(&listed.name)) } }
                small { (readable(&listed.name)) }
            }
            td data-label="Part" { @if let Some(made) = made { (readable(&made.name)) @if summary.is_some_and(|one| one.parts > 1) { small { (summary.map_or(0, |one| one.parts)) " parts" } } } @else { "–" } }
            td data-label="Verdict" { (verdict(one, made)) }
            td data-label="When" { @if let Some((begin, _)) = listed.bounds { (when(begin)) } @else { "–" } }
            td.number data-label="Length" { @if let Some((begin, end)) = listed.bounds { (span(end.since_s(begin))) } @else { "–" } }
            td.number data-label="Gap × noise" { @if let Some(ratio) = summary.and_then(|one| one.ratio) { (format!("{ratio:.1}")) } @else { "–" } }
            td data-label="Cause" { @if let Some(cause) = summary.and_then(|one| one.cause.as_ref()) { (cause) } @else { "–" } }
            td data-label="" { p.actions { (links(listed)) } }
        }
    }
}

fn verdict(one: &Recorded, made: Option<&Made>) -> Markup {
    html! {
        @if one.listed.under_way { span.under-way { span.sign aria-hidden="true" { "●" } " under way" } }
        @else if let Some(made) = made { span.verdict.(made.class) { span.sign aria-hidden="true" { (sign_of(made.class)) } " " (made.end) } }
        @else if one.cells.is_none() && one.listed.bounds.is_some() { "not read yet" }
        @else if one.listed.trouble.is_empty() { "–" }
        @if !one.listed.trouble.is_empty() { small.mark { (one.listed.trouble) } }
    }
}

/// Two sessions side by side.
fn comparison(all: &[Recorded]) -> Markup {
    let said = |one: &Recorded| {
        let first = one.cells.iter().flatten().next();
        let part =
            first.and_then(|(_, one)| Some(format!(", {}", readable(&one.part.as_ref()?.name))));
        format!("{}{}", readable(&one.listed.name), part.unwrap_or_default())
    };
    html! {
        form.compare action="/compare" method="get" {
            label { "Compare " select name="a" { @for one in all { option value=(one.listed.name) { (said(one)) } } } }
            label { " with " select name="b" { @for (index, one) in all.iter().enumerate() { option value=(one.listed.name) selected[index == 1] { (said(one)) } } } }
            button type="submit" { "Side by side" }
        }
    }
}

/// The list as a table: a row for each cell of each recording.
pub(crate) fn sessions_csv(all: &[Recorded]) -> String {
    let names = [
        "recording",
        "cell",
        "part",
        "verdict",
        "begin/UTC",
        "length/s",
        "gap/noise",
        "cause",
        "bytes",
    ];
    let mut text = row(&names.map(str::to_owned));
    for one in all {
        let (begin, end) = one.listed.bounds.unwrap_or((Stamp(0), Stamp(0)));
        for (name, summary) in one.cells.iter().flatten() {
            let made = summary.part.as_ref();
            text.push_str(&row(&[
                one.listed.name.clone(),
                name.clone(),
                made.map_or_else(String::new, |made| made.name.clone()),
                made.map_or_else(String::new, |made| made.end.to_owned()),
                super::numbers::date(begin),
                number(Some(end.since_s(begin)), 1.0),
                number(summary.ratio, 1.0),
                summary.cause.clone().unwrap_or_default(),
                one.listed.bytes.to_string(),
            ]));
        }
    }
    text
}
