//! Cells that run another version of the program: what they send in another layout is read by the names of its fields.
//!
//! The key of a topic holds the hash of its definition, so that a subscription to a message of this version hears none of
//! another's. The node that publishes it gives the definition ([`Observer::definition_of`]).

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use graph::topics;
use host::bus::{
    Entity, EntityKind, Graph, Observed, Observer, OnObserved, Received, TypeId, Watched,
};
use probecell_msgs::migration::Migration;

use crate::observed::{Callbacks, FAST, fast, observed};
use crate::state::{Differs, is_read, split};

/// Wait before a definition that could not be had is asked for again.
const AGAIN: Duration = Duration::from_secs(30);
/// Topics of other versions that are followed; further ones are not read.
const TOPICS: usize = 2_000;
/// Fields that are named of a topic, and letters of a sentence.
const FIELDS: usize = 20;
const LETTERS: usize = 200;
/// Bytes of the longest message that is read by its fields, which takes some thirty times as much.
const LONGEST: usize = 4 << 20;

/// A topic with the layout of its messages.
type Key = (String, TypeId);

/// What is known of such a topic: what differs in its messages, or why they are not read and when that was tried.
enum Known {
    Read(
        Vec<String>,
        #[expect(dead_code, reason = "held for its drop")] Watched,
    ),
    Unread(String, Instant),
}

/// The topics of cells of another version.
#[derive(Default)]
pub(crate) struct Versions {
    migrations: BTreeMap<TypeId, Arc<Migration>>,
    topics: BTreeMap<Key, Known>,
}

impl Versions {
    /// Reads what the cells that are present publish in another layout; what differs by cell and topic, or why it is not read.
    pub(crate) fn follow(
        &mut self,
        observer: &Observer,
        graph: &Graph,
        present: &BTreeSet<String>,
        on: &Callbacks,
    ) -> Differs {
        let others: BTreeMap<Key, Other> = (graph.entities().iter().filter_map(of_another_version))
            .filter(|other| present.contains(other.cell))
            .map(|other| ((other.topic.to_owned(), other.ty.clone()), other))
            .collect();
        self.topics.retain(|key, _| others.contains_key(key));
        let types: BTreeSet<&TypeId> = others.keys().map(|(_, ty)| ty).collect();
        self.migrations.retain(|ty, _| types.contains(ty));
        for (key, other) in &others {
            let is_done = match self.topics.get(key) {
                Some(Known::Read(..)) => true,
                Some(Known::Unread(_, tried)) => tried.elapsed() < AGAIN,
                None => self.topics.len() >= TOPICS,
            };
            if is_done {
                continue;
            }
            let known = self.read(observer, other, on);
            let is_read = matches!(known, Known::Read(..));
            self.topics.insert(key.clone(), known);
            // A node that does not answer holds this thread up once a look.
            if !is_read {
                break;
            }
        }
        self.differs()
    }

    fn read(&mut self, observer: &Observer, other: &Other<'_>, on: &Callbacks) -> Known {
        match self.subscribed(observer, other, on) {
            Ok((watched, changes)) => Known::Read(changes, watched),
            Err(why) => Known::Unread(why, Instant::now()),
        }
    }

    fn subscribed(
        &mut self,
        observer: &Observer,
        other: &Other<'_>,
        on: &Callbacks,
    ) -> Result<(Watched, Vec<String>), String> {
        let migration = if let Some(known) = self.migrations.get(other.ty) {
            Arc::clone(known)
        } else {
            let definition = observer.definition_of(&other.publisher.node, other.ty);
            let definition =
                definition.map_err(|error| format!("its node gives no definition ({error})"))?;
            let migration = Migration::new(&definition, other.known.message);
            let migration = Arc::new(migration.map_err(|error| error.to_string())?);
            self.migrations
                .insert(other.ty.clone(), Arc::clone(&migration));
            migration
        };
        let is_fast = FAST.iter().any(|one| one.name == other.known.name);
        let as_here = if is_fast { fast } else { observed };
        let observed = Observed {
            ty: other.ty.clone(),
            ..as_here(other.known)
        };
        let on_sample = migrated(&on.0, &migration);
        let watched = observer.watch(other.cell, &observed, &on_sample, &on.1);
        let changes = migration.changes();
        let mut shown: Vec<String> = changes.iter().take(FIELDS).cloned().collect();
        if changes.len() > FIELDS {
            shown.push(format!("and {} more", changes.len() - FIELDS));
        }
        Ok((watched.map_err(|error| error.to_string())?, shown))
    }

    fn differs(&self) -> Differs {
        let mut differs = Differs::new();
        for ((topic, _), known) in &self.topics {
            let Some((cell, name)) = split(topic) else {
                continue;
            };
            let told = match known {
                Known::Read(changes, _) => changes.clone(),
                Known::Unread(why, _) => {
                    vec![format!("not read: {why}").chars().take(LETTERS).collect()]
                }
            };
            let of_cell = differs.entry(cell.to_owned()).or_default();
            of_cell.insert(name.to_owned(), told);
        }
        differs
    }
}

/// A topic that the dashboard reads, in another layout than that of this program's messages.
struct Other<'a> {
    known: graph::Topic,
    cell: &'a str,
    topic: &'a str,
    ty: &'a TypeId,
    publisher: &'a Entity,
}

/// Messages of this project only: others have no versions of ours, and drivers of a cell read them.
fn of_another_version(publisher: &Entity) -> Option<Other<'_>> {
    let channel =
        (publisher.channel.as_ref()).filter(|_| publisher.kind == EntityKind::Publisher)?;
    let (cell, name) = split(&channel.name)?;
    let known = topics::by_name(name)?;
    let own = known.message;
    let is_other = channel.ty.dds_name() == own.dds_name && channel.ty.hash() != own.type_hash;
    let is_of_ours = own.name.starts_with("probecell_msgs/") && is_read(&channel.name, own.name);
    (is_other && is_of_ours).then_some(Other {
        known,
        cell,
        topic: &channel.name,
        ty: &channel.ty,
        publisher,
    })
}

/// Hands over messages of another version as those of this one.
fn migrated(on: &OnObserved, migration: &Arc<Migration>) -> OnObserved {
    let (on, migration) = (Arc::clone(on), Arc::clone(migration));
    Arc::new(move |topic: &str, received: Received<'_>| {
        if received.payload.len() > LONGEST {
            tracing::warn!(topic, "a message of more than 4 MiB is left out");
            return;
        }
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
