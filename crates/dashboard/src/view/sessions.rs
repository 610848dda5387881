//! A recording at an instant.

use graph::Stamp;
use maud::{Markup, html};

use super::cell::sections;
use super::numbers::{moment, readable, span, when};
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
    /// It is being written.
    pub under_way: bool,
    /// Why it cannot be read, or what is damaged.
    pub trouble: String,
    /// Its `.mcap` files, by name.
    pub files: Vec<String>,
}

pub(super) fn links(one: &Listed) -> Markup {
    html! {
        a.button href={ "/session/" (one.name) "/report" } { "Report" span.sr { " of " (readable(&one.name)) } } " "
        a.button href={ "/session/" (one.name) "/diagnosis" } { "Diagnosis" span.sr { " of " (readable(&one.name)) } } " "
        @for (index, file) in one.files.iter().enumerate() {
            a.button href={ "/session/" (one.name) "/mcap/" (index) } download { "MCAP" @if one.files.len() > 1 { " " (index + 1) } span.sr { ": " (readable(file)) } } " "
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
        div.title { h1 title=(name) { (readable(name)) } p { (when(begin)) ", " (span(length)) @if listed.under_way { ", being recorded: shown as far as it is written" } } p.actions { (links(listed)) } }
        @if !listed.trouble.is_empty() { p.mark { (listed.trouble) } }
        form.timeline #timeline action={ "/session/" (name) } method="get" {
            label for="t" { "Instant" } " "
            output #instant for="t" { b { (format!("{at:.1} s")) } " of " (format!("{length:.1} s")) ", " (moment(session.at)) }
            input #t name="t" type="range" min="0" max=(format!("{length:.2}")) step="any" value=(format!("{at:.2}"));
            (marks(session.marks, length))
            div.controls {
                div.playing hidden {
                    button #play type="button" title="Space plays and pauses; ← and → move by 1 s, with Shift by 10 s" { "Play" }
                    label for="speed" { "Speed" }
                    select #speed { @for speed in [1, 4, 16, 64] { option value=(speed) { (speed) " ×" } } }
                }
                div.steps {
                    @for (text, to) in [("Begin", 0.0), ("− 10 s", (at - 10.0).max(0.0)), ("− 1 s", (at - 1.0).max(0.0)), ("+ 1 s", (at + 1.0).min(length)), ("+ 10 s", (at + 10.0).min(length)), ("End", length)] {
                        a.button href={ "/session/" (name) "?t=" (format!("{to:.2}")) } { (text) }
                    }
                    noscript { button type="submit" { "Show" } }
                }
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
