//! What can go wrong between a node and the bus.

use std::fmt::Display;

/// Why an operation on the bus failed.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The settings are not those of Zenoh, or contradict one another.
    #[error("the bus settings are invalid: {reason}")]
    Config {
        /// Reason given by the transport.
        reason: String,
    },
    /// Nothing to connect to.
    #[error(
        "no router answers at {endpoints} within {seconds:.1} s: `probecell router` or a running cell provides one, and that of a secured \
         cell of another account admits none but its users ({reason})"
    )]
    NoRouter {
        /// Locators tried.
        endpoints: String,
        /// Time waited, s.
        seconds: f64,
        /// Reason given by the transport.
        reason: String,
    },
    /// The router's address is in use.
    #[error("the address {endpoint} is taken {}", if *answers {
        "by another Zenoh router: connect to that one instead of starting a second"
    } else {
        "by a program that is no Zenoh router: stop it or choose another port"
    })]
    PortTaken {
        /// Locator that could not be bound.
        endpoint: String,
        /// A Zenoh router answers there.
        answers: bool,
    },
    /// Not an absolute ROS name.
    #[error("\"{name}\" is not an absolute ROS name (a slash, then letters, digits, underscores)")]
    Name {
        /// The name.
        name: String,
    },
    /// Not the name of a ROS type.
    #[error("\"{name}\" is not a ROS type name like pkg::msg::dds_::Type_")]
    Type {
        /// The name.
        name: String,
    },
    /// The payload is not little-endian CDR.
    #[error("the payload does not begin with the header of little-endian CDR (00 01)")]
    Payload,
    /// No server offers this service.
    #[error("no server offers {name}: its cell does not run, or on another bus")]
    NoServer {
        /// Service.
        name: String,
    },
    /// The server did not answer in time.
    #[error("{name} did not answer within {seconds:.1} s")]
    Timeout {
        /// Service.
        name: String,
        /// Time waited, s.
        seconds: f64,
    },
    /// The server refused the request.
    #[error("{name} refused the request: {reason}")]
    Refused {
        /// Service.
        name: String,
        /// The server's sentence.
        reason: String,
    },
    /// The transport failed.
    #[error("cannot {action}: {reason}")]
    Transport {
        /// What was tried.
        action: &'static str,
        /// Reason given by the transport.
        reason: String,
    },
}

impl BusError {
    /// True for what the user gave wrongly, false for what went wrong on the bus.
    #[must_use]
    pub fn is_of_input(&self) -> bool {
        matches!(
            self,
            Self::Config { .. } | Self::Name { .. } | Self::Type { .. }
        )
    }

    pub(crate) fn transport(action: &'static str, reason: &dyn Display) -> Self {
        Self::Transport {
            action,
            reason: without_source_lines(&reason.to_string()),
        }
    }
}

/// Zenoh ends its errors in the source line that made them, ` at /path/file.rs:12.`, which is of no use to a user.
pub(super) fn without_source_lines(reason: &str) -> String {
    let mut parts = reason.split(" at /");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        if let Some((_, rest)) = part.split_once(".rs:") {
            text.push_str(rest.trim_start_matches(|digit: char| digit.is_ascii_digit()));
        } else {
            text.push_str(" at /");
            text.push_str(part);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::without_source_lines;

    #[test]
    fn places_in_the_source_are_left_out_and_the_rest_is_kept() {
        assert_eq!(
            without_source_lines(
                "no link at /a/b-1.0/src/net.rs:388. caused by: refused at /c/d.rs:1."
            ),
            "no link. caused by: refused."
        );
        assert_eq!(
            without_source_lines("no file at /etc/hosts"),
            "no file at /etc/hosts"
        );
    }
}
