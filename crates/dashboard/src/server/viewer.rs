//! The handshake of a viewer: [`crate::viewer`] over HTTP.

use std::sync::Arc;

use base64::{Engine as _, prelude::BASE64_STANDARD};
use fastwebsockets::{Role, WebSocket};
use hyper::header::HeaderValue;
use hyper::{HeaderMap, StatusCode, header};
use hyper_util::rt::TokioIo;
use sha1::{Digest as _, Sha1};

use super::answer::Shared;
use super::http::{Request, Response, status_of, told, with};
use super::own::host;
use crate::viewer::{PROTOCOLS, VIEWERS, serve};

/// What the page of an application on this computer names as its origin.
const FILE: &str = "file://";

/// Opens the connection of a viewer.
pub(super) fn viewer(shared: &Shared, request: Request) -> Response {
    let headers = request.headers();
    let Some(accept) = accepted(headers) else {
        let text = "this address is for viewers: give Foxglove or Lichtblick the same one with ws:// for http://\n";
        return told(StatusCode::UPGRADE_REQUIRED, text);
    };
    if let Err(origin) = known_origin(headers, &shared.viewers) {
        let text = format!(
            "a page of {origin} asks for the topics of the cells and gets none; --viewer {origin} lets it in"
        );
        tracing::warn!("{text}");
        return told(StatusCode::FORBIDDEN, text + "\n");
    }
    let Some(protocol) = protocol(headers) else {
        let text = format!(
            "the protocols spoken here are {}\n",
            PROTOCOLS.join(" and ")
        );
        return told(StatusCode::BAD_REQUEST, text);
    };
    let Some(seat) = shared.watching.take(VIEWERS) else {
        let text = format!("there are {VIEWERS} viewers already\n");
        return told(StatusCode::SERVICE_UNAVAILABLE, text);
    };
    let (buses, epoch) = (Arc::clone(&shared.buses), shared.epoch);
    tokio::spawn(async move {
        let _seat = seat;
        let ended = match hyper::upgrade::on(request).await {
            Ok(stream) => {
                let socket = WebSocket::after_handshake(TokioIo::new(stream), Role::Server);
                serve(socket, buses, epoch)
                    .await
                    .map_err(|error| error.to_string())
            }
            Err(error) => Err(error.to_string()),
        };
        if let Err(error) = ended {
            tracing::debug!(%error, "a viewer left");
        }
    });
    let fixed = HeaderValue::from_static;
    let headers = [
        (header::CONNECTION, fixed("upgrade")),
        (header::UPGRADE, fixed("websocket")),
        (header::SEC_WEBSOCKET_ACCEPT, accept),
        (header::SEC_WEBSOCKET_PROTOCOL, fixed(protocol)),
    ];
    let answer = status_of(told(StatusCode::OK, ""), StatusCode::SWITCHING_PROTOCOLS);
    let with_one = |answer, (name, value)| with(answer, name, value);
    headers.into_iter().fold(answer, with_one)
}

/// The answer to the key of a request for a WebSocket (RFC 6455, 4.2.2); none where it is no such request.
fn accepted(headers: &HeaderMap) -> Option<HeaderValue> {
    let names = |name, word: &str| {
        let all = headers.get_all(name);
        let mut words = all
            .iter()
            .filter_map(|one| one.to_str().ok())
            .flat_map(|one| one.split(','));
        words.any(|one| one.trim().eq_ignore_ascii_case(word))
    };
    let is_one = names(header::CONNECTION, "upgrade")
        && names(header::UPGRADE, "websocket")
        && names(header::SEC_WEBSOCKET_VERSION, "13");
    let key = headers.get(header::SEC_WEBSOCKET_KEY).filter(|_| is_one)?;
    let mut hash = Sha1::new();
    hash.update(key.as_bytes());
    hash.update(b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11");
    HeaderValue::from_str(&BASE64_STANDARD.encode(hash.finalize())).ok()
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
