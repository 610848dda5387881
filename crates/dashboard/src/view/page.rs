//! The frame of every page.

use maud::{DOCTYPE, Markup, html};

/// Which entry of the navigation is this page's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The hall.
    Hall,
    /// A cell.
    Cell,
    /// Recordings.
    Sessions,
    /// The key of this device.
    Key,
}

/// What a page is made of.
pub(super) struct Frame<'a> {
    pub(super) title: &'a str,
    pub(super) place: Place,
    /// Classes of the body.
    pub(super) class: &'a str,
    /// Address of the event stream; none where nothing changes by itself.
    pub(super) stream: Option<&'a str>,
    /// Number of the newest event that the page shows.
    pub(super) seen: &'a str,
}

/// A whole page.
pub(super) fn frame(frame: &Frame<'_>, body: &Markup) -> Markup {
    let current = |place: Place| (frame.place == place).then_some("page");
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (frame.title) " · probecell" }
                link rel="stylesheet" href="/assets/style.css";
                link rel="icon" href="/assets/icon.svg" type="image/svg+xml";
                script type="module" src="/assets/app.js" {}
                script type="module" src="/assets/acts.js" {}
                @if frame.class.starts_with("cell") { script type="module" src="/assets/scene.js" {} }
                @if frame.stream.is_some() {
                    noscript { meta http-equiv="refresh" content="5"; }
                }
            }
            body class=(frame.class) data-stream=[frame.stream] data-seen=(frame.seen) {
                a.skip href="#main" { "Skip to content" }
                header.top {
                    a.brand href="/" { "probecell" }
                    nav aria-label="Main" {
                        a href="/" aria-current=[current(Place::Hall)] { "Hall" }
                        a href="/sessions" aria-current=[current(Place::Sessions)] { "Sessions" }
                        a href="/key" aria-current=[current(Place::Key)] { "Key" }
                    }
                    @if frame.stream.is_some() {
                        p #link role="status" { "" }
                    }
                }
                main #main {
                    @if frame.stream.is_some() {
                        div #notice role="status" hidden {}
                        p.mark #bus hidden {}
                    }
                    (body)
                }
                footer {
                    p { "What is done from these pages is signed by an operator; a correction that the policy of the cell file approves needs nobody. Deviations are measured minus nominal; excess material is positive. U is the expanded uncertainty. " span #zone { "Times are UTC." } }
                }
            }
        }
    }
}

/// A page with a title and one sentence, such as an error.
pub fn message_page(title: &str, text: &str, place: Place) -> Markup {
    let page = Frame {
        title,
        place,
        class: "message",
        stream: None,
        seen: "",
    };
    frame(
        &page,
        &html! { h1 { (title) } p.lead { (text) } p { a.button href="/" { "To the hall" } } },
    )
}
