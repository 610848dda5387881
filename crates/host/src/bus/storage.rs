//! The latest sample of some topics of every cell, retained in the router for subscribers that join after the publisher has left.
//!
//! It answers as a storage of Zenoh does (the storage manager of `zenohd`): at the key of the data, with payload and time
//! stamp, and without the attachment of rmw_zenoh. So whoever asks a storage asks this one in the same way, and a subscription
//! of a node never gets what is kept: it asks for `…/@adv/**`, which no storage answers, and takes no sample without
//! attachment. On disk, each sample is a file whose path is its key and whose time of change is its stamp, as with
//! `zenoh-backend-filesystem`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, UNIX_EPOCH};

use zenoh::Wait;
use zenoh::key_expr::keyexpr;
use zenoh::query::Query;
use zenoh::time::{NTP64, Timestamp, TimestampId};

use super::graph::lock;
use super::observer::{Observed, topic_of};
use super::wire::{check_name, data_key};
use super::{BusError, Router};

/// Bytes of a sample; a longer one is not kept.
const LONGEST: usize = 1 << 20;
/// Bytes of all samples.
const ALL: usize = 64 << 20;
/// Samples.
const SAMPLES: usize = 8192;
/// Questions that wait; a further one is not answered.
const WAITING: usize = 64;

/// The latest sample of each topic of some names, below any namespace. Bounds: 8192 samples, 64 MiB, 1 MiB each; the oldest
/// make room.
pub struct Storage {
    domain_id: u32,
    topics: Vec<Observed>,
    folder: Option<PathBuf>,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    samples: BTreeMap<String, Sample>,
    bytes: usize,
    /// Made room; their files are still there.
    gone: BTreeSet<String>,
}

struct Sample {
    payload: Arc<[u8]>,
    at_ns: i64,
    on_disk: bool,
}

impl Kept {
    fn put(&mut self, key: String, payload: &[u8], at_ns: i64, on_disk: bool) {
        if payload.len() > LONGEST {
            return;
        }
        self.gone.remove(&key);
        let sample = Sample {
            payload: payload.into(),
            at_ns,
            on_disk,
        };
        self.bytes += payload.len();
        if let Some(before) = self.samples.insert(key, sample) {
            self.bytes -= before.payload.len();
        }
        while self.bytes > ALL || self.samples.len() > SAMPLES {
            let oldest = self.samples.iter().min_by_key(|(_, one)| one.at_ns);
            let Some(oldest) = oldest.map(|(key, _)| key.clone()) else {
                return;
            };
            if let Some(one) = self.samples.remove(&oldest) {
                self.bytes -= one.payload.len();
            }
            self.gone.insert(oldest);
        }
    }
}

impl Storage {
    /// Keeps `topics` of a domain: in memory or, in a folder, beyond the end of the process. What lies in the folder is read.
    ///
    /// # Errors
    /// Of reading the folder.
    pub fn open(
        domain_id: u32,
        topics: Vec<Observed>,
        folder: Option<PathBuf>,
    ) -> io::Result<Self> {
        let mut storage = Self {
            domain_id,
            topics,
            folder: None,
            kept: Mutex::default(),
        };
        if let Some(folder) = &folder {
            storage.read(folder, "")?;
        }
        storage.folder = folder;
        Ok(storage)
    }

    /// Reads the files below the part of a key; those that are of no topic that is kept are left alone.
    fn read(&self, folder: &Path, part: &str) -> io::Result<()> {
        for entry in fs::read_dir(folder.join(part))? {
            let entry = entry?;
            let Ok(name) = entry.file_name().into_string() else {
                continue;
            };
            let key = if part.is_empty() {
                name
            } else {
                format!("{part}/{name}")
            };
            let kind = entry.file_type()?;
            if kind.is_dir() {
                self.read(folder, &key)?;
            } else if kind.is_file()
                && topic_of(&key).and_then(|topic| self.key(&topic)).as_ref() == Some(&key)
            {
                let told = entry.metadata()?;
                let at = told.modified()?.duration_since(UNIX_EPOCH);
                if told.len() <= LONGEST as u64 {
                    let payload = fs::read(entry.path())?;
                    let at_ns = at.unwrap_or_default().as_nanos() as i64;
                    lock(&self.kept).put(key, &payload, at_ns, true);
                }
            }
        }
        Ok(())
    }

    /// Key of a topic (absolute); none when it is not kept.
    fn key(&self, topic: &str) -> Option<String> {
        let of = |one: &&Observed| {
            let namespace = topic.strip_suffix(one.name.as_str());
            namespace.is_some_and(|namespace| namespace.len() > 1 && namespace.ends_with('/'))
        };
        let known = self.topics.iter().find(of)?;
        check_name(topic).ok()?;
        Some(data_key(self.domain_id, topic, &known.ty))
    }

    /// Keeps a sample of a topic (absolute) that arrived at `at_ns` (since 1970), unless the topic is none of those kept.
    pub fn keep(&self, topic: &str, payload: &[u8], at_ns: i64) {
        if let Some(key) = self.key(topic) {
            lock(&self.kept).put(key, payload, at_ns, false);
        }
    }

