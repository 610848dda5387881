//! The pages over HTTP. Every answer forbids content from elsewhere, and none is given to a request for another host; nothing
//! but GET is served, except what an operator has signed ([`act`]).

mod act;
mod answer;
mod http;
mod own;
mod recorded;
mod viewer;

use std::convert::Infallible;
use std::future::Future;
use std::io;
use std::time::Duration;

use hyper::header::{self, HeaderMap, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};

use self::act::{key_page, offer, sign, token};
use self::answer::{Look, csv, missing, page};
use self::http::{Request, Response, TEXT, answer, of_kind, parts, query, told, with};
use self::recorded::{
    compare, diagnosis, download, machine, machines, report, session, session_description,
    sessions, sessions_csv,
};
use self::viewer::viewer;
use crate::metrics::{Process, metrics};
use crate::stream::{CLIENTS, Shown, seen_now, stream};
use crate::view;
use crate::view::Choice;

pub(crate) use self::answer::Shared;
pub use self::answer::{MakePage, Pages};
pub(crate) use self::http::{Body, streamed};

/// Nothing from elsewhere, nothing inline.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// In which the head of a request has come: who sends none holds a descriptor for no longer.
const HEAD: Duration = Duration::from_secs(5);
/// Between two attempts to take a connection where there is no room for one.
const NO_ROOM: Duration = Duration::from_millis(50);
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Serves until `end`.
pub(crate) async fn serve(
    listener: tokio::net::TcpListener,
    shared: Shared,
    end: impl Future<Output = ()> + Send + 'static,
) -> io::Result<()> {
    let accept_all = async {
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                // Without a descriptor nothing is taken until one is free.
                tokio::time::sleep(NO_ROOM).await;
                continue;
            };
            let shared = shared.clone();
            let service = service_fn(move |request| {
                let shared = shared.clone();
                async { Ok::<_, Infallible>(guarded(answered(shared, request).await)) }
            });
            tokio::spawn(async move {
                let served = http1::Builder::new()
                    .timer(TokioTimer::new())
                    .header_read_timeout(HEAD)
                    .serve_connection(TokioIo::new(stream), service)
                    .with_upgrades();
                if let Err(error) = served.await {
                    tracing::debug!(%error, "a connection");
                }
            });
        }
    };
    // Streams never end by themselves, hence no graceful end: nothing is being written.
    tokio::select! {
        () = accept_all => {}
        () = end => {}
    }
    Ok(())
}

/// The answer to a request for this host. Whoever asks for anything looks at every cell.
async fn answered(shared: Shared, request: Request) -> Response {
    if !own::is_for(request.headers(), &shared.hosts) {
        let text = "this name is not one of this host: use its address, or start the dashboard with --host NAME\n";
        return told(StatusCode::MISDIRECTED_REQUEST, text);
    }
    shared.live.look().await;
    let path = request.uri().path().to_owned();
    let Some(parts) = parts(&path) else {
        return told(
            StatusCode::BAD_REQUEST,
            "the path of this address is not UTF-8\n",
        );
    };
    let parts: Vec<&str> = parts.iter().map(AsRef::as_ref).collect();
    let acts = matches!(parts[..], ["act"] | ["act", "offer"]);
    let methods: &[Method] = if acts {
        &[Method::POST]
    } else {
        &[Method::GET, Method::HEAD]
    };
    if !methods.contains(request.method()) {
        let allowed = if acts { "POST" } else { "GET,HEAD" };
        let refused = told(StatusCode::METHOD_NOT_ALLOWED, "");
        return with(refused, header::ALLOW, HeaderValue::from_static(allowed));
    }
    let made = match parts[..] {
        ["act"] => Ok(sign(shared, request).await),
        ["act", "offer"] => Ok(offer(shared, request).await),
        ["viewer"] => Ok(viewer(&shared, request)),
        _ => shown(shared, &parts, &request).await,
    };
    made.unwrap_or_else(|why| told(StatusCode::BAD_REQUEST, why))
}

/// The page or file of an address. The error is a sentence: its query cannot be read.
async fn shown(shared: Shared, parts: &[&str], request: &Request) -> Result<Response, String> {
    let rest = || parts[1..].join("/");
    Ok(match *parts {
        [""] => hall(&shared, &query(request)?),
        ["hall.csv"] => hall_csv(&shared, &query(request)?),
        ["cell", ..] => cell(&shared, &rest(), &query(request)?),
        ["description", ..] => description(&shared, &rest()),
        ["events", "hall"] => {
            let choice: Choice = query(request)?;
            let since = choice.since.clone();
            events(
                shared,
                Shown::Hall(choice),
                since.as_deref(),
                request.headers(),
            )
        }
        ["events", "cell", ref name @ ..] => {
            let look: Look = query(request)?;
            let shown = Shown::Cell(name.join("/"), look.view());
            events(shared, shown, look.since.as_deref(), request.headers())
        }
        ["sessions"] => sessions(shared, query(request)?).await,
        ["sessions.csv"] => sessions_csv(shared).await,
        ["session", name] => session(shared, name.to_owned(), query(request)?).await,
        ["session", name, "description"] => {
            session_description(shared, name.to_owned(), query(request)?).await
        }
        ["session", name, "report"] => report(shared, name.to_owned(), query(request)?).await,
        ["session", name, "diagnosis"] => diagnosis(shared, name.to_owned()).await,
        ["session", name, "mcap", index] => match index.parse() {
            Ok(index) => download(shared, name.to_owned(), index).await,
            Err(_) => {
                return Err(format!(
                    "the number of a file of the recording is expected, not {index:?}\n"
                ));
            }
        },
        ["compare"] => compare(shared, query(request)?).await,
        ["machines"] => machines(shared).await,
        ["machine", ..] => machine(shared, rest()).await,
        ["metrics"] => metrics_text(&shared),
        ["key"] => key_page(&shared),
        ["act", "token"] => token(&shared),
        ["assets", ..] => asset(&rest()),
        _ => missing("There is no such page."),
    })
}

