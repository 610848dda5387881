//! Compaction: the files of each table and month become one, or some of limited size.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use arrow_array::Int64Array;
use arrow_ord::sort::{SortColumn, lexsort_to_indices};
use arrow_select::concat::concat_batches;
use arrow_select::take::take_record_batch;
use sha2::{Digest, Sha256};

use super::Lake;
use super::add::hexadecimal;
use super::commit::Commit;
use super::read::read;
use super::schema::{TABLES, Table, schema};

/// Bytes of small files that become one file: what fits into memory as rows.
const MOST: u64 = 128 << 20;

impl Lake {
    /// Makes one file of the files of each table and month, sorted by machine and time; of more than 128 MB several. Gives
    /// the number of files before and after. Columns of an older version are filled up.
    ///
    /// # Errors
    /// The lake cannot be read or written; then nothing was changed.
    pub fn compact(&self) -> anyhow::Result<(usize, usize)> {
        let _lock = self.lock()?;
        let mut commit = Commit::begin(self.root())?;
        let (mut before, mut after) = (0, 0);
        for table in TABLES {
            let files = self.files(table)?;
            before += files.len();
            for (month, group) in groups(&files)? {
                after += 1;
                if group.len() > 1 {
                    self.merge(table, &month, &group, &mut commit)?;
                }
            }
        }
        commit.finish()?;
        Ok((before, after))
    }

    fn merge(
        &self,
        table: &Table,
        month: &str,
        files: &[PathBuf],
        commit: &mut Commit<'_>,
    ) -> anyhow::Result<()> {
        let mut batches = Vec::new();
        let mut names = Sha256::new();
        for path in files {
            read(&schema(table), path, &mut |batch| {
                batches.push(batch);
                Ok(())
            })?;
            names.update(
                path.file_name()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .as_bytes(),
            );
            commit.remove(path.strip_prefix(self.root())?.to_owned());
        }
        let all = concat_batches(&schema(table), &batches)?;
        let by = |column: usize| SortColumn {
            values: all.column(column).clone(),
            options: None,
        };
        // The rows of a session keep their order.
        let place = SortColumn {
            values: Arc::new(Int64Array::from_iter_values(0..all.num_rows() as i64)),
            options: None,
        };
        let order = lexsort_to_indices(&[by(1), by(3), place], None)?;
        let sorted = take_record_batch(&all, &order)?;
        let file = format!("{}.parquet", &hexadecimal(&names.finalize())[..32]);
        commit.write(
            table,
            Path::new(table.name).join(month).join(file),
            &[sorted],
        )
    }
}

/// Files that become one each, with the name of their folder.
fn groups(files: &[(String, PathBuf)]) -> anyhow::Result<Vec<(String, Vec<PathBuf>)>> {
    let mut groups: Vec<(String, Vec<PathBuf>)> = Vec::new();
    let mut bytes = 0;
    for (month, path) in files {
        let size = path
            .metadata()
            .with_context(|| format!("cannot read {}", path.display()))?
            .len();
        match groups.last_mut() {
            Some((last, group)) if last == month && bytes + size <= MOST => {
                group.push(path.clone());
                bytes += size;
            }
            _ => {
                groups.push((month.clone(), vec![path.clone()]));
                bytes = size;
            }
        }
    }
    Ok(groups)
}
