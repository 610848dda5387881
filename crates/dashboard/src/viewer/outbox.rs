//! What waits to be sent to one viewer.

use std::collections::VecDeque;
use std::mem;
use std::sync::{Mutex, MutexGuard, PoisonError};

use fastwebsockets::{Frame, OpCode, Payload};
use serde_json::{Value, json};
use tokio::sync::Notify;

use super::{MESSAGE_DATA, WARNING};

/// Bytes of samples that wait: some seconds of a cell.
const SAMPLES: usize = 16 << 20;
/// Other messages that wait; a viewer that takes none of them is given no more.
const MESSAGES: usize = 4096;

/// Filled by the bus and by the thread of a viewer, emptied by its connection. Samples that find no room push the oldest out.
#[derive(Default)]
pub(super) struct Outbox {
    held: Mutex<Held>,
    filled: Notify,
}

#[derive(Default)]
struct Held {
    messages: VecDeque<Frame<'static>>,
    samples: VecDeque<Vec<u8>>,
    bytes: usize,
    skipped: u64,
}

impl Outbox {
    /// A message of the protocol.
    pub(super) fn say(&self, message: &Value) {
        self.push(OpCode::Text, message.to_string().into_bytes());
    }

    /// A remark that the viewer shows.
    pub(super) fn status(&self, level: u8, text: &str) {
        self.say(&json!({ "op": "status", "level": level, "message": text }));
    }

    /// What the transport answers: pong or close.
    pub(super) fn answer(&self, frame: &Frame<'_>) {
        self.push(frame.opcode, frame.payload.to_vec());
    }

    /// A sample (CDR) of a subscription, received at an instant in ns since 1970.
    pub(super) fn sample(&self, subscription: u32, at: u64, cdr: &[u8]) {
        let mut message = Vec::with_capacity(13 + cdr.len());
        message.push(MESSAGE_DATA);
        message.extend_from_slice(&subscription.to_le_bytes());
        message.extend_from_slice(&at.to_le_bytes());
        message.extend_from_slice(cdr);
        let mut held = self.lock();
        held.bytes += message.len();
        held.samples.push_back(message);
        while held.bytes > SAMPLES && held.samples.len() > 1 {
            let oldest = held.samples.pop_front().unwrap_or_default();
            held.bytes -= oldest.len();
            held.skipped += 1;
        }
        drop(held);
        self.filled.notify_one();
    }

    /// Everything that waits, once there is something: what belongs to the protocol first, since a sample follows its channel.
    pub(super) async fn next(&self) -> Vec<Frame<'static>> {
        loop {
            let held = mem::take(&mut *self.lock());
            let mut frames = Vec::from(held.messages);
            if held.skipped > 0 {
                let text = format!(
                    "{} messages were skipped: the viewer takes them more slowly than they come",
                    held.skipped
                );
                let status = json!({ "op": "status", "level": WARNING, "message": text });
                frames.push(whole(OpCode::Text, status.to_string().into_bytes()));
            }
            frames.extend(
                held.samples
                    .into_iter()
                    .map(|one| whole(OpCode::Binary, one)),
            );
            if !frames.is_empty() {
                return frames;
            }
            self.filled.notified().await;
        }
    }

    fn push(&self, code: OpCode, bytes: Vec<u8>) {
        let mut held = self.lock();
        if held.messages.len() < MESSAGES {
            held.messages.push_back(whole(code, bytes));
        }
        drop(held);
        self.filled.notify_one();
    }

    /// A panic of another thread leaves whole frames behind.
    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn whole(code: OpCode, bytes: Vec<u8>) -> Frame<'static> {
    Frame::new(true, code, None, Payload::Owned(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_viewer_that_is_slow_loses_the_oldest_samples_and_is_told_how_many() {
        let outbox = Outbox::default();
        let sample = vec![0; SAMPLES / 4];
        for number in 0..10 {
            outbox.sample(number, u64::from(number), &sample);
        }
        let frames = outbox.next().await;
        let told = String::from_utf8(frames[0].payload.to_vec()).unwrap();
        assert!(told.contains("7 messages were skipped"), "{told}");
        let kept: Vec<u8> = frames[1..].iter().map(|one| one.payload[1]).collect();
        assert_eq!(kept, [7, 8, 9]);
    }
}
