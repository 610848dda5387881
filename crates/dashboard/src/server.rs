//! The pages over HTTP. Every answer forbids content from elsewhere, and none is given to a request for another host; nothing
//! but GET is served, except what an operator has signed ([`act`]).

mod act;
mod answer;
mod own;
mod recorded;
mod viewer;

use std::future::Future;
use std::io;
use std::time::Duration;

use axum::Router;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::sse::Sse;
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;

use self::act::{key_page, offer, sign, token};
use self::answer::{Look, csv, missing, page};
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
    let router = router(shared);
    let accept_all = async {
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                // Without a descriptor nothing is taken until one is free.
                tokio::time::sleep(NO_ROOM).await;
                continue;
            };
            let service = TowerToHyperService::new(router.clone());
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

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/", get(hall))
        .route("/hall.csv", get(hall_csv))
        .route("/cell/{*name}", get(cell))
        .route("/description/{*name}", get(description))
        .route("/events/hall", get(hall_events))
        .route("/events/cell/{*name}", get(cell_events))
        .route("/sessions", get(sessions))
        .route("/sessions.csv", get(sessions_csv))
        .route("/session/{name}", get(session))
        .route("/session/{name}/description", get(session_description))
        .route("/session/{name}/report", get(report))
        .route("/session/{name}/diagnosis", get(diagnosis))
        .route("/session/{name}/mcap/{index}", get(download))
        .route("/compare", get(compare))
        .route("/machines", get(machines))
        .route("/machine/{*name}", get(machine))
        .route("/metrics", get(metrics_text))
        .route("/viewer", get(viewer))
        .route("/key", get(key_page))
        .route("/act/token", get(token))
        .route("/act/offer", post(offer))
        .route("/act", post(sign))
        .route("/assets/{*name}", get(asset))
        .fallback(|| async { missing("There is no such page.") })
        .layer(from_fn_with_state(shared.clone(), looked))
        .layer(from_fn_with_state(shared.clone(), own::own_host))
        .layer(from_fn(guarded))
        .with_state(shared)
}

/// Whoever asks for anything looks at every cell.
async fn looked(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    shared.live.look().await;
    next.run(request).await
}

/// Headers of every answer.
async fn guarded(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers
        .entry(header::CONTENT_SECURITY_POLICY)
        .or_insert(HeaderValue::from_static(POLICY));
    headers.insert(
        header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    );
    headers.insert(
        header::REFERRER_POLICY,
        HeaderValue::from_static("no-referrer"),
    );
    headers.insert(
        "cross-origin-resource-policy",
        HeaderValue::from_static("same-origin"),
    );
    headers
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    response
}

/// What pages load.
async fn asset(Path(name): Path<String>) -> Response {
    let (kind, content) = match name.as_str() {
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
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, content).into_response()
}

async fn hall(State(shared): State<Shared>, Query(choice): Query<Choice>) -> Response {
    let seen = seen_now(&shared.live, shared.epoch);
    let trouble = shared.live.trouble();
    let hall = shared.live.hall();
    page(view::hall_page(
        &hall,
        host::now(),
        &choice,
        &seen,
        &trouble,
    ))
}

/// The same as a table.
async fn hall_csv(State(shared): State<Shared>, Query(choice): Query<Choice>) -> Response {
    let hall = shared.live.hall();
    csv("hall", view::hall_csv(&hall, host::now(), &choice))
}

async fn cell(
    State(shared): State<Shared>,
    Path(name): Path<String>,
    Query(look): Query<Look>,
) -> Response {
    let seen = seen_now(&shared.live, shared.epoch);
    let hall = shared.live.hall();
    if hall.cell(&name).is_some() {
        shared.live.want_axes(&name);
    }
    match hall.cell(&name) {
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
async fn description(State(shared): State<Shared>, Path(name): Path<String>) -> Response {
    let hall = shared.live.hall();
    let text = hall.cell(&name).map(|cell| cell.description.to_string());
    text.map_or_else(|| missing("No such machine."), IntoResponse::into_response)
}

async fn hall_events(
    State(shared): State<Shared>,
    Query(choice): Query<Choice>,
    headers: HeaderMap,
) -> Response {
    let since = choice.since.clone();
    events(shared, Shown::Hall(choice), since.as_deref(), &headers)
}

async fn cell_events(
    State(shared): State<Shared>,
    Path(name): Path<String>,
    Query(look): Query<Look>,
    headers: HeaderMap,
) -> Response {
    let shown = Shown::Cell(name, look.view());
    events(shared, shown, look.since.as_deref(), &headers)
}

fn events(shared: Shared, shown: Shown, since: Option<&str>, headers: &HeaderMap) -> Response {
    let last = headers
        .get("last-event-id")
        .and_then(|value| value.to_str().ok());
    let seen = last.or(since);
    match shared.clients.take(CLIENTS) {
        Some(seat) => {
            Sse::new(stream(shared.live, shared.epoch, shown, seen, seat)).into_response()
        }
        None => (
            StatusCode::SERVICE_UNAVAILABLE,
            [(header::RETRY_AFTER, "10")],
            "too many pages follow the dashboard",
        )
            .into_response(),
    }
}

async fn metrics_text(State(shared): State<Shared>) -> Response {
    let process = Process {
        clients: shared.clients.count(),
        received: shared
            .live
            .received
            .load(std::sync::atomic::Ordering::Relaxed),
    };
    let text = metrics(&shared.live.hall(), host::now(), &process);
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4")], text).into_response()
}
