//! Messages that a node took and the recording does not hold, since it begins after them: a replay cannot go on without them.

use std::collections::{BTreeMap, BTreeSet};

use bags::Bag;
use graph::{
    Stamp,
    journal::{TIMER_PORT, steps},
    topics,
};
use probecell_msgs::{StepJournal, from_cdr};

use crate::embedded;

/// s after the first step of a node within which it has taken whatever was published before it, and before the recorder,
/// subscribed.
const BEGIN: f64 = 60.0;

/// A sentence for each topic of which a node took messages that were published before its first one that is recorded. Nothing
/// where the recording holds no cell or no step journals.
pub(crate) fn before_the_first(bag: &Bag, namespace: &str) -> Vec<String> {
    let Ok(Some(cell)) = embedded::cell(bag) else {
        return Vec::new();
    };
    let Ok(nodes) = cell.nodes(false) else {
        return Vec::new();
    };
    let mut missing: BTreeMap<&str, (BTreeSet<u64>, BTreeSet<&str>)> = BTreeMap::new();
    for node in &nodes {
        for (port, numbers) in first_taken(bag, namespace, node.name()) {
            let Some(topic) = node.inputs().get(usize::from(port)) else {
                continue;
            };
            let name = format!("{namespace}/{}", topic.name);
            let lacking = lacking(bag, &name, &numbers);
            if !lacking.is_empty() {
                let (all, nodes) = missing.entry(topic.name).or_default();
                all.extend(lacking);
                nodes.insert(node.name());
            }
        }
    }
    let sentence = |(topic, (numbers, nodes)): (&str, (BTreeSet<u64>, BTreeSet<&str>))| {
        let count = numbers.len();
        let noun = if count == 1 { "message" } else { "messages" };
        let nodes: Vec<&str> = nodes.into_iter().collect();
        format!(
            "{namespace}/{topic}: {count} {noun} that {} took came before the first that is recorded: a replay is incomplete",
            nodes.join(" and ")
        )
    };
    missing.into_iter().map(sentence).collect()
}

/// Numbers of the first messages that a node took, by port and in order; none where the recording does not hold its first step.
fn first_taken(bag: &Bag, namespace: &str, node: &str) -> BTreeMap<u16, Vec<u64>> {
    let mut taken: BTreeMap<u16, Vec<u64>> = BTreeMap::new();
    let mut begin: Option<Stamp> = None;
    let name = format!("{namespace}/{}", topics::journal_name(node));
    for recorded in bag.messages_on(&[&name]).flatten() {
        let Ok(message) = from_cdr::<StepJournal>(&recorded.payload) else {
            break;
        };
        if begin.is_none() && message.first_step != 0 {
            break;
        }
        for step in steps(&message) {
            let begin = *begin.get_or_insert(step.now);
            if step.now.since_s(begin) > BEGIN {
                return taken;
            }
            if step.port != TIMER_PORT {
                taken.entry(step.port).or_default().push(step.sequence);
            }
        }
    }
    taken
}

/// Those of the numbers taken on a topic that are smaller than any recorded: of the first process that published it, since the
/// numbers of a later one begin again.
fn lacking(bag: &Bag, topic: &str, taken: &[u64]) -> Vec<u64> {
    let mut rising = Vec::new();
    for &number in taken {
        if rising.last().is_some_and(|last| number < *last) {
            break;
        }
        rising.push(number);
    }
    let Some(&smallest) = rising.first() else {
        return rising;
    };
    let (mut first, mut newest) = (u64::MAX, (0, 0));
    for message in bag.messages_on(&[topic]).flatten() {
        let number = u64::from(message.sequence);
        if number < newest.0 && message.publish_time > newest.1 {
            break;
        }
        newest = newest.max((number, message.publish_time));
        first = first.min(number);
        if first <= smallest {
            return Vec::new();
        }
    }
    rising.retain(|number| *number < first);
    rising
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use bags::{Overflow, Recorder, RecorderOptions};

    use super::*;
    use crate::record;

    fn sample() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../bags/samples/punch.mcap")
    }

    /// The sample again, without the samples of the controller up to a number.
    fn without(last: u32, folder: &Path) {
        let bag = Bag::open(sample()).expect("a sample");
        let recorder = Recorder::start(RecorderOptions {
            overflow: Overflow::Block,
            ..RecorderOptions::new(folder)
        })
        .expect("a recorder");
        for attachment in bag.attachments().flatten() {
            let added = recorder.attach(
                attachment.name,
                attachment.media_type,
                attachment.log_time,
                attachment.data,
            );
            added.expect("an attachment");
        }
        for message in bag.messages().flatten() {
            let is_status = message.channel.topic.ends_with("/controller_status");
            if is_status && message.sequence <= last {
                continue;
            }
            let channel = recorder.channel(&message.channel).expect("a channel");
            let pushed = recorder.push(
                channel,
                u64::from(message.sequence),
                message.log_time,
                message.publish_time,
                message.payload,
            );
            pushed.expect("a message");
        }
        recorder.stop().expect("a recording");
    }

    #[test]
    fn what_a_node_took_before_the_recording_is_named() {
        let (whole, damage) = record::read(&sample()).expect("a session");
        assert!(damage.is_empty() && whole.damage.is_empty());
        let folder = tempfile::tempdir().expect("a folder");
        let late = folder.path().join("late");
        without(5, &late);
        let (session, damage) = record::read(&late).expect("a session");
        assert!(damage.is_empty());
        let topic = "controller_status";
        let expected = format!(
            "/{}/{topic}: 5 messages that machine_state took came before the first that is recorded: a replay is incomplete",
            session.cell
        );
        assert_eq!(session.damage, [expected]);
    }
}
