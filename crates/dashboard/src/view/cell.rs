//! The page of a cell; the same sections show a recording at an instant.

use graph::Stamp;
use maud::{Markup, html};

use super::numbers::cell_title;
use super::page::{Frame, Place, frame};
use super::picture::{View, picture};
use super::small::strip_length;
use super::{gap, ledger, parts, runs, sizes, why};
use crate::state::{CellState, Hall, Section};

/// Element of a section.
pub fn section_id(section: Section) -> &'static str {
    match section {
        Section::State => "state",
        Section::Part => "part",
        Section::Order => "order",
        Section::Sizes => "sizes",
        Section::Runs => "runs",
        Section::Ledger => "ledger",
        Section::Faults => "faults",
        Section::Why => "why",
        Section::Gap => "gap",
        Section::Axes => "axes",
    }
}

fn title_of(section: Section) -> &'static str {
    match section {
        Section::State => "State",
        Section::Part => "Machine and part",
        Section::Order => "Measuring order",
        Section::Sizes => "Sizes",
        Section::Runs => "Over parts",
        Section::Ledger => "Corrections",
        Section::Faults => "Faults and losses",
        Section::Why => "Why, and what to do",
        Section::Gap => "Why it differs from the model",
        Section::Axes => "Axes and temperatures",
    }
}

/// A section of the page of `cell`, which stands in `hall`. `path` is the address of the page.
pub fn section(
    section: Section,
    cell: &CellState,
    hall: &Hall,
    now: Stamp,
    view: View,
    path: &str,
) -> Markup {
    let id = section_id(section);
    let acts = hall.takes_acts(&cell.name);
    html! {
        section.card id=(id) aria-labelledby={ (id) "-title" } {
            h2 #{ (id) "-title" } { (title_of(section)) }
            @match section {
                Section::State => (parts::state(cell, acts, now)),
                Section::Part => (picture(cell, view, path)),
                Section::Order => (parts::order(cell, now)),
                Section::Sizes => (sizes::sizes(cell)),
                Section::Runs => (runs::runs(cell, now, strip_length(hall, now))),
                Section::Ledger => (ledger::ledger(cell, acts, now)),
                Section::Faults => (parts::faults(cell, hall)),
                Section::Why => (why::why(cell)),
                Section::Gap => (gap::gap(cell, acts)),
                Section::Axes => (parts::axes(cell)),
            }
        }
    }
}

/// All sections.
pub(super) fn sections(
    cell: &CellState,
    hall: &Hall,
    now: Stamp,
    view: View,
    path: &str,
) -> Markup {
    html! { div.cards { @for one in Section::ALL { (section(one, cell, hall, now, view, path)) } } }
}

/// The page of a live cell.
pub fn cell_page(cell: &CellState, hall: &Hall, now: Stamp, view: View, seen: &str) -> Markup {
    let (title, place) = cell_title(&cell.name);
    let path = format!("/cell/{}", cell.name);
    let stream = format!(
        "/events/cell/{}?az={}&el={}",
        cell.name, view.azimuth, view.elevation
    );
    let body = html! {
        div.title { h1 { (title) @if !place.is_empty() { small { (place) } } } p.actions { a.button href="/" { "To the hall" } } }
        (sections(cell, hall, now, view, &path))
    };
    frame(
        &Frame {
            title,
            place: Place::Cell,
            class: "cell",
            stream: Some(&stream),
            seen,
        },
        &body,
    )
}
