//! Pages of recordings.

use std::path::Path as FilePath;
use std::sync::{Arc, PoisonError};

use graph::Stamp;
use hyper::StatusCode;
use hyper::header::{CONTENT_LENGTH, CONTENT_SECURITY_POLICY, HeaderValue};
use serde::Deserialize;

use super::answer::{Look, Shared, csv, missing, page, saved};
use super::http::{HTML, Response, TEXT, answer, of_kind, told, with};
use crate::recordings::{Opened, RecordingError};
use crate::state::{CellState, Hall};
use crate::view::{self, Compared, Listing, Place, SessionView, message_page};

/// Pages of reports kept: a diagnosis takes seconds.
const KEPT_PAGES: usize = 8;

/// No content but styles, for the pages of reports, which carry their style and no script.
const POLICY_REPORT: &str =
    "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; frame-ancestors 'none'";

pub(super) async fn sessions(shared: Shared, listing: Listing) -> Response {
    let folders = shared.recordings.folder_count();
    blocking(move || {
        let all = shared.recordings.list();
        page(view::sessions_page(&all, folders, &listing))
    })
    .await
}

pub(super) async fn sessions_csv(shared: Shared) -> Response {
    blocking(move || csv("sessions", view::sessions_csv(&shared.recordings.list()))).await
}

/// Reading a recording blocks, hence on a thread for that.
async fn blocking(work: impl FnOnce() -> Response + Send + 'static) -> Response {
    tokio::task::spawn_blocking(work)
        .await
        .unwrap_or_else(|error| {
            tracing::error!(%error, "a page could not be made");
            let text = "the page could not be made";
            told(StatusCode::INTERNAL_SERVER_ERROR, text)
        })
}

/// A page of a recording; where it cannot be opened, why not.
async fn of_recording(
    shared: Shared,
    name: String,
    work: impl FnOnce(&Opened) -> Response + Send + 'static,
) -> Response {
    blocking(move || match shared.recordings.open(&name) {
        Ok(opened) => work(&opened),
        Err(error) => refused(&error),
    })
    .await
}

fn refused(error: &RecordingError) -> Response {
    missing(&format!("{error}."))
}

/// The cell of that name, or the first.
fn chosen<'a>(hall: &'a Hall, name: Option<&str>) -> Option<&'a CellState> {
    name.and_then(|name| hall.cell(name))
        .or_else(|| hall.cells().next())
}

fn instant(opened: &Opened, seconds: Option<f64>) -> Stamp {
    let (begin, end) = opened.listed.bounds.unwrap_or((Stamp(0), Stamp(0)));
    let at = seconds
        .filter(|one| one.is_finite())
        .map_or(end, |seconds| {
            begin.after_s(seconds.clamp(0.0, end.since_s(begin)))
        });
    // A slider gives hundredths: its end is the end.
    if end.since_s(at) < 0.05 { end } else { at }
}

pub(super) async fn session(shared: Shared, name: String, look: Look) -> Response {
    of_recording(shared, name, move |opened| {
        let at = instant(opened, look.t);
        let hall = opened.at(at);
        page(view::session_page(&SessionView {
            listed: &opened.listed,
            hall: &hall,
            at,
            cell: chosen(&hall, look.cell.as_deref()),
            view: look.view(),
            marks: &opened.marks,
        }))
    })
    .await
}

/// Description of the machine of a recording.
pub(super) async fn session_description(shared: Shared, name: String, look: Look) -> Response {
    of_recording(shared, name, move |opened| {
        let hall = opened.at(instant(opened, None));
        let cell = chosen(&hall, look.cell.as_deref());
        let text = cell.map_or_else(String::new, |cell| cell.description.to_string());
        answer(TEXT, text)
    })
    .await
}

pub(super) async fn machines(shared: Shared) -> Response {
    blocking(move || {
        let (mut machines, unread) = shared.recordings.machines();
        // A lake that cannot be read is told on the page of each machine.
        let of_lake = shared.trends.machines().unwrap_or_default();
        for name in of_lake.keys() {
            machines.entry(name.clone()).or_default();
        }
        page(view::machines_page(&machines, &of_lake, unread))
    })
    .await
}

