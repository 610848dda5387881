//! The lake: tables as folders of Parquet files, one folder for each month, which any reader of Parquet reads.
//!
//! ```text
//! LAKE/lake.json                                version of the tables
//! LAKE/sessions/month=2026-03/HASH.parquet      a row for each recording: the list of what the lake holds
//! LAKE/effects/month=2026-03/HASH.parquet       ...
//! ```
//!
//! Recordings stay the truth, and the lake is an index that can be made again. A recording is known by the hash of its
//! content, so that adding it twice does nothing. One writer at a time; readers need no lock.

mod add;
mod commit;
mod compact;
mod events;
mod follow;
mod read;
pub(crate) mod remote;
pub mod rows;
pub mod schema;

pub use read::{counts, flags, moments, numbers, texts};

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

#[cfg(feature = "cluster")]
pub(crate) use add::hash_files;
pub use add::{Added, Rows, hash};
pub use events::Event;
pub use follow::{Follower, Look};
pub use remote::Pushed;
use remote::{Remote, is_url};
use schema::{SESSIONS, TABLES, Table};

/// Name of the file that tells the version.
const FILE: &str = "lake.json";
/// Name of the file that a writer locks.
const LOCK: &str = ".lock";

#[derive(Serialize, Deserialize)]
struct Header {
    /// `probecell/lake`.
    schema: String,
    version: u32,
}

/// A lake in a folder, or the copy of one behind a URL.
#[derive(Debug, Clone)]
pub struct Lake {
    root: PathBuf,
    remote: Option<Remote>,
}

impl Lake {
    /// Opens a lake in a folder, or behind `s3://BUCKET/FOLDER` to read.
    ///
    /// # Errors
    /// There is none, or it was made by a later version.
    pub fn open(root: &Path) -> anyhow::Result<Self> {
        let remote = match root.to_str() {
            Some(url) if is_url(url) => Some(Remote::new(url)?),
            _ => None,
        };
        let absent = || {
            format!(
                "there is no lake in {}: `lake add` makes one",
                root.display()
            )
        };
        let text = match &remote {
            Some(remote) => remote.get(Path::new(FILE))?.with_context(absent)?.to_vec(),
            None => fs::read(root.join(FILE)).with_context(absent)?,
        };
        let header: Header = serde_json::from_slice(&text)
            .with_context(|| format!("cannot read {}", root.join(FILE).display()))?;
        if header.version > schema::VERSION {
            bail!(
                "the lake in {} is of version {}; this program reads versions up to {}",
                root.display(),
                header.version,
                schema::VERSION
            );
        }
        Ok(Self {
            root: root.to_owned(),
            remote,
        })
    }

    /// Opens a lake, or makes one in a folder that is empty or not there.
    ///
    /// # Errors
    /// As [`Lake::open`]; the folder holds something else.
    pub fn open_or_create(root: &Path) -> anyhow::Result<Self> {
        if root.join(FILE).exists() || root.to_str().is_some_and(is_url) {
            return Self::open(root);
        }
        fs::create_dir_all(root).with_context(|| format!("cannot make {}", root.display()))?;
        if fs::read_dir(root)?.next().is_some() {
            bail!("{} is neither empty nor a lake", root.display());
        }
        for table in TABLES {
            fs::create_dir_all(root.join(table.name))?;
        }
        let header = Header {
            schema: "probecell/lake".to_owned(),
            version: schema::VERSION,
        };
        let written = root.join(".lake.json");
        fs::write(&written, serde_json::to_vec_pretty(&header)?)?;
        fs::rename(&written, root.join(FILE))?;
        Ok(Self {
            root: root.to_owned(),
            remote: None,
        })
    }

    /// The place behind a URL, of a copy.
    pub(crate) fn remote(&self) -> Option<&Remote> {
        self.remote.as_ref()
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Files of a table with the names of their folders, sorted.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn files(&self, table: &Table) -> anyhow::Result<Vec<(String, PathBuf)>> {
        if let Some(remote) = &self.remote {
            return remote.files(table);
        }
        let mut found = Vec::new();
        let folder = self.root.join(table.name);
        if !folder.exists() {
            return Ok(found);
        }
        for month in
            fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?
        {
            let month = month?;
            let name = month.file_name().to_string_lossy().into_owned();
            if !month.file_type()?.is_dir() {
                continue;
            }
            for file in fs::read_dir(month.path())? {
                let path = file?.path();
                if path
                    .extension()
                    .is_some_and(|extension| extension == "parquet")
                {
                    found.push((name.clone(), path));
                }
            }
        }
        found.sort();
        Ok(found)
    }

    /// Hashes of the recordings in the lake.
    ///
    /// # Errors
    /// A file of the sessions cannot be read.
    pub fn known(&self) -> anyhow::Result<BTreeSet<String>> {
        self.keys(&SESSIONS)
    }

    fn keys(&self, table: &Table) -> anyhow::Result<BTreeSet<String>> {
        let mut known = BTreeSet::new();
        self.scan(table, &["bag"], &mut |batch| {
            let keys = read::texts(batch, 0)?;
            known.extend(keys.iter().flatten().map(ToOwned::to_owned));
            Ok(())
        })?;
        Ok(known)
    }

    /// Writes a file beside the tables, whole or not at all.
    pub(crate) fn keep(&self, name: &str, content: &[u8]) -> anyhow::Result<()> {
        let _lock = self.lock()?;
        let (path, written) = (self.root.join(name), self.root.join(format!(".{name}")));
        fs::write(&written, content)
            .and_then(|()| fs::rename(&written, &path))
            .with_context(|| format!("cannot write {}", path.display()))
    }

    /// The lock of the one writer, until it is dropped.
    fn lock(&self) -> anyhow::Result<File> {
        if self.remote.is_some() {
            bail!(
                "{} is a copy, which `lake push` writes: add to the lake in its folder",
                self.root.display()
            );
        }
        let path = self.root.join(LOCK);
        let file =
            File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(fs::TryLockError::WouldBlock) => {
                bail!(
                    "another program is writing to the lake in {}",
                    self.root.display()
                )
            }
            Err(fs::TryLockError::Error(error)) => {
                Err(error).with_context(|| format!("cannot lock {}", path.display()))
            }
        }
    }
}
