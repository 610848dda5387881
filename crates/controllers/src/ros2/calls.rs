//! Calls of services that run concurrently with the polls.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, TryRecvError},
    },
    time::{Duration, Instant},
};

use crate::driver::RosService;

/// A server that is not there is waited for this long.
const FOUND: Duration = Duration::from_secs(2);
/// A service says itself that nobody answers; it is believed to be stuck when it has not said so this much later.
const STUCK: Duration = Duration::from_secs(1);

/// What a service has answered: CDR, or a sentence.
pub(super) type Answer = Result<Vec<u8>, String>;

/// A call that is under way.
#[derive(Debug)]
pub(super) struct Pending {
    receiver: Receiver<Answer>,
    /// It has no answer any more at this instant.
    deadline: Instant,
    limit: Duration,
}

impl Pending {
    /// Calls `service` at the instant `at`; its answer comes `within` that time or never.
    pub(super) fn call(
        service: &Arc<dyn RosService>,
        request: Vec<u8>,
        within: Duration,
        at: Instant,
    ) -> Self {
        let found = FOUND.min(within);
        let limit = found + within + STUCK;
        Self {
            receiver: Arc::clone(service).begin(request, found, within),
            deadline: at + limit,
            limit,
        }
    }

    /// The answer, once it is there.
    pub(super) fn answer(&self, at: Instant) -> Option<Answer> {
        match self.receiver.try_recv() {
            Ok(answer) => Some(answer),
            Err(TryRecvError::Empty) if at >= self.deadline => {
                Some(Err(format!("no answer within {} s", self.limit.as_secs())))
            }
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err("the call has ended".to_owned())),
        }
    }

    /// The answer, waited for.
    pub(super) fn wait(&self, within: Duration) -> Answer {
        self.receiver
            .recv_timeout(within)
            .unwrap_or_else(|_| Err("no answer".to_owned()))
    }
}
