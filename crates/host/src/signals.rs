//! Publishes signals of auxiliary controllers, which a program beside this one reads ([`Reader`]). As a driver it does I/O, makes no
//! decision and keeps no journal; a replay takes what it published as external input.

mod reader;

use std::{
    collections::BTreeMap,
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

use graph::topics;
use plc::{Outcome, Poll, Reading, Signal};
use probecell_msgs::{
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    to_cdr,
};
use tracing::{info, warn};

pub use reader::{Reader, ReaderEnded};

use crate::{
    bus::{Bus, BusError},
    clock::now,
    topology::bus_qos,
};

/// How often it is looked whether the process is to end.
const LOOK: Duration = Duration::from_millis(100);
/// Timeout of the start, in which the other processes of the cell subscribe.
const START_TIMEOUT: Duration = Duration::from_secs(20);
/// Timeout of the end, in which what was published is written out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Has `reader` read these controllers and publishes each reading, stamped when it arrives, until `stopped` returns true. Gives why
/// the reader has ended before. `subscribers`: how many there are in the cell, so that a recording holds the first reading, too.
///
/// # Errors
/// What the bus says.
pub fn run_signals(
    bus: Bus,
    mut reader: Reader,
    polls: &[Poll],
    namespace: &str,
    subscribers: usize,
    stopped: &dyn Fn() -> bool,
) -> Result<Option<ReaderEnded>, BusError> {
    let topic = topics::SIGNALS;
    let name = format!("{namespace}/{}", topic.name);
    let publisher = bus.publisher(&name, topic.message, bus_qos(topic.qos))?;
    let deadline = Instant::now() + START_TIMEOUT;
    let are_there = || bus.wait_for_subscribers(&publisher, subscribers, Instant::now() + LOOK);
    while !stopped() && !are_there() {
        if Instant::now() > deadline {
            warn!("signals are read, although subscriptions to {name} are missing");
            break;
        }
    }
    let (sender, receiver) = channel();
    // Not before there is somebody who listens: what waited in the pipe would be stamped late.
    let readings = reader.read(polls);
    // It ends with the reader.
    thread::spawn(move || {
        for reading in readings {
            if sender.send((now(), reading)).is_err() {
                return;
            }
        }
    });
    let mut failures = BTreeMap::new();
    let mut ended = None;
    while ended.is_none() && !stopped() {
        match receiver.recv_timeout(LOOK) {
            Ok((instant, reading)) => match reading.and_then(|one| known(polls, one)) {
                Ok((signal, reading)) => {
                    tell_changes(&mut failures, &reading);
                    let reading = DiagnosticArray {
                        header: instant.header(""),
                        status: vec![status(signal, reading)],
                    };
                    publisher.publish(to_cdr(&reading), instant.0)?;
                }
                Err(text) => ended = Some(reader.wrong(&text)),
            },
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => ended = Some(reader.ended()),
        }
    }
    drop(reader);
    bus.close(CLOSE_TIMEOUT)?;
    Ok(ended)
}

/// The signal of a reading.
fn known(polls: &[Poll], reading: Reading) -> Result<(&Signal, Reading), String> {
    let poll = polls.iter().find(|poll| poll.source == reading.source);
    let mut signals = poll.into_iter().flat_map(|poll| &poll.signals);
    match signals.find(|signal| signal.name == reading.signal) {
        Some(signal) => Ok((signal, reading)),
        None => Err(format!(
            "{:?} of {} is not among the signals",
            reading.signal, reading.source
        )),
    }
}

/// Logs when a controller fails, fails in another way, and is read again.
fn tell_changes(failures: &mut BTreeMap<String, String>, reading: &Reading) {
    let source = &reading.source;
    match &reading.outcome {
        Outcome::Failure(text) => {
            if failures.insert(source.clone(), text.clone()).as_ref() != Some(text) {
                warn!("{text}");
            }
        }
        Outcome::Value(_) => {
            if failures.remove(source).is_some() {
                info!("{source} is read again");
            }
        }
    }
}

/// A reading as a ROS 2 diagnostic status: the name is that of the signal, the hardware its controller.
fn status(signal: &Signal, reading: Reading) -> DiagnosticStatus {
    let pair = |key: &str, value: String| KeyValue {
        key: key.to_owned(),
        value,
    };
    let (level, message, value) = match reading.outcome {
        Outcome::Value(value) => (DiagnosticStatus::OK, String::new(), Some(value)),
        Outcome::Failure(text) => (DiagnosticStatus::ERROR, text, None),
    };
    let mut values = vec![
        pair("address", signal.address.clone()),
        pair("unit", signal.unit.clone()),
    ];
    values.extend(value.map(|value| pair("value", value.to_string())));
    DiagnosticStatus {
        level,
        name: signal.name.clone(),
        message,
        hardware_id: reading.source,
        values,
    }
}
