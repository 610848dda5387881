//! Requests and answers of hyper.

use std::borrow::Cow;
use std::io;

use futures::{Stream, TryStreamExt as _};
use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt as _, Full, StreamBody};
use hyper::body::{Bytes, Frame, Incoming};
use hyper::header::{CONTENT_TYPE, HeaderName, HeaderValue};
use hyper::{HeaderMap, StatusCode};
use serde::de::DeserializeOwned;

/// Types of content.
pub(super) const HTML: &str = "text/html; charset=utf-8";
pub(super) const TEXT: &str = "text/plain; charset=utf-8";
pub(super) const JSON: &str = "application/json";

pub(super) type Request = hyper::Request<Incoming>;
pub(crate) type Body = UnsyncBoxBody<Bytes, io::Error>;
pub(crate) type Response = hyper::Response<Body>;

/// Content known as a whole.
fn whole(content: impl Into<Bytes>) -> Body {
    Full::new(content.into())
        .map_err(|never| match never {})
        .boxed_unsync()
}

/// Content that is made while it is sent.
pub(crate) fn streamed(blocks: impl Stream<Item = io::Result<Bytes>> + Send + 'static) -> Body {
    StreamBody::new(blocks.map_ok(Frame::data)).boxed_unsync()
}

/// An answer with content of a type.
pub(super) fn answer(kind: &'static str, content: impl Into<Bytes>) -> Response {
    of_kind(kind, whole(content))
}

pub(super) fn of_kind(kind: &'static str, body: Body) -> Response {
    let answer = Response::new(body);
    with(answer, CONTENT_TYPE, HeaderValue::from_static(kind))
}

/// A sentence with a status.
pub(super) fn told(status: StatusCode, text: impl Into<Bytes>) -> Response {
    status_of(answer(TEXT, text), status)
}

pub(super) fn status_of(mut answer: Response, status: StatusCode) -> Response {
    *answer.status_mut() = status;
    answer
}

pub(super) fn with(mut answer: Response, name: HeaderName, value: HeaderValue) -> Response {
    answer.headers_mut().insert(name, value);
    answer
}

/// The first header of that name, where it is text.
pub(super) fn header<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name)?.to_str().ok()
}

/// The parts of a path between its slashes; none where one is not UTF-8.
pub(super) fn parts(path: &str) -> Option<Vec<Cow<'_, str>>> {
    let parts = path.split('/').skip(1);
    parts
        .map(|part| {
            percent_encoding::percent_decode_str(part)
                .decode_utf8()
                .ok()
        })
        .collect()
}

/// What follows the question mark of an address. The error is a sentence.
pub(super) fn query<Q: DeserializeOwned>(request: &Request) -> Result<Q, String> {
    let text = request.uri().query().unwrap_or_default();
    serde_urlencoded::from_str(text)
        .map_err(|error| format!("the query of this address cannot be read: {error}\n"))
}
