//! `probecell replay`: every node of a recording computed again, and compared.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    time::Instant,
};

use anyhow::{Context, bail};
use bags::Bag;
use cell::Cell;
use graph::{
    Instance, Stamp,
    replay::{Difference, Factory, Recording, Report, Verdict, replay},
    topics,
};
use probecell_msgs::from_cdr;
use serde_json::json;

use crate::{FAILED, GOOD, LOSS, output};
use session_io::embedded;

/// Fields of the first difference that are shown, and characters of a value.
const SHOWN: usize = 12;
const LONGEST: usize = 40;

/// Replays the bag. A bag without step journals is computed from its plan and touches alone.
pub(crate) fn run(path: &Path, json: bool) -> anyhow::Result<u8> {
    let bag = Bag::open(path)?;
    let Some(cell) = embedded::cell(&bag)? else {
        return super::plan::replay_foreign(&bag, json);
    };
    if cell.key().is_none() {
        output::remark(
            "the recording holds no key of its cell: approvals cannot be verified, and the replay refuses what they entitled",
        );
    }
    let program = of_another_program(&bag);
    if !json {
        for line in &program {
            output::line(line);
        }
    }
    let begun = Instant::now();
    let recording = read(&bag, &cell)?;
    let corrections = recording.payloads(topics::CORRECTIONS.name);
    // One that cannot be read differs from what is computed again, and is reported as such.
    let cell = cell.with_recorded_approvals(corrections.filter_map(|cdr| from_cdr(cdr).ok()));
    let factories: Vec<Factory> = cell
        .node_names()
        .into_iter()
        .map(|name| factory(&cell, name))
        .collect();
    let result = replay(&recording, &factories)?;
    let seconds = begun.elapsed().as_secs_f64();
    if json {
        let damage = bag.damage();
        output::json(&json!({
            "replay": result, "seconds": seconds, "damage": damage, "program": program
        }))?;
    } else {
        print(&result, seconds)?;
        for damage in bag.damage() {
            output::line(&format!("damage    {damage}"));
        }
    }
    Ok(match result.verdict {
        Verdict::Equal => GOOD,
        Verdict::Different => FAILED,
        Verdict::Incomplete => LOSS,
    })
}

/// What a recording of another version of the program differs in before anything is compared: the version, and each topic whose
/// messages have other fields.
fn of_another_program(bag: &Bag) -> Vec<String> {
    let (version, revision) = embedded::program(bag);
    let (own_version, own) = (crate::VERSION, crate::REVISION);
    let mut lines = Vec::new();
    if !revision.is_empty() && (version.as_str(), revision.as_str()) != (own_version, own) {
        lines.push(format!(
            "recorded by probecell {version} ({revision}), computed again by {own_version} ({own}): outputs differ where the program does"
        ));
    }
    let changed = bag.migrated();
    lines.extend(
        changed.map(|(channel, changes)| {
            format!("fields of {}: {}", channel.topic, changes.join(", "))
        }),
    );
    lines
}

fn factory(cell: &Cell, name: &'static str) -> Factory {
    let cell = cell.clone();
    Box::new(move || -> Box<dyn Instance> {
        // The cell was checked when it was read, by building each of its nodes.
        cell.instance(name, false)
            .unwrap_or_else(|error| panic!("a checked cell builds its nodes: {error}"))
    })
}

fn read(bag: &Bag, cell: &Cell) -> anyhow::Result<Recording> {
    let total: u64 = bag.counts().iter().sum();
    let prefix = format!("{}/", cell.namespace());
    let mut recording = Recording::default();
    for (number, message) in (0..).zip(bag.messages()) {
        if number % 10_000 == 0 {
            output::position("reading, messages", number, total);
        }
        // Damage is reported by the bag itself; the intact part is used.
        let Ok(message) = message else { continue };
        if let Some(topic) = message.channel.topic.strip_prefix(&prefix) {
            let published = Stamp(message.publish_time as i64);
            recording.push(
                topic,
                u64::from(message.sequence),
                published,
                &message.payload,
            );
        }
    }
    output::end_progress();
    if recording.journaled().next().is_none() {
        bail!(
            "{} has no step journals: it was not recorded from a running cell",
            bag.path().display()
        );
    }
    Ok(recording)
}

fn print(result: &Report, seconds: f64) -> anyhow::Result<()> {
    for topic in result
        .topics
        .iter()
        .filter(|topic| topic.recorded + topic.not_recorded > 0)
    {
        let mut line = format!(
            "{:>7} of {:<7} equal  {}",
            topic.equal, topic.recorded, topic.topic
        );
        for (count, word) in [
            (topic.different, "DIFFERENT"),
            (topic.not_recomputed, "not recomputed"),
            (topic.not_recorded, "not recorded"),
        ] {
            if count > 0 {
                line = format!("{line}  {count} {word}");
            }
        }
        output::line(&line);
    }
    for node in &result.nodes {
        if node.steps_left > 0 || node.timers_not_asked_for > 0 {
            let waits = node
                .waits_for
                .as_ref()
                .map(|input| format!(", waiting for {input}"))
                .unwrap_or_default();
            output::line(&format!(
                "{}: {} steps not executed{waits}; {} timers that were not set",
                node.node, node.steps_left, node.timers_not_asked_for
            ));
        }
    }
    if let Some(difference) = &result.first_difference {
        print_difference(difference)?;
    }
    let steps: u64 = result.nodes.iter().map(|node| node.steps).sum();
    let span = result.span.map_or(0.0, |(first, last)| last.since_s(first));
    let verdict = match result.verdict {
        Verdict::Equal => "all outputs of all nodes are equal",
        Verdict::Different => "outputs differ",
        Verdict::Incomplete => "no differences, but part of the recording could not be compared",
    };
    output::line(&format!(
        "{verdict}: {steps} steps of {span:.1} s in {seconds:.2} s ({:.0} x real time)",
        span / seconds.max(1e-9)
    ));
    Ok(())
}

fn print_difference(difference: &Difference) -> anyhow::Result<()> {
    let topic = topics::by_name(&difference.topic)
        .context("a node published on a topic that the cell does not have")?;
    output::line(&format!(
        "first difference: message {} on {}",
        difference.sequence, difference.topic
    ));
    let fields = |cdr: &[u8]| -> anyhow::Result<BTreeMap<String, String>> {
        Ok(topic.message.describe(cdr)?.leaves().into_iter().collect())
    };
    let (recorded, recomputed) = (
        fields(&difference.recorded)?,
        fields(&difference.recomputed)?,
    );
    let paths: BTreeSet<&String> = recorded.keys().chain(recomputed.keys()).collect();
    let differing = paths
        .into_iter()
        .filter(|path| recorded.get(*path) != recomputed.get(*path));
    let differing: Vec<&String> = differing.collect();
    for path in differing.iter().take(SHOWN) {
        let show = |fields: &BTreeMap<String, String>| {
            fields
                .get(*path)
                .map_or_else(|| "-".to_owned(), |value| shortened(value))
        };
        output::line(&format!(
            "  {path}: recorded {}, computed {}",
            show(&recorded),
            show(&recomputed)
        ));
    }
    if differing.len() > SHOWN {
        output::line(&format!("  and {} further fields", differing.len() - SHOWN));
    }
    Ok(())
}

/// A value in one line of a terminal.
fn shortened(value: &str) -> String {
    match value.char_indices().nth(LONGEST) {
        Some((end, _)) => format!(
            "{}... ({} characters)",
            &value[..end],
            value.chars().count()
        ),
        None => value.to_owned(),
    }
}
