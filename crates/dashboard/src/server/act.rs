//! What a page asks for and sends when an operator acts: [`crate::acts`] over HTTP.

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::answer::{Shared, page};
use super::own::check;
use crate::acts::{Answer, Signed, Wish};
use crate::view;

/// Bytes of a request.
const LONGEST: usize = 16_384;

pub(super) async fn key_page(State(shared): State<Shared>) -> Response {
    let cells: Vec<String> = shared.acts.cells().into_iter().collect();
    page(view::key_page(&cells))
}

/// The token of our pages: a page from elsewhere can ask for it, but not read the answer.
pub(super) async fn token(State(shared): State<Shared>) -> Response {
    Json(json!({ "token": shared.acts.page_token })).into_response()
}

/// What exactly is to be signed.
pub(super) async fn offer(
    State(shared): State<Shared>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    answered(shared, &headers, &body, |shared, wish: &Wish| {
        shared.acts.offer(shared.live.hall(), wish)
    })
    .await
}

/// A signed act.
pub(super) async fn sign(
    State(shared): State<Shared>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    answered(shared, &headers, &body, |shared, signed: &Signed| {
        let answer = shared.acts.carry_out(signed);
        match &answer {
            Ok(answer) => {
                tracing::info!(by = %signed.operator, accepted = answer.accepted, text = %answer.text, "an act");
            }
            Err(why) => tracing::warn!(by = %signed.operator, %why, "an act is refused"),
        }
        answer
    })
    .await
}

async fn answered<Q: DeserializeOwned + Send + 'static, A: Serialize + Send + 'static>(
    shared: Shared,
    headers: &HeaderMap,
    body: &Bytes,
    work: fn(&Shared, &Q) -> Result<A, String>,
) -> Response {
    if let Err((status, why)) = check(headers, &shared.acts.page_token) {
        return refused(status, why);
    }
    if body.len() > LONGEST {
        return refused(StatusCode::PAYLOAD_TOO_LARGE, "an act is shorter than this");
    }
    let asked: Q = match serde_json::from_slice(body) {
        Ok(asked) => asked,
        Err(error) => {
            let why = format!("this is no act: {error}");
            return refused(StatusCode::BAD_REQUEST, &why);
        }
    };
    // The services of a cell are called on a thread that may block.
    let done = tokio::task::spawn_blocking(move || work(&shared, &asked)).await;
    match done {
        Ok(Ok(answer)) => Json(answer).into_response(),
        Ok(Err(why)) => refused(StatusCode::FORBIDDEN, &why),
        Err(error) => {
            tracing::error!(%error, "an act failed");
            refused(StatusCode::INTERNAL_SERVER_ERROR, "the act failed")
        }
    }
}

fn refused(status: StatusCode, why: &str) -> Response {
    let answer = Answer {
        accepted: false,
        text: why.to_owned(),
    };
    (status, Json(answer)).into_response()
}
