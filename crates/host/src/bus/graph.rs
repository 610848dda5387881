//! What the nodes of a domain announce: nodes, topics, services and their types.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Instant;

use super::qos::Qos;
use super::types::TypeId;
use super::wire::{Entity, EntityKind};

/// The ROS graph at one instant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Graph {
    entities: Vec<Entity>,
}

/// A topic, a type on it, and its publishers and subscriptions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicInfo {
    /// Absolute name.
    pub name: String,
    /// Type and hash.
    pub ty: TypeId,
    /// Quality of service of each publisher.
    pub offered: Vec<Qos>,
    /// Number of subscriptions.
    pub subscriptions: usize,
}

impl Graph {
    pub(crate) fn new(entities: Vec<Entity>) -> Self {
        Self { entities }
    }

    /// Everything announced, in the order of the tokens.
    pub fn entities(&self) -> &[Entity] {
        &self.entities
    }

    /// Full names of the nodes, sorted; a name that two nodes bear comes twice.
    pub fn nodes(&self) -> Vec<String> {
        let mut names: Vec<_> = self
            .entities
            .iter()
            .filter(|entity| entity.kind == EntityKind::Node)
            .map(|entity| entity.node.full())
            .collect();
        names.sort();
        names
    }

    /// How many sessions have announced a node of this full name, or an endpoint of it.
    pub fn sessions_of(&self, node: &str) -> usize {
        let of_node = self.entities.iter().filter(|one| one.node.full() == node);
        let sessions: BTreeSet<&str> = of_node.map(|one| one.session.as_str()).collect();
        sessions.len()
    }

    /// Topics with their types, sorted; a topic with two types comes twice.
    pub fn topics(&self) -> Vec<TopicInfo> {
        let mut topics = BTreeMap::<(&str, &TypeId), (Vec<Qos>, usize)>::new();
        for entity in &self.entities {
            let Some(channel) = &entity.channel else {
                continue;
            };
            let key = (channel.name.as_str(), &channel.ty);
            match entity.kind {
                EntityKind::Publisher => topics.entry(key).or_default().0.push(channel.qos),
                EntityKind::Subscription => topics.entry(key).or_default().1 += 1,
                _ => {}
            }
        }
        topics
            .into_iter()
            .map(|((name, ty), (offered, subscriptions))| TopicInfo {
                name: name.to_owned(),
                ty: ty.clone(),
                offered,
                subscriptions,
            })
            .collect()
    }

    /// Services that are served, with their types, sorted.
    pub fn services(&self) -> Vec<(String, TypeId)> {
        self.entities
            .iter()
            .filter(|entity| entity.kind == EntityKind::Server)
            .filter_map(|entity| entity.channel.as_ref())
            .map(|channel| (channel.name.clone(), channel.ty.clone()))
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect()
    }

    /// Number of subscriptions to `topic` with this type; by its name alone where the transport has no hash.
    pub fn subscriptions(&self, topic: &str, ty: &TypeId) -> usize {
        self.count(EntityKind::Subscription, topic, ty)
    }

    /// Number of publishers of `topic` with this type.
    pub(crate) fn publishers(&self, topic: &str, ty: &TypeId) -> usize {
        self.count(EntityKind::Publisher, topic, ty)
    }

    pub(crate) fn count(&self, kind: EntityKind, name: &str, ty: &TypeId) -> usize {
        self.entities
            .iter()
            .filter(|entity| entity.kind == kind)
            .filter_map(|entity| entity.channel.as_ref())
            // DDS has no hash.
            .filter(|channel| {
                channel.name == name
                    && channel.ty.dds_name() == ty.dds_name()
                    && (channel.ty.hash().is_empty() || channel.ty.hash() == ty.hash())
            })
            .count()
    }
}

/// The graph as it grows and shrinks; shared with the transport's threads.
#[derive(Clone, Default)]
pub(crate) struct LiveGraph {
    shared: Arc<(Mutex<BTreeMap<String, Entity>>, Condvar)>,
}

impl LiveGraph {
    /// A token appeared; foreign ones are left out.
    pub(crate) fn add(&self, token: &str) {
        if let Some(entity) = Entity::from_token(token) {
            let (tokens, changed) = &*self.shared;
            lock(tokens).insert(token.to_owned(), entity);
            changed.notify_all();
        }
    }

    /// A token vanished.
    pub(crate) fn remove(&self, token: &str) {
        let (tokens, changed) = &*self.shared;
        lock(tokens).remove(token);
        changed.notify_all();
    }

    pub(crate) fn snapshot(&self) -> Graph {
        Graph::new(lock(&self.shared.0).values().cloned().collect())
    }

    /// Waits until at least `count` such entities exist; false when `deadline` came first.
    pub(crate) fn wait_for(
        &self,
        kind: EntityKind,
        name: &str,
        ty: &TypeId,
        count: usize,
        deadline: Instant,
    ) -> bool {
        let (tokens, changed) = &*self.shared;
        let mut guard = lock(tokens);
        loop {
            let present = guard
                .values()
                .filter(|entity| entity.kind == kind)
                .filter_map(|entity| entity.channel.as_ref())
                .filter(|channel| channel.name == name && channel.ty == *ty)
                .count();
            if present >= count {
                return true;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            guard = changed
                .wait_timeout(guard, left)
                .unwrap_or_else(PoisonError::into_inner)
                .0;
        }
    }
}

/// A panic of another thread leaves these maps whole, hence poison is no reason to stop.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
