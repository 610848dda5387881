//! Adding recordings as they end, and handing the lake over when the network lets it.
//!
//! A recording has ended when its last file has a footer and nothing was written to it for ten seconds (between two files of
//! a recording there is an instant at which all have a footer). One without a footer has ended when nothing was written for ten
//! minutes: its recorder was killed, since one that runs writes every second.

use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::Context;
use bags::{Bag, DamageKind};

use super::add::{Added, scan};
use super::{Lake, Pushed};

/// Nothing is written for this long to a recording that has ended.
const ENDED: Duration = Duration::from_secs(10);
/// The same of a recording whose recorder was killed.
const KILLED: Duration = Duration::from_mins(10);

/// Files of a recording when it was added: bytes in all, and the last instant of writing.
type State = (u64, SystemTime);

/// Recordings that are followed.
#[derive(Debug)]
pub struct Follower {
    lake: Lake,
    folders: Vec<PathBuf>,
    to: Option<String>,
    added: BTreeMap<PathBuf, State>,
    to_push: bool,
}

/// What one look did.
#[derive(Debug)]
pub struct Look {
    /// Recordings that have ended since the look before.
    pub added: Added,
    /// Recordings that go on.
    pub recording: usize,
    /// The lake was handed over, or why it was not; none where nothing was to be.
    pub pushed: Option<anyhow::Result<Pushed>>,
}

impl Follower {
    /// Follows folders with recordings; `to`: the URL to which the lake is handed over.
    pub fn new(lake: Lake, folders: Vec<PathBuf>, to: Option<String>) -> Self {
        Self {
            lake,
            folders,
            to_push: to.is_some(),
            to,
            added: BTreeMap::new(),
        }
    }

    /// Adds what has ended, and hands the lake over if it has changed or the last attempt has failed. `now`: by the clock of
    /// the file system.
    ///
    /// # Errors
    /// A folder cannot be read; the lake cannot be written.
    pub fn look(&mut self, now: SystemTime) -> anyhow::Result<Look> {
        let mut all = Vec::new();
        for folder in &self.folders {
            scan(folder, &mut all)?;
        }
        let (mut ended, mut recording) = (Vec::new(), 0);
        for path in all {
            let state = state(&path)?;
            if self.added.get(&path) == Some(&state) {
                continue;
            }
            if has_ended(&path, now.duration_since(state.1).unwrap_or(ENDED)) {
                ended.push((path, state));
            } else {
                recording += 1;
            }
        }
        let mut added = Added::default();
        if !ended.is_empty() {
            let paths: Vec<PathBuf> = ended.iter().map(|(path, _)| path.clone()).collect();
            added = self.lake.add(&paths, &mut |_, _| {})?;
            self.added.extend(ended);
        }
        self.to_push |= added.new > 0;
        let pushed = match &self.to {
            Some(to) if self.to_push => {
                let pushed = self.lake.push(to);
                self.to_push = pushed.is_err();
                Some(pushed)
            }
            _ => None,
        };
        Ok(Look {
            added,
            recording,
            pushed,
        })
    }
}

/// Of a file, or of the files in the folder of a recording.
fn state(path: &Path) -> anyhow::Result<State> {
    let read = |path: &Path| -> std::io::Result<State> {
        let of = |of: Metadata| Ok((of.len(), of.modified()?));
        if !path.is_dir() {
            return of(fs::metadata(path)?);
        }
        let mut all = (0, SystemTime::UNIX_EPOCH);
        for entry in fs::read_dir(path)? {
            let (bytes, written) = of(entry?.metadata()?)?;
            all = (all.0 + bytes, all.1.max(written));
        }
        Ok(all)
    };
    read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// A recording that nothing was written to for this long has ended. One that cannot be opened has, and is refused by name.
fn has_ended(path: &Path, quiet: Duration) -> bool {
    let truncated = |bag: &Bag| {
        (bag.damage().iter()).any(|damage| matches!(damage.kind, DamageKind::Truncated))
    };
    quiet >= KILLED || quiet >= ENDED && !Bag::open(path).is_ok_and(|bag| truncated(&bag))
}
