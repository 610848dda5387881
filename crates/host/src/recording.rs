//! The recorder: every topic of the cell into a bag, with what the bus lost.
//!
//! Subscriptions push on the transport's threads into a bounded queue; a thread of the bag's own writes. A loss on the
//! bus is written down in the bag and published on `loss_reports`.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use bags::{Channel, Recorder, RecorderOptions, Sealer, SplitAt, Statistics};
use graph::{Stamp, Topic, topics};
use probecell_msgs::{LossReport, MessageType, std_msgs, to_cdr};
use tracing::error;

use crate::{
    bus::{Bus, BusError, Publisher, Received, Subscription},
    clock::now,
    topology::bus_qos,
};

/// Settings of a recording.
#[derive(Clone, Debug)]
pub struct RecordingSettings {
    /// Folder to write, which must not exist.
    pub folder: PathBuf,
    /// Namespace of the cell, with its slash.
    pub namespace: String,
    /// Absolute name of the topic on which whatever is on the bus reports its health.
    pub diagnostics: String,
    /// Topics to record.
    pub topics: Vec<Topic>,
    /// Nodes whose step journals are recorded.
    pub nodes: Vec<String>,
    /// Longest time of messages that a kill may lose.
    pub sync_interval: Duration,
    /// When a new file is begun.
    pub split: SplitAt,
    /// Name, media type and bytes of files to embed.
    pub attachments: Vec<(String, String, Vec<u8>)>,
    /// What signs its seals.
    pub sealer: Option<Sealer>,
    /// Name and content of a table that says what recorded: program, revision, configuration.
    pub provenance: (String, BTreeMap<String, String>),
}

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The bag cannot be written.
    #[error(transparent)]
    Bag(#[from] bags::Error),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// A recording under way.
pub struct RecorderProcess {
    recorder: Recorder,
    subscriptions: Vec<Subscription>,
    /// Number of the last message of each topic of the cell and of each journal.
    taken: Vec<Arc<AtomicU64>>,
    on_taken: OnTaken,
}

/// Called after each message that is taken; must not block.
pub type OnTaken = Arc<dyn Fn() + Send + Sync>;

/// Publishes losses on the bus.
struct Losses {
    publisher: Publisher,
    namespace: String,
}

impl RecorderProcess {
    /// Makes the bag and subscribes to every topic of the cell, and to `/diagnostics`.
    ///
    /// # Errors
    /// What the bus or the file system says.
    pub fn start(
        bus: &Bus,
        settings: RecordingSettings,
        on_taken: OnTaken,
    ) -> Result<Self, RecordingError> {
        let mut options = RecorderOptions::new(&settings.folder);
        options.sync_interval = settings.sync_interval;
        options.split = settings.split;
        options.ros_distro = ros_distro();
        options.sealer = settings.sealer;
        let recorder = Recorder::start(options)?;
        for (name, media_type, data) in settings.attachments {
            recorder.attach(name, media_type, now().0 as u64, data)?;
        }
        let (name, table) = settings.provenance;
        recorder.metadata(name, table)?;
        let topic = topics::LOSS_REPORTS;
        let name = format!("{}/{}", settings.namespace, topic.name);
        let losses = Arc::new(Losses {
            publisher: bus.publisher(&name, topic.message, bus_qos(topic.qos))?,
            namespace: settings.namespace.clone(),
        });
        let mut process = Self {
            recorder,
            subscriptions: Vec::new(),
            taken: Vec::new(),
            on_taken,
        };
        let absolute = |name: &str| format!("{}/{name}", settings.namespace);
        for topic in &settings.topics {
            let name = absolute(topic.name);
            let taken = process.subscribe(bus, &name, topic.message, topic.qos, &losses)?;
            process.taken.push(taken);
        }
        for node in &settings.nodes {
            let (message, qos) = topics::JOURNAL;
            let name = absolute(&topics::journal_name(node));
            let taken = process.subscribe(bus, &name, message, qos, &losses)?;
            process.taken.push(taken);
        }
        let (_, message, qos) = topics::DIAGNOSTICS;
        process.subscribe(bus, &settings.diagnostics, message, qos, &losses)?;
        Ok(process)
    }

    fn subscribe(
        &mut self,
        bus: &Bus,
        name: &str,
        message: &'static MessageType,
        qos: graph::Qos,
        losses: &Arc<Losses>,
    ) -> Result<Arc<AtomicU64>, RecordingError> {
        let pusher = self.recorder.pusher();
        let channel = pusher.channel(&Channel::of(name, message, bag_qos(qos)))?;
        let for_losses = pusher.clone();
        let taken = Arc::new(AtomicU64::new(0));
        let last = Arc::clone(&taken);
        let on_taken = Arc::clone(&self.on_taken);
        let on_sample = move |received: Received<'_>| {
            let number = received.sequence;
            let (reception, source) = (received.received_ns as u64, received.source_time_ns as u64);
            let pushed = pusher.push(
                channel,
                received.sequence,
                reception,
                source,
                received.payload.into_owned(),
            );
            // A full queue is counted by the bag itself; a stopped or failed one is reported by `finish`.
            drop(pushed);
            last.store(number, Ordering::Release);
            on_taken();
        };
        let losses = Arc::clone(losses);
        let prefix = format!("{}/", losses.namespace);
        let topic = name.strip_prefix(&prefix).unwrap_or(name).to_owned();
        let on_lost = move |lost: crate::bus::Lost| {
            for_losses.report_bus_loss(channel, lost.count, false);
            losses.publish(&topic, lost);
        };
        let subscription = bus.subscribe(
            name,
            message,
            bus_qos(qos),
            Box::new(on_sample),
            Box::new(on_lost),
        )?;
        self.subscriptions.push(subscription);
        Ok(taken)
    }

    /// Number of the last message that was taken of each topic of [`topic_names`], in that order.
    pub fn taken(&self) -> impl Iterator<Item = u64> {
        self.taken.iter().map(|one| one.load(Ordering::Acquire))
    }

    /// The failure that ended the recording early, if there was one.
    pub fn failure(&self) -> Option<bags::Error> {
        self.recorder.failure()
    }

    /// How long the disk has kept the thread that writes, as [`bags::Pusher::silent_for`].
    pub fn silent_for(&self) -> Duration {
        self.recorder.silent_for()
    }

    /// Writes what is queued, closes the files and returns what was written.
    ///
    /// # Errors
    /// What could not be written.
    pub fn finish(mut self) -> Result<Statistics, RecordingError> {
        self.subscriptions.clear();
        Ok(self.recorder.stop()?)
    }
}

