//! What the recorder costs beside the bare MCAP writer, and how much memory it takes. One run prints all figures.
//!
//! Both sides write the same joint states with the same chunk size, zstd level and CRCs, and end with a durable file.

#![allow(
    clippy::print_stdout,
    reason = "a benchmark's result is what it prints"
)]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::time::{Duration, Instant};

use bags::{Bag, Channel, Overflow, Qos, Recorder, RecorderOptions};
use bytes::Bytes;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, WriteOptions};
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{Message, to_cdr};

const MESSAGES: u64 = 300_000;
const ROUNDS: usize = 5;

type Failure = Box<dyn std::error::Error>;

/// Joint states of a five-axis machine that moves.
fn payloads() -> Vec<Bytes> {
    let names = ["X", "Y", "Z", "A", "C"];
    let state = |tick: u32| {
        let phase = f64::from(tick) * 1e-3;
        let values = |scale: f64| {
            (0..names.len())
                .map(|axis| scale * (phase * (1.0 + axis as f64)).sin())
                .collect()
        };
        let mut state = JointState {
            name: names.map(str::to_owned).to_vec(),
            position: values(0.3),
            velocity: values(0.01),
            effort: values(20.0),
            ..JointState::default()
        };
        state.header.stamp.nanosec = tick * 1_000_000 % 1_000_000_000;
        to_cdr(&state).into()
    };
    (0..4096).map(state).collect()
}

fn channel(number: usize) -> Channel {
    Channel::of(
        format!("/cell{number}/joint_states"),
        JointState::TYPE,
        Qos::default(),
    )
}

fn bare(path: &Path, payloads: &[Bytes]) -> Result<Duration, Failure> {
    let started = Instant::now();
    let file = File::create(path)?;
    let options = WriteOptions::new()
        .profile("ros2")
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        .chunk_size(Some(1 << 20))
        .disable_seeking(true);
    let mut writer = options.create(NoSeek::new(BufWriter::with_capacity(
        1 << 16,
        file.try_clone()?,
    )))?;
    let schema = writer.add_schema(
        JointState::TYPE.name,
        "ros2msg",
        JointState::TYPE.definition.as_bytes(),
    )?;
    let id = writer.add_channel(schema, "/cell0/joint_states", "cdr", &BTreeMap::new())?;
    for number in 0..MESSAGES {
        let payload = &payloads[number as usize % payloads.len()];
        let time = number * 1_000_000;
        let header = MessageHeader {
            channel_id: id,
            sequence: number as u32,
            log_time: time,
            publish_time: time,
        };
        writer.write_to_known_channel(&header, payload)?;
    }
    writer.finish()?;
    drop(writer);
    file.sync_all()?;
    Ok(started.elapsed())
}

fn recorded(path: &Path, payloads: &[Bytes]) -> Result<Duration, Failure> {
    let started = Instant::now();
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(path)
    })?;
    let id = recorder.channel(&channel(0))?;
    for number in 0..MESSAGES {
        let payload = payloads[number as usize % payloads.len()].clone();
        recorder.push(id, number, number * 1_000_000, number * 1_000_000, payload)?;
    }
    recorder.stop()?;
    Ok(started.elapsed())
}

/// A field of `/proc/self/status`, MiB; NaN where there is none.
fn memory_mib(field: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix(field))
        .unwrap_or_default();
    line.split_whitespace()
        .nth(1)
        .and_then(|kib| kib.parse::<f64>().ok())
        .map_or(f64::NAN, |kib| kib / 1024.0)
}

/// 50 channels at 1 kHz in real time: queue, memory, loss.
fn fifty_at_a_kilohertz(path: &Path, payloads: &[Bytes], seconds: u64) -> Result<(), Failure> {
    let before = memory_mib("VmRSS");
    let recorder = Recorder::start(RecorderOptions::new(path))?;
    let ids = (0..50)
        .map(|number| recorder.channel(&channel(number)))
        .collect::<Result<Vec<_>, _>>()?;
    let started = Instant::now();
    let mut most = before;
    for tick in 0..seconds * 1000 {
        let due = started + Duration::from_millis(tick);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        for id in &ids {
            let payload = payloads[tick as usize % payloads.len()].clone();
            recorder.push(*id, tick, tick * 1_000_000, tick * 1_000_000, payload)?;
        }
        if tick % 50 == 0 {
            most = most.max(memory_mib("VmRSS"));
        }
    }
    let statistics = recorder.stop()?;
    println!(
        "50 x 1 kHz joint states, {seconds} s: {} messages, {} lost, queue peak {:.2} MiB, resident +{:.1} MiB, files {:.1} MiB",
        statistics.messages,
        statistics.missing(),
        statistics.queue_peak_bytes as f64 / 1_048_576.0,
        most - before,
        statistics.file_bytes as f64 / 1_048_576.0,
    );
    Ok(())
}

fn main() -> Result<(), Failure> {
    let payloads = payloads();
    let folder = tempfile::tempdir()?;
    // Before the memory is warmed by the comparison.
    fifty_at_a_kilohertz(&folder.path().join("fifty"), &payloads, 10)?;
    let mut ratios = Vec::new();
    for round in 0..ROUNDS {
        let ours = folder.path().join(format!("recorded{round}"));
        let bare = bare(&folder.path().join(format!("bare{round}.mcap")), &payloads)?.as_secs_f64();
        let recorded = recorded(&ours, &payloads)?.as_secs_f64();
        ratios.push(recorded / bare);
        println!(
            "round {round}: bare {:.0} k/s, recorder {:.0} k/s, ratio {:.3}",
            MESSAGES as f64 / bare / 1e3,
            MESSAGES as f64 / recorded / 1e3,
            recorded / bare
        );
        if round == 0 {
            let started = Instant::now();
            let count = Bag::open(&ours)?.messages().flatten().count();
            println!(
                "reading in time order: {:.0} k/s",
                count as f64 / started.elapsed().as_secs_f64() / 1e3
            );
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "recorder against the bare writer, median of {ROUNDS}: {:.3} (goal 1.15)",
        ratios[ROUNDS / 2]
    );
    Ok(())
}
