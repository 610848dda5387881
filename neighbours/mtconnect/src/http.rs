//! Requests of MTConnect over HTTP (Part 1, section 8): `probe`, `current` and `sample`, once or as a stream of documents.

use std::collections::HashMap;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Query, State};
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use connector::mtconnect::agent::{Agent, Answer};
use futures::stream::unfold;

use crate::{Served, now};

/// Observations of an answer unless the request says otherwise.
const COUNT: usize = 100;
/// Longest time without a document in a stream, ms, unless the request says otherwise.
const HEARTBEAT: u64 = 10_000;
/// It separates the parts of a stream.
const BOUNDARY: &str = "probecell-mtconnect-part";
/// Parameters that a request may have.
const PARAMETERS: [&str; 5] = ["at", "from", "count", "interval", "heartbeat"];

type Parameters = HashMap<String, String>;

/// Serves until `end`; `ready` gets the address.
pub(crate) fn serve(
    listen: SocketAddr,
    served: Arc<Served>,
    end: impl Future<Output = ()>,
    ready: impl FnOnce(SocketAddr),
) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let listener = tokio::net::TcpListener::bind(listen).await;
        let listener = listener.with_context(|| format!("cannot listen on {listen}"))?;
        ready(listener.local_addr()?);
        // Streams never end by themselves, hence no graceful end.
        tokio::select! {
            ended = axum::serve(listener, router(served)) => Ok(ended?),
            () = end => Ok(()),
        }
    })
}

fn router(served: Arc<Served>) -> Router {
    Router::new()
        .route("/", get(probe))
        .route("/{request}", get(request))
        .route("/{device}/{request}", get(request_of_device))
        .fallback(unsupported)
        .with_state(served)
}

async fn probe(State(served): State<Arc<Served>>) -> Response {
    answer(Ok(served.agent().probe(now())))
}

async fn request(
    State(served): State<Arc<Served>>,
    Path(request): Path<String>,
    Query(parameters): Query<Parameters>,
) -> Response {
    respond(&served, &request, &parameters)
}

async fn request_of_device(
    State(served): State<Arc<Served>>,
    Path((device, request)): Path<(String, String)>,
    Query(parameters): Query<Parameters>,
) -> Response {
    let is_known = served.agent().is_device(&device);
    if is_known {
        return respond(&served, &request, &parameters);
    }
    let text = format!("there is no device {device} here");
    let document = served
        .agent()
        .error("NoDevice", &format!("/{device}/{request}"), &text, now());
    xml(StatusCode::NOT_FOUND, document)
}

async fn unsupported(State(served): State<Arc<Served>>, uri: Uri) -> Response {
    refuse(&served, uri.path(), "only probe, current and sample are")
}

fn refuse(served: &Served, what: &str, why: &str) -> Response {
    let text = format!("{what} is not supported: {why}");
    let document = served.agent().error("Unsupported", what, &text, now());
    xml(StatusCode::NOT_FOUND, document)
}

fn respond(served: &Arc<Served>, request: &str, parameters: &Parameters) -> Response {
    let now = now();
    if let Some(unknown) = parameters
        .keys()
        .find(|one| !PARAMETERS.contains(&one.as_str()))
    {
        return refuse(
            served,
            &format!("/{request}?{unknown}"),
            "no such parameter is known here",
        );
    }
    let asked = match Asked::read(parameters) {
        Ok(asked) => asked,
        Err((name, text)) => return answer(Err(served.agent().invalid(name, &text, now))),
    };
    match (request, asked.interval) {
        ("probe", None) => answer(Ok(served.agent().probe(now))),
        ("current", None) => answer(served.agent().current(asked.at, now)),
        ("sample", None) => answer(served.agent().sample(asked.from, asked.count, now)),
        ("current", Some(Duration::ZERO)) => {
            let text = "interval = 0 is for sample: current is answered at intervals from 1 ms";
            answer(Err(served.agent().invalid("interval", text, now)))
        }
        ("current" | "sample", Some(interval)) => {
            let is_sample = request == "sample";
            let first = served.agent().sample(asked.from, asked.count, now);
            if let (true, Err(document)) = (is_sample, first) {
                return answer(Err(document));
            }
            if asked.at.is_some() {
                let text = "at asks for one instant, interval for a stream";
                return answer(Err(served.agent().invalid("at", text, now)));
            }
            follow(Arc::clone(served), is_sample, &asked, interval)
        }
        _ => refuse(
            served,
            &format!("/{request}"),
            "only probe, current and sample are",
        ),
    }
}

