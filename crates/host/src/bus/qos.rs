//! Quality of service of a topic, and its spelling in rmw_zenoh's liveliness tokens.
//!
//! Only the policies that a cell uses are kept: reliability, durability, history and lifespan. Deadline and liveliness stay at
//! their defaults on both transports.

use std::time::Duration;

/// Whether a sample that the network lost is sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Reliability {
    /// What was published arrives, or is reported lost by number.
    Reliable,
    /// What was lost is only counted.
    BestEffort,
}

/// Whether a late joiner gets what was published before it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Durability {
    /// Only what is published from now on.
    Volatile,
    /// First the last samples, as many as the history keeps.
    TransientLocal,
}

/// How many published samples are kept for late joiners and for recovery.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum History {
    /// The last samples, at least 1.
    KeepLast(usize),
    /// All, up to the depth that the bus configuration allows.
    KeepAll,
}

/// Quality of service of one publisher or subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Qos {
    /// Resend or not.
    pub reliability: Reliability,
    /// Late joiners or not.
    pub durability: Durability,
    /// Depth.
    pub history: History,
    /// Age at which a sample is no longer valid; `None`: it stays valid. On Zenoh it is announced and expires nothing, as with
    /// rmw_zenoh.
    pub lifespan: Option<Duration>,
}

/// Depth that rmw_zenoh assumes, and therefore leaves out of its tokens.
const RMW_DEFAULT_DEPTH: usize = 42;

impl Qos {
    /// Reliable, volatile, the last `depth` samples: the default of a ROS 2 topic at depth 10.
    pub const fn reliable(depth: usize) -> Self {
        Self {
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            history: History::KeepLast(depth),
            lifespan: None,
        }
    }

    /// Best effort, volatile, the last `depth` samples.
    pub const fn best_effort(depth: usize) -> Self {
        Self {
            reliability: Reliability::BestEffort,
            durability: Durability::Volatile,
            history: History::KeepLast(depth),
            lifespan: None,
        }
    }

    /// Reliable, volatile, keep all: events of which none may be missed.
    pub const fn events() -> Self {
        Self {
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            history: History::KeepAll,
            lifespan: None,
        }
    }

    /// Reliable, transient local, the last `depth` samples: state that a late joiner must know.
    pub const fn latched(depth: usize) -> Self {
        Self {
            reliability: Reliability::Reliable,
            durability: Durability::TransientLocal,
            history: History::KeepLast(depth),
            lifespan: None,
        }
    }

    /// The same, with samples that are valid until this age.
    #[must_use]
    pub const fn with_lifespan(self, lifespan: Duration) -> Self {
        Self {
            lifespan: Some(lifespan),
            ..self
        }
    }

    /// Quality of service of requests and responses (`rmw_qos_profile_services_default`).
    pub(crate) const fn services() -> Self {
        Self::reliable(10)
    }

    pub(crate) fn is_reliable(self) -> bool {
        self.reliability == Reliability::Reliable
    }

    pub(crate) fn is_latched(self) -> bool {
        self.durability == Durability::TransientLocal
    }

    pub(crate) fn keeps_all(self) -> bool {
        self.history == History::KeepAll
    }

    /// Samples to keep, at least 1; `all` stands for keep all.
    pub(crate) fn depth(self, all: usize) -> usize {
        match self.history {
            History::KeepLast(depth) => depth.max(1),
            History::KeepAll => all.max(1),
        }
    }

    /// The token's spelling: `rel:dur:hist,depth:deadline:lifespan:liveliness`, empty where rmw's default holds.
    pub(crate) fn to_token(self) -> String {
        let reliability = match self.reliability {
            Reliability::Reliable => "",
            Reliability::BestEffort => "2",
        };
        let durability = match self.durability {
            Durability::Volatile => "",
            Durability::TransientLocal => "1",
        };
        let (history, depth) = match self.history {
            History::KeepLast(depth) if depth == RMW_DEFAULT_DEPTH => ("", String::new()),
            History::KeepLast(depth) => ("", depth.to_string()),
            History::KeepAll => ("2", String::new()),
        };
        let lifespan = self.lifespan.map_or(",".to_owned(), |age| {
            format!("{},{}", age.as_secs(), age.subsec_nanos())
        });
        format!("{reliability}:{durability}:{history},{depth}:,:{lifespan}:,,")
    }

    /// Reads a token's spelling; policies that this type does not keep are ignored.
    pub(crate) fn from_token(token: &str) -> Option<Self> {
        let mut parts = token.split(':');
        let reliability = match parts.next()? {
            "" | "0" | "1" => Reliability::Reliable,
            "2" => Reliability::BestEffort,
            _ => return None,
        };
        let durability = match parts.next()? {
            "" | "0" | "2" => Durability::Volatile,
            "1" => Durability::TransientLocal,
            _ => return None,
        };
        let (kind, depth) = parts.next()?.split_once(',')?;
        let history = match kind {
            "" | "0" | "1" if depth.is_empty() => History::KeepLast(RMW_DEFAULT_DEPTH),
            "" | "0" | "1" => History::KeepLast(depth.parse().ok()?),
            "2" => History::KeepAll,
            _ => return None,
        };
        let lifespan = parts.nth(1).and_then(|part| part.split_once(','));
        let lifespan = match lifespan {
            None | Some(("", _)) => None,
            Some((seconds, nanos)) => {
                let nanos = if nanos.is_empty() { "0" } else { nanos };
                let whole = Duration::from_secs(seconds.parse().ok()?);
                Some(whole.saturating_add(Duration::from_nanos(nanos.parse().ok()?)))
            }
        };
        Some(Self {
            reliability,
            durability,
            history,
            lifespan,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spellings seen on the wire from rmw_zenoh and its Python counterpart.
    #[test]
    fn token_spelling_equals_rmw() {
        for (qos, token) in [
            (Qos::reliable(10), "::,10:,:,:,,"),
            (Qos::latched(5), ":1:,5:,:,:,,"),
            (Qos::reliable(42), "::,:,:,:,,"),
            (Qos::best_effort(10), "2::,10:,:,:,,"),
            (Qos::events(), "::2,:,:,:,,"),
            (
                Qos::latched(1_000).with_lifespan(Duration::from_secs(10)),
                ":1:,1000:,:10,0:,,",
            ),
            (
                Qos::reliable(10).with_lifespan(Duration::from_millis(1_500)),
                "::,10:,:1,500000000:,,",
            ),
        ] {
            assert_eq!(qos.to_token(), token);
            assert_eq!(Qos::from_token(token), Some(qos));
        }
    }

    #[test]
    fn explicit_defaults_are_read_and_nonsense_is_refused() {
        assert_eq!(Qos::from_token("1:2:1,10:,:,:,,"), Some(Qos::reliable(10)));
        assert_eq!(Qos::from_token("9::,10"), None);
        assert_eq!(Qos::from_token("::,10:,:ten,0:,,"), None);
        assert_eq!(Qos::from_token("::,ten"), None);
        assert_eq!(Qos::from_token(""), None);
    }
}
