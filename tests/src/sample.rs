//! The sample recordings of `bags/samples`: made from their recipes, read again, compared.
//!
//! A sample is a recording of a whole cell on virtual time, step journals and cell file included, so that it can be
//! replayed and diagnosed like one of a running cell. `NAME.toml` is the recipe, `NAME.mcap` the recording,
//! `NAME.report.txt` its gap report, and `NAME.jsonl` its readable twin: a header with the number of messages on each
//! topic, and every message of the topics that a person reads, in the order of publication.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

use bags::{Bag, Channel, Measurement, Overflow, Recorder, RecorderOptions};
use cell::{Cell, CellText};
use diagnosis::{Options, Report, diagnose};
use graph::{Published, Stamp, replay::Recording, topics};
use probecell_msgs::{MessageType, OperatorRequest, Value};
use serde::Deserialize;
use serde_json::json;

use crate::{BEGIN, launch_scripts, session::Session};

/// Topics whose messages are too many or too long to be read; the twin counts them.
const COUNTED_ONLY: [&str; 10] = [
    "controller_status",
    "joint_commands",
    "joint_states",
    "machine_state",
    "plan_progress",
    "probe_triggers",
    "robot_description",
    "tf",
    "tf_static",
    "touch_markers",
];

/// How a sample is made, and what its test expects of it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// What makes it again.
    pub command: String,
    /// What it shows.
    pub proves: String,
    /// File name of the cell in `launch-scripts`.
    pub cell: String,
    /// Seed of the simulated machine.
    pub seed: u64,
    /// Changes of the cell file: text, and what replaces it.
    #[serde(default)]
    pub changes: Vec<(String, String)>,
    /// Part that is asked for.
    pub part: String,
    /// Verdict of the part report: a constant of `PartReport.msg`.
    pub part_verdict: u8,
    /// Plan whose touches are diagnosed.
    pub plan: String,
    /// Verdict of the diagnosis.
    pub verdict: String,
    /// Effects that the diagnosis names, in its order.
    pub effects: Vec<String>,
}

/// The folder of the samples.
pub fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../bags/samples"))
}

/// Names of the samples, sorted.
pub fn names() -> BTreeSet<String> {
    fs::read_dir(folder())
        .expect("bags/samples")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "toml")
        })
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
        .collect()
}

