//! Adding recordings.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use bags::Bag;
use sha2::{Digest, Sha256};

use super::Lake;
use super::commit::Commit;
use super::rows::{Row, Value, batch};
use super::schema::{MONTH, TABLES, Table};
use crate::bag;

/// Recordings that are read before their rows are written.
const BATCH: usize = 1000;

/// What came of adding recordings.
#[derive(Debug, Default)]
pub struct Added {
    /// Recordings that are in the lake now and were not before.
    pub new: usize,
    /// Recordings that were in the lake, or were given twice.
    pub known: usize,
    /// Recordings that were added although damaged or not to be diagnosed: a sentence each.
    pub remarks: Vec<String>,
    /// Recordings that were not added: a sentence each.
    pub refused: Vec<String>,
}

/// Rows by table and month.
#[derive(Debug, Default)]
pub struct Rows {
    rows: BTreeMap<(&'static str, String), Vec<Row>>,
}

impl Rows {
    /// Takes a row of a table, whose month is that of its column `time`.
    pub fn push(&mut self, table: &Table, row: Row) {
        let month = match row.get(3) {
            Some(Value::Moment(time)) => month(*time),
            _ => month(0),
        };
        self.rows.entry((table.name, month)).or_default().push(row);
    }

    fn extend(&mut self, other: Self) {
        for (key, rows) in other.rows {
            self.rows.entry(key).or_default().extend(rows);
        }
    }
}

/// Year and month of an instant (µs since 1970), UTC.
pub(super) fn month(time: i64) -> String {
    use arrow_array::temporal_conversions::timestamp_us_to_datetime;
    timestamp_us_to_datetime(time).map_or_else(
        || "1970-01".to_owned(),
        |moment| moment.format("%Y-%m").to_string(),
    )
}

/// Writes the rows of each table and month as a file named after the recordings in it.
pub(super) fn write(commit: &mut Commit<'_>, rows: &Rows) -> anyhow::Result<()> {
    for ((name, month), rows) in &rows.rows {
        let Some(table) = TABLES.iter().find(|table| table.name == *name) else {
            bail!("there is no table {name}");
        };
        let mut sorted: Vec<&Row> = rows.iter().collect();
        sorted.sort_by_cached_key(|row| match (row.get(1), row.get(3)) {
            (Some(Value::Text(machine)), Some(Value::Moment(time))) => (machine.clone(), *time),
            _ => (String::new(), 0),
        });
        let mut keys = Sha256::new();
        let all: BTreeSet<&str> = rows
            .iter()
            .filter_map(|row| match row.first() {
                Some(Value::Text(key)) => Some(key.as_str()),
                _ => None,
            })
            .collect();
        for key in all {
            keys.update(key);
        }
        let file = format!("{}.parquet", &hexadecimal(&keys.finalize())[..32]);
        let to = Path::new(name).join(format!("{MONTH}={month}")).join(file);
        commit.write(table, to, &[batch(table, sorted)?])?;
    }
    Ok(())
}

/// Lower-case hexadecimal digits.
pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    let digit = |of: u8| char::from(DIGITS[usize::from(of)]);
    bytes
        .iter()
        .flat_map(|byte| [digit(byte >> 4), digit(byte & 15)])
        .collect()
}

/// SHA-256 of the content of a recording: of its files one after the other.
///
/// # Errors
/// A file cannot be read.
pub fn hash(bag: &Bag) -> anyhow::Result<(String, u64)> {
    hash_files(bag.files())
}

/// SHA-256 of the content of files, one after the other, and their bytes.
pub(crate) fn hash_files<P: AsRef<Path>>(
    paths: impl IntoIterator<Item = P>,
) -> anyhow::Result<(String, u64)> {
    let mut hash = Sha256::new();
    let mut bytes = 0;
    let mut buffer = vec![0; 1 << 18];
    for path in paths {
        let path = path.as_ref();
        let mut file =
            File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
        loop {
            let count = file
                .read(&mut buffer)
                .with_context(|| format!("cannot read {}", path.display()))?;
            if count == 0 {
                break;
            }
            bytes += count as u64;
            hash.update(&buffer[..count]);
        }
    }
    Ok((hexadecimal(&hash.finalize()), bytes))
}

/// Recordings at or below a path: a file, a folder with `metadata.yaml`, or each of them in any other folder.
pub(super) fn scan(path: &Path, found: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    if !path.is_dir() || path.join("metadata.yaml").is_file() {
        found.push(path.to_owned());
        return Ok(());
    }
    let mut entries = fs::read_dir(path)
        .with_context(|| format!("cannot read {}", path.display()))?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<Vec<_>, _>>()?;
    entries.sort();
    for entry in entries {
        if entry.is_dir() {
            scan(&entry, found)?;
        } else if entry
            .extension()
            .is_some_and(|extension| extension == "mcap")
        {
            found.push(entry);
        }
    }
    Ok(())
}

/// What came of reading one recording.
enum Outcome {
    Known,
    Read {
        key: String,
        rows: Rows,
        remarks: Vec<String>,
    },
    Refused(String),
}

impl Lake {
    /// Adds recordings: files, folders of rosbag2, or folders that hold some. `progress` is told how many have been read.
    ///
    /// # Errors
    /// A path that holds no recording; the lake cannot be written. A recording that cannot be read is no error: it is
    /// named in [`Added::refused`], and the others are added.
    pub fn add(
        &self,
        paths: &[PathBuf],
        progress: &mut dyn FnMut(usize, usize),
    ) -> anyhow::Result<Added> {
        let mut all = Vec::new();
        for path in paths {
            let before = all.len();
            scan(path, &mut all)?;
            if all.len() == before {
                bail!("there is no recording in {}", path.display());
            }
        }
        let _lock = self.lock()?;
        Commit::begin(self.root())?.finish()?;
        let mut known = self.known()?;
        let mut added = Added::default();
        let mut done = 0;
        for paths in all.chunks(BATCH) {
            let mut rows = Rows::default();
            for (path, outcome) in paths.iter().zip(read_all(paths, &known)) {
                match outcome {
                    Outcome::Known => added.known += 1,
                    Outcome::Refused(why) => added.refused.push(why),
                    Outcome::Read { key, .. } if known.contains(&key) => added.known += 1,
                    Outcome::Read {
                        key,
                        rows: own,
                        remarks,
                    } => {
                        known.insert(key);
                        added.new += 1;
                        let name = path.display();
                        added
                            .remarks
                            .extend(remarks.iter().map(|remark| format!("{name}: {remark}")));
                        rows.extend(own);
                    }
                }
            }
            let mut commit = Commit::begin(self.root())?;
            write(&mut commit, &rows)?;
            commit.finish()?;
            done += paths.len();
            progress(done, all.len());
        }
        Ok(added)
    }
}

/// Reads recordings on all processors.
fn read_all(paths: &[PathBuf], known: &BTreeSet<String>) -> Vec<Outcome> {
    crate::parallel::map(paths, |path| {
        read(path, known).unwrap_or_else(|error| {
            Outcome::Refused(format!("{}: {}", path.display(), crate::sentence(&error)))
        })
    })
}

fn read(path: &Path, known: &BTreeSet<String>) -> anyhow::Result<Outcome> {
    let bag = Bag::open(path)?;
    let (key, bytes) = hash(&bag)?;
    if known.contains(&key) {
        return Ok(Outcome::Known);
    }
    let mut rows = Rows::default();
    let remarks = bag::rows(&bag, &key, bytes, &mut rows)?;
    Ok(Outcome::Read { key, rows, remarks })
}
