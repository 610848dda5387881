//! Cells that run another version of the program: what they send in another layout is read by the names of its fields.
//!
//! The key of a topic holds the hash of its definition, so that a subscription to a message of this version hears none of
//! another's. The node that publishes it gives the definition ([`Observer::definition_of`]).

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use host::bus::{Channel, Entity, EntityKind, Observed, Observer, OnObserved, Received, Watched};
use probecell_msgs::migration::Migration;

use crate::live::{Callbacks, FAST, fast, observed};
use crate::state::{read_topics, split};

/// Wait before a definition that could not be had is asked for again.
const AGAIN: Duration = Duration::from_secs(30);

/// What is known of a message of another version.
enum Known {
    Read(Arc<Migration>),
    /// When it was tried.
    Unread(Instant),
}

/// The topics of cells of another version that are read, or cannot be.
#[derive(Default)]
pub(crate) struct Versions {
    /// By type and hash.
    known: BTreeMap<(String, String), Known>,
    /// By topic, type and hash.
    read: BTreeMap<(String, String, String), Watched>,
}

impl Versions {
    /// Reads what cells publish in another layout. `tell` is called once with each such topic of a cell and what differs, or with
    /// why it is not read.
    pub(crate) fn follow(
        &mut self,
        observer: &Observer,
        on: &Callbacks,
        mut tell: impl FnMut(&str, &str, Vec<String>),
    ) {
        let graph = observer.graph();
        let others: BTreeMap<_, _> = (graph.entities().iter().filter_map(of_another_version))
            .map(|(topic, publisher, channel)| (key_of(channel), (topic, publisher, channel)))
            .collect();
        self.read.retain(|key, _| others.contains_key(key));
        for (key, (topic, publisher, channel)) in others {
            let Some((cell, name)) = split(&channel.name) else {
                continue;
            };
            if self.read.contains_key(&key) {
                continue;
            }
            let (_, ty, hash) = &key;
            let known = self.known.entry((ty.clone(), hash.clone()));
            let known = known.or_insert_with(|| Known::Unread(Instant::now() - AGAIN));
            if let Known::Unread(tried) = known {
                if tried.elapsed() < AGAIN {
                    continue;
                }
                *tried = Instant::now();
                let migration = (observer
                    .definition_of(publisher)
                    .map_err(|one| one.to_string()))
                .and_then(|definition| {
                    Migration::new(&definition, topic.message).map_err(|one| one.to_string())
                });
                match migration {
                    Ok(migration) => *known = Known::Read(Arc::new(migration)),
                    Err(why) => {
                        tell(cell, name, vec![format!("not read: {why}")]);
                        continue;
                    }
                }
            }
            let Known::Read(migration) = known else {
                continue;
            };
            let is_fast = FAST.iter().any(|one| one.name == topic.name);
            let observed = Observed {
                ty: channel.ty.clone(),
                ..if is_fast {
                    fast(topic)
                } else {
                    observed(topic)
                }
            };
            let on_sample = migrated(&on.0, migration);
            match observer.watch(cell, &observed, &on_sample, &on.1) {
                Ok(watched) => {
                    tell(cell, name, migration.changes().to_vec());
                    self.read.insert(key, watched);
                }
                Err(error) => tracing::warn!(%error, cell, "{name} cannot be read"),
            }
        }
    }
}

fn key_of(channel: &Channel) -> (String, String, String) {
    let ty = &channel.ty;
    let [name, dds_name, hash] =
        [channel.name.as_str(), ty.dds_name(), ty.hash()].map(str::to_owned);
    (name, dds_name, hash)
}

/// The topic that an entity publishes, where the dashboard reads it and this program's messages have another layout.
fn of_another_version(entity: &Entity) -> Option<(graph::Topic, &Entity, &Channel)> {
    let channel = entity.channel.as_ref()?;
    let (_, name) = split(&channel.name)?;
    let topic = *read_topics().iter().find(|one| one.name == name)?;
    let known = topic.message;
    let other = channel.ty.dds_name() == known.dds_name && channel.ty.hash() != known.type_hash;
    (entity.kind == EntityKind::Publisher && other).then_some((topic, entity, channel))
}

/// Hands over messages of another version as those of this one.
fn migrated(on: &OnObserved, migration: &Arc<Migration>) -> OnObserved {
    let (on, migration) = (Arc::clone(on), Arc::clone(migration));
    Arc::new(move |topic: &str, received: Received<'_>| {
        match migration.migrate(&received.payload) {
            Ok(payload) => {
                let payload = payload.into();
                on(
                    topic,
                    Received {
                        payload,
                        ..received
                    },
                );
            }
            Err(error) => tracing::warn!(%error, topic, "a message is left out"),
        }
    })
}