/// The recipe of a sample.
pub fn recipe(name: &str) -> Recipe {
    let path = folder().join(format!("{name}.toml"));
    let text =
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    toml::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The cell of a recipe.
pub fn cell(recipe: &Recipe) -> Cell {
    let original =
        Cell::read(&launch_scripts().join(&recipe.cell)).unwrap_or_else(|error| panic!("{error}"));
    let mut text = original.text().cell.clone();
    let seed = ("seed = 1\n".to_owned(), format!("seed = {}\n", recipe.seed));
    for (from, to) in [&seed].into_iter().chain(&recipe.changes) {
        assert!(
            text.contains(from),
            "{} does not contain {from:?}",
            recipe.cell
        );
        text = text.replace(from, to);
    }
    let cell = Cell::from_text(CellText {
        cell: text,
        ..original.text().clone()
    });
    cell.unwrap_or_else(|error| panic!("{error}")).simulated()
}

/// Everything that is published while the part of the recipe is made, step journals included.
pub fn make(recipe: &Recipe, cell: &Cell) -> Vec<Published> {
    let mut session = Session::new(cell);
    session.run_s(0.5);
    let request = OperatorRequest {
        subject: recipe.part.clone(),
        operator_name: "sample".to_owned(),
        ..OperatorRequest::default()
    };
    session.send(topics::RUN_REQUESTS, &request);
    session.wait_for_report();
    session.run_s(0.1);
    session.finish()
}

/// Writes a recording of one file.
pub fn write(cell: &Cell, log: &[Published], file: &Path) {
    let work = tempfile::tempdir().expect("a folder");
    let mut options = RecorderOptions::new(work.path().join("sample"));
    options.overflow = Overflow::Block;
    options.compression_level = 19;
    let recorder = Recorder::start(options).expect("a recording");
    let text = cell.text();
    for (name, media, content) in [
        ("cell.toml", "application/toml", &text.cell),
        ("robot.urdf", "application/xml", &text.robot_description),
        ("cell.pub", "text/plain", &text.key),
    ] {
        recorder
            .attach(name, media, BEGIN.0 as u64, content.clone().into_bytes())
            .expect("an attachment");
    }
    for published in log {
        let (message, qos) = type_of(&published.topic);
        let qos = if qos.transient_local {
            bags::Qos::latched()
        } else {
            bags::Qos::default()
        };
        let channel = recorder
            .channel(&Channel::of(cell.topic(&published.topic), message, qos))
            .expect("a channel");
        let at = published.at.0 as u64;
        recorder
            .push(
                channel,
                published.sequence,
                at,
                at,
                published.payload.clone(),
            )
            .expect("a message");
    }
    recorder.stop().expect("a whole recording");
    fs::copy(work.path().join("sample/sample_0.mcap"), file).expect("the sample's file");
}

/// Message type and quality of service of a topic, which may be that of a step journal.
fn type_of(topic: &str) -> (&'static MessageType, graph::Qos) {
    topics::by_name(topic).map_or(topics::JOURNAL, |topic| (topic.message, topic.qos))
}

/// The messages of a sample, by topic below the cell's namespace and publication number.
pub fn read(cell: &Cell, bag: &Bag) -> Vec<Published> {
    let prefix = format!("{}/", cell.namespace());
    bag.messages()
        .map(|message| message.expect("a whole message"))
        .filter_map(|message| {
            Some(Published {
                topic: message.channel.topic.strip_prefix(&prefix)?.to_owned(),
                sequence: u64::from(message.sequence),
                at: Stamp(message.publish_time as i64),
                payload: message.payload.to_vec(),
            })
        })
        .collect()
}

/// Messages as the recording that a replay takes.
pub fn recording(log: &[Published]) -> Recording {
    crate::recording(log)
}

/// The gap report of a sample in `file`, diagnosed as the command line does.
pub fn gap_report(name: &str, recipe: &Recipe, cell: &Cell, file: &Path) -> Report {
    let measurement = Measurement::Named(recipe.plan.clone());
    let mut session = crate::bag::session(cell, file, &measurement);
    session.name = format!("{name}.mcap");
    diagnose(&session, &Options::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// The readable twin: JSON lines.
pub fn twin(name: &str, log: &[Published]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for published in log {
        *counts.entry(&published.topic).or_default() += 1;
    }
    let mut lines = vec![json!({ "sample": name, "messages": counts }).to_string()];
    for published in log {
        let topic = published.topic.as_str();
        if COUNTED_ONLY.contains(&topic) || topics::by_name(topic).is_none() {
            continue;
        }
        let message = described(published);
        lines.push(
            json!({
                "at_s": published.at.since_s(BEGIN),
                "topic": topic,
                "sequence": published.sequence,
                "message": readable(&message),
            })
            .to_string(),
        );
    }
    lines.join("\n") + "\n"
}

/// A published message as a tree of named values.
pub fn described(published: &Published) -> Value {
    let (message, _) = type_of(&published.topic);
    message
        .describe(&published.payload)
        .unwrap_or_else(|error| panic!("{}: {error}", published.topic))
}

fn readable(value: &Value) -> serde_json::Value {
    match value {
        Value::Bool(value) => json!(value),
        Value::Integer(value) => json!(*value as i64),
        // JSON has no NaN; numbers are read by people here, to 1e-9 of the unit.
        Value::Float(value) if value.is_finite() => json!((value * 1e9).round() / 1e9),
        Value::Float(value) => json!(value.to_string()),
        Value::Text(value) => json!(value),
        Value::List(values) => values.iter().map(readable).collect(),
        Value::Record(fields) => fields
            .iter()
            .map(|(name, value)| ((*name).to_owned(), readable(value)))
            .collect::<serde_json::Map<_, _>>()
            .into(),
    }
}

/// Where two messages of a topic differ by more than rounding on another machine, if they do: a path and both values.
pub fn difference(a: &Published, b: &Published) -> Option<String> {
    if a.payload == b.payload {
        return None;
    }
    let (left, right) = (described(a).leaves(), described(b).leaves());
    if left.len() != right.len() {
        return Some(format!("{} and {} values", left.len(), right.len()));
    }
    left.into_iter().zip(right).find_map(|((path, a), (_, b))| {
        let close = match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => (a - b).abs() <= 1e-9 * (1.0 + a.abs().max(b.abs())),
            _ => a == b,
        };
        (!close).then(|| format!("{path}: {a} and {b}"))
    })
}
