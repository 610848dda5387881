//! A lake behind S3, and recordings there.
//!
//! Such a lake is the copy of one in a folder: its files never change under their names, so that handing it over is to
//! put what is missing, the list of sessions last, and to remove what the folder has no more. Credentials and endpoint are
//! taken from the environment as other programs do (`AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT`,
//! `AWS_ALLOW_HTTP`).

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, SystemTime};

use anyhow::{Context, anyhow, bail};
use futures::TryStreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt, PutMode, PutPayload, RetryConfig};
use sha2::{Digest, Sha256};
use tokio::runtime::Runtime;
use url::Url;

use super::add::hexadecimal;
use super::schema::{SESSIONS, TABLES, Table};
use super::{FILE, Lake};

/// Name of the object and of the file beside the lake that tell of which lake the copy is.
const ORIGIN: &str = "origin";

/// For a request with all its repetitions: whoever is cut off tries again later.
const PATIENCE: Duration = Duration::from_secs(30);

/// What waits for the network, for the life of the program.
static RUNTIME: LazyLock<std::io::Result<Runtime>> = LazyLock::new(|| {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
});

/// A place behind a URL.
#[derive(Clone)]
pub(crate) struct Remote {
    url: Url,
    store: Arc<dyn ObjectStore>,
    prefix: Key,
}

impl fmt::Debug for Remote {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", self.url)
    }
}

/// True for a name that is a URL.
pub(crate) fn is_url(name: &str) -> bool {
    name.contains("://")
}

impl Remote {
    /// The place with this URL, `s3://BUCKET/FOLDER`.
    pub(crate) fn new(name: &str) -> anyhow::Result<Self> {
        let url = Url::parse(name).with_context(|| format!("{name:?} is no URL"))?;
        if url.scheme() != "s3" || url.host_str().is_none() {
            bail!("{name:?} is neither a path nor s3://BUCKET/FOLDER");
        }
        let store = AmazonS3Builder::from_env()
            .with_url(name)
            .with_retry(RetryConfig {
                max_retries: 3,
                retry_timeout: PATIENCE,
                ..RetryConfig::default()
            })
            .build()
            .map_err(|error| anyhow!("cannot reach {name}: {}", line(&error)))?;
        let prefix = Key::from_url_path(url.path()).with_context(|| format!("{name:?}"))?;
        Ok(Self {
            url,
            store: Arc::new(store),
            prefix,
        })
    }

    /// URL of the bucket, with what reads it.
    pub(crate) fn store(&self) -> (&Url, Arc<dyn ObjectStore>) {
        (&self.url, self.store.clone())
    }

    /// The URL, ending with `/`.
    pub(crate) fn folder(&self) -> String {
        format!("{}/", self.url.as_str().trim_end_matches('/'))
    }

    /// URL of a file below the place; of the place itself where there is no name.
    fn name(&self, file: &Path) -> String {
        if file.as_os_str().is_empty() {
            self.url.to_string()
        } else {
            format!("{}{}", self.folder(), file.display())
        }
    }

    fn key(&self, file: &Path) -> Key {
        let parts = file.iter().map(|part| part.to_string_lossy().into_owned());
        let prefix = self.prefix.parts().map(|part| part.as_ref().to_owned());
        prefix.chain(parts).collect()
    }

