//! Calls of services that run concurrently with the polls.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, TryRecvError, channel},
    },
    time::Duration,
};

use crate::driver::RosService;

/// A server that is not there is waited for this long.
const FOUND: Duration = Duration::from_secs(2);

/// What a service has answered: CDR, or a sentence.
pub(super) type Answer = Result<Vec<u8>, String>;

/// A call that is under way.
#[derive(Debug)]
pub(super) struct Pending(Receiver<Answer>);

impl Pending {
    /// Calls `service` on a thread of its own.
    pub(super) fn call(service: &Arc<dyn RosService>, request: Vec<u8>, within: Duration) -> Self {
        let (sender, receiver) = channel();
        let service = Arc::clone(service);
        let thread = std::thread::Builder::new().name("robot call".to_owned());
        // Nobody may wait for the answer any more.
        let spawned = thread.spawn({
            let sender = sender.clone();
            move || drop(sender.send(service.call(&request, FOUND.min(within), within)))
        });
        if let Err(error) = spawned {
            drop(sender.send(Err(error.to_string())));
        }
        Self(receiver)
    }

    /// The answer, once it is there.
    pub(super) fn answer(&self) -> Option<Answer> {
        match self.0.try_recv() {
            Ok(answer) => Some(answer),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err("the call has ended".to_owned())),
        }
    }

    /// The answer, waited for.
    pub(super) fn wait(&self, within: Duration) -> Answer {
        self.0
            .recv_timeout(within)
            .unwrap_or_else(|_| Err("no answer".to_owned()))
    }
}
