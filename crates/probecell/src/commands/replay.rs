//! `probecell replay`: every node of a recording computed again, and compared.

use std::{path::Path, time::Instant};

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
        output::json(&json!({ "replay": result, "seconds": seconds, "damage": damage }))?;
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
    let recorded = topic.message.describe(&difference.recorded)?.leaves();
    let recomputed = topic.message.describe(&difference.recomputed)?.leaves();
    let mut lines = 0;
    for index in 0..recorded.len().max(recomputed.len()) {
        let show = |leaf: Option<&(String, String)>| {
            leaf.map_or_else(
                || "-".to_owned(),
                |(path, value)| format!("{path} = {value}"),
            )
        };
        let (was, is) = (recorded.get(index), recomputed.get(index));
        if was != is && lines < 12 {
            output::line(&format!(
                "  recorded {}    recomputed {}",
                show(was),
                show(is)
            ));
            lines += 1;
        }
    }
    Ok(())
}
