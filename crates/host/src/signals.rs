//! Reads signals of auxiliary controllers and publishes them. As a driver it does I/O, makes no decision and keeps no
//! journal; a replay takes what it published as external input.

use std::{
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use graph::topics;
use plc::{Poll, Signal};
use probecell_msgs::{
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    to_cdr,
};
use tracing::{info, warn};

use crate::{
    bus::{Bus, BusError},
    clock::now,
    topology::bus_qos,
};

/// How often it is looked whether the process is to end.
const LOOK: Duration = Duration::from_millis(100);
/// Timeout of the end, in which what was published is written out.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// Reads each controller on a thread of its own, so that none waits for another, until `stopped` returns true.
///
/// # Errors
/// What the bus says.
pub fn run_signals(
    bus: Bus,
    polls: Vec<Poll>,
    namespace: &str,
    stopped: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    let topic = topics::SIGNALS;
    let name = format!("{namespace}/{}", topic.name);
    let publisher = bus.publisher(&name, topic.message, bus_qos(topic.qos))?;
    let (sender, receiver) = channel();
    for poll in polls {
        let sender = sender.clone();
        // It ends with the process, or with its next reading.
        thread::spawn(move || {
            let mut last = None;
            poll.run(|signal, value| {
                let instant = now();
                let failure = value.as_ref().err().cloned();
                if failure != last {
                    if let Some(text) = &failure {
                        warn!("{text}");
                    } else {
                        info!("{} is read again", poll.source);
                    }
                    last.clone_from(&failure);
                }
                let status = status(&poll.source, signal, value);
                let reading = DiagnosticArray {
                    header: instant.header(""),
                    status: vec![status],
                };
                sender.send((instant, reading)).is_ok()
            });
        });
    }
    drop(sender);
    while !stopped() {
        match receiver.recv_timeout(LOOK) {
            Ok((instant, reading)) => drop(publisher.publish(to_cdr(&reading), instant.0)?),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    bus.close(CLOSE_TIMEOUT)
}

/// A reading as a ROS 2 diagnostic status: the name is that of the signal, the hardware its controller.
fn status(source: &str, signal: &Signal, value: Result<f64, String>) -> DiagnosticStatus {
    let pair = |key: &str, value: String| KeyValue {
        key: key.to_owned(),
        value,
    };
    let (level, message, value) = match value {
        Ok(value) => (DiagnosticStatus::OK, String::new(), Some(value)),
        Err(text) => (DiagnosticStatus::ERROR, text, None),
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
        hardware_id: source.to_owned(),
        values,
    }
}