    fn wait<T, E: std::error::Error + Send + Sync + 'static>(
        &self,
        file: &Path,
        work: impl Future<Output = Result<T, E>>,
    ) -> anyhow::Result<T> {
        let runtime = RUNTIME
            .as_ref()
            .map_err(|error| anyhow!("cannot start the threads of the network: {error}"))?;
        runtime
            .block_on(work)
            .map_err(|error| anyhow!("{}: {}", self.name(file), line(&error)))
    }

    /// The content of a file below the place; none where it is not there.
    pub(crate) fn get(&self, file: &Path) -> anyhow::Result<Option<bytes::Bytes>> {
        let key = self.key(file);
        self.wait(file, async {
            match self.store.get(&key).await {
                Ok(found) => found.bytes().await.map(Some),
                Err(object_store::Error::NotFound { .. }) => Ok(None),
                Err(error) => Err(error),
            }
        })
    }

    /// Files of a table, as [`Lake::files`] gives them.
    pub(super) fn files(&self, table: &Table) -> anyhow::Result<Vec<(String, PathBuf)>> {
        let folder = Path::new(table.name);
        let key = self.key(folder);
        let objects: Vec<_> = self.wait(folder, self.store.list(Some(&key)).try_collect())?;
        let mut found = Vec::new();
        for object in objects {
            let parts: Vec<String> = object
                .location
                .prefix_match(&key)
                .into_iter()
                .flatten()
                .map(|part| part.as_ref().to_owned())
                .collect();
            if let [month, file] = parts.as_slice()
                && file.ends_with(".parquet")
            {
                found.push((month.clone(), folder.join(month).join(file)));
            }
        }
        found.sort();
        Ok(found)
    }

    /// Copies a file of a folder to the same name here.
    fn put(&self, root: &Path, file: &Path) -> anyhow::Result<()> {
        let path = root.join(file);
        let content =
            std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
        self.wait(
            file,
            self.store.put(&self.key(file), PutPayload::from(content)),
        )?;
        Ok(())
    }
}

/// An error of the network in one line, without the layers that passed it on.
fn line(error: &dyn std::error::Error) -> String {
    let text = error.to_string();
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ")
}

/// What handing over did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pushed {
    /// Files that were put.
    pub put: usize,
    /// Files that were there already.
    pub there: usize,
    /// Files that were removed, since the lake has no more of them.
    pub removed: usize,
}

impl Lake {
    /// Makes the lake behind a URL a copy of this one; what is there already is left, so that a copy that was cut off is
    /// completed by the next.
    ///
    /// # Errors
    /// The place cannot be reached or written, or holds the copy of another lake.
    pub fn push(&self, to: &str) -> anyhow::Result<Pushed> {
        let _lock = self.lock()?;
        let remote = Remote::new(to)?;
        self.claim(&remote)?;
        let mut pushed = Pushed {
            put: 0,
            there: 0,
            removed: 0,
        };
        // The list of sessions last: a session that it names has all of its rows.
        let others = TABLES.iter().filter(|table| table.name != SESSIONS.name);
        let mut superfluous = Vec::new();
        for table in others.chain([&SESSIONS]) {
            let there: BTreeSet<PathBuf> = remote
                .files(table)?
                .into_iter()
                .map(|(_, file)| file)
                .collect();
            let mut own = BTreeSet::new();
            for (_, path) in self.files(table)? {
                own.insert(path.strip_prefix(self.root())?.to_owned());
            }
            for file in own.difference(&there) {
                remote.put(self.root(), file)?;
                pushed.put += 1;
            }
            pushed.there += own.intersection(&there).count();
            superfluous.extend(there.difference(&own).cloned());
        }
        remote.put(self.root(), Path::new(FILE))?;
        for file in superfluous {
            remote.wait(&file, remote.store.delete(&remote.key(&file)))?;
            pushed.removed += 1;
        }
        Ok(pushed)
    }

    /// Makes sure that the place holds nothing, or a copy of this lake.
    fn claim(&self, remote: &Remote) -> anyhow::Result<()> {
        let file = self.root().join(format!(".{ORIGIN}"));
        let own = match std::fs::read_to_string(&file) {
            Ok(own) => own,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let told = format!(
                    "{:?} {} {}",
                    SystemTime::now(),
                    std::process::id(),
                    file.display()
                );
                let own = format!("{}\n", &hexadecimal(&Sha256::digest(told))[..32]);
                std::fs::write(&file, &own)
                    .with_context(|| format!("cannot write {}", file.display()))?;
                own
            }
            Err(error) => {
                return Err(error).with_context(|| format!("cannot read {}", file.display()));
            }
        };
        let name = Path::new(ORIGIN);
        let put = async {
            let payload = PutPayload::from(own.clone());
            match remote
                .store
                .put_opts(&remote.key(name), payload, PutMode::Create.into())
                .await
            {
                Err(object_store::Error::AlreadyExists { .. }) => Ok(()),
                put => put.map(|_| ()),
            }
        };
        remote.wait(name, put)?;
        let there = remote.get(name)?.unwrap_or_default();
        if there != own.as_bytes() {
            bail!("{} holds the copy of another lake", remote.folder());
        }
        Ok(())
    }
}
