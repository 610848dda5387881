//! The handshake of a viewer: [`crate::viewer`] over HTTP.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use fastwebsockets::upgrade::{is_upgrade_request, upgrade};

use super::answer::Shared;
use super::own::host;
use crate::viewer::{PROTOCOLS, VIEWERS, serve};

/// What the page of an application on this computer names as its origin.
const FILE: &str = "file://";

/// Opens the connection of a viewer.
pub(super) async fn viewer(State(shared): State<Shared>, mut request: Request) -> Response {
    let headers = request.headers();
    if !is_upgrade_request(&request) {
        let text = "this address is for viewers: give Foxglove or Lichtblick the same one with ws:// for http://\n";
        return (StatusCode::UPGRADE_REQUIRED, text).into_response();
    }
    if let Err(origin) = known_origin(headers, &shared.viewers) {
        let text = format!(
            "a page of {origin} asks for the topics of the cells and gets none; --viewer {origin} lets it in"
        );
        tracing::warn!("{text}");
        return (StatusCode::FORBIDDEN, text + "\n").into_response();
    }
    let Some(protocol) = protocol(headers) else {
        let text = format!(
            "the protocols spoken here are {}\n",
            PROTOCOLS.join(" and ")
        );
        return (StatusCode::BAD_REQUEST, text).into_response();
    };
    let Some(seat) = shared.watching.take(VIEWERS) else {
        let text = format!("there are {VIEWERS} viewers already\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    let (response, upgraded) = match upgrade(&mut request) {
        Ok(begun) => begun,
        Err(error) => return (StatusCode::BAD_REQUEST, format!("{error}\n")).into_response(),
    };
    tokio::spawn(async move {
        let _seat = seat;
        let ended = match upgraded.await {
            Ok(socket) => serve(socket, Arc::clone(&shared.buses), shared.epoch).await,
            Err(error) => Err(error),
        };
        if let Err(error) = ended {
            tracing::debug!(%error, "a viewer left");
        }
    });
    let mut response = response.map(Body::new);
    let headers = response.headers_mut();
    headers.insert(
        header::SEC_WEBSOCKET_PROTOCOL,
        HeaderValue::from_static(protocol),
    );
    response
}

/// Browsers let every page open a WebSocket to this host: a page from elsewhere is let in only when it is named. Programs name
/// no origin; applications on this computer name [`FILE`].
fn known_origin<'a>(headers: &'a HeaderMap, viewers: &[String]) -> Result<(), &'a str> {
    let Some(origin) = headers.get(header::ORIGIN) else {
        return Ok(());
    };
    let origin = origin.to_str().map_err(|_| "an unreadable origin")?;
    let own = origin.split_once("://").map(|(_, name)| name);
    let same = own.is_some() && own == host(headers);
    if same || origin == FILE || viewers.iter().any(|one| one == origin) {
        Ok(())
    } else {
        Err(origin)
    }
}

/// The first protocol that both speak.
fn protocol(headers: &HeaderMap) -> Option<&'static str> {
    let offered = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL);
    let offered = offered.iter().filter_map(|one| one.to_str().ok());
    let mut names = offered.flat_map(|one| one.split(',')).map(str::trim);
    names.find_map(|name| PROTOCOLS.into_iter().find(|one| *one == name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &'static str)]) -> HeaderMap {
        let pairs = pairs.iter().cloned();
        pairs
            .map(|(name, value)| (name, HeaderValue::from_static(value)))
            .collect()
    }

    #[test]
    fn pages_from_elsewhere_are_let_in_when_they_are_named() {
        let named = ["https://app.foxglove.dev".to_owned()];
        let host = (header::HOST, "127.0.0.1:7480");
        for origin in [
            "file://",
            "http://127.0.0.1:7480",
            "https://app.foxglove.dev",
        ] {
            let headers = headers(&[host.clone(), (header::ORIGIN, origin)]);
            assert_eq!(known_origin(&headers, &named), Ok(()), "{origin}");
        }
        assert_eq!(
            known_origin(&headers(std::slice::from_ref(&host)), &[]),
            Ok(())
        );
        for origin in ["https://evil.example", "null", "http://127.0.0.1:8080"] {
            let headers = headers(&[host.clone(), (header::ORIGIN, origin)]);
            assert_eq!(known_origin(&headers, &named), Err(origin), "{origin}");
        }
    }

    #[test]
    fn the_first_protocol_that_both_speak_is_taken() {
        let of = |text| protocol(&headers(&[(header::SEC_WEBSOCKET_PROTOCOL, text)]));
        assert_eq!(of("other, foxglove.sdk.v1"), Some("foxglove.sdk.v1"));
        let both = "foxglove.websocket.v1, foxglove.sdk.v1";
        assert_eq!(of(both), Some("foxglove.websocket.v1"));
        assert_eq!(of("foxglove.sdk.v11"), None);
    }
}
