//! Changes of several files that happen whole or not at all.
//!
//! New files are written and synced below `.staging`, then a journal that names them, their places and the files to remove;
//! only then they are moved. A change that was cut off before its journal is there leaves nothing, one that was cut off
//! after it is completed by the next writer.

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::Context;
use arrow_array::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use serde::{Deserialize, Serialize};

use super::schema::{Table, schema};

/// Folder of files that are not in the lake yet.
const STAGING: &str = ".staging";
/// Name of the journal in it.
const JOURNAL: &str = "journal.json";

/// What remains to be done; paths are relative to the lake.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Journal {
    /// From the staging folder to the lake.
    moves: Vec<(PathBuf, PathBuf)>,
    /// Files that the new ones replace.
    removals: Vec<PathBuf>,
}

/// A change under way.
#[derive(Debug)]
pub(super) struct Commit<'l> {
    root: &'l Path,
    journal: Journal,
}

impl<'l> Commit<'l> {
    /// Completes what an earlier writer left, and begins a change of the lake at `root`, whose lock the caller holds.
    pub(super) fn begin(root: &'l Path) -> anyhow::Result<Self> {
        let staging = root.join(STAGING);
        match fs::read(staging.join(JOURNAL)) {
            Ok(text) => {
                let journal = serde_json::from_slice(&text)
                    .with_context(|| format!("cannot read {}", staging.join(JOURNAL).display()))?;
                perform(root, &journal)?;
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error).context("cannot read the journal of the lake"),
        }
        match fs::remove_dir_all(&staging) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot empty {}", staging.display()));
            }
            _ => {}
        }
        fs::create_dir_all(&staging)
            .with_context(|| format!("cannot make {}", staging.display()))?;
        Ok(Self {
            root,
            journal: Journal::default(),
        })
    }

    /// Writes a file that shall stand at `to`.
    pub(super) fn write(
        &mut self,
        table: &Table,
        to: PathBuf,
        batches: &[RecordBatch],
    ) -> anyhow::Result<()> {
        let from = Path::new(STAGING).join(format!("{}.parquet", self.journal.moves.len()));
        let path = self.root.join(&from);
        let file =
            File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
            .build();
        let mut writer = ArrowWriter::try_new(file, schema(table), Some(properties))?;
        for batch in batches {
            writer.write(batch)?;
        }
        writer
            .into_inner()?
            .sync_all()
            .with_context(|| format!("cannot write {}", path.display()))?;
        self.journal.moves.push((from, to));
        Ok(())
    }

    /// Removes a file together with the change.
    pub(super) fn remove(&mut self, file: PathBuf) {
        self.journal.removals.push(file);
    }

    /// Performs the change.
    pub(super) fn finish(self) -> anyhow::Result<()> {
        if self.journal.moves.is_empty() && self.journal.removals.is_empty() {
            return Ok(());
        }
        let journal = self.root.join(STAGING).join(JOURNAL);
        let text = serde_json::to_vec(&self.journal)?;
        let written = journal.with_extension("new");
        fs::write(&written, text)
            .and_then(|()| File::open(&written)?.sync_all())
            .and_then(|()| fs::rename(&written, &journal))
            .and_then(|()| File::open(self.root.join(STAGING))?.sync_all())
            .with_context(|| format!("cannot write {}", journal.display()))?;
        perform(self.root, &self.journal)?;
        fs::remove_file(&journal).with_context(|| format!("cannot remove {}", journal.display()))
    }
}

/// Does what is left of a journal.
fn perform(root: &Path, journal: &Journal) -> anyhow::Result<()> {
    for (from, to) in &journal.moves {
        let (from, to) = (root.join(from), root.join(to));
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
        }
        match fs::rename(&from, &to) {
            // It was moved before the writer was cut off.
            Err(error) if error.kind() == ErrorKind::NotFound && to.is_file() => {}
            done => {
                done.with_context(|| {
                    format!("cannot move {} to {}", from.display(), to.display())
                })?;
            }
        }
    }
    for file in &journal.removals {
        let file = root.join(file);
        match fs::remove_file(&file) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot remove {}", file.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A writer that ends between its journal and the moves has not lost or doubled anything.
    #[test]
    fn a_change_that_was_cut_off_after_its_journal_is_completed_by_the_next_writer() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        let staging = root.join(STAGING);
        fs::create_dir_all(&staging).expect("a folder");
        fs::write(root.join("old"), "old").expect("a file");
        fs::write(root.join("moved"), "first").expect("a file that was moved already");
        fs::write(staging.join("1.parquet"), "second").expect("a file");
        let journal = Journal {
            moves: vec![
                (Path::new(STAGING).join("0.parquet"), "moved".into()),
                (Path::new(STAGING).join("1.parquet"), "table/new".into()),
            ],
            removals: vec!["old".into()],
        };
        fs::write(
            staging.join(JOURNAL),
            serde_json::to_vec(&journal).expect("JSON"),
        )
        .expect("a file");
        Commit::begin(root)
            .expect("a change")
            .finish()
            .expect("nothing to do");
        assert_eq!(
            fs::read_to_string(root.join("moved")).expect("a file"),
            "first"
        );
        assert_eq!(
            fs::read_to_string(root.join("table/new")).expect("a file"),
            "second"
        );
        assert!(!root.join("old").exists());
        assert_eq!(fs::read_dir(&staging).expect("a folder").count(), 0);
    }
}
