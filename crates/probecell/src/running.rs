//! Cells of this user that run here: each holds the lock of a note of its cell file while it runs, so that a command without
//! `--cell` finds it from any folder. What a killed one has left is not locked, and goes with the next look.

use std::{
    fs::{self, File, TryLockError},
    io::Write as _,
    os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _},
    path::{Path, PathBuf},
};

use anyhow::bail;
use serde::{Deserialize, Serialize};

use crate::{DEFAULT_CELL, output, own_socket};

/// What a running cell notes.
#[derive(Serialize, Deserialize)]
struct Note {
    name: String,
    file: PathBuf,
    /// Host and network namespace: elsewhere its router cannot be reached.
    place: String,
}

/// The note of this process; it stands until this is dropped.
pub(crate) struct Noted(#[expect(dead_code, reason = "holds the lock")] Option<File>);

/// Notes a cell. A cell that cannot be noted runs all the same, and is named by `--cell`.
pub(crate) fn note(name: &str, file: &Path) -> Noted {
    Noted(written(name, file))
}

fn written(name: &str, file: &Path) -> Option<File> {
    let folder = folder()?;
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true).mode(0o700).create(&folder).ok()?;
    let note = Note {
        name: name.to_owned(),
        file: file.canonicalize().ok()?,
        place: place(),
    };
    // Containers that share the folder have the same process numbers.
    let place_of_it = own_socket::fnv1a(note.place.as_bytes());
    let path = folder.join(format!("{place_of_it:016x}-{}.json", std::process::id()));
    let mut options = File::options();
    let options = options.write(true).create(true).truncate(false).mode(0o600);
    let mut open = options.open(path).ok()?;
    // A look at it holds the lock for an instant.
    open.lock().ok()?;
    open.set_len(0).ok()?;
    open.write_all(&serde_json::to_vec(&note).ok()?).ok()?;
    Some(open)
}

/// The cell that a command means.
#[derive(clap::Args)]
pub(crate) struct Meant {
    /// Cell file; default: the only cell of this user that runs here.
    #[arg(long, global = true)]
    cell: Option<PathBuf>,
}

impl Meant {
    /// The file that is named, or that of the only cell that runs, which is told where it is not the one that lies here.
    pub(crate) fn file(&self) -> anyhow::Result<PathBuf> {
        if let Some(named) = &self.cell {
            return Ok(named.clone());
        }
        let here = PathBuf::from(DEFAULT_CELL);
        let mut cells = running();
        match (cells.len(), here.exists()) {
            (0, false) => bail!(
                "no cell runs here: start one with `probecell up CELL.toml`, or name its file with --cell"
            ),
            (0, true) => Ok(here),
            (1, _) => {
                let Note { name, file, .. } = cells.remove(0);
                if here.canonicalize().ok().as_ref() != Some(&file) {
                    output::remark(&format!("cell {name}, {}", file.display()));
                }
                Ok(file)
            }
            _ => {
                let each = cells
                    .iter()
                    .map(|one| format!("{} (--cell {})", one.name, one.file.display()));
                bail!(
                    "which of the cells that run here? {}",
                    each.collect::<Vec<_>>().join(", ")
                )
            }
        }
    }
}

/// All that run in this place, by name.
fn running() -> Vec<Note> {
    let Some(entries) = folder().and_then(|folder| fs::read_dir(folder).ok()) else {
        return Vec::new();
    };
    let here = place();
    let mut all: Vec<Note> = (entries.flatten())
        .filter_map(|entry| held(&entry.path()))
        .filter(|note| note.place == here)
        .collect();
    all.sort_by(|a, b| (&a.name, &a.file).cmp(&(&b.name, &b.file)));
    // A second start of a cell is refused, and has a note until then.
    all.dedup_by(|a, b| a.file == b.file);
    all
}

/// A note whose cell runs.
fn held(path: &Path) -> Option<Note> {
    let open = File::open(path).ok()?;
    match open.try_lock_shared() {
        Err(TryLockError::WouldBlock) => serde_json::from_slice(&fs::read(path).ok()?).ok(),
        Err(TryLockError::Error(_)) => None,
        Ok(()) => {
            // One that begins has its file before its lock: an empty one is left.
            if open.metadata().is_ok_and(|file| file.len() > 0) {
                fs::remove_file(path).ok();
            }
            None
        }
    }
}

fn folder() -> Option<PathBuf> {
    Some(own_socket::folder()?.with_file_name("running"))
}

fn place() -> String {
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let network = fs::read_link("/proc/self/ns/net").unwrap_or_default();
    format!("{} {}", host.trim(), network.display())
}