pub(super) async fn machine(shared: Shared, name: String) -> Response {
    blocking(move || {
        let (machines, unread) = shared.recordings.machines();
        let trends = shared.trends.machines();
        let of_lake = match &trends {
            Ok(all) => all.get(&name).map(Ok),
            Err(text) => Some(Err(text.as_str())),
        };
        match (machines.get(&name), &of_lake) {
            (None, None | Some(Err(_))) => {
                missing("Neither a recording nor a lake tells of a machine of this name.")
            }
            (sessions, _) => {
                let sessions = sessions.map_or(&[][..], Vec::as_slice);
                page(view::machine_page(&name, sessions, unread, of_lake))
            }
        }
    })
    .await
}

#[derive(Deserialize)]
pub(super) struct Two {
    a: String,
    b: String,
}

pub(super) async fn compare(shared: Shared, two: Two) -> Response {
    blocking(move || {
        let open = |name: &str| {
            shared.recordings.open(name).map(|one| {
                let end = instant(&one, None);
                (one.at(end), one)
            })
        };
        let (a, b) = match (open(&two.a), open(&two.b)) {
            (Ok(a), Ok(b)) => (a, b),
            (Err(error), _) | (_, Err(error)) => return refused(&error),
        };
        let empty = CellState::default();
        let side = |hall: &'_ Hall| -> CellState { chosen(hall, None).unwrap_or(&empty).clone() };
        let (cell_a, cell_b) = (side(&a.0), side(&b.0));
        page(view::compare_page(
            &Compared {
                listed: &a.1.listed,
                cell: &cell_a,
            },
            &Compared {
                listed: &b.1.listed,
                cell: &cell_b,
            },
        ))
    })
    .await
}

/// Place of a part among those of a recording; none: the report of all.
#[derive(Deserialize)]
pub(super) struct Part {
    part: Option<usize>,
}

pub(super) async fn report(shared: Shared, name: String, Part { part }: Part) -> Response {
    let make = shared.pages.report;
    let kind = part.map_or("report".to_owned(), |part| format!("report {part}"));
    made(shared, name, kind, move |path| make(path, part)).await
}

pub(super) async fn diagnosis(shared: Shared, name: String) -> Response {
    let make = shared.pages.diagnosis;
    made(shared, name, "diagnosis".to_owned(), make).await
}

/// A page of a recording, made once for as long as the recording stays as it is.
async fn made(
    shared: Shared,
    name: String,
    kind: String,
    make: impl FnOnce(&FilePath) -> Result<String, String> + Send + 'static,
) -> Response {
    // One at a time: a diagnosis takes a processor for seconds.
    let Ok(_turn) = Arc::clone(&shared.making).acquire_owned().await else {
        return missing("The dashboard is ending.");
    };
    blocking(move || {
        let (path, bytes) = match (shared.recordings.path(&name), shared.recordings.open(&name)) {
            (Ok(path), Ok(opened)) => (path, opened.listed.bytes),
            (Err(error), _) | (_, Err(error)) => return refused(&error),
        };
        let lock = || shared.made.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock()
            .iter()
            .find(|one| (&one.0, &one.1, one.2) == (&path, &kind, bytes))
            .map(|one| one.3.clone());
        let html = match known.map_or_else(|| make(&path), Ok) {
            Ok(html) => html,
            Err(text) => {
                return page(message_page(
                    "No such page of this session",
                    &format!("{text}."),
                    Place::Sessions,
                ));
            }
        };
        let mut pages = lock();
        pages.retain(|one| (&one.0, &one.1) != (&path, &kind));
        if pages.len() == KEPT_PAGES {
            pages.remove(0);
        }
        pages.push((path, kind, bytes, html.clone()));
        let policy = HeaderValue::from_static(POLICY_REPORT);
        with(answer(HTML, html), CONTENT_SECURITY_POLICY, policy)
    })
    .await
}

pub(super) async fn download(shared: Shared, name: String, index: usize) -> Response {
    let found = tokio::task::spawn_blocking(move || shared.recordings.file(&name, index)).await;
    let path = match found {
        Ok(Ok(path)) => path,
        Ok(Err(error)) => return refused(&error),
        Err(_) => return missing("The recording cannot be read."),
    };
    match crate::download::body(&path).await {
        Ok((length, body)) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let answer = of_kind("application/octet-stream", body);
            saved(with(answer, CONTENT_LENGTH, length.into()), &name)
        }
        Err(_) => missing("The recording cannot be read."),
    }
}
