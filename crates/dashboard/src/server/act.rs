//! What a page asks for and sends when an operator acts: [`crate::acts`] over HTTP.

use http_body_util::{BodyExt as _, LengthLimitError, Limited};
use hyper::StatusCode;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use super::answer::{Shared, page};
use super::http::{JSON, Request, Response, answer, status_of, told};
use super::own::check;
use crate::acts::{Answer, Signed, Wish};
use crate::view;

/// Bytes of a request.
const LONGEST: usize = 16_384;

pub(super) fn key_page(shared: &Shared) -> Response {
    let cells: Vec<String> = shared.acts.cells().into_iter().collect();
    page(view::key_page(&cells))
}

/// The token of our pages: a page from elsewhere can ask for it, but not read the answer.
pub(super) fn token(shared: &Shared) -> Response {
    json(&json!({ "token": shared.acts.page_token }))
}

/// What exactly is to be signed.
pub(super) async fn offer(shared: Shared, request: Request) -> Response {
    answered(shared, request, |shared, wish: &Wish| {
        shared.acts.offer(shared.live.hall(), wish)
    })
    .await
}

/// A signed act.
pub(super) async fn sign(shared: Shared, request: Request) -> Response {
    answered(shared, request, |shared, signed: &Signed| {
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
    request: Request,
    work: fn(&Shared, &Q) -> Result<A, String>,
) -> Response {
    if let Err((status, why)) = check(request.headers(), &shared.acts.page_token) {
        return refused(status, why);
    }
    let body = match Limited::new(request.into_body(), LONGEST).collect().await {
        Ok(body) => body.to_bytes(),
        Err(error) if error.is::<LengthLimitError>() => {
            return refused(StatusCode::PAYLOAD_TOO_LARGE, "an act is shorter than this");
        }
        Err(error) => {
            return refused(
                StatusCode::BAD_REQUEST,
                &format!("the act did not arrive whole: {error}"),
            );
        }
    };
    let asked: Q = match serde_json::from_slice(&body) {
        Ok(asked) => asked,
        Err(error) => {
            let why = format!("this is no act: {error}");
            return refused(StatusCode::BAD_REQUEST, &why);
        }
    };
    // The services of a cell are called on a thread that may block.
    let done = tokio::task::spawn_blocking(move || work(&shared, &asked)).await;
    match done {
        Ok(Ok(answer)) => json(&answer),
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
    status_of(json(&answer), status)
}

fn json(content: &impl Serialize) -> Response {
    match serde_json::to_vec(content) {
        Ok(content) => answer(JSON, content),
        Err(error) => told(StatusCode::INTERNAL_SERVER_ERROR, error.to_string()),
    }
}