/// An answer with the headers of every answer.
fn guarded(mut answer: Response) -> Response {
    let headers = answer.headers_mut();
    let fixed = HeaderValue::from_static;
    headers
        .entry(header::CONTENT_SECURITY_POLICY)
        .or_insert(fixed(POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, fixed("nosniff"));
    headers.insert(header::REFERRER_POLICY, fixed("no-referrer"));
    headers.insert("cross-origin-resource-policy", fixed("same-origin"));
    headers
        .entry(header::CACHE_CONTROL)
        .or_insert(fixed("no-store"));
    answer
}

/// What pages load.
fn asset(name: &str) -> Response {
    let (kind, content) = match name {
        "style.css" => (
            "text/css; charset=utf-8",
            include_str!("../assets/style.css"),
        ),
        "app.js" => (SCRIPT, include_str!("../assets/app.js")),
        "acts.js" => (SCRIPT, include_str!("../assets/acts.js")),
        "scene.js" => (SCRIPT, include_str!("../assets/scene.js")),
        "icon.svg" => ("image/svg+xml", include_str!("../assets/icon.svg")),
        "vendor/three.module.min.js" => {
            (SCRIPT, include_str!("../assets/vendor/three.module.min.js"))
        }
        "vendor/three.core.min.js" => (SCRIPT, include_str!("../assets/vendor/three.core.min.js")),
        "vendor/three.LICENSE" => (
            "text/plain; charset=utf-8",
            include_str!("../assets/vendor/three.LICENSE"),
        ),
        _ => return missing("There is no such page."),
    };
    let asset = answer(kind, content);
    with(
        asset,
        header::CACHE_CONTROL,
        HeaderValue::from_static("no-cache"),
    )
}

fn hall(shared: &Shared, choice: &Choice) -> Response {
    let seen = seen_now(&shared.live, shared.epoch);
    let trouble = shared.live.trouble();
    let hall = shared.live.hall();
    page(view::hall_page(&hall, host::now(), choice, &seen, &trouble))
}

/// The same as a table.
fn hall_csv(shared: &Shared, choice: &Choice) -> Response {
    let hall = shared.live.hall();
    csv("hall", view::hall_csv(&hall, host::now(), choice))
}

fn cell(shared: &Shared, name: &str, look: &Look) -> Response {
    let seen = seen_now(&shared.live, shared.epoch);
    let hall = shared.live.hall();
    if hall.cell(name).is_some() {
        shared.live.want_axes(name);
    }
    match hall.cell(name) {
        Some(cell) => page(view::cell_page(
            cell,
            &hall,
            host::now(),
            look.view(),
            &seen,
        )),
        None => missing(
            "No cell of this name has been heard. It may not have started yet, or have left a while ago.",
        ),
    }
}

/// Description of the machine of a cell, for the picture in three dimensions.
fn description(shared: &Shared, name: &str) -> Response {
    let hall = shared.live.hall();
    let text = hall.cell(name).map(|cell| cell.description.to_string());
    text.map_or_else(|| missing("No such machine."), |text| answer(TEXT, text))
}

fn events(shared: Shared, shown: Shown, since: Option<&str>, headers: &HeaderMap) -> Response {
    let seen = http::header(headers, "last-event-id").or(since);
    let Some(seat) = shared.clients.take(CLIENTS) else {
        let full = told(
            StatusCode::SERVICE_UNAVAILABLE,
            "too many pages follow the dashboard",
        );
        return with(full, header::RETRY_AFTER, HeaderValue::from_static("10"));
    };
    let events = stream(shared.live, shared.epoch, shown, seen, seat);
    of_kind("text/event-stream", streamed(events))
}

fn metrics_text(shared: &Shared) -> Response {
    let process = Process {
        clients: shared.clients.count(),
        received: shared
            .live
            .received
            .load(std::sync::atomic::Ordering::Relaxed),
    };
    let text = metrics(&shared.live.hall(), host::now(), &process);
    answer("text/plain; version=0.0.4", text)
}
