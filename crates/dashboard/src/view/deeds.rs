//! Buttons by which an operator acts, and the page of the key of this device. They are shown where the browser holds a key
//! (`assets/acts.js`): without scripts or key nothing is there to press.

use maud::{Markup, html};

use super::page::{Frame, Place, frame};
use crate::state::CellState;

/// A button for an act.
pub(super) fn deed(cell: &CellState, act: &str, subject: &str, label: &str) -> Markup {
    html! { button.deed.(act) type="button" data-act=(act) data-cell=(cell.name) data-subject=(subject) { (label) } }
}

/// A button for an act whose subject is asked for first.
pub(super) fn deed_asking(cell: &CellState, act: &str, question: &str, label: &str) -> Markup {
    html! { button.deed.(act) type="button" data-act=(act) data-cell=(cell.name) data-ask=(question) { (label) } }
}

/// The page of the key of this device. `cells`: those that take acts.
pub(crate) fn key_page(cells: &[String]) -> Markup {
    let body = html! {
        div.title { h1 { "Key of this device" } }
        section.card aria-labelledby="key-title" {
            h2 #key-title { "Signing" }
            p { "Whatever an operator does from these pages is signed. The key is made by this browser and stays in it; nothing can read it out, neither this page nor the dashboard. Each cell registers its public half once:" }
            p #key-state role="status" { "Without scripts this device only reads." }
            form #key-form hidden {
                label for="key-name" { "Name of the operator" } " "
                input #key-name name="name" autocomplete="off" maxlength="64" required;
                " " button type="submit" { "Make a key" }
            }
            p { code #key-command hidden {} }
            p { button #key-forget type="button" hidden { "Forget the key" } }
            @if cells.is_empty() {
                p.note { "This dashboard was given the file of no cell, so that nothing can be done from it: start it with --cell FILE." }
            } @else {
                p.note { "Cells that take acts from this dashboard: " (cells.join(", ")) "." }
            }
            p.note { "Who holds this device can sign with it. When it is lost: " code { "probecell key revoke NAME" } "." }
        }
    };
    let page = Frame {
        title: "Key of this device",
        place: Place::Key,
        class: "key",
        stream: None,
        seen: "",
    };
    frame(&page, &body)
}
