//! What the handlers of all pages share.

use std::path::{Path as FilePath, PathBuf};
use std::sync::{Arc, Mutex};

use host::bus::BusConfig;
use hyper::StatusCode;
use hyper::header::{CONTENT_DISPOSITION, HeaderValue};
use serde::Deserialize;
use tokio::sync::Semaphore;

use super::http::{HTML, Response, answer, status_of, with};
use crate::acts::Acts;
use crate::live::Live;
use crate::recordings::Recordings;
use crate::stream::Clients;
use crate::trends::Trends;
use crate::view::{Place, View, message_page};

/// Makes a page of a recording; the error is a sentence.
pub type MakePage = fn(&FilePath) -> Result<String, String>;

/// Pages that other parts of the program make of a recording.
#[derive(Clone, Copy)]
pub struct Pages {
    /// The record of its parts, or of the one at that place among them.
    pub report: fn(&FilePath, Option<usize>) -> Result<String, String>,
    /// Why it differs from its model.
    pub diagnosis: MakePage,
}

#[derive(Clone)]
pub(crate) struct Shared {
    pub(crate) live: Arc<Live>,
    pub(crate) recordings: Arc<Recordings>,
    pub(crate) trends: Arc<Trends>,
    pub(crate) pages: Pages,
    /// Instant of the start: distinguishes pages of another run of the program.
    pub(crate) epoch: u64,
    pub(crate) clients: Clients,
    pub(crate) acts: Arc<Acts>,
    /// Names of this host, besides its addresses.
    pub(crate) hosts: Arc<[String]>,
    /// How to reach each router.
    pub(crate) buses: Arc<[BusConfig]>,
    /// Origins of pages from elsewhere that may read topics.
    pub(crate) viewers: Arc<[String]>,
    /// Viewers that are connected.
    pub(crate) watching: Clients,
    /// One page of a report at a time.
    pub(crate) making: Arc<Semaphore>,
    pub(crate) made: Arc<Mutex<Vec<ReportPage>>>,
}

/// A page of a report: of which file, which kind, how old the file is, its text.
pub(crate) type ReportPage = (PathBuf, String, u64, String);

/// A page as an answer.
pub(super) fn page(markup: maud::Markup) -> Response {
    answer(HTML, markup.into_string())
}

/// A table that the browser saves.
pub(super) fn csv(name: &str, text: String) -> Response {
    saved(
        answer("text/csv; charset=utf-8", text),
        &format!("{name}.csv"),
    )
}

/// An answer that the browser saves under a name.
pub(super) fn saved(answer: Response, name: &str) -> Response {
    let value = format!("attachment; filename=\"{}\"", name.replace('"', ""));
    let value =
        HeaderValue::from_str(&value).unwrap_or_else(|_| HeaderValue::from_static("attachment"));
    with(answer, CONTENT_DISPOSITION, value)
}

/// There is none.
pub(super) fn missing(text: &str) -> Response {
    let page = page(message_page("Not found", text, Place::Hall));
    status_of(page, StatusCode::NOT_FOUND)
}

/// Where the part is looked at from, and the instant of a session.
#[derive(Deserialize)]
pub(super) struct Look {
    pub(super) az: Option<f64>,
    pub(super) el: Option<f64>,
    pub(super) t: Option<f64>,
    pub(super) cell: Option<String>,
    pub(super) since: Option<String>,
}

impl Look {
    pub(super) fn view(&self) -> View {
        View::of(self.az, self.el)
    }
}
