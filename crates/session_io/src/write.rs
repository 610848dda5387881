//! Writes a simulated or imported session as a recording that conforms to the interface contract.

use std::collections::BTreeMap;
use std::path::Path;

use bags::{Channel, ChannelId, History, Overflow, Qos, Recorder, RecorderOptions};
use diagnosis::Session;
use graph::topics;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{FeatureResult, Message, PartReport, TouchDeviation, std_msgs, to_cdr};

/// What a recording holds besides its session.
#[derive(Default)]
pub struct More<'a> {
    /// Deviations of the touches.
    pub touches: &'a [TouchDeviation],
    /// Fitted features.
    pub results: &'a [FeatureResult],
    /// Ends of parts.
    pub reports: &'a [PartReport],
    /// Files: name, media type, content.
    pub attachments: Vec<(String, &'static str, Vec<u8>)>,
    /// Named tables.
    pub tables: Vec<(&'static str, BTreeMap<String, String>)>,
}

/// Writes the session as an MCAP recording into `folder`, which must not exist, with topics under `/cell`.
///
/// # Errors
/// The folder cannot be written, or is there.
pub fn write(folder: &Path, cell: &str, session: &Session) -> anyhow::Result<()> {
    write_with(folder, cell, session, &More::default())
}

/// As [`write`], with more than the session.
///
/// # Errors
/// As [`write`].
pub fn write_with(
    folder: &Path,
    cell: &str,
    session: &Session,
    more: &More<'_>,
) -> anyhow::Result<()> {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(folder)
    })?;
    let begin = begin(session);
    let mut writer = Writer {
        recorder: &recorder,
        cell,
        waiting: Vec::new(),
    };
    let model = std_msgs::String {
        data: session.robot_description.clone(),
    };
    writer.topic("robot_description", Qos::latched(), [(begin, &model)])?;
    let plan = session.plan.iter().map(|plan| (begin, plan));
    writer.topic("inspection_plan", Qos::latched(), plan)?;
    let events = session
        .events
        .iter()
        .map(|one| (nanoseconds(one.header.stamp), one));
    writer.topic("probe_events", Qos::default(), events)?;
    let states = session
        .joint_states
        .iter()
        .map(|one| (nanoseconds(one.header.stamp), one));
    writer.topic("joint_states", Qos::default(), states)?;
    let commands = session
        .joint_commands
        .iter()
        .map(|one| (nanoseconds(one.header.stamp), one));
    writer.topic("joint_commands", Qos::default(), commands)?;
    let machine = session
        .machine_states
        .iter()
        .map(|one| (nanoseconds(one.header.stamp), one));
    writer.topic("machine_state", Qos::default(), machine)?;
    let references = session
        .references
        .iter()
        .map(|one| (nanoseconds(one.header.stamp), one));
    writer.topic("reference", Qos::latched(), references)?;
    writer.results(more, begin)?;
    writer.finish()?;
    for (name, media_type, data) in &more.attachments {
        recorder.attach(name, *media_type, begin, data.clone())?;
    }
    for (name, table) in &more.tables {
        recorder.metadata(*name, table.clone())?;
    }
    recorder.stop()?;
    Ok(())
}

/// Messages wait until all are known, so that they stand in the order of their times.
struct Writer<'a> {
    recorder: &'a Recorder,
    cell: &'a str,
    waiting: Vec<(u64, ChannelId, u64, Vec<u8>)>,
}

impl Writer<'_> {
    fn topic<'m, M: Message + 'm>(
        &mut self,
        name: &str,
        qos: Qos,
        messages: impl IntoIterator<Item = (u64, &'m M)>,
    ) -> anyhow::Result<()> {
        let mut messages = messages.into_iter().peekable();
        if messages.peek().is_none() {
            return Ok(());
        }
        let topic = format!("/{}/{name}", self.cell);
        let channel = self.recorder.channel(&Channel::of(&topic, M::TYPE, qos))?;
        for (sequence, (time, message)) in messages.enumerate() {
            self.waiting
                .push((time, channel, sequence as u64 + 1, to_cdr(message)));
        }
        Ok(())
    }

    /// What was found of the touches stands behind them.
    fn results(&mut self, more: &More<'_>, begin: u64) -> anyhow::Result<()> {
        let touches = more.touches.iter();
        let touches = touches.map(|one| (nanoseconds(one.header.stamp), one));
        self.topic(topics::TOUCH_DEVIATIONS.name, Qos::default(), touches)?;
        let end = self.waiting.iter().map(|(time, ..)| *time).max();
        let end = end.unwrap_or(begin);
        let latched = Qos {
            history: History::KeepLast(64),
            ..Qos::latched()
        };
        let results = more.results.iter().map(|one| (end, one));
        self.topic(topics::FEATURE_RESULTS.name, latched, results)?;
        let reports = more.reports.iter().map(|one| (end, one));
        self.topic(topics::PART_REPORTS.name, latched, reports)
    }

    fn finish(mut self) -> anyhow::Result<()> {
        self.waiting.sort_by_key(|(time, ..)| *time);
        for (time, channel, sequence, payload) in self.waiting {
            self.recorder.push(channel, sequence, time, time, payload)?;
        }
        Ok(())
    }
}

fn nanoseconds(stamp: Time) -> u64 {
    stamp.nanos().unsigned_abs()
}

/// The first instant of the session.
fn begin(session: &Session) -> u64 {
    let stamps = session
        .events
        .iter()
        .map(|one| one.header.stamp)
        .chain(session.joint_states.iter().map(|one| one.header.stamp))
        .chain(session.machine_states.iter().map(|one| one.header.stamp));
    stamps.map(nanoseconds).min().unwrap_or(0)
}
