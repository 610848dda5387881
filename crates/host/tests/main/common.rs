//! A key that answers after all that was said before on the way to its session: tests wait for it instead of for a time.

use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use zenoh::{Session, Wait, query::Query};

/// Longest wait for what must happen.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

/// What was heard: who said it, and what or on which key.
pub(crate) type Heard = Arc<Mutex<BTreeSet<(String, String)>>>;

/// The key of a topic, whatever its type.
pub(crate) fn key(topic: &str) -> String {
    format!("0/{topic}/T/H")
}

/// Serves the key as long as the session lives.
pub(crate) fn serve(session: &Session, key: String) -> String {
    let answer = key.clone();
    let queryable = session
        .declare_queryable(&key)
        .callback(move |query: Query| {
            query.reply(&answer, "here").wait().expect("a reply");
        });
    queryable.background().wait().expect("a queryable");
    key
}

/// Asks until the key answers, whose announcement may still be on its way.
pub(crate) fn reach(session: &Session, key: &str) {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let replies = session.get(key).timeout(PATIENCE).wait().expect("asked");
        if replies.recv().is_ok_and(|reply| reply.result().is_ok()) {
            return;
        }
        assert!(Instant::now() < deadline, "{key} is not reached");
        std::thread::yield_now();
    }
}