/// Parameters of a request.
struct Asked {
    at: Option<u64>,
    from: Option<u64>,
    count: usize,
    interval: Option<Duration>,
    heartbeat: Duration,
}

impl Asked {
    /// Reads them; the name of the one that is not a number, and a sentence.
    fn read(parameters: &Parameters) -> Result<Self, (&'static str, String)> {
        let number = |name: &'static str| {
            let text = parameters.get(name);
            text.map(|text| {
                text.parse::<u64>()
                    .map_err(|_| (name, format!("{name} = {text} is no number")))
            })
            .transpose()
        };
        let count =
            number("count")?.map_or(COUNT, |count| usize::try_from(count).unwrap_or(usize::MAX));
        Ok(Self {
            at: number("at")?,
            from: number("from")?,
            count,
            interval: number("interval")?.map(Duration::from_millis),
            heartbeat: match number("heartbeat")?.unwrap_or(HEARTBEAT) {
                0 => return Err(("heartbeat", "heartbeat = 0 is below 1 ms".to_owned())),
                heartbeat => Duration::from_millis(heartbeat),
            },
        })
    }
}

/// A stream of documents, `multipart/x-mixed-replace`: samples as they come, no two closer than the interval, an empty one as
/// heartbeat; or what is current each interval.
fn follow(served: Arc<Served>, is_sample: bool, asked: &Asked, interval: Duration) -> Response {
    let (count, heartbeat) = (asked.count, asked.heartbeat);
    let from = asked.from.unwrap_or_else(|| served.agent().first());
    let observations = served.observations();
    let parts = unfold(
        (served, observations, Some(from), true),
        move |state| async move {
            let (served, mut observations, from, is_first) = state;
            let from = from?;
            if !is_first {
                tokio::time::sleep(interval).await;
            }
            if is_sample && served.agent().next_sequence() <= from {
                let newer = observations.wait_for(|next| *next > from);
                // Without one in time an empty document says that the agent lives.
                drop(tokio::time::timeout(heartbeat, newer).await);
            }
            let now = now();
            let agent = served.agent();
            let (document, next) = if is_sample {
                sampled(&agent, from, count, now)
            } else {
                (agent.current(None, now), Some(from))
            };
            drop(agent);
            let document = document.unwrap_or_else(|error| error);
            let head = format!(
                "--{BOUNDARY}\r\nContent-type: application/xml\r\nContent-length: {}\r\n\r\n",
                document.len()
            );
            let part = Bytes::from(head + &document + "\r\n");
            // A reader that fell out of the buffer gets the error document, which ends the stream.
            Some((
                Ok::<_, Infallible>(part),
                (served, observations, next, false),
            ))
        },
    );
    let kind = format!("multipart/x-mixed-replace;boundary={BOUNDARY}");
    ([(header::CONTENT_TYPE, kind)], Body::from_stream(parts)).into_response()
}

fn sampled(
    agent: &Agent,
    from: u64,
    count: usize,
    now: probecell_msgs::builtin_interfaces::Time,
) -> (Answer, Option<u64>) {
    let document = agent.sample(Some(from), count, now);
    let next = document
        .is_ok()
        .then(|| agent.next_sequence().min(from.saturating_add(count as u64)));
    (document, next)
}

fn answer(answer: Answer) -> Response {
    match answer {
        Ok(document) => xml(StatusCode::OK, document),
        Err(document) => xml(StatusCode::NOT_FOUND, document),
    }
}

fn xml(status: StatusCode, document: String) -> Response {
    (
        status,
        [(header::CONTENT_TYPE, "application/xml")],
        document,
    )
        .into_response()
}