    /// Writes what is new to the folder, if there is one; each file is replaced as a whole.
    ///
    /// # Errors
    /// Of writing; what was not written is written with the next call.
    pub fn write(&self) -> io::Result<()> {
        let Some(folder) = &self.folder else {
            return Ok(());
        };
        let (new, gone): (Vec<_>, _) = {
            let mut kept = lock(&self.kept);
            let new = kept.samples.iter().filter(|(_, one)| !one.on_disk);
            let new = new.map(|(key, one)| (key.clone(), Arc::clone(&one.payload), one.at_ns));
            (new.collect(), std::mem::take(&mut kept.gone))
        };
        for key in gone {
            match fs::remove_file(folder.join(key)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        for (key, payload, at_ns) in new {
            let path = folder.join(&key);
            let beside = path.with_extension("new");
            fs::create_dir_all(path.parent().unwrap_or(folder))?;
            fs::write(&beside, &payload)?;
            let file = fs::File::options().append(true).open(&beside)?;
            file.set_modified(UNIX_EPOCH + Duration::from_nanos(at_ns.max(0) as u64))?;
            fs::rename(&beside, &path)?;
            if let Some(one) = lock(&self.kept).samples.get_mut(&key) {
                one.on_disk |= one.at_ns == at_ns;
            }
        }
        Ok(())
    }

    fn answer(&self, query: &Query, id: TimestampId) {
        let asked = |key: &str| keyexpr::new(key).is_ok_and(|key| query.key_expr().intersects(key));
        let found: Vec<_> = {
            let kept = lock(&self.kept);
            let found = kept.samples.iter().filter(|(key, _)| asked(key));
            let found = found.map(|(key, one)| (key.clone(), Arc::clone(&one.payload), one.at_ns));
            found.collect()
        };
        for (key, payload, at_ns) in found {
            let since_1970 = Duration::from_nanos(at_ns.max(0) as u64);
            let stamp = Timestamp::new(NTP64::from(since_1970), id);
            let reply = query.reply(key, payload.to_vec()).timestamp(stamp);
            if let Err(reason) = reply.wait() {
                tracing::warn!(%reason, "cannot answer with what is kept");
                return;
            }
        }
    }
}

impl Router {
    /// Answers questions for what a storage keeps until it is closed, on a thread of its own: whoever reads slowly holds up
    /// nothing that is routed.
    ///
    /// # Errors
    /// [`BusError::Transport`].
    pub fn serve(&self, storage: &Arc<Storage>) -> Result<(), BusError> {
        let failed = |reason| BusError::transport("serve what is kept", &reason);
        let (sender, questions) = mpsc::sync_channel::<Query>(WAITING);
        for topic in &storage.topics {
            let sender = sender.clone();
            let key = data_key(storage.domain_id, &format!("**/{}", topic.name), &topic.ty);
            (self.session.declare_queryable(key))
                .callback(move |query| {
                    if sender.try_send(query).is_err() {
                        tracing::warn!("too many ask for what is kept");
                    }
                })
                .background()
                .wait()
                .map_err(failed)?;
        }
        let (storage, id) = (Arc::clone(storage), self.session.zid().into());
        std::thread::Builder::new()
            .name("storage".to_owned())
            .spawn(move || {
                for query in questions {
                    storage.answer(&query, id);
                }
            })
            .map_err(|error| failed(error.into()))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::{Qos, TypeId};

    fn storage(folder: Option<&Path>) -> Storage {
        let state = Observed {
            name: "machine_state".to_owned(),
            ty: TypeId::new("T", "H"),
            qos: Qos::latched(1),
        };
        Storage::open(0, vec![state], folder.map(Path::to_owned)).expect("a folder")
    }

    fn kept(storage: &Storage) -> Vec<(String, Vec<u8>, i64)> {
        let kept = lock(&storage.kept);
        let each = kept.samples.iter();
        each.map(|(key, one)| (key.clone(), one.payload.to_vec(), one.at_ns))
            .collect()
    }

    #[test]
    fn the_newest_of_each_cell_outlives_the_process_and_nothing_else_is_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = storage(Some(folder.path()));
        first.keep("/lathe/machine_state", b"old", 1);
        first.keep("/lathe/machine_state", b"new", 2_000_000_001);
        first.keep("/hall/mill/machine_state", b"mill", 3);
        for other in [
            "/lathe/approvals",
            "/machine_state",
            "/lathe/supermachine_state",
            "/lathe/../machine_state",
        ] {
            first.keep(other, b"other", 9);
        }
        let expected = vec![
            (
                "0/hall/mill/machine_state/T/H".to_owned(),
                b"mill".to_vec(),
                3,
            ),
            (
                "0/lathe/machine_state/T/H".to_owned(),
                b"new".to_vec(),
                2_000_000_001,
            ),
        ];
        assert_eq!(kept(&first), expected);
        first.write().expect("written");
        // What somebody lays there is not served for that.
        for other in ["0/lathe/approvals/T/H", "0/lathe/machine_state/T/H.new"] {
            let path = folder.path().join(other);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, "other").expect("written");
        }
        assert_eq!(kept(&storage(Some(folder.path()))), expected);
    }

    #[test]
    fn the_oldest_make_room() {
        let folder = tempfile::tempdir().expect("a folder");
        let storage = storage(Some(folder.path()));
        let long = vec![0; LONGEST];
        for number in 0..=64 {
            storage.keep(
                &format!("/cell_{number}/machine_state"),
                &long,
                100 - number,
            );
            storage.write().expect("written");
        }
        storage.keep("/longer/machine_state", &vec![0; LONGEST + 1], 200);
        storage.write().expect("written");
        let kept = kept(&storage);
        assert_eq!(kept.len(), ALL / LONGEST);
        assert!(kept.iter().all(|(_, _, at_ns)| *at_ns > 36));
        let files = fs::read_dir(folder.path().join("0/cell_63/machine_state/T"));
        assert_eq!(files.expect("a folder").count(), 1);
        let files = fs::read_dir(folder.path().join("0/cell_64/machine_state/T"));
        assert_eq!(files.map_or(0, Iterator::count), 0);
    }
}
