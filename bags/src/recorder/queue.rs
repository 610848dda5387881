//! The bounded queue between pushers and the writer thread.
//!
//! One mutex, two condition variables. The writer takes the whole queue at once, so pushers meet it rarely; what it has
//! taken still counts against the bound until it is written.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::{Losses, Overflow, Pushed};
use crate::channel::Channel;
use crate::error::Error;

#[derive(Debug)]
pub(super) enum Entry {
    Message {
        channel: usize,
        sequence: u32,
        log_time: u64,
        publish_time: u64,
        payload: Bytes,
    },
    Attachment {
        name: String,
        media_type: String,
        log_time: u64,
        data: Bytes,
    },
    Metadata {
        name: String,
        table: BTreeMap<String, String>,
    },
}

impl Entry {
    /// Bytes it counts for in the queue.
    pub(super) fn size(&self) -> usize {
        let content = match self {
            Self::Message { payload, .. } => payload.len(),
            Self::Attachment {
                name,
                media_type,
                data,
                ..
            } => name.len() + media_type.len() + data.len(),
            Self::Metadata { name, table } => {
                name.len()
                    + table
                        .iter()
                        .map(|(key, value)| key.len() + value.len())
                        .sum::<usize>()
            }
        };
        content + size_of::<Self>()
    }
}

#[derive(Default)]
struct State {
    entries: VecDeque<Entry>,
    /// Bytes of `entries` and of what the writer has taken and not yet written.
    bytes: usize,
    peak: usize,
    channels: Vec<Channel>,
    numbers: BTreeMap<Channel, usize>,
    losses: Vec<Losses>,
    /// Grows with every change of `losses`.
    loss_changes: u64,
    closed: bool,
    failure: Option<Error>,
}

impl State {
    fn lose(&mut self, entries: &VecDeque<Entry>) {
        for entry in entries {
            if let Entry::Message { channel, .. } = entry {
                self.losses[*channel].queue += 1;
            }
        }
        self.loss_changes += 1;
    }
}

pub(super) struct Queue {
    state: Mutex<State>,
    filled: Condvar,
    drained: Condvar,
    limit: usize,
    overflow: Overflow,
    /// Messages that were on disk after the last sync.
    durable: AtomicU64,
    /// When the writer thread was last seen outside a call to the disk.
    alive: Mutex<Instant>,
}

/// What the writer takes at once.
pub(super) struct Batch {
    pub(super) entries: VecDeque<Entry>,
    /// Channels registered since the last batch, in order.
    pub(super) new_channels: Vec<Channel>,
    /// Nothing will follow.
    pub(super) last: bool,
}

impl Queue {
    pub(super) fn new(limit: usize, overflow: Overflow) -> Self {
        Self {
            state: Mutex::default(),
            filled: Condvar::new(),
            drained: Condvar::new(),
            limit,
            overflow,
            durable: AtomicU64::new(0),
            alive: Mutex::new(Instant::now()),
        }
    }

    /// Called by the writer thread between its calls to the disk.
    pub(super) fn mark_alive(&self) {
        *self.alive.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    pub(super) fn silent_for(&self) -> Duration {
        let alive = self.alive.lock().unwrap_or_else(PoisonError::into_inner);
        alive.elapsed()
    }

    pub(super) fn durable(&self) -> u64 {
        self.durable.load(Ordering::Acquire)
    }

    pub(super) fn set_durable(&self, messages: u64) {
        self.durable.store(messages, Ordering::Release);
    }

    /// No code panics while it holds the lock, so a poisoned state is whole.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn channel(&self, channel: &Channel) -> Result<usize, Error> {
        let mut state = self.lock();
        if let Some(number) = state.numbers.get(channel) {
            return Ok(*number);
        }
        let number = state.channels.len();
        if number >= usize::from(u16::MAX) {
            return Err(Error::TooManyChannels);
        }
        state.channels.push(channel.clone());
        state.numbers.insert(channel.clone(), number);
        state.losses.push(Losses::default());
        Ok(number)
    }

    pub(super) fn push(&self, entry: Entry, folder: &Path) -> Result<Pushed, Error> {
        let size = entry.size();
        let mut state = self.lock();
        loop {
            if let Some(failure) = &state.failure {
                return Err(failure.clone());
            }
            if state.closed {
                return Err(Error::Stopped {
                    path: folder.to_owned(),
                });
            }
            // A message larger than the whole queue is taken alone rather than never.
            if state.bytes == 0 || state.bytes.saturating_add(size) <= self.limit {
                break;
            }
            if let (Entry::Message { channel, .. }, Overflow::Count) = (&entry, self.overflow) {
                state.losses[*channel].queue += 1;
                state.loss_changes += 1;
                return Ok(Pushed::Lost);
            }
            state = self
                .drained
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
        }
        state.bytes += size;
        state.peak = state.peak.max(state.bytes);
        state.entries.push_back(entry);
        // The writer sleeps only on an empty queue.
        let was_empty = state.entries.len() == 1;
        drop(state);
        if was_empty {
            self.filled.notify_one();
        }
        Ok(Pushed::Queued)
    }

    /// Waits for entries, the end, or `deadline`.
    pub(super) fn take(&self, known_channels: usize, deadline: Instant) -> Batch {
        let mut state = self.lock();
        while state.entries.is_empty() && !state.closed {
            let rest = deadline.saturating_duration_since(Instant::now());
            if rest == Duration::ZERO {
                break;
            }
            state = self
                .filled
                .wait_timeout(state, rest)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
        Batch {
            entries: std::mem::take(&mut state.entries),
            new_channels: state
                .channels
                .get(known_channels..)
                .unwrap_or_default()
                .to_vec(),
            last: state.closed,
        }
    }

    /// Gives back the room of written entries.
    pub(super) fn release(&self, bytes: usize) {
        let mut state = self.lock();
        state.bytes = state.bytes.saturating_sub(bytes);
        drop(state);
        self.drained.notify_all();
    }

    pub(super) fn report_bus_loss(&self, channel: usize, count: u64, recovered: bool) {
        let mut state = self.lock();
        if let Some(losses) = state.losses.get_mut(channel) {
            losses.bus += count;
            if recovered {
                losses.recovered += count;
            }
            state.loss_changes += 1;
        }
    }

    /// Losses of every channel, and a number that changes with them.
    pub(super) fn all_losses(&self) -> (Vec<Losses>, u64) {
        let state = self.lock();
        (state.losses.clone(), state.loss_changes)
    }

    pub(super) fn losses(&self) -> Vec<(String, Losses)> {
        let state = self.lock();
        let named = state.channels.iter().zip(&state.losses);
        named
            .filter(|(_, losses)| **losses != Losses::default())
            .map(|(c, losses)| (c.topic.clone(), *losses))
            .collect()
    }

    pub(super) fn peak(&self) -> usize {
        self.lock().peak
    }

    pub(super) fn failure(&self) -> Option<Error> {
        self.lock().failure.clone()
    }

    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.filled.notify_all();
        self.drained.notify_all();
    }

    /// Counts entries taken and not written.
    pub(super) fn lose(&self, entries: &VecDeque<Entry>) {
        self.lock().lose(entries);
    }

    /// Ends the recording early: pushers get the error, what is queued is counted as lost.
    pub(super) fn fail(&self, failure: Error) {
        let mut state = self.lock();
        let left = std::mem::take(&mut state.entries);
        state.lose(&left);
        state.bytes = 0;
        state.failure = Some(failure);
        drop(state);
        self.drained.notify_all();
    }
}
