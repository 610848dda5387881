//! Recordings: the list, and one of them at an instant.

use graph::Stamp;
use maud::{Markup, html};

use super::cell::sections;
use super::numbers::{clock, counted, date, span};
use super::page::{Frame, Place, frame};
use super::picture::View;
use crate::state::{CellState, Hall};

/// A recording in the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// Name in the addresses of its pages: unique among all folders.
    pub name: String,
    /// First and last message; none when it cannot be read.
    pub bounds: Option<(Stamp, Stamp)>,
    /// Bytes of its files.
    pub bytes: u64,
    /// Why it cannot be read, or what is damaged.
    pub trouble: String,
    /// Its `.mcap` files, by name.
    pub files: Vec<String>,
}

/// The list.
pub fn sessions_page(all: &[Listed], folders: usize) -> Markup {
    let body = html! {
        div.title { h1 { "Sessions" } p { (counted(all.len(), "recording")) " in " (counted(folders, "folder")) } p.actions { a.button href="/machines" { "Machines over time" } } }
        @if all.is_empty() { p.lead.empty { "No recording is in the folder. " code { "probecell up" } " records each session; name other folders with " code { "--recordings DIR" } "." } }
        @if all.len() > 1 {
            form.compare action="/compare" method="get" {
                label { "Compare " select name="a" { @for one in all { option value=(one.name) { (one.name) } } } }
                label { " with " select name="b" { @for (index, one) in all.iter().enumerate() { option value=(one.name) selected[index == 1] { (one.name) } } } }
                button type="submit" { "Side by side" }
            }
        }
        ul.sessions {
            @for one in all {
                li {
                    h2 { a href={ "/session/" (one.name) } { (one.name) } }
                    p { @if let Some((begin, end)) = one.bounds { (date(begin)) ", " (span(end.since_s(begin))) ", " } (format!("{:.1} MB", one.bytes as f64 / 1e6)) }
                    @if !one.trouble.is_empty() { p.mark { (one.trouble) } }
                    p.actions { (links(one)) }
                }
            }
        }
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

fn links(one: &Listed) -> Markup {
    html! {
        a.button href={ "/session/" (one.name) "/report" } { "Report" span.sr { " of " (one.name) } } " "
        a.button href={ "/session/" (one.name) "/diagnosis" } { "Diagnosis" span.sr { " of " (one.name) } } " "
        @for (index, file) in one.files.iter().enumerate() {
            a.button href={ "/session/" (one.name) "/mcap/" (index) } download { "MCAP" @if one.files.len() > 1 { " " (index + 1) } span.sr { ": " (file) } } " "
        }
    }
}

/// What the page of a session shows.
pub struct SessionView<'a> {
    /// The recording.
    pub listed: &'a Listed,
    /// The state at the instant.
    pub hall: &'a Hall,
    /// The instant.
    pub at: Stamp,
    /// Which cell, where there are several.
    pub cell: Option<&'a CellState>,
    /// Where the part is looked at from.
    pub view: View,
    /// Marks on the timeline: s from the beginning, and what happened.
    pub marks: &'a [(f64, String)],
}

/// The page of a session at an instant.
pub fn session_page(session: &SessionView<'_>) -> Markup {
    let listed = session.listed;
    let name = &listed.name;
    let (begin, end) = listed.bounds.unwrap_or((session.at, session.at));
    let (at, length) = (session.at.since_s(begin), end.since_s(begin));
    let path = format!("/session/{name}?t={at:.2}");
    let body = html! {
        div.title { h1 { (name) } p { (date(begin)) ", " (span(length)) } p.actions { (links(listed)) } }
        @if !listed.trouble.is_empty() { p.mark { (listed.trouble) } }
        form.timeline #timeline action={ "/session/" (name) } method="get" {
            label for="t" { "Instant" } " "
            output #instant for="t" { b { (format!("{at:.1} s")) } " of " (format!("{length:.1} s")) ", " (clock(session.at)) }
            input #t name="t" type="range" min="0" max=(format!("{length:.2}")) step="0.05" value=(format!("{at:.2}"));
            (marks(session.marks, length))
            div.steps {
                @for (text, to) in [("Begin", 0.0), ("− 10 s", (at - 10.0).max(0.0)), ("− 1 s", (at - 1.0).max(0.0)), ("+ 1 s", (at + 1.0).min(length)), ("+ 10 s", (at + 10.0).min(length)), ("End", length)] {
                    a.button href={ "/session/" (name) "?t=" (format!("{to:.2}")) } { (text) }
                }
                noscript { button type="submit" { "Show" } }
            }
        }
        div #at {
            @if let Some(cell) = session.cell {
                (sections(cell, session.hall, session.at, session.view, &path))
            } @else { p.lead.empty { "At this instant the recording has told nothing of a cell yet." } }
        }
    };
    frame(
        &Frame {
            title: name,
            place: Place::Sessions,
            class: "cell session",
            stream: None,
            seen: "",
        },
        &body,
    )
}

fn marks(marks: &[(f64, String)], length: f64) -> Markup {
    html! {
        svg.marks viewBox="0 0 1000 20" preserveAspectRatio="none" role="img" aria-label={ (marks.len()) " marks on the timeline: stages, verdicts, corrections, faults" } {
            @for (at, text) in marks { line x1=(format!("{:.1}", at / length.max(1e-9) * 1000.0)) x2=(format!("{:.1}", at / length.max(1e-9) * 1000.0)) y1="0" y2="20" { title { (format!("{at:.1} s: ")) (text) } } }
        }
    }
}
