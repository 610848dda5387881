//! The log of a session on virtual time as a recording on disk, and its diagnosis from there.

use std::path::Path;

use bags::{Bag, Channel, Measurement, Overflow, Recorder, RecorderOptions};
use cell::Cell;
use diagnosis::{Options, Report};
use graph::{Published, topics};

/// Writes everything that was published to a new folder.
pub fn write(cell: &Cell, log: &[Published], folder: &Path) {
    let mut options = RecorderOptions::new(folder);
    options.overflow = Overflow::Block;
    let recorder = Recorder::start(options).unwrap_or_else(|error| panic!("{error}"));
    let pusher = recorder.pusher();
    for published in log {
        // Journals have no place in the table; no reader of a session asks for them.
        let Some(topic) = topics::by_name(&published.topic) else {
            continue;
        };
        let channel = Channel::of(cell.topic(topic.name), topic.message, bags::Qos::default());
        let channel = pusher
            .channel(&channel)
            .unwrap_or_else(|error| panic!("{error}"));
        let at = published.at.0 as u64;
        let pushed = pusher.push(
            channel,
            published.sequence,
            at,
            at,
            published.payload.clone(),
        );
        pushed.unwrap_or_else(|error| panic!("{error}"));
    }
    recorder.stop().unwrap_or_else(|error| panic!("{error}"));
}

/// A measurement of a recording of the cell, as the command line reads it.
pub fn session(cell: &Cell, folder: &Path, measurement: &Measurement) -> diagnosis::Session {
    let bag = Bag::open(folder).unwrap_or_else(|error| panic!("{error}"));
    let read = bags::Session::read_measurement(&bag, measurement)
        .unwrap_or_else(|error| panic!("{error}"));
    diagnosis::Session {
        name: "bag".to_owned(),
        robot_description: read.robot_description,
        plan: read.plan,
        events: plain(read.events),
        joint_states: plain(read.joint_states),
        joint_commands: plain(read.joint_commands),
        machine_states: plain(read.machine_states),
        references: plain(read.references),
        declared: cell.model.effects.clone(),
    }
}

/// The diagnosis of a measurement in a log, by way of a recording.
pub fn diagnosis(cell: &Cell, log: &[Published], measurement: &Measurement) -> Report {
    let folder = tempfile::tempdir().expect("a folder");
    let bag = folder.path().join("session");
    write(cell, log, &bag);
    diagnosis::diagnose(&session(cell, &bag, measurement), &Options::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn plain<T>(stamped: Vec<bags::Stamped<T>>) -> Vec<T> {
    stamped.into_iter().map(|one| one.message).collect()
}
