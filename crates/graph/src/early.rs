//! Messages that arrive before the one to which they refer: between topics there is no order.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Messages that wait for the one to which they refer, such as touches for their plan, in the order of arrival.
///
/// ```
/// let mut early = graph::Early::default();
/// assert_eq!(early.keep("a1", 2), None);
/// assert_eq!(early.keep("b1", 2), None);
/// assert_eq!(early.keep("a2", 2), Some("a1"));
/// assert_eq!(early.release(|message| message.starts_with('a')), ["a2"]);
/// assert_eq!(early.release(|_| true), ["b1"]);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Early<M>(VecDeque<M>);

impl<M> Default for Early<M> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl<M> Early<M> {
    /// Keeps `message`, and gives back the oldest one where more than `limit` would wait.
    pub fn keep(&mut self, message: M, limit: usize) -> Option<M> {
        self.0.push_back(message);
        if self.0.len() > limit {
            return self.0.pop_front();
        }
        None
    }

    /// Takes out the messages for which the wait is over.
    pub fn release(&mut self, is_ready: impl FnMut(&M) -> bool) -> Vec<M> {
        let all = std::mem::take(&mut self.0);
        let (ready, waiting): (Vec<M>, Vec<M>) = all.into_iter().partition(is_ready);
        self.0 = waiting.into();
        ready
    }
}