impl Losses {
    fn publish(&self, topic: &str, lost: crate::bus::Lost) {
        let instant: Stamp = now();
        error!(
            "lost {} messages on {topic} of cell {} from number {}",
            lost.count, self.namespace, lost.first
        );
        let report = LossReport {
            header: std_msgs::Header {
                stamp: instant.time(),
                frame_id: String::new(),
            },
            observer: "recorder".to_owned(),
            topic: topic.to_owned(),
            first_sequence: lost.first,
            count: lost.count,
            recovered: false,
        };
        if let Err(error) = self.publisher.publish(to_cdr(&report), instant.0) {
            error!("a loss could not be published: {error}");
        }
    }
}

/// The ROS 2 distribution of the environment, as rosbag2 names it.
fn ros_distro() -> String {
    let named = std::env::var("ROS_DISTRO").ok();
    let is_name = |text: &String| {
        !text.is_empty() && text.chars().all(|letter| letter.is_ascii_alphanumeric())
    };
    named.filter(is_name).unwrap_or("unknown".to_owned())
}

fn bag_qos(qos: graph::Qos) -> bags::Qos {
    bags::Qos {
        reliability: if qos.reliable {
            bags::Reliability::Reliable
        } else {
            bags::Reliability::BestEffort
        },
        durability: if qos.transient_local {
            bags::Durability::TransientLocal
        } else {
            bags::Durability::Volatile
        },
        history: qos
            .depth
            .map_or(bags::History::KeepAll, bags::History::KeepLast),
    }
}

/// What the recorder subscribes to, once each, below the namespace of the cell: each topic, then each journal.
pub fn topic_names(topics: &[Topic], nodes: &[&str]) -> Vec<String> {
    let names = topics.iter().map(|topic| topic.name.to_owned());
    names
        .chain(nodes.iter().map(|node| topics::journal_name(node)))
        .collect()
}
