//! Whether a request is for this host and from its own page.
//!
//! A name of somebody else's that suddenly means this host (DNS rebinding) makes a page from elsewhere one of ours in the eyes
//! of a browser; hence no request is answered that names a host which is not this one. An address cannot be rebound.

use std::net::IpAddr;

use hyper::{HeaderMap, StatusCode};

use super::http::header;

/// Header of the token of a page.
const TOKEN: &str = "x-act-token";

/// Whether a request is for this host, which has these names.
pub(super) fn is_for(headers: &HeaderMap, names: &[String]) -> bool {
    host(headers).is_some_and(|host| is_own(host, names))
}

pub(super) fn host(headers: &HeaderMap) -> Option<&str> {
    header(headers, "host")
}

/// An address, `localhost`, or one of the names of this host; a port may follow.
fn is_own(host: &str, names: &[String]) -> bool {
    let (name, port) = match host.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((name, port)) => (
            name,
            port.strip_prefix(':').or(port.is_empty().then_some("0")),
        ),
        None => host
            .split_once(':')
            .map_or((host, Some("0")), |(name, port)| (name, Some(port))),
    };
    // Whatever follows the name and is no port makes it another name.
    if port.is_none_or(|port| port.parse::<u16>().is_err()) {
        return false;
    }
    name.parse::<IpAddr>().is_ok()
        || name.eq_ignore_ascii_case("localhost")
        || names.iter().any(|own| own.eq_ignore_ascii_case(name))
}

/// Whether a request that acts is one of a page of ours: from the same origin, in JSON, which no form of another page can
/// send, and with the token that only our pages can read. The error is a sentence.
pub(super) fn check(headers: &HeaderMap, token: &str) -> Result<(), (StatusCode, &'static str)> {
    let kind = header(headers, "content-type").unwrap_or_default();
    if kind.split(';').next().map(str::trim) != Some("application/json") {
        return Err((
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "an act comes as application/json",
        ));
    }
    let origin = header(headers, "origin").and_then(|origin| origin.split_once("://"));
    let same = match (origin, host(headers)) {
        (Some((_, origin)), Some(host)) => origin.eq_ignore_ascii_case(host),
        _ => false,
    };
    let site = header(headers, "sec-fetch-site");
    if !same || site.is_some_and(|site| site != "same-origin") {
        return Err((
            StatusCode::FORBIDDEN,
            "an act comes from a page of this dashboard only",
        ));
    }
    if header(headers, TOKEN) != Some(token) {
        return Err((
            StatusCode::FORBIDDEN,
            "an act carries the token of a page of this dashboard: load the page again",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_own_names_are_this_host_and_nothing_else_is() {
        let names = ["hall-pc".to_owned()];
        for own in [
            "127.0.0.1:7480",
            "[::1]:7480",
            "10.0.0.7",
            "localhost:7480",
            "Hall-PC:7480",
        ] {
            assert!(is_own(own, &names), "{own}");
        }
        for other in [
            "evil.example:7480",
            "127.0.0.1.evil.example",
            "localhost.evil.example:7480",
            "hall-pc.evil.example",
            "127.0.0.1@evil.example:7480",
            "127.0.0.1:7480@evil.example",
            "127.0.0.1:7480/evil",
            "[::1]evil.example",
            "",
        ] {
            assert!(!is_own(other, &names), "{other}");
        }
    }
}
