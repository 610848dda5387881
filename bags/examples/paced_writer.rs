//! Records one message for every byte on standard input: what the kill test kills.
//!
//! Arguments: folder, sync interval in ms. Each line of output is `number durable monotonic_ns`, written after the push:
//! the message's number, how many messages the recorder states to be on disk, the instant of the push.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use bags::{Channel, Overflow, Qos, Recorder, RecorderOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("first argument: folder")?;
    let interval = Duration::from_millis(arguments.next().ok_or("second argument: ms")?.parse()?);
    let recorder = Recorder::start(RecorderOptions {
        sync_interval: interval,
        overflow: Overflow::Block,
        chunk_bytes: 20_000,
        queue_bytes: 1 << 20,
        ..RecorderOptions::new(folder)
    })?;
    let topic = Channel::new(
        "/cell/a",
        "std_msgs/msg/String",
        "string data\n",
        "",
        Qos::default(),
    );
    let channel = recorder.channel(&topic)?;
    let started = Instant::now();
    let mut requests = std::io::stdin().lock();
    let mut replies = std::io::stdout().lock();
    let mut buffer = [0; 64];
    let mut number = 0u64;
    loop {
        let count = requests.read(&mut buffer)?;
        if count == 0 {
            recorder.stop()?;
            return Ok(());
        }
        for _ in 0..count {
            let now = u64::try_from(started.elapsed().as_nanos())?;
            let payload = [number.to_le_bytes(), now.to_le_bytes()].concat().repeat(8);
            recorder.push(channel, number, now, now, payload)?;
            writeln!(replies, "{number} {} {now}", recorder.durable_messages())?;
            number += 1;
        }
        replies.flush()?;
    }
}
