//! Offers of stops, which cost this process nothing: whoever asks for many takes none away from the operator.
//!
//! Other acts wait in a table of bounded length until they are signed. A stop is carried by its token instead: cell, instant
//! and a signature of this process, by a key that is drawn at its start.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

use probecell_msgs::builtin_interfaces::Time;
use signatures::{Act, Kind, PublicKey, SecretKey};

use super::{ActionEndpoint, OFFERED, bytes, hexadecimal, lock};

/// First word of a token; those of other acts are hexadecimal digits.
const WORD: &str = "stop";

/// Makes and knows tokens of stops.
pub(super) struct Stops {
    key: SecretKey,
    /// Those that an operator has signed, until they are too old: each stops once.
    used: Mutex<BTreeMap<String, Instant>>,
}

impl Stops {
    pub(super) fn new() -> Result<Self, getrandom::Error> {
        let mut seed = [0; 32];
        getrandom::fill(&mut seed)?;
        Ok(Self {
            key: SecretKey::from_seed(seed),
            used: Mutex::default(),
        })
    }

    /// The token of a stop that is offered now.
    pub(super) fn token(&self, desk: &ActionEndpoint, at: Time) -> String {
        let signature = hexadecimal(&self.key.sign(&act(desk.key, at)));
        format!("{WORD}/{}/{}/{signature}", desk.cell, at.nanos())
    }

    /// Cell and instant of a stop that this process has offered.
    pub(super) fn offered<'a>(
        &self,
        token: &str,
        desk: impl Fn(&str) -> Option<&'a ActionEndpoint>,
    ) -> Option<(&'a ActionEndpoint, Time)> {
        let rest = token.strip_prefix(WORD)?.strip_prefix('/')?;
        let (rest, signature) = rest.rsplit_once('/')?;
        let (cell, at) = rest.rsplit_once('/')?;
        let (desk, at) = (desk(cell)?, Time::from_nanos(at.parse().ok()?));
        let age = host::now().0 - at.nanos();
        let is_recent = u128::try_from(age).is_ok_and(|age| age < OFFERED.as_nanos());
        let signature = bytes(signature)?;
        let is_own = self.key.public().verifies(&act(desk.key, at), &signature);
        (is_own && is_recent).then_some((desk, at))
    }

    /// Takes a token that an operator has signed; false where it was taken before.
    pub(super) fn take(&self, token: &str) -> bool {
        let mut used = lock(&self.used);
        used.retain(|_, at| at.elapsed() < OFFERED);
        used.insert(token.to_owned(), Instant::now()).is_none()
    }
}

fn act(cell: PublicKey, at: Time) -> Act<'static> {
    Act {
        cell,
        kind: Kind::Stop,
        by: "",
        at,
        shown: "",
        subject: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn desk(cell: &str) -> ActionEndpoint {
        ActionEndpoint {
            cell: cell.to_owned(),
            key: SecretKey::from_seed([5; 32]).public(),
            private: None,
            bus: Box::new(|| Err("no bus".to_owned())),
        }
    }

    #[test]
    fn a_stop_is_known_by_its_token_for_a_minute_and_taken_once() {
        let (stops, desk) = (Stops::new().unwrap(), desk("hall/mill_1"));
        let known = |name: &str| (name == desk.cell).then_some(&desk);
        let now = host::now();
        let token = stops.token(&desk, now.time());
        let (of, at) = stops.offered(&token, known).expect("it was offered");
        assert_eq!((of.cell.as_str(), at), ("hall/mill_1", now.time()));
        assert!(stops.take(&token) && !stops.take(&token));
        let old = stops.token(&desk, now.after_s(-61.0).time());
        let future = stops.token(&desk, now.after_s(61.0).time());
        let other = Stops::new().unwrap().token(&desk, now.time());
        let elsewhere = token.replace("mill_1", "mill_2");
        let later = token.replace(&now.0.to_string(), &now.after_s(1.0).0.to_string());
        for wrong in [
            &old,
            &future,
            &other,
            &elsewhere,
            &later,
            "stop",
            "stop/a/1/ff",
            "",
        ] {
            assert!(stops.offered(wrong, known).is_none(), "{wrong}");
        }
    }
}
